"""`pdpatrol import`: a scenario from the map of a substation."""

from pathlib import Path
from typing import Annotated

import tyro

from pdpatrol.envs.scenario.loader import check_content
from pdpatrol.missions.atomic_file import write_text
from pdpatrol.missions.cli.arguments import Flag, optional
from pdpatrol.missions.cli.terminal import note, refuse, say
from pdpatrol.missions.record.words import counted
from pdpatrol.missions.scenario_picture import write_picture
from pdpatrol.missions.site_map_files import site_scenario


def import_site(
    site: Annotated[Path, tyro.conf.arg(metavar="SITE.geojson|SITE.dxf")],
    /,
    *,
    mapping: Annotated[Path | None, optional("MAPPING.toml")] = None,
    out_file: Annotated[Path | None, optional("SITE.toml", "out")] = None,
    picture: Flag = False,
) -> None:
    """Make a scenario from a map of a substation, and list the features that were left out.

    The map is GeoJSON with tags of OpenStreetMap, or as written by `pdpatrol export SCENARIO.toml`, or a DXF drawing
    whose blocks and layers have known names. The outline of the substation becomes the fence; the position on Earth is
    kept.

    Args:
        site: GeoJSON or DXF file.
        mapping: Table of the kinds that names of blocks and layers of a DXF file stand for, ahead of common English
            names, and the voltage: `kv = 220`.
        out_file: File to write; must not exist. Default: the name of the map, ending in .toml.
        picture: Draw the plan to a PNG file of the same name.
    """
    if not site.name or site.is_dir():
        refuse(f"{site}: must be a file, is a folder")
    target = site.with_suffix(".toml") if out_file is None else out_file
    png = target.with_suffix(".png")
    errors = [] if target.suffix == ".toml" else [f"--out: must end in .toml, got {target}"]
    errors += [f"--out: {file} must not exist" for file in (target, *((png,) if picture else ())) if file.exists()]
    if errors:
        refuse(*errors)
    text, yard, notes = site_scenario.import_site(site, mapping)
    note(*notes)
    scenario = check_content(text.encode(), target)
    write_text(target, text)
    if picture:
        write_picture(scenario, png)
    counts = (len(yard.equipment), "piece"), (len(yard.site_names()), "site"), (len(notes), "note")
    in_words = ", ".join(counted(n, noun) for n, noun in counts)
    say(f"{target}: {yard.size_m[0]:g} x {yard.size_m[1]:g} m, {in_words}")


import_site.__name__ = "import"  # the command, which is not a name in Python
