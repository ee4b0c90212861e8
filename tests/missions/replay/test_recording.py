"""Recordings written and read back."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from dirmusic.angles import wrap
from dirmusic.arrays import FloatArray
from pdpatrol.envs import load_scenario
from pdpatrol.missions.record.finding_pulses import phase_patterns
from pdpatrol.missions.record.log_contents import true_yard
from pdpatrol.missions.record.mission_log import TABLES, MissionLog
from pdpatrol.missions.recording import Recorder, write_recording
from pdpatrol.missions.recording.findings import UNITS_PER_DB
from pdpatrol.missions.recording.scene import STEPS_PER_M
from pdpatrol.robot_models.world import describe_equipment
from tests.missions.conftest import call
from tests.missions.field.surveys import EXAMPLE, log_of_table
from tests.missions.replay.read_back import Entities, read_recording, recorded
from tests.missions.replay.short_mission import copy_of, short_mission
from tests.missions.report.logs import empty_log


@pytest.fixture(autouse=True)
def _strict() -> Iterator[None]:
    """Turn Rerun's warnings about dropped data into errors."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(before)


@pytest.fixture(scope="module")
def log() -> MissionLog:
    return short_mission(43.0, seed=1, scenario="two_sources")


@pytest.fixture(scope="module")
def recording(log: MissionLog, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "mission.rrd"
    write_recording(log, path)
    return path


@pytest.fixture(scope="module")
def drawn(recording: Path) -> Entities:
    return read_recording(recording)


def direction(rays: object) -> FloatArray:
    """Return the directions of rays (n, 2, 3), shape (n,), radians."""
    ahead = np.diff(np.array(rays), axis=1)[:, 0]
    return np.arctan2(ahead[:, 1], ahead[:, 0])


def test_recording_has_every_row_of_the_log(drawn: Entities, log: MissionLog) -> None:
    assert set(drawn["world/robot"]["translation"]) == set(range(log.n_rows("step")))
    for path in ("world/trajectory", "world/truth/trajectory", "world/odometry"):
        assert len(drawn[path]["strips"]) == -(-log.n_rows("step") // 5)
    n_rays = sum(len(rays) for rays in drawn["world/bearings"]["strips"].values())
    assert n_rays == log.n_rows("bearing") > 100
    shown = "".join(text for (text,) in drawn["mission/events"]["text"].values()).replace("\N{NO-BREAK SPACE}", " ")
    assert not [text for text in log.column("event", "text").tolist() if text.replace("_", "\\_") not in shown]
    for number in set(log.column("finding", "id").tolist()):
        assert f"world/findings/{number}" in drawn
    for path in ("yard/equipment/box", "robot/body/cylinder", "yard/sites", "route", "likelihood"):
        assert f"world/{path}" in drawn
    assert not [path for path, entity in drawn.items() if re.search(r"\bnan\b", repr(entity))]


def test_times_match_the_steps(recording: Path, log: MissionLog) -> None:
    time_s = log.column("step", "time_s")
    for chunk in RrdReader(recording).stream().to_chunks():
        batch = chunk.to_record_batch()
        if "step" in batch.schema.names:
            at_s = batch.column("sim_time").cast("int64").to_numpy() / 1e9
            np.testing.assert_allclose(at_s, time_s[batch.column("step").to_numpy()], atol=1e-6)


def test_every_panel_shows_something_at_time_zero(recording: Path, log: MissionLog) -> None:
    """The first step ends at 0.1 s; at time zero, robot and camera stand where they stand then."""
    for chunk in RrdReader(recording).stream().to_chunks():
        batch = chunk.to_record_batch()
        if "sim_time" in batch.schema.names and "step" not in batch.schema.names:
            assert batch.column("sim_time").cast("int64").to_pylist() == [0]
    start, place_m = read_recording(recording, is_start=True), log.column("step", "pose")[0, :2]
    np.testing.assert_allclose(start["world/robot"]["translation"][None], [[*place_m, 0.0]], atol=1e-5)
    assert start["world/camera"]["mat3x3"]
    assert start["mission/status"]["text"][None][0].startswith("### The mission starts")
    assert start["mission/events"]["text"]


def test_views_and_overrides_refer_to_entities(recording: Path, drawn: Entities) -> None:
    reader = RrdReader(recording)
    (entry,) = reader.blueprints()
    paths = set[str]()
    for chunk in reader.stream(store=entry).to_chunks():
        paths |= set(re.findall(r"overrides?/(.+?)(?:/visualizers.*)?$", str(chunk.entity_path)))
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name.endswith(":space_origin"):
                paths |= {origin.strip("/") for cell in batch.column(name).to_pylist() for origin in cell or ()}
    assert len(paths) >= 12
    for path in paths:
        assert [entity for entity in drawn if f"{entity}/".startswith(f"{path}/")], path


def test_growing_log_gives_the_same_recording(log: MissionLog, tmp_path: Path, drawn: Entities) -> None:
    growing = MissionLog(log.meta)
    recorder = Recorder(growing)
    recorder.stream.save(tmp_path / "live.rrd")
    tables = {name: log.table(name) for name in TABLES}
    for start in range(0, log.n_rows("step"), 7):
        is_last = start + 7 >= log.n_rows("step")
        for name, table in tables.items():
            stop = 0 if name == "association" else log.rows_before(name, start + 7)
            for row in range(growing.n_rows(name), log.n_rows(name) if is_last else stop):
                growing.append(name, **{column: values[row] for column, values in table.items()})
        recorder.update(is_over=is_last)
    recorder.stream.flush()
    recorder.stream.disconnect()
    live = read_recording(tmp_path / "live.rrd")
    same = [path for path in drawn if not path.startswith("__properties")]
    assert len(same) > 30
    for path in same:
        assert live[path] == drawn[path], path


def test_field_data_and_empty_logs_can_be_recorded(tmp_path: Path) -> None:
    assert "world/truth/sources" not in recorded(empty_log(), tmp_path)
    field = log_of_table(EXAMPLE)
    drawn = recorded(field, tmp_path)
    assert len(drawn["world/robot"]["translation"]) == field.n_rows("step")
    assert "world/odometry" not in drawn


def test_any_name_is_recorded_without_a_warning(capfd: pytest.CaptureFixture[str]) -> None:
    log = empty_log()
    log.meta["name"] = "Prüfung 1.2 (Nord)"
    Recorder(log).stream.disconnect()
    assert capfd.readouterr().err == ""


def test_recording_of_a_killed_mission(tmp_path: Path, log: MissionLog) -> None:
    copy_of(log, "step", "pulse", "bearing", "finding").write_part(tmp_path)
    drawn = recorded(MissionLog.load(tmp_path), tmp_path)
    assert len(drawn["world/robot"]["translation"]) == log.n_rows("step")
    assert not [path for path in drawn if path.startswith("phase_pattern")]
    assert "The mission ended after 43 s: killed." in drawn["mission/status"]["text"][log.n_rows("step") - 1][0]


def test_replay_draws_a_damaged_recording_again(
    log: MissionLog, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "Prüffeld 1, [süd] €"
    folder.mkdir()
    (folder / "mission.rrd").write_bytes(b"damaged")
    log.save(folder)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(OSError, match="no screen"):
        call("replay", folder)
    assert read_recording(folder / "mission.rrd")


def test_map_errors_are_drawn_as_outlines(tmp_path: Path, log: MissionLog) -> None:
    missing = describe_equipment(load_scenario("one_source").yard.equipment[:1])
    drawn = recorded(copy_of(log, "step", n_steps=5, solids={**log.meta["solids"], "map": missing}), tmp_path)
    outline = drawn["world/yard/map/box"]
    np.testing.assert_allclose(outline["centers"][None], [missing[0]["position_m"]], atol=1e-6)
    assert outline["fill_mode"][None] == [rr.components.FillMode.MajorWireframe.value]


def test_dropped_finding_is_cleared(tmp_path: Path, log: MissionLog) -> None:
    dropped = copy_of(log, "step", n_steps=20)
    row = {name: column[-1] for name, column in log.table("finding").items()}
    for step, state in ((3, "candidate"), (9, "dropped")):
        dropped.append("finding", **row | {"step": step, "state": state, "id": 1})
    drawn = recorded(dropped, tmp_path)
    assert list(drawn["world/findings/1"]["positions"]) == [3]
    assert drawn["world/findings/1"]["is_recursive"] == {9: [True]}


def test_rays_start_at_the_robot_and_follow_the_bearings(drawn: Entities, log: MissionLog) -> None:
    pulse_step = log.column("pulse", "step")[log.column("bearing", "pulse")]
    rays = np.concatenate([own for _, own in sorted(drawn["world/bearings"]["strips"].items())])
    half_step_m = 0.501 / STEPS_PER_M  # of each coordinate of both ends of a ray 25 m long
    np.testing.assert_allclose(rays[:, 0, :2], log.column("step", "pose")[pulse_step, :2], atol=half_step_m)
    np.testing.assert_allclose(
        direction(rays), log.column("bearing", "bearing_rad"), atol=np.sqrt(8) * half_step_m / 25
    )
    for step, (degrees,) in drawn["plots/directions/bearing"]["scalars"].items():
        assert np.abs(np.degrees(log.column("bearing", "bearing_rad")[pulse_step == step]) - degrees).min() < 1e-4


def test_ring_peaks_on_a_ray(drawn: Entities) -> None:
    rings, rays = drawn["world/spectrum"]["strips"], drawn["world/bearings"]["strips"]
    assert len(rings) > 50
    for step, (ring,) in rings.items():
        starts = np.array(rays[step])[:, 0, :2]
        out = np.array(ring)[:, :2] - starts[:, np.newaxis]
        radius = np.linalg.norm(out, axis=-1)
        own = int(np.abs(radius.max(axis=-1) - 3.0).argmin())  # the ray from the centre of the ring
        peak = np.arctan2(*out[own, radius[own].argmax()][::-1])
        assert (
            np.degrees(np.abs(wrap(peak - direction(rays[step])))).min() < 3.01
        )  # azimuths are 3 degrees apart, plus rounding


def test_left_turn_turns_the_robot(drawn: Entities, log: MissionLog) -> None:
    yaw_rad = np.unwrap(log.column("step", "pose")[:, 2])
    assert np.ptp(yaw_rad) > 1.0
    turns = np.unwrap([turn["angle"] for _, (turn,) in sorted(drawn["world/robot"]["rotation_axis_angle"].items())])
    np.testing.assert_allclose(turns, yaw_rad, atol=1e-5)
    for step, (degrees,) in drawn["plots/directions/heading"]["scalars"].items():
        assert degrees == pytest.approx(np.degrees(wrap(yaw_rad[step])))


def test_camera_looks_at_the_robot_from_behind(drawn: Entities, log: MissionLog) -> None:
    """Its view is level, contains the horizon, and turns slowly."""
    camera, pose = drawn["world/camera"], log.column("step", "pose")
    rows = [(camera["translation"][step][0], camera["mat3x3"][step][0]) for step in range(len(pose))]
    place_m = np.array([place for place, _ in rows])
    right, down, forward = np.moveaxis(np.array([matrix for _, matrix in rows]).reshape(-1, 3, 3), 1, 0)
    np.testing.assert_allclose(np.cross(right, down), forward, atol=1e-6)
    np.testing.assert_allclose(right[:, 2], 0.0, atol=1e-6)
    assert (down[:, 2] < -0.9).all()
    assert (np.abs(np.arcsin(forward[:, 2])) < 0.5 * camera_fov_rad(drawn)).all()  # half of the image is above
    to_robot = np.column_stack([pose[:, :2], np.full(len(pose), 0.5)]) - place_m
    along = (to_robot * forward).sum(axis=1) / np.linalg.norm(to_robot, axis=1)
    assert (along > np.cos(0.25 * camera_fov_rad(drawn))).all()
    turn_rad = np.abs(wrap(np.diff(np.arctan2(forward[:, 1], forward[:, 0]))))
    assert turn_rad.max() < 0.6 * np.abs(wrap(np.diff(pose[:, 2]))).max()


def test_no_equipment_hides_the_robot_from_the_camera(tmp_path: Path) -> None:
    """Where equipment would stand between them, the camera comes nearer; then it moves away, not all at once."""
    log = short_mission(14.0, scenario="switchyard")
    yard, pose = true_yard(log), log.column("step", "pose")
    assert yard is not None
    placed = recorded(log, tmp_path)["world/camera"]["translation"]
    place_m = np.array([placed[step][0] for step in range(len(pose))])
    middle_m = np.column_stack([pose[:, :2], np.full(len(pose), 0.5)])
    assert yard.solids.distance(np.linspace(middle_m, place_m, 100)[25:]).min() > 0.1
    away_m = np.linalg.norm(place_m - middle_m, axis=-1)
    assert away_m.min() < 0.8 * away_m.max()  # equipment stands behind the dock
    assert np.diff(away_m).max() < 0.1


def camera_fov_rad(drawn: Entities) -> float:
    """Return the vertical field of view of the camera."""
    matrix = np.array(drawn["world/camera"]["image_from_camera"][None][0]).reshape(3, 3, order="F")
    return float(2.0 * np.arctan(matrix[1, 2] / matrix[1, 1]))


def test_one_number_has_one_colour_everywhere(drawn: Entities, log: MissionLog) -> None:
    numbers = sorted(set(log.column("finding", "id").tolist()))
    colours = set[int]()
    for number in numbers:
        own = [colour for path in (f"world/findings/{number}", f"world/findings/{number}/ellipse",
               f"plots/uncertainty/{number}", f"phase_pattern/{number}", f"phase_pattern/{number}/kind")
               for cell in drawn.get(path, {}).get("colors", {}).values() for colour in cell]  # fmt: skip
        assert len(own) >= 3
        assert len(set(own)) == 1
        colours |= set(own)
    assert len(colours) == len(numbers) > 1


def test_only_what_is_confirmed_is_called_a_finding(log: MissionLog, tmp_path: Path) -> None:
    unconfirmed = copy_of(log, "step", "pulse", "bearing", "association")
    for row in zip(*log.table("finding").values(), strict=True):
        values = dict(zip(log.table("finding"), row, strict=True))
        state = "candidate" if values["state"] == "confirmed" else values["state"]
        unconfirmed.append("finding", **{**values, "state": state})
    drawn = recorded(unconfirmed, tmp_path)
    kinds = [entity["labels"] for path, entity in drawn.items() if path.endswith("/kind/label")]
    assert kinds
    assert all(re.fullmatch(r"\d+\? \w+", str(label)) for cells in kinds for cell in cells.values() for label in cell)
    words = [
        str(text)
        for path, entity in drawn.items()
        for name in ("text", "labels", "names")
        for cell in entity.get(name, {}).values()
        for text in cell
        if path != "mission/legend"
    ]
    assert not [text for text in words if re.search(r"\bfinding\b", text, re.IGNORECASE)]


def test_list_of_events_never_shows_the_future(drawn: Entities, log: MissionLog) -> None:
    event = log.table("event")
    for step, (text,) in drawn["mission/events"]["text"].items():
        assert step is not None
        past = event["text"][event["step"] <= step][::-1]
        shown = [line.partition("** ")[2].replace("\N{NO-BREAK SPACE}", " ") for line in text.splitlines()]
        assert shown == past[: len(shown)].tolist()


def test_phase_pattern_has_levels_in_decibels(drawn: Entities, log: MissionLog) -> None:
    patterns, _ = phase_patterns(log)
    assert patterns
    for number, (pulses, _) in patterns.items():
        points, steps = drawn[f"phase_pattern/{number}"]["positions"], log.column("pulse", "step")[pulses.pulse]
        assert set(points) == set(steps.tolist())
        y = np.concatenate(list(points.values()))[:, 1]
        above_db, level_db = np.sort(-y / UNITS_PER_DB), np.sort(pulses.level_db)
        np.testing.assert_allclose(above_db - above_db[0], level_db - level_db[0], atol=1e-4)
