"""Write a mission as CSV, GeoJSON, Parquet and MCAP."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from pyproj import Transformer

from dirmusic.locating.association import Unassociated
from dirmusic.locating.finding import outline95
from pdpatrol.envs.scenario.map import GeoreferenceConfig
from pdpatrol.missions.atomic_file import atomic_file
from pdpatrol.missions.export.ros2_recording import OUTLINE_POINTS, write_ros2_recording
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.records import FindingRecord, Report

FloatArray = NDArray[np.float64]
Columns = dict[str, tuple[Any, str]]
"""Values and description of each column of a Parquet file."""

WORLD = "world frame: x east, y north, origin at the south-west corner of the yard, yaw counter-clockwise from east"
ARRAY = "array frame: counter-clockwise from straight ahead"


def export_mission(log: MissionLog, folder: Path) -> tuple[str, ...]:
    """Write all exports into an existing folder, each file complete or not at all.

    Returns:
        Names of the files; without findings.geojson if the scenario has no georeference.

    Raises:
        OSError: If a file cannot be written.
    """
    report = make_report(log, 0.0)
    reference = log.meta.get("scenario", {}).get("georeference")
    writers: dict[str, Any] = {"findings.csv": lambda path: write_findings_csv(report, path)}
    if reference is not None:
        georeference = GeoreferenceConfig.model_validate(reference)
        writers["findings.geojson"] = lambda path: write_findings_geojson(report, georeference, path)
    writers["steps.parquet"] = lambda path: write_steps(log, path)
    writers["pulses.parquet"] = lambda path: write_pulses(log, path)
    writers["mission.mcap"] = lambda path: write_ros2_recording(log, path)
    for name, write in writers.items():
        with atomic_file(folder / name) as temporary:
            write(temporary)
    return tuple(writers)


def write_findings_csv(report: Report, path: Path) -> None:
    """Write one line for each finding and candidate; names of columns end in units."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(FINDING_COLUMNS)
        writer.writerows(_facts(finding).values() for finding in (*report.findings, *report.candidates))


def write_findings_geojson(report: Report, reference: GeoreferenceConfig, path: Path) -> None:
    """Write a point for each finding and candidate and the outline of its 95 % ellipse (RFC 7946)."""
    features: list[dict[str, Any]] = []
    for finding in (*report.findings, *report.candidates):
        position_m, covariance_m2 = np.array(finding.position_m), np.array(finding.covariance_m2)
        place = longitude_latitude(position_m, reference).tolist()
        outline_m = outline95(position_m[:2], covariance_m2[:2, :2], OUTLINE_POINTS)
        outline = longitude_latitude(outline_m, reference).tolist()
        point = {"type": "Point", "coordinates": [*place, round(position_m[2], 3)]}
        polygon = {"type": "Polygon", "coordinates": [[*outline[:-1], outline[0]]]}
        for name, geometry, facts in (("finding", point, _facts(finding)), ("ellipse", polygon, {"id": finding.id})):
            feature = {"type": "Feature", "id": f"{name}-{finding.id}", "geometry": geometry, "properties": facts}
            features.append(feature)
    text = json.dumps({"type": "FeatureCollection", "features": features}, indent=1, ensure_ascii=False)
    path.write_text(text + "\n", encoding="utf-8")


def longitude_latitude(places_m: FloatArray, reference: GeoreferenceConfig) -> FloatArray:
    """Convert places in the yard, shape (..., 2 or more), to longitude and latitude on WGS 84, degrees, (..., 2)."""
    heading = np.radians(reference.heading_deg)
    x, y = places_m[..., 0], places_m[..., 1]
    east_m, north_m = np.cos(heading) * x + np.sin(heading) * y, np.cos(heading) * y - np.sin(heading) * x
    origin = f"+lat_0={reference.latitude_deg} +lon_0={reference.longitude_deg}"
    to_degrees = Transformer.from_crs(f"+proj=aeqd {origin} +ellps=WGS84", "EPSG:4326", always_xy=True)
    degrees = np.stack(to_degrees.transform(east_m, north_m), axis=-1, dtype=np.float64)
    return np.round(degrees, 8)  # to the millimetre


