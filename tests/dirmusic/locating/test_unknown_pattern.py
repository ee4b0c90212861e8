"""Positions when only the horizontal cut of the pattern is known: computed helices, which differ off the plane."""

from functools import cache

import numpy as np
import pytest

from dirmusic import ArrayModel, ElementSpread, GainManifold, PoseError, PulseBatch
from dirmusic.angles import difference
from dirmusic.array.pattern_file import read_spatial_pattern
from dirmusic.array.spatial_pattern import SpatialPattern
from dirmusic.arrays import FloatArray, IntArray
from dirmusic.locating.finding import ellipse95, is_inside95
from dirmusic.locating.joint_fit import JointEstimate, locate_jointly
from dirmusic.locating.plane_wave import BearingErrors
from pdpatrol.sensing.array.helical_array import SHIPPED_PATTERNS
from tests.dirmusic.scenes import RING, RING_M, detected, sights, with_bearings

BAND_HZ = np.linspace(1.4e9, 2.2e9, 9)
N_SURVEYS, N_POSES, N_PULSES = 60, 16, 20


@cache
def helix() -> SpatialPattern:
    return read_spatial_pattern(SHIPPED_PATTERNS["helix_in_ring"])


def gain_of_helices(azimuth_rad: FloatArray, elevation_rad: FloatArray) -> FloatArray:
    """Return the gain of each element in the band, shape (n, 6)."""
    of_band = helix().gain(azimuth_rad - RING.boresights_rad, elevation_rad, BAND_HZ)
    return np.sqrt(np.square(of_band).mean(axis=0))


def pulses_of_helices(
    rng: np.random.Generator, pose: FloatArray, truth_m: FloatArray
) -> tuple[PulseBatch, FloatArray, IntArray]:
    """Make `N_PULSES` of a source at each pose in the ring of helices, with their poses and the source's number."""
    azimuth, elevation, _ = sights(pose, truth_m, RING_M * [0.0, 0.0, 1.0])
    gain = gain_of_helices(azimuth + np.radians(2.0) * rng.normal(size=6), elevation) * np.exp(
        0.05 * rng.normal(size=6)
    )
    strengths = np.repeat(gain / np.linalg.norm(gain, axis=-1, keepdims=True), N_PULSES, axis=0)
    strengths = np.maximum(strengths + 0.02 * rng.normal(size=strengths.shape), 0.0)
    rows = np.repeat(np.arange(len(pose)), N_PULSES)
    return detected(strengths, 0.02, 10.0 * rows), pose[rows], np.zeros_like(rows)


def locate(
    rng: np.random.Generator,
    pose: FloatArray,
    truth_m: FloatArray,
    pattern_error: float,
    start_m: FloatArray | None = None,
) -> JointEstimate:
    """Fit pulses of helices of which only the cut in the plane is known, from a start next to the truth."""
    array = ArrayModel(
        manifold=GainManifold(helix().cut(), RING.boresights_rad),
        positions_m=RING_M,
        spread=ElementSpread(gain=0.05, pointing_rad=np.radians(2.0), pattern=pattern_error),
    )
    exact = PoseError(position_m=0.03, heading_rad=np.radians(0.5), correlation_s=5.0)
    start_m = truth_m + 0.3 if start_m is None else start_m
    return locate_jointly(*pulses_of_helices(rng, pose, truth_m), start_m[np.newaxis], array, exact)


def drawn_drive(rng: np.random.Generator) -> FloatArray:
    """Draw headings on a straight drive along the x axis."""
    return np.column_stack([np.linspace(-6.0, 6.0, N_POSES), np.zeros(N_POSES), rng.uniform(-np.pi, np.pi, N_POSES)])


@pytest.mark.parametrize("seed", range(8))
def test_fit_from_below_the_array_ends_above_ground(seed: int) -> None:
    """A mirrored pattern deviation explains the mirror image equally well: the prior decides."""
    rng = np.random.default_rng([5, seed])
    truth_m = np.array([0.0, rng.uniform(2.0, 5.0), rng.uniform(1.4, 3.0)])
    pose = drawn_drive(rng)
    below_m = np.array([0.0, truth_m[1], 1.2 - truth_m[2]])
    heights_m = [
        locate(np.random.default_rng(seed), pose, truth_m, 0.02, start_m).positions_m[0, 2]
        for start_m in (truth_m, below_m)
    ]
    assert heights_m[0] == pytest.approx(heights_m[1], abs=0.05)
    assert min(heights_m) > 0.0


def test_pattern_error_cancels_around_a_source() -> None:
    """The robot drives a circle that keeps the source in one direction of the array."""
    at_rad = 2 * np.pi * np.arange(N_POSES) / N_POSES
    pose = np.column_stack([3.0 * np.cos(at_rad), 3.0 * np.sin(at_rad), at_rad + np.radians(110.0)])
    fixes = [locate(np.random.default_rng(11), pose, np.array([0.0, 0.0, 1.6]), error) for error in (0.0, 0.02)]
    exact_m, uncertain_m = (ellipse95(fix.covariances_m2[0, :2, :2]).semi_major_m for fix in fixes)
    assert uncertain_m < 6.0 * exact_m  # 15 times if it were noise of the direction


@pytest.mark.parametrize("elevation_deg", [10.0, 20.0, 30.0, 40.0, 45.0])
def test_bearing_errors_off_the_plane_agree_with_deviation(elevation_deg: float) -> None:
    manifold = GainManifold(helix().cut(), RING.boresights_rad)
    array = ArrayModel(manifold=manifold, positions_m=RING_M, spread=ElementSpread(pattern=0.02))
    azimuth_rad = np.radians(np.arange(0.0, 360.0, 3.0))
    elevation_rad = np.full(azimuth_rad.size, np.radians(elevation_deg))
    strengths = gain_of_helices(azimuth_rad[:, np.newaxis], np.tile(elevation_rad[:, np.newaxis], 6))
    bearing_rad = with_bearings(detected(strengths, 1e-3), array).azimuth_rad
    errors = BearingErrors(array)
    miss_rad = difference(bearing_rad, azimuth_rad + errors.by_elevation(azimuth_rad, elevation_rad))
    expected_rad2 = np.square(errors.std(azimuth_rad)) + errors.variance_off_plane(azimuth_rad, elevation_rad)
    assert 0.4 < np.sqrt(np.mean(np.square(miss_rad)) / np.mean(expected_rad2)) < 2.0


def test_ellipse_coverage_with_pattern_error() -> None:
    """The robot drives past a source with elements whose pattern differs from the one that the fit assumes."""
    error_m, coverage = {}, {}
    for pattern_error in (0.0, 0.02):
        miss_m, inside = [], []
        for k in range(N_SURVEYS):
            rng = np.random.default_rng([3, k])
            truth_m = np.array([0.0, rng.uniform(2.0, 5.0), 0.6 + rng.uniform(0.2, 2.6)])
            fix = locate(rng, drawn_drive(rng), truth_m, pattern_error)
            miss_m.append((fix.positions_m[0] - truth_m)[:2])
            inside.append(is_inside95(miss_m[-1], fix.covariances_m2[0, :2, :2]))
        error_m[pattern_error], coverage[pattern_error] = np.median(np.linalg.norm(miss_m, axis=-1)), np.mean(inside)
    assert coverage[0.02] >= 0.85
    assert coverage[0.0] < coverage[0.02]
    assert error_m[0.02] < 1.5 * error_m[0.0]
