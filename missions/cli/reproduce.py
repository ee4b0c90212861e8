"""`pdpatrol reproduce`: the tables and figures of the paper, reproduced and compared."""

from typing import Annotated

from pydantic import Field, NonNegativeInt
from rich.box import SIMPLE_HEAD
from rich.table import Table

from pdpatrol.missions.cli.arguments import Flag, JsonOutput, OutFolder
from pdpatrol.missions.cli.mission_files import print_times
from pdpatrol.missions.cli.terminal import out, output_folder, print_written, progress_bar
from pdpatrol.missions.reproduction.comparison import verdict
from pdpatrol.missions.reproduction.reproduce import COLUMNS, PARTS, cells, write_reproduction
from pdpatrol.missions.reproduction.reproduce import reproduce as run_trials
from pdpatrol.missions.runner import Stopwatch


def reproduce(
    *,
    trials: Annotated[int, Field(ge=100, le=1_000_000)] = 3600,
    seed: NonNegativeInt = 0,
    out_dir: OutFolder = None,
    json_output: JsonOutput = False,
    timing: Flag = False,
) -> None:
    """Reproduce every table and figure of the Dir-MUSIC paper, by the paper's method and by the best one.

    A verdict states which of the printed numbers agree with the paper's method, and which do not. Writes
    reproduction.html, reproduction.json and the pictures.

    Args:
        trials: Trials of each cell; 100 to 1000000. The paper uses 3600.
        seed: Seed of all random draws, 0 or more.
        out_dir: Folder to write to; new or empty. Default: runs/reproduction-SEED, then -2, -3 and so on.
        json_output: Print the numbers as JSON instead of tables.
        timing: Print how long each part took.
    """
    stopwatch = Stopwatch()
    with output_folder(out_dir, f"reproduction-{seed}") as folder:
        with stopwatch.on("trials"), progress_bar() as progress:
            bar = progress.add_task(f"{trials} trials per cell", total=len(PARTS))
            exhibits = run_trials(trials, seed, lambda: progress.advance(bar))
        with stopwatch.on("pictures and page"):
            data = write_reproduction(exhibits, trials, seed, folder)
    if json_output:
        out.print_json(data=data)
    else:
        for exhibit in exhibits:
            if not exhibit.rows:
                continue
            table = Table("", *COLUMNS, title=exhibit.title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1))
            for row in exhibit.rows:
                table.add_row(*cells(row))
            out.print(table, *exhibit.notes, "", sep="\n")
        summary, misses = verdict(exhibits)
        out.print(f"{trials} or more trials per cell in {stopwatch.total_s:.0f} s; intervals are 95 %.", soft_wrap=True)
        out.print(summary, *misses, sep="\n", soft_wrap=True)
        print_written(folder, "reproduction.html", "reproduction.json", "pictures")
    if timing:
        print_times(stopwatch)
