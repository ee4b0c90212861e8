"""`pdpatrol worth`: what a change of array, estimator or robot is worth."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Annotated

import tyro

from missions.cli.terminal import err, make_folder, new_folder, out, refuse, write_text


def worth(
    scenario: tyro.conf.Positional[str] = "one_source",
    *,
    missions: int = 20,
    seed: int = 0,
    workers: int | None = None,
    out_dir: Annotated[Path | None, tyro.conf.arg(name="out", metavar="DIR")] = None,
    json_output: Annotated[bool, tyro.conf.arg(name="json")] = False,
) -> None:
    """Compare arrays, estimators and robots over the same missions, with 95 % intervals.

    4, 6, 8 and 12 elements; the three estimators, with the fix from their bearings alone and with the joint fix; two
    robots. 200 missions of some five seconds each with the default of 20.

    Args:
        scenario: Name of a shipped scenario, or path of a TOML file; with one source, the error of bearings is known.
        missions: Missions of each variant.
        seed: Of the first mission; the others follow. Each variant has the same seeds.
        workers: Processes side by side. Default: as many as the machine has cores.
        out_dir: Folder to write worth.json and worth.md to; new or empty. Default: runs/worth-SCENARIO, then -2, -3.
        json_output: Print JSON instead of a table.
    """
    n_workers = (os.cpu_count() or 1) if workers is None else workers
    at_least = {"--missions": (missions, 1), "--seed": (seed, 0), "--workers": (n_workers, 1)}
    faults = [
        f"{key}: got {value}; allowed is {least} or more" for key, (value, least) in at_least.items() if value < least
    ]
    if faults:
        refuse(*faults)
    from envs.scenario import ScenarioError, load_scenario

    try:
        loaded = load_scenario(scenario)
    except ScenarioError as error:
        refuse(*error.faults)
    folder = make_folder(new_folder(out_dir, f"worth-{loaded.name}"))

    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from missions.comparison.scores import as_json
    from missions.comparison.table import markdown, terminal_table
    from missions.comparison.variants import VARIANTS
    from missions.comparison.worth import compare

    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Progress(*columns, console=err, transient=True) as progress:
        bar = progress.add_task("missions", total=None)

        def follow(done: int, total: int) -> None:
            progress.update(bar, completed=done, total=total)

        scores = compare(loaded, VARIANTS, range(seed, seed + missions), n_workers, follow)
    data = {
        "scenario": loaded.name,
        "missions": missions,
        "first_seed": seed,
        "variants": [
            {"group": variant.group, "name": variant.name, **as_json(scores[variant.key])} for variant in VARIANTS
        ],
    }
    write_text(folder / "worth.json", json.dumps(data, indent=2) + "\n")
    write_text(folder / "worth.md", markdown(VARIANTS, scores))
    if json_output:
        out.print_json(data=data)
    else:
        title = f"{loaded.name}: {missions} missions of each, 95 % intervals"
        out.print(terminal_table(VARIANTS, scores, title), highlight=False)
        out.print(f"Written to {folder}: worth.json, worth.md", highlight=False, soft_wrap=True)
