"""Frame of the localisation: found from scans, with an honest covariance, and applied only when it is significant."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.stats import chi2

from dirmusic import PoseError
from dirmusic.angles import wrap
from dirmusic.arrays import FloatArray
from dirmusic.frame import FrameEstimate, turned
from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.runner import run_mission
from tests.missions.driving.scans import ScannedRoute, with_wrong_map

POSE_ERROR = PoseError(position_m=0.05, heading_rad=0.01, correlation_s=5.0)
YARDS = ("one_source", "two_sources", "suite/several_01", "suite/wrong_map_01")


@cache
def route(name: str) -> ScannedRoute:
    return ScannedRoute.drive(load_scenario(name), 150.0)


def shifted(name: str, offset_m: tuple[float, float], rotation_deg: float) -> Scenario:
    """Return a scenario whose localisation is displaced and rotated."""
    wrong = {"pose_sensor": {"frame_offset_m": offset_m, "frame_rotation_deg": rotation_deg}}
    return Scenario.model_validate(load_scenario(name).model_dump() | {"nature": wrong})


def drawn_frame(rng: np.random.Generator) -> FloatArray:
    return rng.standard_normal(3) * [0.3, 0.3, np.radians(1.0)]


def test_frame_inverts_displacement_and_rotation() -> None:
    frame = FrameEstimate(np.array([3.0, 2.0]), np.array([0.5, -0.4, 0.1]), np.eye(3), POSE_ERROR)
    on_map = np.array([20.0, 10.0, 3.1])
    place_m = frame.pivot_m + turned(on_map[:2] - frame.pivot_m, 0.1) + frame.offset[:2]
    np.testing.assert_allclose(frame.on_map(np.append(place_m, wrap(3.1 + 0.1))), on_map, atol=1e-12)


def test_covariance_at_a_place_is_that_of_its_errors() -> None:
    """A rotation displaces across the line from the dock, in proportion to the distance."""
    std = np.array([0.02, 0.03, 0.002])
    frame, rng = FrameEstimate(np.array([3.0, 2.0]), np.zeros(3), np.diag(std**2), POSE_ERROR), np.random.default_rng(0)
    places_m = np.array([[3.0, 2.0], [33.0, 22.0]])
    errors = std * rng.standard_normal((100_000, 1, 3))
    moved_m = frame.pivot_m + turned(places_m - frame.pivot_m, errors[..., 2]) + errors[..., :2] - places_m
    expected = np.einsum("npi,npj->pij", moved_m, moved_m) / len(moved_m)
    np.testing.assert_allclose(frame.covariance_at(places_m), expected, rtol=0.03, atol=2e-5)


@pytest.mark.parametrize("name", YARDS)
@pytest.mark.parametrize("seed", range(3))
def test_registration_starts_from_far_off(name: str, seed: int) -> None:
    """A frame 1.5 m and 3 degrees off, five and three standard deviations, is found with the first scan."""
    rng = np.random.default_rng(seed)
    angle_rad = rng.uniform(-np.pi, np.pi)
    frame = np.array([1.5 * np.cos(angle_rad), 1.5 * np.sin(angle_rad), np.radians(3.0)])
    estimates = [registration.frame for registration in route(name).register(frame, rng)]
    first, last = estimates[0].offset - frame, estimates[-1].offset - frame
    assert np.hypot(*first[:2]) < 0.4
    assert np.hypot(*last[:2]) < 0.1
    assert abs(last[2]) < np.radians(0.3)


def test_sound_frames_change_nothing() -> None:
    """Without a significant frame, pose and observation are passed on as they are, and nothing is reported."""
    observation = {"pose": np.ones(4, np.float32), "bearing": np.ones(2, np.float32)}
    for seed, name in enumerate(YARDS):
        believed = load_scenario(name).pose_sensor.pose_error
        for registration in route(name).register(np.zeros(3), np.random.default_rng(seed)):
            pose = np.array([1.0, 2.0, 3.0])
            on_map = registration.corrected(observation, pose)
            assert on_map[0] is observation
            assert on_map[1] is pose
            assert not registration.disagreement
            assert registration.frame.pose_error == believed


def test_uncorrected_frame_counts_as_an_error() -> None:
    """A frame too small to be significant is not corrected; then its square is part of the covariance."""
    frame, squares = np.array([0.06, 0.0, 0.0]), list[float]()
    for seed in range(6):
        *_, last = route("one_source").register(frame, np.random.default_rng(seed))
        if not last.frame.is_applied:
            squares.append(float(frame @ np.linalg.inv(last.frame.covariance) @ frame))
    assert len(squares) >= 3
    assert np.mean(squares) < 3.0


@pytest.mark.parametrize("std_m", [0.0, 0.15])
def test_covariance_is_honest(std_m: float) -> None:
    """Normalised squared errors follow chi square with 3 degrees of freedom, or smaller, also with wrong maps."""
    squares = normalised_squares(std_m, 1, 5)
    assert (squares < chi2.ppf(0.95, 3)).mean() >= 0.75
    assert squares.max() < 40.0


def test_covariance_is_honest_for_poses_worse_than_believed() -> None:
    """With twice the believed deviations, those of the frame grow, and the Locator is given larger pose errors."""
    squares, ratios = list[float](), list[tuple[float, float]]()
    for seed, name in enumerate(YARDS * 3):
        believed, rng = load_scenario(name), np.random.default_rng(seed)
        frame = drawn_frame(rng)
        doubled = {"position_std_m": 0.1, "heading_std_deg": 1.0}
        true = Scenario.model_validate(believed.model_dump() | {"pose_sensor": doubled})
        *_, last = route(name)._replace(scenario=true).register(frame, rng, believed)
        error = last.frame.offset - frame
        squares.append(float(error @ np.linalg.inv(last.frame.covariance) @ error))
        given, stated = last.frame.pose_error, believed.pose_sensor.pose_error
        ratios.append((given.position_m / stated.position_m, given.heading_rad / stated.heading_rad))
    assert np.mean(squares) < 1.5 * 3
    assert np.median(ratios, axis=0) == pytest.approx([2.0, 2.0], rel=0.3)


@pytest.mark.slow
@pytest.mark.parametrize(("std_m", "n_moved"), [(0.0, 0), (0.05, 1), (0.15, 0)])
def test_covariance_is_honest_in_200_missions(std_m: float, n_moved: int) -> None:
    squares = normalised_squares(std_m, n_moved, 50)
    assert (squares < chi2.ppf(0.95, 3)).mean() >= 0.90
    assert squares.mean() < 1.3 * 3


def normalised_squares(std_m: float, n_moved: int, n_seeds: int) -> FloatArray:
    """Return the squared Mahalanobis distances of final errors, for frames of the prior that were applied."""
    squares = []
    for number, name in enumerate(YARDS):
        for seed in range(n_seeds):
            rng = np.random.default_rng([number, seed])
            frame, scenario = drawn_frame(rng), load_scenario(name)
            *_, last = route(name).register(frame, rng, with_wrong_map(scenario, std_m, n_moved, n_moved, rng))
            error = last.frame.offset - frame
            squares.append(error @ np.linalg.inv(last.frame.covariance) @ error)
    return np.array(squares)


@pytest.mark.whole
def test_mission_with_a_shifted_and_rotated_frame() -> None:
    """Poses are corrected once, findings keep their accuracy, and log and report name the disagreement."""
    scenario = shifted("one_source", (0.8, -0.6), 2.0)
    log = run_mission(scenario, "seek", seed=1)
    report, step = make_report(log, 0.0), log.table("step")
    assert report.evaluation is not None
    assert report.evaluation.sources[0].match is not None
    assert report.evaluation.sources[0].match.error_m < 0.3
    assert not report.waypoints.missed
    assert any("localisation and map disagree by" in note for note in report.notes)
    off_m = np.hypot(*(step["pose"] - step["true_pose"])[:, :2].T)
    assert np.sqrt(np.square(off_m).mean()) < 0.15
    localised_m = log.column("scan", "localised_pose")[:, :2]
    assert np.hypot(*(localised_m - step["true_pose"][:, :2]).T).mean() > 0.5
    error = log.column("frame", "offset")[-1] - [0.8, -0.6, np.radians(2.0)]
    assert error @ np.linalg.inv(log.column("frame", "covariance")[-1]) @ error < 16.3
