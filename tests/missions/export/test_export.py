"""Exported files, read back with standard readers of their formats."""

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from geojson_pydantic import FeatureCollection
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from pyproj import Geod

from pdpatrol.envs import load_scenario
from pdpatrol.missions.export.export_mission import export_mission
from pdpatrol.missions.export.ros2_recording import write_ros2_recording
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.runner import run_mission
from tests.missions.steps import append_step
from tests.processes import pdpatrol

PLACE = {"latitude_deg": 51.5, "longitude_deg": 7.4, "heading_deg": 20.0}


@pytest.fixture(scope="module")
def log() -> MissionLog:
    settings = {f"georeference.{key}": value for key, value in PLACE.items()}
    scenario = load_scenario("transformer_bay", {**settings, "task.time_limit_s": 75.0})
    return run_mission(scenario, "seek", 3)


@pytest.fixture(scope="module")
def folder(log: MissionLog, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("export")
    written = export_mission(log, folder)
    assert {path.name for path in folder.iterdir()} == set(written)
    return folder


def read(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Return the times and contents of the messages of each topic of an MCAP file, and check their order in time."""
    messages: dict[str, list[tuple[int, Any]]] = {}
    last_ns = 0
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, content in reader.iter_decoded_messages(log_time_order=False):
            assert message.log_time >= last_ns
            last_ns = message.log_time
            messages.setdefault(channel.topic, []).append((message.log_time, content))
    return messages


def test_geojson_has_findings_and_their_ellipses_on_the_map(folder: Path, log: MissionLog) -> None:
    text = (folder / "findings.geojson").read_text(encoding="utf-8")
    collection = FeatureCollection.model_validate_json(text)
    report = make_report(log, 0.0)
    assert len(collection.features) == 2 * (len(report.findings) + len(report.candidates)) > 0
    point, ellipse = (feature["geometry"]["coordinates"] for feature in json.loads(text)["features"][:2])
    x_m, y_m, _ = [*report.findings, *report.candidates][0].position_m
    azimuth_deg, _, distance_m = Geod(ellps="WGS84").inv(PLACE["longitude_deg"], PLACE["latitude_deg"], *point[:2])
    assert distance_m == pytest.approx(np.hypot(x_m, y_m), abs=0.01)
    assert azimuth_deg == pytest.approx(PLACE["heading_deg"] + np.degrees(np.arctan2(x_m, y_m)), abs=0.02)
    ring = np.array(ellipse[0])
    assert ring[0].tolist() == ring[-1].tolist()
    np.testing.assert_allclose(ring[:-1].mean(axis=0), point[:2], atol=1e-7)
    x, y = (ring - ring[0]).T
    assert 0.5 * (x[:-1] * y[1:] - x[1:] * y[:-1]).sum() > 0.0  # counter-clockwise, as RFC 7946 requires


def test_findings_csv_agrees_with_the_report(folder: Path, log: MissionLog) -> None:
    rows: Any = pd.read_csv(folder / "findings.csv")
    report = make_report(log, 0.0)
    expected = [*report.findings, *report.candidates]
    assert rows["id"].tolist() == [finding.id for finding in expected]
    np.testing.assert_allclose(rows[["x_m", "y_m", "z_m"]], [finding.position_m for finding in expected], atol=1e-3)
    assert rows["site"][0] == expected[0].sites[0].name
    sources = {source.match.finding_id: source for source in report.scores.sources if source.match}
    assert rows.loc[rows["true_source"].notna(), "id"].tolist() == list(sources) != []
    for row in rows.to_dict("records"):
        if source := sources.get(row["id"]):
            assert (row["true_source"], row["true_site"]) == (source.name, source.true_site)
            assert source.match is not None
            for name, value in source.match.model_dump(mode="json", exclude={"finding_id"}).items():
                assert row[f"true_{name}"] == value, name


def test_parquet_has_all_steps_and_pulses(folder: Path, log: MissionLog) -> None:
    steps, pulses = pq.read_table(folder / "steps.parquet"), pq.read_table(folder / "pulses.parquet")
    assert steps.num_rows == log.n_rows("step")
    np.testing.assert_array_equal(steps["yaw_rad"].to_numpy(), log.column("step", "pose")[:, 2])
    assert pulses.num_rows == log.n_rows("pulse")
    assert pulses["bearing_rad"].null_count == log.n_rows("pulse") - log.n_rows("bearing") > 0
    owner = log.column("association", "finding")
    assert pulses["finding"].null_count == pulses.num_rows - int((owner > 0).sum())


def test_mcap_holds_poses_scans_and_markers(folder: Path, log: MissionLog) -> None:
    messages = {topic: [content for _, content in each] for topic, each in read(folder / "mission.mcap").items()}
    for topic in ("/tf", "/pose", "/true_pose", "/scan"):
        assert len(messages[topic]) == log.n_rows("step")
    (x, y, yaw), at = log.column("step", "pose")[100], messages["/pose"][100].pose
    assert [at.position.x, at.position.y] == pytest.approx([x, y])
    assert np.exp(2j * np.arctan2(at.orientation.z, at.orientation.w)) == pytest.approx(np.exp(1j * yaw))
    scan = messages["/scan"][100]
    np.testing.assert_allclose(
        scan.ranges, log.meta["lidar"]["start_m"] + log.column("scan", "range_m")[100], atol=1e-5
    )
    assert scan.angle_min + scan.angle_increment * len(scan.ranges) == pytest.approx(2.0 * np.pi)
    finding = make_report(log, 0.0).findings[0]
    (name,) = [one for one in messages["/findings"][-1].markers if one.ns == "names" and one.id == finding.id]
    assert name.text == f"finding {finding.id}"
    assert [name.pose.position.x, name.pose.position.y] == pytest.approx(finding.position_m[:2], abs=1e-3)
    assert sum(len(each.markers[0].points) for each in messages["/bearings"]) == 2 * log.n_rows("bearing")


def test_mcap_markers_have_the_size_of_the_yard(folder: Path, log: MissionLog) -> None:
    ((_, yard),) = read(folder / "mission.mcap")["/yard"]
    assert {marker.text for marker in yard.markers if marker.ns == "sites"} == set(log.meta["sites"])
    scales = {(one.ns, one.id): [one.scale.x, one.scale.y, one.scale.z] for one in yard.markers}
    axes = {"box": (0, 1, 2), "cylinder": (0, 0, 1)}
    solids = [(number, solid) for number, solid in enumerate(log.meta["solids"]["yard"]) if solid["shape"] in axes]
    assert {solid["shape"] for _, solid in solids} == set(axes)
    for number, solid in solids:
        expected = [2 * solid["size_m"][axis] for axis in axes[solid["shape"]]]
        assert scales[solid["group"], number] == pytest.approx(expected)


def field_log(*time_s: float, date: str | None = None) -> MissionLog:
    """Make the log of a survey from one pose, without truth and odometry."""
    array = {"boresights_rad": [0.0, 3.1]}
    log = MissionLog({"name": "survey", "seed": None, "policy": None, "n_elements": 2, "array": array, "date": date})
    for at_s in time_s:
        append_step(log, at_s, np.array([1.0, 2.0, 0.5]), battery=np.nan)
    return log


@pytest.mark.parametrize("start_s", [-1000.0, 0.0, 1.7e7, 1.75e9])
def test_recording_begins_on_the_date_or_in_unix_time(start_s: float, tmp_path: Path) -> None:
    write_ros2_recording(field_log(start_s, start_s + 90.0, date="2026-03-02"), tmp_path / "mission.mcap")
    expected_s = start_s if start_s > 1e9 else datetime(2026, 3, 2, tzinfo=UTC).timestamp()
    poses = read(tmp_path / "mission.mcap")["/pose"]
    assert [time_ns / 1e9 - expected_s for time_ns, _ in poses] == pytest.approx([0.0, 90.0])
    assert poses[1][1].header.stamp.sec == expected_s + 90


@pytest.mark.whole
def test_field_data_are_exported_without_truth_and_map(tmp_path: Path) -> None:
    folder = tmp_path / "a survey ü"
    folder.mkdir()
    field_log(1.0).save(folder)
    done = pdpatrol("export", folder.name, "--out", "out", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stderr == "note: findings.geojson was not written, because the scenario has no table [georeference]\n"
    names = {"findings.csv", "steps.parquet", "pulses.parquet", "mission.mcap"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == names
    assert all(name in done.stdout for name in names)
    assert read(tmp_path / "out" / "mission.mcap").keys() == {"/yard", "/tf", "/pose"}
    assert pq.read_table(tmp_path / "out" / "steps.parquet")["true_x_m"].null_count == 1
