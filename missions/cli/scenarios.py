"""`pdpatrol scenarios`: the shipped scenarios, and the errors in a file, and its picture."""

from pathlib import Path
from typing import Annotated

from pydantic import Field
from rich.table import Table

from dirmusic.array.beam import describe_beam
from pdpatrol.envs.plausibility import plausibility
from pdpatrol.envs.scenario import SHIPPED, load_scenario, shipped_scenarios
from pdpatrol.envs.scenario.suite import load_suite
from pdpatrol.missions.cli.arguments import JsonOutput, optional
from pdpatrol.missions.cli.terminal import err, note, out, refuse, say
from pdpatrol.missions.record.words import counted
from pdpatrol.missions.scenario_picture import write_picture
from pdpatrol.sensing import HelicalArray


def scenarios(
    scenario: Annotated[str | None, optional("[FILE.toml]")] = None,
    /,
    *,
    picture: Annotated[tuple[Path, ...] | None, optional("[OUT.png]"), Field(max_length=1)] = None,
    json_output: JsonOutput = False,
) -> None:
    """List the shipped scenarios and the levels of the suite, or check a file and print every error in it.

    The picture shows the yard from above: equipment and discharge sites by name, fence, zones, dock and route; true
    sources and the paths of people and vehicles; and where the map that the robot has differs from the yard.

    Args:
        scenario: Scenario file to check, or name of a shipped scenario.
        picture: Draw the scenario to this PNG file, which must not exist. Default: a file of the same name, next to the
            scenario file, or in the current folder.
        json_output: Print JSON instead of a table.
    """
    if scenario is None:
        if picture is not None:
            refuse("--picture needs a scenario: pdpatrol scenarios FILE.toml --picture")
        _list_scenarios(json_output)
        return
    png = None
    if picture is not None:
        png = picture[0] if picture else Path(scenario if scenario.endswith(".toml") else Path(scenario).name)
        png = png if picture else png.with_suffix(".png")
        if png.suffix.lower() != ".png" or png.exists() or not png.parent.is_dir():
            refuse(f"--picture: must be a new .png file in an existing folder, got {png}")
    loaded = load_scenario(scenario)
    note(*plausibility(loaded))
    if loaded.array.pattern is not None:
        note(f"array.pattern: {describe_beam(HelicalArray.nominal(loaded.array).cut())}")
    if png is not None:
        with err.status("Drawing the scenario"):
            write_picture(loaded, png)
    n_sources, n_sites = len(loaded.sources), len(loaded.yard.site_names())
    if json_output:
        out.print_json(data={"scenario": loaded.name, "sources": n_sources, "candidate_sites": n_sites})
        return
    say(f"{scenario}: no errors; {counted(n_sources, 'source')}, {counted(n_sites, 'candidate site')}")
    if png is not None:
        say(f"Written: {png}")


def _list_scenarios(json_output: bool) -> None:
    """Print the shipped scenarios and the levels of the suite."""
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
