"""`pdpatrol scenarios`: what is shipped, and what is wrong with a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro
from rich.table import Table

from pdpatrol.missions.cli.output.terminal import out, refuse, tell_notes


def scenarios(
    check: Annotated[tyro.conf.Positional[Path | None], tyro.conf.arg(metavar="CHECK.toml")] = None,
    *,
    json_output: Annotated[bool, tyro.conf.arg(name="json")] = False,
) -> None:
    """List the shipped scenarios and the levels of the suite, or check a file and name every fault in it.

    Args:
        check: A scenario file to check.
        json_output: Print JSON instead of a table.
    """
    from pdpatrol.envs.scenario import SHIPPED, ScenarioError, load_scenario, shipped_scenarios
    from pdpatrol.envs.scenario.suite import load_suite

    if check is not None:
        try:
            scenario = load_scenario(check if check.suffix == ".toml" else check / "")
        except ScenarioError as error:
            refuse(*error.faults)
        tell_notes(scenario)
        n_sites = len(scenario.yard.site_names())
        facts = {"scenario": scenario.name, "sources": len(scenario.sources), "candidate_sites": n_sites}
        if json_output:
            out.print_json(data=facts)
        else:
            out.print(f"{check}: no fault; {len(scenario.sources)} sources, {n_sites} candidate sites")
        return
    stories = {name: _first_line(SHIPPED / f"{name}.toml") for name in shipped_scenarios()}
    levels = {f"suite/{level}": story for level, story in load_suite().levels.items()}
    if json_output:
        out.print_json(data=stories | levels)
        return
    table = Table("scenario", "what it shows")
    for name, story in stories.items():
        table.add_row(name, story)
    table.add_section()
    for name, story in levels.items():
        table.add_row(name, story)
    out.print(table)
    out.print("A level of the suite is many yards: pdpatrol sweep suite/open, or run suite/open_01.")


def _first_line(path: Path) -> str:
    with path.open(encoding="utf-8") as file:
        return file.readline().lstrip("# ").strip()
