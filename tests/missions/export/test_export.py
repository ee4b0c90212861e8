"""Exports, read back with the readers of their formats."""

import csv
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow.parquet as pq
import pytest
from geojson_pydantic import FeatureCollection
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from pyproj import Geod

from pdpatrol.envs import load_scenario
from pdpatrol.envs.scenario.map import GeoreferenceConfig
from pdpatrol.missions.export.export_mission import export_mission, longitude_latitude
from pdpatrol.missions.export.ros2_recording import write_ros2_recording
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.runner import run_mission
from tests.missions.steps import append_step

PLACE = {"latitude_deg": 51.5, "longitude_deg": 7.4, "heading_deg": 20.0}


@pytest.fixture(scope="module")
def log() -> MissionLog:
    settings = {f"georeference.{key}": value for key, value in PLACE.items()}
    scenario = load_scenario("transformer_bay", {**settings, "task.time_limit_s": 45.0})
    return run_mission(scenario, "seek", 3)


@pytest.fixture(scope="module")
def folder(log: MissionLog, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("export")
    written = export_mission(log, folder)
    assert {path.name for path in folder.iterdir()} == set(written)
    return folder


class Read(NamedTuple):
    """Decoded message."""

    topic: str
    time_ns: int
    content: Any


def read(path: Path) -> list[Read]:
    """Return all messages of an MCAP file."""
    with path.open("rb") as file:
        decoded = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
        return [Read(channel.topic, message.log_time, content) for _, channel, message, content in decoded]


@pytest.mark.parametrize("latitude_deg", [-60.0, 0.0, 51.5])
def test_longitude_latitude_keep_distance_and_heading(latitude_deg: float) -> None:
    reference = GeoreferenceConfig(latitude_deg=latitude_deg, longitude_deg=7.4, heading_deg=20.0)
    for place_m, azimuth_deg in (([0.0, 150.0], 20.0), ([150.0, 0.0], 110.0), ([150.0, 150.0], 65.0)):
        place = longitude_latitude(np.array(place_m), reference)
        azimuth, _, distance_m = Geod(ellps="WGS84").inv(7.4, latitude_deg, *place)
        assert distance_m == pytest.approx(np.hypot(place_m[0], place_m[1]), abs=0.01)
        assert azimuth == pytest.approx(azimuth_deg, abs=0.01)


def test_geojson_is_valid(folder: Path, log: MissionLog) -> None:
    text = (folder / "findings.geojson").read_text(encoding="utf-8")
    collection = FeatureCollection.model_validate_json(text)
    report = make_report(log, 0.0)
    assert len(collection.features) == 2 * (len(report.findings) + len(report.candidates)) > 0
    point, ellipse = (feature["geometry"]["coordinates"] for feature in json.loads(text)["features"][:2])
    ring = np.array(ellipse[0])
    assert ring[0].tolist() == ring[-1].tolist()
    np.testing.assert_allclose(ring[:-1].mean(axis=0), point[:2], atol=1e-7)
    x, y = (ring - ring[0]).T
    assert 0.5 * (x[:-1] * y[1:] - x[1:] * y[:-1]).sum() > 0.0  # counter-clockwise, as RFC 7946 asks


def test_findings_csv_agrees_with_the_report(folder: Path, log: MissionLog) -> None:
    with (folder / "findings.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    report = make_report(log, 0.0).model_dump(mode="json")
    expected = [*report["findings"], *report["candidates"]]
    assert [row["id"] for row in rows] == [str(finding["id"]) for finding in expected]
    assert [float(rows[0][name]) for name in ("x_m", "y_m", "z_m")] == list(expected[0]["position_m"])
    assert rows[0]["site"] == expected[0]["sites"][0]["name"]


def test_parquet_has_all_steps_and_pulses(folder: Path, log: MissionLog) -> None:
    steps, pulses = pq.read_table(folder / "steps.parquet"), pq.read_table(folder / "pulses.parquet")
    assert steps.num_rows == log.n_rows("step")
    np.testing.assert_array_equal(steps["yaw_rad"].to_numpy(), log.column("step", "pose")[:, 2])
    assert pulses.num_rows == log.n_rows("pulse")
    assert pulses["bearing_rad"].null_count == log.n_rows("pulse") - log.n_rows("bearing") > 0
    owner = log.column("association", "finding")
    assert pulses["finding"].null_count == pulses.num_rows - int((owner > 0).sum())
    assert pulses["fate"].null_count == pulses.num_rows - int((owner <= 0).sum())
    for field in (*steps.schema, *pulses.schema):
        assert field.metadata[b"description"]


def test_mcap_messages_are_complete_and_in_order(folder: Path, log: MissionLog) -> None:
    messages: dict[str, list[Any]] = {}
    times: list[int] = []
    for topic, time_ns, content in read(folder / "mission.mcap"):
        messages.setdefault(topic, []).append(content)
        times.append(time_ns)
    assert (np.diff(times) >= 0).all()
    n_steps = log.n_rows("step")
    for topic in ("/tf", "/pose", "/true_pose", "/scan"):
        assert len(messages[topic]) == n_steps
    at, pose = 100, log.column("step", "pose")[100]
    turn = messages["/pose"][at].pose.orientation
    assert 2.0 * np.arctan2(turn.z, turn.w) == pytest.approx(np.arctan2(np.sin(pose[2]), np.cos(pose[2])))
    assert [messages["/pose"][at].pose.position.x, messages["/pose"][at].pose.position.y] == pytest.approx(pose[:2])
    scan = messages["/scan"][at]
    start_m = log.meta["lidar"]["start_m"]
    np.testing.assert_allclose(scan.ranges, start_m + log.column("scan", "range_m")[at], atol=1e-5)
    assert scan.angle_min + scan.angle_increment * len(scan.ranges) == pytest.approx(2.0 * np.pi)
    (yard,) = messages["/yard"]
    assert {marker.text for marker in yard.markers if marker.ns == "sites"} == set(log.meta["sites"])
    finding = make_report(log, 0.0).findings[0]
    (name,) = [one for one in messages["/findings"][-1].markers if one.ns == "names" and one.id == finding.id]
    assert name.text == f"finding {finding.id}"
    assert [name.pose.position.x, name.pose.position.y] == pytest.approx(finding.position_m[:2], abs=1e-3)
    rays = sum(len(message.markers[0].points) for message in messages["/bearings"])
    assert rays == 2 * log.n_rows("bearing")


def test_mcap_markers_have_the_size_of_the_yard(folder: Path, log: MissionLog) -> None:
    (yard,) = [content for topic, _, content in read(folder / "mission.mcap") if topic == "/yard"]
    solids = log.meta["solids"]["yard"]
    shapes = {solid["shape"] for solid in solids}
    assert {"box", "cylinder"} <= shapes
    for number, solid in enumerate(solids):
        if solid["shape"] not in ("box", "cylinder"):
            continue
        (marker,) = [one for one in yard.markers if one.id == number and one.ns == solid["group"]]
        x, y, z = solid["size_m"]
        expected = (2 * x, 2 * y, 2 * z) if solid["shape"] == "box" else (2 * x, 2 * x, 2 * y)
        assert (marker.scale.x, marker.scale.y, marker.scale.z) == pytest.approx(expected)


def field_log(*time_s: float, date: str | None = None) -> MissionLog:
    """Log of a survey of one pose, without truth and odometry."""
    array = {"boresights_rad": [0.0, 3.1]}
    log = MissionLog({"name": "survey", "seed": None, "policy": None, "n_elements": 2, "array": array, "date": date})
    for at_s in time_s:
        append_step(log, at_s, np.array([1.0, 2.0, 0.5]), battery=np.nan)
    return log


@pytest.mark.parametrize("start_s", [-1000.0, 0.0, 1.7e7])
def test_recording_begins_on_the_date(start_s: float, tmp_path: Path) -> None:
    write_ros2_recording(field_log(start_s, start_s + 90.0, date="2026-03-02"), tmp_path / "mission.mcap")
    poses = [message for message in read(tmp_path / "mission.mcap") if message.topic == "/pose"]
    midnight = datetime(2026, 3, 2, tzinfo=UTC).timestamp()
    assert [pose.time_ns / 1e9 - midnight for pose in poses] == pytest.approx([0.0, 90.0])
    assert poses[1].content.header.stamp.sec == midnight + 90


def test_recording_keeps_unix_times(tmp_path: Path) -> None:
    write_ros2_recording(field_log(1.75e9, date="2026-03-02"), tmp_path / "mission.mcap")
    assert {message.time_ns for message in read(tmp_path / "mission.mcap")} == {1_750_000_000 * 10**9}


def test_field_data_are_exported_without_truth(tmp_path: Path) -> None:
    written = export_mission(field_log(1.0), tmp_path)
    assert "findings.geojson" not in written
    assert {topic for topic, _, _ in read(tmp_path / "mission.mcap")} == {"/yard", "/tf", "/pose"}
    assert pq.read_table(tmp_path / "steps.parquet")["true_x_m"].null_count == 1
