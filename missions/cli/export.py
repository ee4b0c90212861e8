"""`pdpatrol export`: convert a mission to the formats of other tools."""

from pdpatrol.missions.cli.arguments import MissionFolder, OutFolder
from pdpatrol.missions.cli.terminal import err, note, output_folder, print_written
from pdpatrol.missions.export.export_mission import export_mission
from pdpatrol.missions.record.mission_log import MissionLog


def export(
    folder: MissionFolder,
    /,
    *,
    out_dir: OutFolder = None,
) -> None:
    """Write a mission in the formats of other tools.

    The files are findings.csv for spreadsheets; findings.geojson for maps, if the scenario has a table `[georeference]`
    or the survey was located with --georeference; steps.parquet and pulses.parquet for data frames; and mission.mcap
    for ROS 2 and Foxglove, with poses, transforms, lidar scans, and markers for the yard, bearings and findings.

    Args:
        folder: Folder of a mission, as written by `pdpatrol run` or `pdpatrol locate`.
        out_dir: Folder to write to, new or empty. Default: runs/export-NAME, then -2, -3 and so on.
    """
    log = MissionLog.load(folder)
    with output_folder(out_dir, f"export-{folder.resolve().name}") as target, err.status("Exporting"):
        written = export_mission(log, target)
    print_written(target, *written)
    if "findings.geojson" not in written:
        why = "locate had no --georeference" if "field_data" in log.meta else "the scenario has no table [georeference]"
        note(f"findings.geojson was not written, because {why}")
