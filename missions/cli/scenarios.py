"""`pdpatrol scenarios`: the shipped scenarios, and the errors in a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro
from rich.table import Table

from pdpatrol.envs.scenario import SHIPPED, ScenarioError, load_scenario, shipped_scenarios
from pdpatrol.envs.scenario.suite import load_suite
from pdpatrol.missions.cli.mission_files import print_plausibility
from pdpatrol.missions.cli.terminal import out, refuse


def scenarios(
    check: Annotated[tyro.conf.Positional[Path | None], tyro.conf.arg(metavar="CHECK.toml")] = None,
    *,
    json_output: Annotated[bool, tyro.conf.arg(name="json")] = False,
) -> None:
    """List the shipped scenarios and the levels of the suite, or check a file and print every error in it.

    Args:
        check: Scenario file to check.
        json_output: Print JSON instead of a table.
    """
    if check is not None:
        _check(check, json_output)
        return
    shipped = {name: _first_line(SHIPPED / f"{name}.toml") for name in shipped_scenarios()}
    levels = {f"suite/{level}": text for level, text in load_suite().levels.items()}
    if json_output:
        out.print_json(data=shipped | levels)
        return
    table = Table("scenario", "what it shows")
    for names in (shipped, levels):
        for name, text in names.items():
            table.add_row(name, text)
        table.add_section()
    out.print(table)
    out.print("A level of the suite has many yards: pdpatrol sweep suite/open, or run suite/open_01.")


def _check(path: Path, json_output: bool) -> None:
    try:
        scenario = load_scenario(path if path.suffix == ".toml" else path / "")
    except ScenarioError as error:
        refuse(*error.faults)
    print_plausibility(scenario)
    n_sites = len(scenario.yard.site_names())
    facts = {"scenario": scenario.name, "sources": len(scenario.sources), "candidate_sites": n_sites}
    if json_output:
        out.print_json(data=facts)
    else:
        out.print(f"{path}: no errors; {len(scenario.sources)} sources, {n_sites} candidate sites", soft_wrap=True)


def _first_line(path: Path) -> str:
    with path.open(encoding="utf-8") as file:
        return file.readline().lstrip("# ").strip()
