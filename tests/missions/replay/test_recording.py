"""Recordings are written for real and read back."""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from pdpatrol.envs import load_scenario
from pdpatrol.missions.record.mission_log import TABLES, MissionLog
from pdpatrol.missions.recording import Recorder, paths, write_recording
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.runner import run_mission
from pdpatrol.robot_models.drawn_solids import describe_equipment
from tests.missions.replay.read_back import cells, rows, values

AT_REST = {"odometry": np.zeros(3), "battery": 1.0, "command": np.zeros(2)}


@pytest.fixture(autouse=True)
def _strict() -> Iterator[None]:
    """Rerun drops what it cannot read with a warning; here that is an error."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(before)


@pytest.fixture(scope="module")
def log() -> MissionLog:
    scenario = load_scenario("one_source")
    task = scenario.task.model_copy(update={"time_limit_s": 25.0})
    return run_mission(scenario.model_copy(update={"task": task}), seed=1)


@pytest.fixture(scope="module")
def recording(log: MissionLog, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "mission.rrd"
    write_recording(log, path)
    return path


def test_reruns_own_checker_accepts_the_file(recording: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "verify", str(recording)], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr


def test_counts_are_those_of_the_log(recording: Path, log: MissionLog) -> None:
    counted, found = rows(recording), values(recording)
    n_steps, n_bins = log.n_rows("step"), -(-log.n_rows("step") // 5)
    assert counted[f"/{paths.ROBOT}"] == n_steps + 1  # and what it is marked by
    for path in (paths.TRAJECTORY, paths.TRUE_TRAJECTORY, paths.ODOMETRY, paths.SPECTRA_HEADING):
        assert counted[f"/{path}"] == n_bins + 1  # and its style
    assert counted[f"/{paths.BATTERY}"] == n_bins
    drawn = {
        path: sum(len(strips) for strips in cells(found[f"/{path}"], "strips").values())
        for path in (paths.NEW_BEARINGS, paths.REJECTED)
    }
    assert drawn[paths.NEW_BEARINGS] == log.n_rows("bearing") > 100
    assert drawn[paths.REJECTED] == log.n_rows("pulse") - log.n_rows("bearing") > 5
    assert counted[f"/{paths.EVENTS}"] == log.n_rows("event")
    finding = log.table("finding")
    for number in np.unique(finding["id"]).tolist():
        positions = cells(found[f"/{paths.finding_path(number)}"], "positions")
        assert set(positions) == set(finding["step"][finding["id"] == number].tolist())
    assert counted[f"/{paths.LIKELIHOOD}"] == log.n_rows("likelihood") * 2  # the picture, and where it lies
    for path in (f"{paths.EQUIPMENT}/box", f"{paths.BODY}/cylinder", paths.SITES, paths.ROUTE, paths.PHASE):
        assert counted[f"/{path}"] >= 1


def test_times_increase_along_every_entity(recording: Path, log: MissionLog) -> None:
    time_s = log.column("step", "time_s")
    for chunk in RrdReader(recording).stream().to_chunks():
        batch = chunk.to_record_batch()
        if paths.SIM_TIME not in batch.schema.names:
            continue
        at = batch.column(paths.SIM_TIME).cast("int64").to_numpy() / 1e9
        assert (np.diff(at) >= 0.0).all(), chunk.entity_path
        np.testing.assert_allclose(at, time_s[batch.column(paths.STEP).to_numpy()], atol=1e-6)


def test_every_view_shows_something_that_is_there(recording: Path) -> None:
    reader, there = RrdReader(recording), rows(recording)
    (entry,) = reader.blueprints()
    origins, overridden = set[str](), set[str]()
    for chunk in reader.stream(store=entry).to_chunks():
        overridden |= set(re.findall(r"overrides?(/.+?)(?:/visualizers.*)?$", str(chunk.entity_path)))
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name.endswith(":space_origin"):
                origins |= {origin for cell in batch.column(name).to_pylist() for origin in cell or ()}
    assert len(origins) >= 9
    assert len(overridden) >= 9
    for path in (*(f"/{origin.strip('/')}" for origin in origins), *overridden):
        assert [one for one in there if one == path or one.startswith(f"{path}/")], path


def test_a_recording_made_slice_by_slice_as_the_log_grows_holds_the_same(log: MissionLog, tmp_path: Path) -> None:
    growing = MissionLog(log.meta)
    stream = rr.RecordingStream("pdpatrol")
    stream.save(tmp_path / "slices.rrd")
    recorder = Recorder(stream, growing, float(log.column("step", "time_s")[-1]))
    tables = {name: log.table(name) for name in TABLES}
    pulse_step = tables["pulse"]["step"]
    owner = {name: table["step"] for name, table in tables.items() if "step" in table}
    owner |= {"step": np.arange(log.n_rows("step")), "bearing": pulse_step[tables["bearing"]["pulse"]]}
    owner["association"] = np.full(log.n_rows("association"), log.n_rows("step") - 1)  # written at the end
    for start in range(0, log.n_rows("step"), 7):
        for name, table in tables.items():
            for row in np.flatnonzero((owner[name] >= start) & (owner[name] < start + 7)):
                growing.append(name, **{column: entries[row] for column, entries in table.items()})
        recorder.update()
    stream.flush()
    stream.disconnect()
    write_recording(log, tmp_path / "whole.rrd")
    whole, slices = values(tmp_path / "whole.rrd"), values(tmp_path / "slices.rrd")
    drawn = [path for path in whole if not path.startswith("/__properties") and path != f"/{paths.PHASE}"]
    assert len(drawn) > 40
    for path in drawn:
        assert sorted(map(repr, whole[path])) == sorted(map(repr, slices[path])), path
    assert cells(whole[f"/{paths.PHASE}"], "state") == cells(slices[f"/{paths.PHASE}"], "state")


def test_no_value_in_the_file_is_nan(recording: Path) -> None:
    for path, entity in values(recording).items():
        assert not [row for row in entity if re.search(r"\bnan\b", repr(row))], path


def test_field_data_without_robot_truth_or_pulses_is_recorded_too(tmp_path: Path) -> None:
    field = MissionLog({"n_elements": 4, "array": {"boresights_rad": [1.57, 0.52, -0.52, -1.57]}})
    for k in range(20):
        field.append(
            "step",
            time_s=0.1 * k,
            pose=np.zeros(3),
            true_pose=np.full(3, np.nan),
            **AT_REST,
            phase="field",
            phase_target=0,
        )
    write_recording(field, tmp_path / "field.rrd")
    write_recording(MissionLog(field.meta), tmp_path / "empty.rrd")
    counted = rows(tmp_path / "field.rrd")
    assert counted[f"/{paths.ROBOT}"] >= 20
    assert f"/{paths.TRUE_SOURCES}" not in counted


def test_a_capsule_is_drawn_about_its_middle(tmp_path: Path, log: MissionLog) -> None:
    # Rerun's capsule starts at its translation and runs along its own z; MuJoCo's is centred
    lying = {
        "name": "bar",
        "group": "robot",
        "shape": "capsule",
        "size_m": [0.01, 0.3, 0.0],
        "position_m": [1.0, 2.0, 3.0],
        "quaternion_wxyz": [np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0],
        "rgba": [1.0, 1.0, 1.0, 1.0],
    }
    write_recording(MissionLog({**log.meta, "solids": {"yard": [], "robot": [lying]}}), tmp_path / "bar.rrd")
    (row,) = values(tmp_path / "bar.rrd")[f"/{paths.BODY}/capsule"]
    start = next(cell for name, cell in row.items() if name.endswith(":translations"))[0]
    np.testing.assert_allclose(start, [0.7, 2.0, 3.0], atol=1e-6)  # turned by 90 degrees about y: z became x


def test_what_the_map_shows_and_does_not_stand_there_is_an_outline(tmp_path: Path, log: MissionLog) -> None:
    wrong = describe_equipment(load_scenario("one_source").yard.equipment[:1])
    solids = {**log.meta["solids"], "map": wrong}
    write_recording(MissionLog({**log.meta, "solids": solids}), tmp_path / "map.rrd")
    (row,) = values(tmp_path / "map.rrd")[f"/{paths.MAP}/box"]
    drawn = {name.rpartition(":")[2]: cell for name, cell in row.items()}
    np.testing.assert_allclose(drawn["centers"], np.array([wrong[0]["position_m"]]), atol=1e-6)
    assert drawn["fill_mode"] == [rr.components.FillMode.MajorWireframe.value]


def test_an_interferer_that_moves_is_drawn_with_its_line(tmp_path: Path, log: MissionLog) -> None:
    bus = {"name": "bus", "position_m": [-9.0, 0.0, 3.0], "moves_to_m": [-9.0, 30.0, 3.0], "speed_mps": 8.0}
    truth = {**log.meta["truth"], "interferers": [bus]}
    write_recording(MissionLog({**log.meta, "truth": truth}), tmp_path / "bus.rrd")
    (row,) = values(tmp_path / "bus.rrd")[f"/{paths.TRUE_WAYS}"]
    strips = next(cell for name, cell in row.items() if name.endswith(":strips"))
    np.testing.assert_allclose(strips, [[bus["position_m"], bus["moves_to_m"]]], atol=1e-6)


def test_a_finding_that_is_dropped_disappears(tmp_path: Path, log: MissionLog) -> None:
    dropped = MissionLog(log.meta)
    step, finding = log.table("step"), log.table("finding")
    for k in range(20):
        dropped.append("step", **{name: column[k] for name, column in step.items()})
    for at, state in ((3, "candidate"), (9, "dropped")):
        row = {name: column[-1] for name, column in finding.items()}
        dropped.append("finding", **row | {"step": at, "state": state, "id": 1})
    write_recording(dropped, tmp_path / "dropped.rrd")
    found = values(tmp_path / "dropped.rrd")
    path = paths.finding_path(1)
    for part, component in (
        (path, "positions"),
        (f"{path}/label", "positions"),
        (f"{path}/ellipse", "strips"),
        (f"{path}/height", "strips"),
    ):
        drawn = cells(found[f"/{part}"], component)
        assert {at: len(shapes) for at, shapes in drawn.items()} == {3: 1, 9: 0}


def test_the_parts_that_a_killed_mission_left_make_a_recording(tmp_path: Path, log: MissionLog) -> None:
    killed = MissionLog(log.meta)
    for table in ("step", "pulse", "bearing", "finding"):
        for row in range(log.n_rows(table)):
            killed.append(table, **{name: column[row] for name, column in log.table(table).items()})
    killed.write_part(tmp_path)
    write_recording(MissionLog.load(tmp_path), tmp_path / "killed.rrd")
    counted = rows(tmp_path / "killed.rrd")
    assert counted[f"/{paths.ROBOT}"] >= log.n_rows("step")
    assert not [path for path in counted if path.startswith(f"/{paths.PHASE_PATTERN}/")]


def test_a_finding_has_one_number_in_log_events_recording_and_report(recording: Path, log: MissionLog) -> None:
    report = make_report(log, 0.0)
    ids = {finding.id for finding in (*report.findings, *report.candidates)}
    last = log.column("finding", "step") == log.column("finding", "step")[-1]
    assert ids == set(log.column("finding", "id")[last].tolist())
    told = " ".join(log.column("event", "text"))
    for number in ids:
        assert re.search(rf"(finding|candidate) {number} ", told)
        labels = cells(values(recording)[f"/{paths.finding_path(number)}/label"], "labels")
        assert {label.split()[1].rstrip(":") for (label,) in labels.values()} == {str(number)}
