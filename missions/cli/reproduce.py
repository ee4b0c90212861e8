"""`pdpatrol reproduce`: the paper beside ours."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Annotated

import tyro

from missions.cli.output.folders import output_folder
from missions.cli.output.terminal import err, in_one_line, out, refuse
from missions.whole_file import write_whole


def reproduce(
    *,
    trials: int = 3600,
    seed: int = 0,
    out_dir: Annotated[Path | None, tyro.conf.arg(name="out", metavar="DIR")] = None,
    json_output: Annotated[bool, tyro.conf.arg(name="json")] = False,
) -> None:
    """Put every exhibit of the Dir-MUSIC paper beside ours, by the paper's method and by the best one.

    Writes reproduction.json and the pictures, drawn like the paper's.

    Args:
        trials: Of each cell; 100 to 1000000. The paper has 3600.
        seed: Fixes all that is drawn; 0 or more.
        out_dir: Folder to write to; new or empty. Default: runs/reproduction-SEED, then -2, -3 and so on.
        json_output: Print the numbers as JSON instead of tables.
    """
    faults = [
        *([] if 100 <= trials <= 1_000_000 else [f"--trials: got {trials}; allowed is 100 to 1000000"]),
        *([] if seed >= 0 else [f"--seed: got {seed}; allowed is 0 or more"]),
    ]
    if faults:
        refuse(*faults)
    from rich.progress import Progress

    started_s = time.perf_counter()
    with output_folder(out_dir, f"reproduction-{seed}") as folder, Progress(console=err, transient=True) as progress:
        from missions.reproduction.figures import draw_all
        from missions.reproduction.reproduce import reproduce as run_trials
        from missions.reproduction.tables import as_json, as_table

        bar = progress.add_task(f"{trials} trials a cell", total=1.0)
        exhibits = run_trials(trials, seed, lambda share: progress.advance(bar, share))
        progress.update(bar, description="pictures")
        pictures = draw_all(exhibits, folder, seed)
        data = as_json(exhibits, trials, seed)
        write_whole(folder / "reproduction.json", json.dumps(data, indent=2) + "\n")
    if json_output:
        out.print_json(data=data)
        return
    for exhibit in exhibits:
        out.print(as_table(exhibit))
        out.print()
    out.print(
        f"{trials} trials a cell or more in {time.perf_counter() - started_s:.0f} s; intervals are 95 %.\n"
        f"Written to {in_one_line(str(folder))}: reproduction.json and {len(pictures)} pictures",
        soft_wrap=True,
    )
