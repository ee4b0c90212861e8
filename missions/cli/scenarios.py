"""`pdpatrol scenarios`: the shipped scenarios, and the errors in a file."""

from typing import Annotated

from rich.table import Table

from dirmusic.array.beam import describe_beam
from pdpatrol.envs.plausibility import plausibility
from pdpatrol.envs.scenario import SHIPPED, load_scenario, shipped_scenarios
from pdpatrol.envs.scenario.suite import load_suite
from pdpatrol.missions.cli.arguments import JsonOutput, optional
from pdpatrol.missions.cli.terminal import note, out, say
from pdpatrol.sensing import HelicalArray


def scenarios(
    check: Annotated[str | None, optional("[FILE.toml]")] = None,
    /,
    *,
    json_output: JsonOutput = False,
) -> None:
    """List the shipped scenarios and the levels of the suite, or check a file and print every error in it.

    Args:
        check: Scenario file to check.
        json_output: Print JSON instead of a table.
    """
    if check is not None:
        scenario = load_scenario(check)
        note(*plausibility(scenario))
        if scenario.array.pattern is not None:
            note(f"array.pattern: {describe_beam(HelicalArray.nominal(scenario.array).cut())}")
        n_sources, n_sites = len(scenario.sources), len(scenario.yard.site_names())
        if json_output:
            out.print_json(data={"scenario": scenario.name, "sources": n_sources, "candidate_sites": n_sites})
        else:
            say(f"{check}: no errors; {n_sources} sources, {n_sites} candidate sites")
        return
    texts = {name: (SHIPPED / f"{name}.toml").read_text(encoding="utf-8") for name in shipped_scenarios()}
    shown = {name: text.partition("\n")[0].lstrip("# ") for name, text in texts.items()}
    shown |= {f"suite/{level}": text for level, text in load_suite().levels.items()}
    if json_output:
        out.print_json(data=shown)
        return
    table = Table("scenario", "what it shows")
    for row in shown.items():
        table.add_row(*row)
    out.print(table)
    say("A level of the suite has many yards: pdpatrol sweep suite/open, or run suite/open_01.")
