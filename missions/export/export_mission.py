"""Write a mission as CSV, GeoJSON, Parquet and MCAP."""

import json
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dirmusic.locating.finding import outline95
from pdpatrol.envs.scenario.map import GeoreferenceConfig
from pdpatrol.missions.atomic_file import atomic_file
from pdpatrol.missions.export.ros2_recording import write_ros2_recording
from pdpatrol.missions.record.log_contents import georeference_of
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.records import FindingRecord, Report, SourceMatch, Survey
from pdpatrol.missions.site_map_files.geodesy import longitude_latitude


def export_mission(log: MissionLog, folder: Path) -> tuple[str, ...]:
    """Write all exports into an existing folder, each file complete or not at all.

    Returns:
        Names of the files; without findings.geojson if no georeference is known.

    Raises:
        OSError: If a file cannot be written.
    """
    report = make_report(log, 0.0)
    located = (*report.findings, *report.candidates)
    facts = [_facts(finding, report) for finding in located]
    table = pd.DataFrame(facts, columns=list(FINDING_COLUMNS))
    writers: dict[str, Callable[[Path], object]] = {
        "findings.csv": partial(table.to_csv, index=False),
        "steps.parquet": partial(_steps(log).to_parquet, index=False),
        "pulses.parquet": partial(_pulses(log).to_parquet, index=False),
        "mission.mcap": partial(write_ros2_recording, log),
    }
    if (reference := georeference_of(log)) is not None:
        writers["findings.geojson"] = partial(_write_geojson, located, facts, reference)
    for name, write in writers.items():
        with atomic_file(folder / name) as temporary:
            write(temporary)
    return tuple(writers)


def _write_geojson(
    findings: Sequence[FindingRecord], facts: Sequence[dict[str, Any]], reference: GeoreferenceConfig, path: Path
) -> None:
    """Write a point for each finding and the outline of its 95 % ellipse (RFC 7946)."""
    features: list[dict[str, Any]] = []
    for finding, properties in zip(findings, facts, strict=True):
        position_m, covariance_m2 = np.array(finding.position_m), np.array(finding.covariance_m2)
        place = longitude_latitude(position_m, reference).tolist()
        outline_m = outline95(position_m[:2], covariance_m2[:2, :2], 37)
        outline = longitude_latitude(outline_m, reference).tolist()
        point = {"type": "Point", "coordinates": [*place, round(position_m[2], 3)]}
        polygon = {"type": "Polygon", "coordinates": [[*outline[:-1], outline[0]]]}
        features += [
            {"type": "Feature", "id": f"finding-{finding.id}", "geometry": point, "properties": properties},
            {"type": "Feature", "id": f"ellipse-{finding.id}", "geometry": polygon, "properties": {"id": finding.id}},
        ]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}, indent=1) + "\n")


FINDING_COLUMNS = {
    "id": "id",
    "state": "state",
    "existence": "existence",
    "possibly_two": "possibly_two",
    "asset": "asset.name",
    "asset_id": "asset.asset_id",
    "kv": "asset.kv",
    "phase": "asset.phase",
    "severity": "assessment.severity",
    "action": "assessment.action",
    "due": "assessment.due",
    "site": "sites.0.name",
    "site_probability": "sites.0.probability",
    "kind": "discharge.kind",
    "kind_confidence": "discharge.confidence",
    "x_m": "position_m.0",
    "y_m": "position_m.1",
    "z_m": "position_m.2",
    "std_x_m": "position_std_m.0",
    "std_y_m": "position_std_m.1",
    "std_z_m": "position_std_m.2",
    "ellipse95_semi_major_m": "ellipse95.semi_major_m",
    "ellipse95_semi_minor_m": "ellipse95.semi_minor_m",
    "level_db": "strength.level_db",
    "rate_per_s": "strength.rate_per_s",
    "n_bearings": "n_bearings",
    "first_detected_s": "first_detected_s",
    "confirmed_s": "confirmed_s",
    "survey_date": "date",
    **{f"survey_{name}": f"survey.{name}" for name in Survey.model_fields},
    "true_source": "source.name",
    "true_site": "source.true_site",
    "true_x_m": "source.true_position_m.0",
    "true_y_m": "source.true_position_m.1",
    "true_z_m": "source.true_position_m.2",
} | {f"true_{name}": f"source.match.{name}" for name in SourceMatch.model_fields if name != "finding_id"}
"""Columns of findings.csv, and the place of each value in a finding of report.json, its `source` of `evaluation`, or
`date` and `survey` of the report."""


def _facts(finding: FindingRecord, report: Report) -> dict[str, Any]:
    """Return the values of `FINDING_COLUMNS`, rounded as in report.json; None for unknown ones."""
    sources = report.evaluation.sources if report.evaluation else ()
    own = [each for each in sources if each.match and each.match.finding_id == finding.id]
    record = {
        **finding.model_dump(mode="json"),
        **report.model_dump(mode="json", include={"date", "survey"}),
        "source": own[0].model_dump(mode="json") if own else None,
    }
    return {name: _value(record, place.split(".")) for name, place in FINDING_COLUMNS.items()}


def _value(part: Any, keys: Iterable[str]) -> Any:  # noqa: ANN401 - a part of JSON data
    """Return a value of nested dictionaries and lists; None if it is missing."""
    for key in keys:
        if not part:
            return None
        part = part[int(key)] if isinstance(part, list) else part[key]
    return part


def _steps(log: MissionLog) -> pd.DataFrame:
    """Return the table of control steps."""
    step = log.table("step")
    columns: dict[str, Any] = {"time_s": step["time_s"]}
    for prefix, name in (("", "pose"), ("true_", "true_pose"), ("odometry_", "odometry")):
        columns |= zip((f"{prefix}x_m", f"{prefix}y_m", f"{prefix}yaw_rad"), step[name].T, strict=True)
    columns["battery"] = step["battery"]
    columns |= zip(("commanded_speed_mps", "commanded_yaw_rate_radps"), step["command"].T, strict=True)
    return pd.DataFrame(columns | {name: step[name] for name in ("phase", "phase_target")})


def _pulses(log: MissionLog) -> pd.DataFrame:
    """Return the table of pulses; bearing and finding are null where a pulse has none."""
    pulse, association = log.table("pulse"), log.table("association")
    columns: dict[str, Any] = {"step": pulse["step"], "time_s": log.column("step", "time_s")[pulse["step"]]}
    columns |= {f"strength_{k + 1}_v": volts for k, volts in enumerate(pulse["strengths_v"].T)}
    columns |= {name: pulse[name] for name in ("mains_phase_rad", "is_clipped", "is_used")}
    pulses = pd.DataFrame(columns).join(pd.DataFrame(log.table("bearing")).set_index("pulse"))
    finding = pd.Series(association["finding"], association["pulse"])
    pulses["finding"] = finding[finding > 0].astype("Int64")
    return pulses