FINDING_COLUMNS = (
    "id",
    "state",
    "site",
    "site_probability",
    "kind",
    "kind_confidence",
    "x_m",
    "y_m",
    "z_m",
    "std_x_m",
    "std_y_m",
    "std_z_m",
    "ellipse95_semi_major_m",
    "ellipse95_semi_minor_m",
    "level_db",
    "rate_per_s",
    "n_bearings",
    "first_detected_s",
    "confirmed_s",
)


def _facts(finding: FindingRecord) -> dict[str, Any]:
    """Return the values of `FINDING_COLUMNS`, rounded as in report.json; None for unknown ones."""
    record = finding.model_dump(mode="json")
    site, discharge = next(iter(record["sites"]), {}), record["discharge"] or {}
    parts = (
        {"site": site.get("name"), "site_probability": site.get("probability")},
        {"kind": discharge.get("kind"), "kind_confidence": discharge.get("confidence")},
        dict(zip(("x_m", "y_m", "z_m"), record["position_m"], strict=True)),
        dict(zip(("std_x_m", "std_y_m", "std_z_m"), record["position_std_m"], strict=True)),
        {f"ellipse95_{name}": value for name, value in record["ellipse95"].items()},
        record["strength"] or {},
    )
    values = record | {name: value for part in parts for name, value in part.items()}
    return {name: values.get(name) for name in FINDING_COLUMNS}


def write_steps(log: MissionLog, path: Path) -> None:
    """Write one row for each control step."""
    step = log.table("step")
    columns: Columns = {"time_s": (step["time_s"], "since the start of the mission")}
    poses = (
        ("", "pose", "estimated by the robot"),
        ("true_", "true_pose", "true"),
        ("odometry_", "odometry", "by wheels and gyro"),
    )
    for prefix, name, description in poses:
        for values, unit in zip(step[name].T, ("x_m", "y_m", "yaw_rad"), strict=True):
            columns[prefix + unit] = (values, f"{description}; {WORLD}")
    columns["battery"] = (step["battery"], "remaining share of the charge")
    for values, name in zip(step["command"].T, ("speed_mps", "yaw_rate_radps"), strict=True):
        columns[f"commanded_{name}"] = (values, "command during the step")
    columns["phase"] = ([phase or None for phase in step["phase"].tolist()], "activity of the policy")
    columns["phase_target"] = (step["phase_target"], "waypoint or finding that it drove to; 0 for neither")
    _write_table(columns, path)


def write_pulses(log: MissionLog, path: Path) -> None:
    """Write one row for each pulse; bearing and finding are null where it has none."""
    pulse, bearing, association = log.table("pulse"), log.table("bearing"), log.table("association")
    n = log.n_rows("pulse")
    columns: Columns = {
        "step": (pulse["step"], "row in the table of steps"),
        "time_s": (log.column("step", "time_s")[pulse["step"]], "end of its step"),
        **{f"strength_{k + 1}_v": (volts, f"in element {k + 1}") for k, volts in enumerate(pulse["strengths_v"].T)},
        "mains_phase_rad": (pulse["mains_phase_rad"], "phase of the receiver's mains"),
        "is_clipped": (pulse["is_clipped"], "reached full scale of the ADC"),
        "is_credible": (pulse["is_credible"], "consistent with a single plane wave"),
    }
    for name, what in (("azimuth_rad", ARRAY), ("bearing_rad", WORLD), ("std_rad", "of the bearing, from noise alone")):
        values = np.full(n, np.nan)
        values[bearing["pulse"]] = bearing[name]
        columns[name] = (values, what)
    owner = np.full(n, np.nan)
    owner[association["pulse"]] = association["finding"]
    codes = {float(code): code.name.lower() for code in Unassociated}
    finding = pa.array(np.where(owner > 0, owner, np.nan), from_pandas=True).cast(pa.int64())
    columns["finding"] = (finding, "id of its finding")
    columns["fate"] = ([codes.get(value) for value in owner.tolist()], "why it has no finding")
    _write_table(columns, path)


def _write_table(columns: Columns, path: Path) -> None:
    """Write columns with their descriptions; NaN becomes null."""
    arrays: dict[str, pa.Array] = {}
    for name, (values, _) in columns.items():
        arrays[name] = values if isinstance(values, pa.Array) else pa.array(values, from_pandas=True)
    fields = [pa.field(name, arrays[name].type, metadata={"description": text}) for name, (_, text) in columns.items()]
    pq.write_table(pa.table(arrays, schema=pa.schema(fields)), path)
