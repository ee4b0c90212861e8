"""What is drawn of pulses: rays, rings, spectra over time, phase patterns; read back from a recording."""

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from dirmusic.angles import wrap
from pdpatrol.envs import load_scenario
from pdpatrol.missions.record.array_description import described_manifold
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.phase_patterns import phase_patterns
from pdpatrol.missions.recording import paths, write_recording
from pdpatrol.missions.recording.drawing.phase_pattern import SPAN_DB, UNITS_PER_DB
from pdpatrol.missions.recording.drawing.spectra import HEIGHT, WIDTH
from pdpatrol.missions.runner import run_mission
from tests.missions.replay.read_back import Row, cells, still, values


@pytest.fixture(scope="module")
def log() -> MissionLog:
    scenario = load_scenario("one_source")
    task = scenario.task.model_copy(update={"time_limit_s": 43.0})
    return run_mission(scenario.model_copy(update={"task": task}), seed=1)


@pytest.fixture(scope="module")
def drawn(log: MissionLog, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Row]]:
    path = tmp_path_factory.mktemp("recording") / "mission.rrd"
    write_recording(log, path)
    return values(path)


def direction(rays: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of rays (n, 2, 3), shape (n,), radians."""
    ahead = rays[:, 1] - rays[:, 0]
    return np.arctan2(ahead[:, 1], ahead[:, 0])


def test_rays_start_at_the_robot_and_point_as_the_bearings_do(drawn: dict[str, list[Row]], log: MissionLog) -> None:
    rays = cells(drawn[f"/{paths.NEW_BEARINGS}"], "strips")
    pulse_step = log.column("pulse", "step")[log.column("bearing", "pulse")]
    assert set(rays) == set(pulse_step.tolist())
    for step in np.unique(pulse_step):
        told = np.sort(log.column("bearing", "bearing_rad")[pulse_step == step])
        ray = np.array(rays[int(step)])
        start = np.tile(log.column("step", "pose")[step, :2], (told.size, 1))
        np.testing.assert_allclose(ray[:, 0, :2], start, atol=1e-5)
        np.testing.assert_allclose(np.sort(direction(ray)), told, atol=1e-5)


def test_the_ring_of_each_bin_is_about_the_pose_of_its_pulse_and_its_peak_lies_on_the_ray(
    drawn: dict[str, list[Row]], log: MissionLog
) -> None:
    rings = cells(drawn[f"/{paths.SPECTRUM}"], "strips")
    rays = cells(drawn[f"/{paths.PAST_BEARINGS}"], "strips")
    steps = np.array(sorted(rays))
    assert len(rings) > 50
    for end, strips in rings.items():
        (ring,) = np.array(strips)
        (step,) = steps[(steps > end - 5) & (steps <= end)]
        centre = log.column("step", "pose")[step, :2]
        out = ring[:, :2] - centre
        radius = np.linalg.norm(out, axis=-1)
        assert 0.8 - 1e-5 <= radius.min() <= radius.max() <= 3.0 + 1e-5
        peak = np.arctan2(*out[radius.argmax()][::-1])
        ray = direction(np.array(rays[int(step)]))
        assert np.degrees(np.abs(wrap(peak - ray))).max() < 1.0


def test_rejected_pulses_are_drawn_in_grey_to_where_their_spectrum_peaks(
    drawn: dict[str, list[Row]], log: MissionLog
) -> None:
    rays = cells(drawn[f"/{paths.REJECTED}"], "strips")
    rejected = log.column("pulse", "step")[~log.column("pulse", "is_credible")]
    assert {step: len(strips) for step, strips in rays.items()} == {
        int(step): int(n) for step, n in zip(*np.unique(rejected, return_counts=True), strict=True)
    }
    azimuth = np.radians(np.arange(-180.0, 180.0, 0.5))
    gain = described_manifold(log.meta["array"]).gain(azimuth)
    is_rejected = ~log.column("pulse", "is_credible")
    step, strengths = log.column("pulse", "step")[is_rejected], log.column("pulse", "strengths_v")[is_rejected]
    best = azimuth[(strengths @ (gain / np.linalg.norm(gain, axis=0))).argmax(axis=-1)]
    towards = wrap(best + log.column("step", "pose")[step, 2])
    for at in np.unique(step).tolist():
        told = direction(np.array(rays[at]))
        off = wrap(told[:, np.newaxis] - towards[step == at])
        assert np.degrees(np.abs(off)).min(axis=0).max() < 2.0


def test_a_turn_to_the_left_goes_up_in_the_spectra_over_time_and_turns_the_robot_about_z(
    log: MissionLog, tmp_path: Path
) -> None:
    turning = MissionLog(log.meta)
    step = log.table("step")
    for k in range(40):
        row = {name: column[k] for name, column in step.items()}
        turning.append("step", **row | {"pose": np.array([5.0, 5.0, -0.5 + 0.03 * k])})
    write_recording(turning, tmp_path / "turning.rrd")
    found = values(tmp_path / "turning.rrd")
    heading = np.array([strips[0][-1] for strips in cells(found[f"/{paths.SPECTRA_HEADING}"], "strips").values()])
    assert (np.diff(heading[:, 0]) > 0.0).all()
    assert (np.diff(heading[:, 1]) < 0.0).all()  # y goes down
    assert heading[-1] == pytest.approx([WIDTH, HEIGHT * (0.5 - (-0.5 + 0.03 * 39) / (2 * np.pi))], abs=1e-3)
    turn = np.array([quaternion[0] for quaternion in cells(found[f"/{paths.ROBOT}"], "quaternion").values()])
    assert (np.diff(turn[:, 2]) > 0.0).all()


def test_the_spectra_over_time_are_brightest_at_the_bearings(drawn: dict[str, list[Row]], log: MissionLog) -> None:
    bearing, pulse_step = log.column("bearing", "bearing_rad"), log.column("pulse", "step")
    tile = drawn[f"/{paths.SPECTRA}/1"]
    (buffer,) = next(row[key] for row in tile for key in row if key.endswith(":buffer"))
    tiles = [int(path.rpartition("/")[2]) for path in drawn if re.fullmatch(f"/{paths.SPECTRA}/[0-9]+", path)]
    assert sorted(tiles) == list(range(-(-log.n_rows("step") // 50)))  # the last one may be a shorter one
    picture = np.frombuffer(bytes(buffer), dtype=np.uint8).reshape(90, -1, 3).sum(axis=-1)
    assert picture.shape[1] == 10
    for column in range(10):
        first = 50 + 5 * column
        step = pulse_step[log.column("bearing", "pulse")]
        own = bearing[(step >= first) & (step < first + 5)]
        brightest = np.pi - 2 * np.pi * (picture[:, column].argmax() + 0.5) / 90
        assert np.degrees(np.abs(wrap(own - brightest))).min() < 5.0


def test_the_phase_pattern_grows_with_the_pulses_on_an_axis_in_decibels(
    drawn: dict[str, list[Row]], log: MissionLog
) -> None:
    patterns = phase_patterns(log)
    assert patterns
    labels = still(drawn[f"/{paths.PHASE_PATTERN}/axes/marks"], "labels")
    heights = still(drawn[f"/{paths.PHASE_PATTERN}/axes/marks"], "positions")
    (zero,) = [
        int(label.removesuffix(" dBV")) for label, (x, y) in zip(labels, heights, strict=True) if x < 0.0 and y == 0.0
    ]
    for number, resolved in patterns.items():
        points = cells(drawn[f"/{paths.PHASE_PATTERN}/{number}"], "positions")
        steps = log.column("pulse", "step")[resolved.pulse]
        assert set(points) == set(steps.tolist())
        step = int(steps[0])
        level_db = zero - np.array(points[step])[:, 1] / UNITS_PER_DB
        np.testing.assert_allclose(np.sort(level_db), np.sort(resolved.level_db[steps == step]), atol=1e-4)


def test_the_names_of_phase_patterns_cover_no_pulse_and_not_each_other(
    drawn: dict[str, list[Row]], log: MissionLog
) -> None:
    names = [cells(drawn[f"/{paths.PHASE_PATTERN}/{number}/kind"], "positions") for number in phase_patterns(log)]
    places = np.array([at[max(at)][0] for at in names])
    assert (places[:, 1] < -UNITS_PER_DB * SPAN_DB).all()
    assert len(np.unique(places, axis=0)) == len(names)
