"""`pdpatrol generate`: the scenario of a substation as engineers lay it out."""

from pathlib import Path
from typing import Annotated

import tyro
from pydantic import Field

from pdpatrol.envs.scenario import load_scenario
from pdpatrol.envs.substation.schemes import Scheme
from pdpatrol.envs.substation.substation import SubstationParameters, draw_substation
from pdpatrol.envs.substation.substation_file import substation_text
from pdpatrol.missions.atomic_file import write_text
from pdpatrol.missions.cli.arguments import Flag
from pdpatrol.missions.cli.terminal import refuse, say
from pdpatrol.missions.scenario_picture import write_picture
from pdpatrol.robot_models.equipment.voltages import Kv


def generate(
    *,
    kv: Kv = 110,
    scheme: Scheme = "double_busbar",
    bays: Annotated[int, Field(ge=1, le=99)] = 6,
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0,
    sources: Annotated[int, Field(ge=0, le=64)] = 1,
    out_file: Annotated[Path, tyro.conf.arg(name="out", metavar="SITE.toml")] = Path("site.toml"),
    picture: Flag = False,
) -> None:
    """Draw a substation and write it as a scenario file, with a patrol route on its roads.

    Args:
        kv: Nominal voltage, which sets sizes, clearances (IEC 61936-1) and the width of bays.
        scheme: Arrangement of the busbars.
        bays: Number of bays: lines, cables, transformers, reactors and couplers.
        seed: Seed of the purposes of the bays, the kinds of disconnectors, the free distances and the discharges.
        sources: Number of discharges, each at another site.
        out_file: File to write; must not exist.
        picture: Draw the plan to a PNG file of the same name.
    """
    png = out_file.with_suffix(".png")
    errors = [f"--{line}" for line in SubstationParameters(kv, scheme, bays, seed).errors()]
    errors += [] if out_file.suffix == ".toml" else [f"--out: must end in .toml, got {out_file}"]
    errors += [f"--out: {file} must not exist" for file in (out_file, *((png,) if picture else ())) if file.exists()]
    if errors:
        refuse(*errors)
    substation = draw_substation(SubstationParameters(kv, scheme, bays, seed))
    write_text(out_file, substation_text(substation, sources))
    scenario = load_scenario(out_file)
    if picture:
        write_picture(scenario, png, substation.roads_m)
    counts = f"{len(scenario.yard.equipment)} pieces, {len(scenario.yard.site_names())} sites"
    x_m, y_m = substation.size_m
    say(f"{out_file}: {x_m:g} x {y_m:g} m, {counts}, route of {substation.route_length_m:.0f} m")
