"""`pdpatrol reproduce`: the paper beside ours."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from pdpatrol.missions.cli.output.folders import output_folder
from pdpatrol.missions.cli.output.terminal import err, in_one_line, out, refuse, tell_time


def reproduce(
    *,
    trials: int = 3600,
    seed: int = 0,
    out_dir: Annotated[Path | None, tyro.conf.arg(name="out", metavar="DIR")] = None,
    json_output: Annotated[bool, tyro.conf.arg(name="json")] = False,
    timing: bool = False,
) -> None:
    """Put every exhibit of the Dir-MUSIC paper beside ours, by the paper's method and by the best one.

    It ends with a verdict: which of the paper's numbers lie where its method puts them, and which do not. Writes
    reproduction.html, reproduction.json and the pictures, drawn like the paper's.

    Args:
        trials: Of each cell; 100 to 1000000. The paper has 3600.
        seed: Fixes all that is drawn; 0 or more.
        out_dir: Folder to write to; new or empty. Default: runs/reproduction-SEED, then -2, -3 and so on.
        json_output: Print the numbers as JSON instead of tables.
        timing: Say in a line where the time went.
    """
    faults = [
        *([] if 100 <= trials <= 1_000_000 else [f"--trials: got {trials}; allowed is 100 to 1000000"]),
        *([] if seed >= 0 else [f"--seed: got {seed}; allowed is 0 or more"]),
    ]
    if faults:
        refuse(*faults)
    from rich.progress import Progress

    from pdpatrol.missions.stopwatch import Stopwatch

    stopwatch = Stopwatch()
    with output_folder(out_dir, f"reproduction-{seed}") as folder, Progress(console=err, transient=True) as progress:
        with stopwatch.on("loading"):
            from pdpatrol.missions.reproduction.output.tables import as_table
            from pdpatrol.missions.reproduction.output.write import write_reproduction
            from pdpatrol.missions.reproduction.reproduce import reproduce as run_trials
            from pdpatrol.missions.reproduction.verdict import verdict

        bar = progress.add_task(f"{trials} trials a cell", total=1.0)
        with stopwatch.on("trials"):
            exhibits = run_trials(trials, seed, lambda share: progress.advance(bar, share))
        bar = progress.add_task("pictures", total=1.0)
        with stopwatch.on("pictures and page"):
            data = write_reproduction(exhibits, trials, seed, folder, lambda share: progress.advance(bar, share))
    if json_output:
        out.print_json(data=data)
    else:
        for exhibit in exhibits:
            out.print(as_table(exhibit))
            out.print()
        found = verdict(exhibits)
        out.print(f"{trials} trials a cell or more in {stopwatch.total_s:.0f} s; intervals are 95 %.", soft_wrap=True)
        out.print(str(found), soft_wrap=True)
        for miss in found.misses:
            out.print(f"  {miss}; {miss.why or 'it may be chance'}", soft_wrap=True)
        out.print(
            f"Written to {in_one_line(str(folder))}: reproduction.html, reproduction.json and the pictures",
            soft_wrap=True,
        )
    if timing:
        tell_time(stopwatch)
