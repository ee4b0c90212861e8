"""`pdpatrol import`: a scenario from the map of a substation."""

from pathlib import Path
from typing import Annotated

import tyro

from pdpatrol.envs.scenario import load_scenario
from pdpatrol.missions.atomic_file import write_text
from pdpatrol.missions.cli.terminal import note, out, refuse
from pdpatrol.missions.site_map_files import site_scenario


def import_site(
    site: Annotated[Path, tyro.conf.arg(metavar="SITE.geojson")],
    /,
    *,
    out_file: Annotated[Path | None, tyro.conf.arg(name="out", metavar="SITE.toml")] = None,
) -> None:
    """Make a scenario from a map of a substation, and list the features that were left out.

    The map is GeoJSON with tags of OpenStreetMap, or as written by `pdpatrol export SCENARIO.toml`. The outline of the
    substation becomes the fence; the position on Earth is kept.

    Args:
        site: GeoJSON file.
        out_file: File to write; must not exist. Default: the name of the map, ending in .toml.
    """
    target = site.with_suffix(".toml") if out_file is None else out_file
    errors = [] if target.suffix == ".toml" else [f"--out: must end in .toml, got {target}"]
    errors += [f"--out: {target} must not exist"] if target.exists() else []
    if errors:
        refuse(*errors)
    text, yard, notes = site_scenario.import_site(site)
    note(*notes)
    write_text(target, text)
    load_scenario(target)
    counts = f"{len(yard.equipment)} pieces, {len(yard.site_names())} sites, {len(notes)} notes"
    out.print(f"{target}: {yard.size_m[0]:g} x {yard.size_m[1]:g} m, {counts}", soft_wrap=True)


import_site.__name__ = "import"  # the verb, which is not a name in Python
