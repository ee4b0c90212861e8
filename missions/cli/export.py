"""`pdpatrol export`: convert a mission, or the yard of a scenario, to the formats of other tools."""

import json
from pathlib import Path
from typing import Annotated

import tyro

from pdpatrol.envs.scenario import load_scenario
from pdpatrol.missions.atomic_file import write_text
from pdpatrol.missions.cli.arguments import OutFolder
from pdpatrol.missions.cli.terminal import err, note, output_folder, print_written, refuse
from pdpatrol.missions.export.export_mission import export_mission
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.site_map_files.write_site_map import site_map


def export(
    source: Annotated[Path, tyro.conf.arg(metavar="DIR|SCENARIO.toml")],
    /,
    *,
    out_dir: OutFolder = None,
) -> None:
    """Write a mission in the formats of other tools, or the yard of a scenario as a map.

    The files of a mission are findings.csv for spreadsheets; findings.geojson for maps, if the scenario has the
    table [georeference] or the survey was located with --georeference; steps.parquet and pulses.parquet for pandas
    and polars; and mission.mcap for ROS 2 and Foxglove, with poses, transforms, lidar scans, and markers for the
    yard, bearings and findings. The file of a scenario is yard.geojson, which `pdpatrol import` reads.

    Args:
        source: Folder of a mission, as written by `pdpatrol run` or `pdpatrol locate`, or a scenario file with a table
            `[georeference]`.
        out_dir: Folder to write to, new or empty. Default: runs/export-NAME, then -2, -3 and so on.
    """
    if source.suffix == ".toml":
        _export_yard(source, out_dir)
        return
    log = MissionLog.load(source)
    with output_folder(out_dir, f"export-{source.resolve().name}") as target, err.status("Exporting"):
        written = export_mission(log, target)
    print_written(target, *written)
    if "findings.geojson" not in written:
        why = "locate had no --georeference" if "field_data" in log.meta else "the scenario has no table [georeference]"
        note(f"findings.geojson was not written, because {why}")


def _export_yard(file: Path, out_dir: Path | None) -> None:
    """Write the yard of a scenario file as yard.geojson."""
    scenario = load_scenario(file)
    if scenario.georeference is None:
        refuse(f"{file}: must have a table [georeference] to be written as a map")
    with output_folder(out_dir, f"export-{scenario.name}") as target:
        text = json.dumps(site_map(scenario, scenario.georeference), indent=1) + "\n"
        write_text(target / "yard.geojson", text)
    print_written(target, "yard.geojson")
