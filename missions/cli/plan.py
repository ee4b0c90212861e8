"""`pdpatrol plan`: a tour from which every site of a yard is covered."""

import json
from typing import Annotated

import tyro
from pydantic import Field, PositiveFloat

from pdpatrol.envs.scenario import load_scenario
from pdpatrol.missions.atomic_file import atomic_file, write_text
from pdpatrol.missions.cli.arguments import JsonOutput, OutFolder, ScenarioName, Settings
from pdpatrol.missions.cli.terminal import out, output_folder, print_written, progress_bar, refuse, say
from pdpatrol.missions.planning.output import as_json, as_toml, blind_sites, draw_plan, sites_table, summary
from pdpatrol.missions.planning.plan import make_plan
from pdpatrol.missions.sweep.plan import parse_grid


def plan(
    scenario: ScenarioName = "one_source",
    /,
    *,
    settings: Settings = (),
    amplitude_v: Annotated[PositiveFloat, tyro.conf.arg(metavar="VOLTS"), Field(le=1e6)] = 0.05,
    out_dir: OutFolder = None,
    json_output: JsonOutput = False,
) -> None:
    """Plan a patrol on the map of a yard: a short tour that covers every site, and which sites cannot be covered.

    A site is covered if the tour has it in sight, near enough and over an aperture wide enough to confirm it. Writes
    plan.png, plan.json, and route.toml, which replaces [route] in a scenario file. With `waypoints_m = "planned"`
    there, a mission makes the same plan for the default amplitude when it starts.

    Args:
        scenario: Name of a shipped scenario (see `pdpatrol scenarios`), or path of a TOML file. Its route and its
            sources are ignored.
        settings: Value of a key of the scenario, such as receiver.noise_v=2e-3; may be given several times.
        amplitude_v: Peak, 1 m away, of the weakest discharge that has to be detected.
        out_dir: Folder to write to; new or empty. Default: runs/plan-SCENARIO, then -2, -3 and so on.
        json_output: Print the plan as JSON instead of a table.
    """
    grid = parse_grid(settings)
    if several := [f"--set: {key} must have one value, got {len(grid[key])}" for key in grid if len(grid[key]) > 1]:
        refuse(*several)
    loaded = load_scenario(scenario, {key: value for key, (value,) in grid.items()})
    with output_folder(out_dir, f"plan-{loaded.name}") as folder, progress_bar() as progress:
        bar = progress.add_task("map", total=1.0)
        made = make_plan(
            loaded, amplitude_v, lambda part, share: progress.update(bar, description=part, completed=share)
        )
        with atomic_file(folder / "plan.png") as picture:
            draw_plan(made).savefig(picture, dpi=110, format="png")
        data = as_json(made)
        write_text(folder / "plan.json", json.dumps(data, indent=2) + "\n")
        write_text(folder / "route.toml", as_toml(made))
    if json_output:
        out.print_json(data=data)
        return
    out.print(sites_table(made))
    say(summary(made))
    if made.blind:
        say(f"Not detectable from any reachable place: {blind_sites(made)}", style="yellow", hanging=2)
    print_written(folder, "plan.png", "plan.json", "route.toml")
