"""`pdpatrol scenarios`: the shipped scenarios, and the errors in a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro
from rich.table import Table

from pdpatrol.envs.scenario import SHIPPED, load_scenario, shipped_scenarios
from pdpatrol.envs.scenario.suite import load_suite
from pdpatrol.missions.cli.arguments import JsonOutput
from pdpatrol.missions.cli.mission_files import print_plausibility
from pdpatrol.missions.cli.terminal import out


def scenarios(
    check: Annotated[tyro.conf.Positional[Path | None], tyro.conf.arg(metavar="CHECK.toml")] = None,
    *,
    json_output: JsonOutput = False,
) -> None:
    """List the shipped scenarios and the levels of the suite, or check a file and print every error in it.

    Args:
        check: Scenario file to check.
        json_output: Print JSON instead of a table.
    """
    if check is not None:
        scenario = load_scenario(check if check.suffix == ".toml" else check / "")
        print_plausibility(scenario)
        n_sources, n_sites = len(scenario.sources), len(scenario.yard.site_names())
        if json_output:
            out.print_json(data={"scenario": scenario.name, "sources": n_sources, "candidate_sites": n_sites})
        else:
            out.print(f"{check}: no errors; {n_sources} sources, {n_sites} candidate sites", soft_wrap=True)
        return
    shipped: dict[str, str] = {}
    for name in shipped_scenarios():
        with (SHIPPED / f"{name}.toml").open(encoding="utf-8") as file:
            shipped[name] = file.readline().lstrip("# ").strip()
    levels = {f"suite/{level}": text for level, text in load_suite().levels.items()}
    if json_output:
        out.print_json(data=shipped | levels)
        return
    table = Table("scenario", "what it shows")
    for names in (shipped, levels):
        for row in names.items():
            table.add_row(*row)
        table.add_section()
    out.print(table)
    out.print("A level of the suite has many yards: pdpatrol sweep suite/open, or run suite/open_01.")
