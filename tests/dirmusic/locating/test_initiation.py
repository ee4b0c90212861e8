"""Initiation of tracks where lines of sight of unexplained pulses cross."""

import numpy as np
import pytest

from dirmusic.arrays import FloatArray
from dirmusic.locating.initiation import (
    CANDIDATE_APART_M,
    LEAST_PULSES,
    LEAST_WINDOWS,
    OF_UNEXPLAINED,
    Crossing,
    Occupied,
    Search,
    find_crossing,
)
from tests.dirmusic.locating.forward_model import groups_from
from tests.dirmusic.scenes import around

SOURCE_M, OTHER_M = np.array([10.0, 8.0]), np.array([16.0, 8.0])
NOWHERE_M = np.empty((0, 3))


def cross(
    path_m: FloatArray,
    targets_m: FloatArray,
    step_s: float,
    occupied_m: FloatArray = NOWHERE_M,
    seed: int = 0,
    may_be_multipath: bool = False,
) -> Crossing | None:
    """Search for a crossing of lines of sight to a target from each place, with errors of 2 degrees."""
    n = len(path_m)
    pose = np.column_stack([path_m, 0.1 * np.arange(n)]).astype(np.float64)
    sight_m = targets_m - path_m
    azimuth: FloatArray = np.arctan2(sight_m[:, 1], sight_m[:, 0]) - pose[:, 2]
    azimuth += np.random.default_rng(seed).normal(0.0, np.radians(2.0), n)
    groups = groups_from(pose, azimuth, 1.0, -10.0, step_s * np.arange(n))
    window = np.floor(groups.time_s / 5.0).astype(np.intp)
    is_free = np.ones(n, dtype=np.bool_)
    search = Search(is_free, is_free & may_be_multipath, window, groups.time_s[-1], OF_UNEXPLAINED)
    return find_crossing(groups, search, Occupied(occupied_m, np.full(len(occupied_m), CANDIDATE_APART_M)))


def test_lines_of_sight_cross_at_the_source() -> None:
    """A crossing is within a metre of the source, and within its stated region."""
    for seed in range(20):
        path_m = around(SOURCE_M, 5.0, 10.0 * seed, 10.0 * seed + 90.0, 20)
        crossing = cross(path_m, np.tile(SOURCE_M, (20, 1)), 7.0, seed=seed)
        assert crossing is not None
        miss_m = crossing.position_m[:2] - SOURCE_M
        assert np.linalg.norm(miss_m) < 1.0
        assert miss_m @ np.linalg.solve(crossing.covariance_m2[:2, :2], miss_m) < 16.0


def test_four_pulses_in_four_windows_initiate() -> None:
    """Few pulses initiate a track whatever their age, but fewer pulses or windows do not."""
    assert LEAST_PULSES == LEAST_WINDOWS == 4
    for n, step_s, is_enough in ((4, 100.0, True), (3, 100.0, False), (4, 1.0, False)):
        crossing = cross(around(SOURCE_M, 5.0, 0.0, 90.0, n), np.tile(SOURCE_M, (n, 1)), step_s)
        assert (crossing is not None) == is_enough


def test_multipath_of_a_known_source_initiates_only_where_it_crosses() -> None:
    """Pulses from one direction within seconds are enough, unless they may be multipath of a known source."""
    path_m, targets_m = around(SOURCE_M, 5.0, 0.0, 5.0, 8), np.tile(SOURCE_M, (8, 1))
    assert cross(path_m, targets_m, 0.5) is not None
    assert cross(path_m, targets_m, 0.5, may_be_multipath=True) is None
    path_m = around(SOURCE_M, 5.0, 0.0, 90.0, 8)
    assert cross(path_m, targets_m, 7.0, may_be_multipath=True) is not None


@pytest.mark.parametrize("rate_hz", [0.2, 2.0, 50.0])
def test_source_initiates_at_any_rate_among_pulses_in_random_directions(rate_hz: float) -> None:
    """In a minute, half of the pulses are of one source, and all may be multipath of known ones."""
    n = max(round(60.0 * rate_hz), 2 * LEAST_PULSES)
    for seed in range(5):
        path_m, is_own = around(SOURCE_M, 8.0, 0.0, 90.0, n), np.arange(n)[:, np.newaxis] % 2 == 0
        random_m = path_m + np.random.default_rng(seed).normal(size=path_m.shape)
        targets_m = np.where(is_own, SOURCE_M, random_m)
        crossing = cross(path_m, targets_m, 1.0 / rate_hz, seed=seed, may_be_multipath=True)
        assert crossing is not None
        assert np.linalg.norm(crossing.position_m[:2] - SOURCE_M) < 1.0


def test_lines_of_sight_in_random_directions_initiate_nothing() -> None:
    """Of many lines of sight in random directions, some cross."""
    n_initiated = 0
    for seed in range(40):
        path_m, rng = around(SOURCE_M, 8.0, 0.0, 300.0, 120), np.random.default_rng(seed)
        targets_m = path_m + rng.normal(size=(120, 2))
        n_initiated += cross(path_m, targets_m, 1.0, seed=seed, may_be_multipath=True) is not None
    assert n_initiated <= 2


def test_occupied_positions_are_skipped() -> None:
    """Where a source is known, another crossing is found, or none."""
    path_m, is_other = around((13.0, 8.0), 7.0, 0.0, 180.0, 40), np.arange(40) % 4 == 0
    targets_m = np.where(is_other[:, np.newaxis], OTHER_M, SOURCE_M)
    first = cross(path_m, targets_m, 7.0)
    assert first is not None
    assert np.linalg.norm(first.position_m[:2] - SOURCE_M) < 1.0
    second = cross(path_m, targets_m, 7.0, first.position_m[np.newaxis])
    assert second is not None
    assert np.linalg.norm(second.position_m[:2] - OTHER_M) < 1.0
    both = np.array([first.position_m, second.position_m])
    third = cross(path_m, targets_m, 7.0, both)
    assert third is None or np.linalg.norm(both - third.position_m, axis=-1).min() >= CANDIDATE_APART_M
