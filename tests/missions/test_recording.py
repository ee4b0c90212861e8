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

from envs import load_scenario
from missions.record.mission_log import TABLES, MissionLog
from missions.record.report import make_report
from missions.recording import Recorder, write_recording
from missions.recording import blueprint as paths
from missions.runner import run_mission
from robot_models.drawn_solids import describe_equipment

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


def rows(path: Path) -> dict[str, int]:
    """Rows of every entity on a timeline or, for static data, in all."""
    counts: dict[str, int] = {}
    for chunk in RrdReader(path).stream().to_chunks():
        counts[str(chunk.entity_path)] = counts.get(str(chunk.entity_path), 0) + chunk.num_rows
    return counts


def values(path: Path) -> dict[str, list[dict]]:
    """Every row of every entity as plain values; what identifies rows and chunks left out."""
    found: dict[str, list[dict]] = {}
    for chunk in RrdReader(path).stream().to_chunks():
        entity = found.setdefault(str(chunk.entity_path), [])
        for row in chunk.to_record_batch().to_pylist():
            entity.append({name: cell for name, cell in row.items() if "rowid" not in name.lower()})
    return found


def cells(rows_of_entity: list[dict], component: str) -> dict[int, list]:
    """One component by step."""
    key = next(name for row in rows_of_entity for name in row if name.endswith(f":{component}"))
    return {row[paths.STEP]: row[key] for row in rows_of_entity if row.get(paths.STEP) is not None and key in row}


def test_reruns_own_checker_accepts_the_file(recording: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "verify", str(recording)], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr


def test_the_file_holds_trajectory_spectrum_bearings_fix_and_blueprint(recording: Path, log: MissionLog) -> None:
    counted = rows(recording)
    n_steps = log.n_rows("step")
    assert counted[f"/{paths.ROBOT}"] >= n_steps
    assert counted[f"/{paths.TRAJECTORY}"] >= n_steps // 5
    assert counted[f"/{paths.ODOMETRY}"] >= n_steps // 5
    assert counted[f"/{paths.BATTERY}"] == n_steps
    heard = np.unique(log.column("pulse", "step")[log.column("bearing", "pulse")]).size
    for path in (paths.SPECTRUM, paths.BEARINGS, f"{paths.STRENGTHS}/1"):
        assert counted[f"/{path}"] >= heard > 50
    number = int(log.column("finding", "id")[-1])
    fixes = int((log.column("finding", "id") == number).sum())
    assert counted[f"/{paths.finding_path(number)}"] >= fixes > 5
    assert counted[f"/{paths.finding_path(number)}/ellipse"] >= fixes
    assert counted[f"/{paths.PHASES}/{number}"] == 1  # pulse phase against level, drawn once at the end
    for path in (
        f"{paths.EQUIPMENT}/box",
        f"{paths.BODY}/cylinder",
        paths.SITES,
        paths.ROUTE,
        paths.EVENTS,
        paths.PHASE,
    ):
        assert counted[f"/{path}"] >= 1
    assert RrdReader(recording).blueprints()
    assert not list(recording.parent.glob(".*"))


def test_a_recording_made_slice_by_slice_as_the_log_grows_holds_the_same(log: MissionLog, tmp_path: Path) -> None:
    growing = MissionLog(log.meta)
    stream = rr.RecordingStream("pdpatrol")
    stream.save(tmp_path / "slices.rrd")
    recorder = Recorder(stream, growing)
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
    moving = [path for path in whole if path.startswith(f"/{paths.WORLD}/") or path.startswith("/plots/")]
    assert len(moving) > 15
    for path in moving:
        assert sorted(map(repr, whole[path])) == sorted(map(repr, slices[path])), path


def test_rays_start_at_the_robot_and_point_as_the_bearings_do(recording: Path, log: MissionLog) -> None:
    rays = cells(values(recording)[f"/{paths.BEARINGS}"], "strips")
    pulse_step = log.column("pulse", "step")[log.column("bearing", "pulse")]
    for step in np.unique(pulse_step):
        told = np.sort(log.column("bearing", "bearing_rad")[pulse_step == step])
        drawn = np.array(rays[int(step)])
        np.testing.assert_allclose(
            drawn[:, 0, :2], np.tile(log.column("step", "pose")[step, :2], (told.size, 1)), atol=1e-5
        )
        ahead = drawn[:, 1] - drawn[:, 0]
        np.testing.assert_allclose(np.sort(np.arctan2(ahead[:, 1], ahead[:, 0])), told, atol=1e-5)


def test_the_ring_of_the_spectrum_bulges_towards_the_bearing(recording: Path, log: MissionLog) -> None:
    rings = cells(values(recording)[f"/{paths.SPECTRUM}"], "strips")
    pulse_step = log.column("pulse", "step")[log.column("bearing", "pulse")]
    for step in np.unique(pulse_step):
        (ring,) = np.array(rings[int(step)])
        radius, towards = np.linalg.norm(ring[:, :2], axis=-1), np.arctan2(ring[:, 1], ring[:, 0])
        azimuths = log.column("bearing", "azimuth_rad")[pulse_step == step]
        off = np.abs(np.angle(np.exp(1j * (azimuths[:, np.newaxis] - towards))))
        # a source high above the array has a flat top, on which rays of five degrees may miss the very peak
        assert (
            off[:, radius.argmax()].min() < np.radians(3.5) or radius[off.argmin(axis=-1)].max() > 0.97 * radius.max()
        )


def test_a_second_of_silence_clears_rays_and_spectrum(tmp_path: Path, log: MissionLog) -> None:
    quiet = MissionLog(log.meta)
    step, pulse, bearing = (log.table(name) for name in ("step", "pulse", "bearing"))
    for k in range(40):
        quiet.append("step", **{name: column[k] for name, column in step.items()})
    quiet.append("pulse", **{name: column[0] for name, column in pulse.items()} | {"step": 5})
    quiet.append("bearing", **{name: column[0] for name, column in bearing.items()} | {"pulse": 0})
    write_recording(quiet, tmp_path / "quiet.rrd")
    for path in (paths.BEARINGS, paths.SPECTRUM):
        drawn = cells(values(tmp_path / "quiet.rrd")[f"/{path}"], "strips")
        assert {at: len(strips) for at, strips in drawn.items()} == {5: 1, 15: 0}


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
    for path, component in ((paths.finding_path(1), "positions"), (f"{paths.finding_path(1)}/ellipse", "strips")):
        drawn = cells(found[f"/{path}"], component)
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
    assert not [path for path in counted if path.startswith(f"/{paths.PHASES}/")]


def test_a_finding_has_one_number_in_log_events_recording_and_report(recording: Path, log: MissionLog) -> None:
    report = make_report(log, 0.0)
    ids = {finding["id"] for finding in (*report["findings"], *report["candidates"])}
    last = log.column("finding", "step") == log.column("finding", "step")[-1]
    assert ids == set(log.column("finding", "id")[last].tolist())
    told = " ".join(log.column("event", "text"))
    for number in ids:
        assert re.search(rf"(finding|candidate) {number} ", told)
        labels = cells(values(recording)[f"/{paths.finding_path(number)}"], "labels")
        assert {label.split()[-1] for (label,) in labels.values()} == {str(number)}
