"""All exports of a mission, each beside the others."""

from __future__ import annotations

from pathlib import Path

from pdpatrol.envs.scenario.map_section import GeoreferenceConfig
from pdpatrol.missions.export.findings import findings_csv, findings_geojson
from pdpatrol.missions.export.parquet_tables import write_pulses, write_steps
from pdpatrol.missions.export.ros2_recording import write_ros2_recording
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.whole_file import whole_file


def export_mission(log: MissionLog, folder: Path) -> tuple[str, ...]:
    """Write every export, each file whole or not at all.

    Args:
        log: Of the mission.
        folder: That is there.

    Returns:
        The names of the files; without GeoJSON where nobody knows where on Earth the yard is.

    Raises:
        OSError: If one cannot be written.
    """
    report = make_report(log, 0.0)
    texts = {"findings.csv": findings_csv(report)}
    reference = log.meta.get("scenario", {}).get("georeference")
    if reference is not None:
        texts["findings.geojson"] = findings_geojson(report, GeoreferenceConfig.model_validate(reference))
    for name, text in texts.items():
        with whole_file(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    files = {"steps.parquet": write_steps, "pulses.parquet": write_pulses, "mission.mcap": write_ros2_recording}
    for name, write in files.items():
        with whole_file(folder / name) as temporary:
            write(log, temporary)
    return (*texts, *files)
