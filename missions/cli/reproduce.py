"""`pdpatrol reproduce`: the tables and figures of the paper, reproduced and compared."""

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field, NonNegativeInt
from rich.box import SIMPLE_HEAD
from rich.table import Table

from pdpatrol.missions.cli.arguments import Flag, JsonOutput, OutFolder
from pdpatrol.missions.cli.mission_files import print_times
from pdpatrol.missions.cli.terminal import out, output_folder, print_written, progress_bar, say
from pdpatrol.missions.reproduction.comparison import Exhibit, verdict
from pdpatrol.missions.reproduction.reproduce import COLUMNS, cells, n_cells, write_reproduction
from pdpatrol.missions.reproduction.reproduce import reproduce as run_trials
from pdpatrol.missions.runner import Stopwatch


def reproduce(
    *,
    trials: Annotated[int, Field(ge=100, le=1_000_000)] = 3600,
    seed: NonNegativeInt = 0,
    out_dir: OutFolder = None,
    tables: Flag = False,
    json_output: JsonOutput = False,
    timing: Flag = False,
) -> None:
    """Reproduce every table and figure of the Dir-MUSIC paper, by the paper's method and by the best one.

    Prints how many of the paper's numbers agree with its own method, which do not, and why. Writes
    reproduction.html, reproduction.json and the pictures, with all numbers.

    Args:
        trials: Trials of each cell; 100 to 1000000. The paper uses 3600.
        seed: Seed of all random draws, 0 or more.
        out_dir: Folder to write to; new or empty. Default: runs/reproduction-SEED, then -2, -3 and so on.
        tables: Print the tables of all numbers, too.
        json_output: Print the numbers as JSON instead of tables.
        timing: Print how long each part took.
    """
    stopwatch = Stopwatch()
    with output_folder(out_dir, f"reproduction-{seed}") as folder:
        with stopwatch.on("trials"), progress_bar() as progress:
            bar = progress.add_task(f"{trials} trials per cell", total=n_cells())
            exhibits = run_trials(trials, seed, lambda share: progress.advance(bar, share))
        with stopwatch.on("pictures and page"):
            data = write_reproduction(exhibits, trials, seed, folder)
    if json_output:
        out.print_json(data=data)
    else:
        _print_verdict(exhibits)
        if tables:
            _print_tables(exhibits)
        say(f"{trials} or more trials per cell in {stopwatch.total_s:.0f} s; intervals are 95 %.")
        print_written(folder, "reproduction.html", "reproduction.json", "pictures")
    if timing:
        print_times(stopwatch)


def _print_verdict(exhibits: Sequence[Exhibit]) -> None:
    """Print the verdict, how many numbers of each exhibit agree, and the numbers that do not."""
    summary, misses = verdict(exhibits)
    say(summary)
    table = Table("exhibit", "numbers that agree", box=SIMPLE_HEAD, padding=(0, 1))
    for exhibit in exhibits:
        if met := [row.is_met for row in exhibit.rows if row.is_met is not None]:
            table.add_row(exhibit.title, f"{sum(met)} of {len(met)}")
    out.print(table)
    for miss in misses:
        say(miss, hanging=2)


def _print_tables(exhibits: Sequence[Exhibit]) -> None:
    """Print the numbers and notes of each exhibit."""
    for exhibit in exhibits:
        if not exhibit.rows:
            continue
        table = Table("", *COLUMNS, title=f"\n{exhibit.title}", title_justify="left", box=SIMPLE_HEAD, padding=(0, 1))
        for row in exhibit.rows:
            table.add_row(*cells(row))
        out.print(table)
        for line in exhibit.notes:
            say(line, hanging=2)
    say("A star marks a number of the paper outside the interval that its own method predicts.")
