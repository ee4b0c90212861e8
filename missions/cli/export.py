"""`pdpatrol export`: a mission in the formats of other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from pdpatrol.missions.cli.output.folders import output_folder
from pdpatrol.missions.cli.output.terminal import err, in_one_line, out, refuse


def export(
    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DIR")],
    *,
    out_dir: Annotated[Path | None, tyro.conf.arg(name="out", metavar="DIR")] = None,
) -> None:
    """Write a mission in the formats of other tools.

    findings.csv for spreadsheets; findings.geojson for maps, where the scenario has a table `[georeference]`;
    steps.parquet and pulses.parquet for data frames; mission.mcap for ROS 2 and Foxglove: poses, transforms, lidar
    scans, markers of the yard, of bearings and of findings.

    Args:
        folder: Of a mission, as `pdpatrol run` or `locate` has written it.
        out_dir: Folder to write to, new or empty. Default: runs/export-NAME, then -2, -3 and so on.
    """
    if not folder.is_dir():
        refuse(f"{folder}: no such folder; give the folder of a mission")
    from pdpatrol.missions.record.mission_log import MissionLog

    try:
        log = MissionLog.load(folder)
    except (FileNotFoundError, ValueError) as error:
        refuse(str(error))
    with output_folder(out_dir, f"export-{folder.resolve().name}") as target:
        from pdpatrol.missions.export.export_mission import export_mission

        with err.status("Writes"):
            written = export_mission(log, target)
        out.print(f"Written to {in_one_line(str(target))}: {', '.join(written)}", soft_wrap=True)
        if "findings.geojson" not in written:
            err.print("note: no findings.geojson, for the scenario has no table [georeference]", soft_wrap=True)
