"""Positions from bearings alone: which errors average out, which do not, and the coverage of the ellipse."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from dirmusic import ElementSpread, PoseError, PulseBatch
from dirmusic.angles import wrap
from dirmusic.array.bounds import bearing_bound, manifold_error, manifold_error_covariance, manifold_error_std
from dirmusic.locating.bearing_fit import locate_by_bearings
from dirmusic.locating.finding import ellipse95, is_inside95
from dirmusic.locating.joint_fit import JointEstimate, locate_jointly
from tests.dirmusic.scenes import ARRAY, NO_POSE_ERROR, POSE_ERROR, RING, SPREAD, detected, drawn_errors

SOURCE_M = np.array([20.0, 15.0])
STEP_S = 0.25
Solver = Callable[..., JointEstimate]
SECTOR_STD_RAD = np.radians(60.0) / np.sqrt(12.0)


def orbit(rng: np.random.Generator, n: int = 120) -> np.ndarray:
    """Draw poses (n, 3) along 120 to 340 degrees around the source, with partly random heading."""
    angle = rng.uniform(0, 2 * np.pi) + np.linspace(0, np.radians(rng.uniform(120, 340)), n)
    yaw = angle + np.pi / 2 + rng.uniform(-0.5, 0.5) + np.cumsum(rng.normal(0, rng.uniform(0, 0.2), n))
    return np.column_stack([SOURCE_M + rng.uniform(2, 5) * np.column_stack([np.cos(angle), np.sin(angle)]), yaw])


def azimuths(pose: np.ndarray) -> np.ndarray:
    sight = SOURCE_M - pose[:, :2]
    return np.arctan2(sight[:, 1], sight[:, 0]) - pose[:, 2]


def wandering(rng: np.random.Generator, n: int) -> np.ndarray:
    """Draw pose errors (n, 3) that are correlated for seconds."""
    keep = np.exp(-STEP_S / POSE_ERROR.correlation_s)
    normal = rng.normal(0.0, [POSE_ERROR.position_m, POSE_ERROR.position_m, POSE_ERROR.heading_rad], (n, 3))
    normal[1:] *= np.sqrt(1 - keep**2)
    return lfilter([1.0], [1.0, -keep], normal, axis=0)


def pulses_at(pose: np.ndarray, noise_rad: float) -> PulseBatch:
    """Make pulses of exact strengths with the noise variance of a bearing error."""
    azimuth_rad = wrap(azimuths(pose))
    noise_v = noise_rad / bearing_bound(RING, azimuth_rad, 1.0)[:, np.newaxis]
    pulses = detected(RING.gain(azimuth_rad).T, noise_v, STEP_S * np.arange(len(pose)))
    return pulses._replace(azimuth_rad=azimuth_rad, std_rad=np.full(len(pose), noise_rad))


def locate(
    pulses: PulseBatch,
    pose: np.ndarray,
    spread: ElementSpread = SPREAD,
    pose_error: PoseError = POSE_ERROR,
    solve: Solver = locate_by_bearings,
):
    fix = solve(
        pulses,
        pose,
        np.zeros(len(pose), dtype=np.intp),
        np.append(SOURCE_M + 0.5, 1.5)[np.newaxis],
        replace(ARRAY, spread=spread),
        pose_error,
    )
    return fix.positions_m[0, :2], fix.covariances_m2[0, :2, :2]


@pytest.mark.parametrize("coarse", [False, True])
def test_ellipse_coverage_with_array_and_pose_errors(coarse: bool) -> None:
    rng, n_orbits = np.random.default_rng(0), 300
    inside, square_m2, semi_major_m = 0, 0.0, 0.0
    for _ in range(n_orbits):
        pose = orbit(rng)
        pulses = pulses_at(pose, np.radians(0.01 if coarse else 1.0))
        if coarse:  # the boresight next to the direction
            strongest = RING.gain(azimuths(pose)).argmax(axis=0)
            bearing = {"azimuth_rad": RING.boresights_rad[strongest], "std_rad": np.full(len(pose), SECTOR_STD_RAD)}
        else:  # 1 degree of noise, and 2.5 degrees that all pulses share because of array errors
            common = manifold_error(RING, azimuths(pose), drawn_errors(rng))
            bearing = {"azimuth_rad": wrap(azimuths(pose) + common + rng.normal(0, np.radians(1.0), len(pose)))}
        believed = pose + wandering(rng, len(pose))
        position, covariance = locate(pulses._replace(**bearing), believed)
        inside += is_inside95(position - SOURCE_M, covariance)
        square_m2 += float(np.square(position - SOURCE_M).sum()) / n_orbits
        semi_major_m += ellipse95(covariance).semi_major_m / n_orbits
    assert 0.91 < inside / n_orbits < 0.985  # three standard deviations are 0.038
    assert semi_major_m < 3.0 * np.sqrt(square_m2)


@pytest.mark.parametrize(
    ("solve", "spread", "pose_error", "method_rad", "factor"),
    [
        (locate_by_bearings, ElementSpread(), NO_POSE_ERROR, 0.0, 0.1),  # noise averages out
        (locate_by_bearings, SPREAD, NO_POSE_ERROR, 0.0, 1.0),  # errors of the array do not
        (locate_by_bearings, ElementSpread(), POSE_ERROR, 0.0, 1.0),  # nor those of the pose within a second
        (locate_by_bearings, ElementSpread(), NO_POSE_ERROR, np.radians(5.0), 1.0),  # nor those of the method
        (locate_jointly, ElementSpread(), NO_POSE_ERROR, 0.0, 0.1),
        (locate_jointly, replace(SPREAD, unexplained=0.02), NO_POSE_ERROR, 0.0, 1.0),
    ],
)
def test_more_pulses_reduce_only_the_noise(
    solve: Solver, spread: ElementSpread, pose_error: PoseError, method_rad: float, factor: float
) -> None:
    pose = orbit(np.random.default_rng(2), 12)
    pulses = pulses_at(pose, np.radians(0.03))
    pulses = pulses._replace(time_s=100 * pulses.time_s, std_rad=np.hypot(pulses.std_rad, method_rad))
    rows = np.repeat(np.arange(12), 10)
    (_, one), (_, ten) = (
        locate(pulses.take(some), pose[some], spread, pose_error, solve)
        for some in (np.arange(12, dtype=np.intp), rows)
    )
    ratio = np.sqrt(np.linalg.det(ten) / np.linalg.det(one))
    assert ratio == pytest.approx(factor, rel=0.02 if factor < 1 else 0.1)


def test_single_line_of_bearings_is_unknown_along() -> None:
    pose = np.column_stack([np.linspace(0.0, 15.0, 60), np.full(60, 15.0), np.zeros(60)])
    _, covariance = locate(pulses_at(pose, np.radians(1.0)), pose)
    assert np.sqrt(covariance[0, 0]) > 5.0
    assert np.sqrt(covariance[1, 1]) < 1.0


def test_outliers_move_the_position_little() -> None:
    rng = np.random.default_rng(4)
    pose = orbit(rng)
    pulses = pulses_at(pose, np.radians(1.0))
    azimuth_rad = pulses.azimuth_rad + rng.normal(0, np.radians(1.0), len(pose))
    azimuth_rad[::7] += rng.uniform(0.5, 2.0, azimuth_rad[::7].size)
    position, _ = locate(pulses._replace(azimuth_rad=wrap(azimuth_rad)), pose)
    assert np.linalg.norm(position - SOURCE_M) < 0.3


def test_several_sources_are_located_like_single_ones() -> None:
    pose, source = orbit(np.random.default_rng(5)), np.arange(120, dtype=np.intp) % 2
    pulses, start_m = pulses_at(pose, np.radians(1.0)), np.add(SOURCE_M, [[0.2, 0.2], [-0.3, 0.1]])
    both = locate_by_bearings(pulses, pose, source, start_m, ARRAY, POSE_ERROR)
    for k in range(2):
        own = source == k
        alone = locate_by_bearings(
            pulses.take(own), pose[own], np.zeros(60, dtype=np.intp), start_m[k : k + 1], ARRAY, POSE_ERROR
        )
        np.testing.assert_array_equal(both.positions_m[k], alone.positions_m[0])
        np.testing.assert_array_equal(both.covariances_m2[k], alone.covariances_m2[0])
    assert not np.any(both.errors.state)


def test_manifold_error_covariance_equals_drawn_arrays() -> None:
    rng, azimuth_rad = np.random.default_rng(6), np.linspace(0.0, 2.0, 5)
    covariance = manifold_error_covariance(RING, azimuth_rad, SPREAD)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), manifold_error_std(RING, azimuth_rad, SPREAD))
    drawn = [manifold_error(RING, azimuth_rad, drawn_errors(rng)) for _ in range(8000)]
    np.testing.assert_allclose(np.cov(np.array(drawn).T), covariance, atol=0.05 * covariance.max())
