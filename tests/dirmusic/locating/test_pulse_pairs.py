"""Pairs of pulses of one pose show two sources where errors of array, pose and multipath hide them."""

import numpy as np
import pytest

from dirmusic import PulseBatch
from dirmusic.arrays import FloatArray
from dirmusic.bearing.maximum_likelihood import maximum_likelihood
from dirmusic.locating.joint_fit import array_prior, nominal_array
from dirmusic.locating.pulse_pairs import compare_pairs
from dirmusic.locating.pulse_pool import PulsePool, pair_pulses
from dirmusic.locating.two_sources import ONE_SOURCE, TwoSources
from tests.dirmusic.locating.forward_model import ARRAY, GRAVEL, POSE_ERROR, START, Nature, modelled
from tests.dirmusic.locating.test_locator import path_round

CENTRE_M = np.array([20.0, 15.0, 1.8])
APART_M = np.array([[0.3, 0.0, 0.0], [0.2, -0.25, 0.0], [0.1, 0.1, 0.4]])


def surveyed(places_m: FloatArray, seed: int, *, noise: float = 0.01, n_poses: int = 120) -> PulsePool:
    """Pool four pulses of randomly chosen sources at each pose; an error of 10 % is the same in all four."""
    rng, pool = np.random.default_rng(seed), PulsePool(ARRAY, POSE_ERROR)
    for k, pose in enumerate(path_round(CENTRE_M[:2], 4.0, 0.0, 250.0, n_poses)):
        own_m, shared = places_m[rng.integers(len(places_m), size=4)], 1.0 + rng.normal(0.0, 0.1, 6)
        strengths_v = shared * modelled(np.tile(pose, (4, 1)), own_m, ARRAY, Nature(widening=0.1, permittivity=GRAVEL))
        strengths_v /= strengths_v.max()
        std_v = np.full(strengths_v.shape, noise)
        pulses = PulseBatch.detected(np.zeros(4), np.abs(strengths_v + rng.normal(0.0, std_v)), np.square(std_v))
        pool.add(2.0 * k, pose, maximum_likelihood(pulses, ARRAY).attached_to(pulses))
    pool.pool()
    return pool


def compared(pool: PulsePool, by_residuals: TwoSources = ONE_SOURCE) -> TwoSources:
    own, state = np.ones(len(pool.groups.time_s)), array_prior(ARRAY, START).mean
    return compare_pairs(pool.pairs, pool.groups, own, CENTRE_M, state, nominal_array(ARRAY), by_residuals)


@pytest.mark.parametrize("apart_m", APART_M)
@pytest.mark.parametrize("noise", [0.005, 0.01])
def test_two_sources_are_told_apart_in_spite_of_shared_errors(apart_m: FloatArray, noise: float) -> None:
    found = compared(surveyed(CENTRE_M + 0.5 * np.array([apart_m, -apart_m]), 1, noise=noise))
    assert found.is_possible
    one, other = found.offsets_m - 0.5 * apart_m
    assert min(np.linalg.norm(one), np.linalg.norm(other)) < 0.1


@pytest.mark.parametrize("noise", [0.003, 0.01, 0.03])
def test_one_source_is_not_two(noise: float) -> None:
    for seed in range(5):
        assert not compared(surveyed(CENTRE_M[np.newaxis], seed, noise=noise)).is_possible


def apart(apart_m: FloatArray) -> TwoSources:
    """Return two sources of which residuals are certain."""
    return TwoSources(200.0, 0.5 * np.array([apart_m, -apart_m]), np.full(2, 0.5), near_m=2.0)


def test_pairs_of_one_source_contradict_two_that_are_near_each_other() -> None:
    """Then a track is not split. Pulses of two that are far apart form no pairs, and show nothing."""
    pool = surveyed(CENTRE_M[np.newaxis], 0)
    near, far = apart(np.array([0.5, 0.0, 0.0])), apart(np.array([2.0, 0.0, 0.0]))
    assert near.is_certain
    assert compared(pool, near).is_possible
    assert not compared(pool, near).is_certain
    assert compared(pool, far) is far


def test_pairs_of_two_sources_leave_the_result_by_residuals() -> None:
    apart_m = np.array([0.5, 0.0, 0.0])
    pool, by_residuals = surveyed(CENTRE_M + 0.5 * np.array([apart_m, -apart_m]), 1), apart(apart_m)
    assert compared(pool, by_residuals) is by_residuals


def test_a_few_pairs_show_nothing() -> None:
    places_m = CENTRE_M + 0.5 * np.array([APART_M[0], -APART_M[0]])
    assert compared(surveyed(places_m, 1, n_poses=8)) is ONE_SOURCE


def test_pairs_are_of_one_pose_and_of_similar_directions() -> None:
    """No pulse is in two pairs; directions next to the cut at 180 degrees do not matter."""
    time_s, azimuth_deg = (
        np.array([0.0] * 5 + [1.0] * 2 + [2.0]),
        np.array([10.0, 100.0, 14.0, 95.0, 30.0, 10.0, 60.0, 12.0]),
    )
    order = np.arange(8.0)
    strengths_v = np.column_stack([1.0 + order, np.ones(8)])
    pulses = PulseBatch.detected(time_s, strengths_v, np.ones((8, 2)))._replace(azimuth_rad=np.radians(azimuth_deg))
    pose = np.zeros((8, 3))
    pairs = pair_pulses(pulses, pose, np.arange(8))
    assert pairs.group.tolist() == [[0, 2], [1, 3]]
    unit = strengths_v / np.linalg.norm(strengths_v, axis=1, keepdims=True)
    np.testing.assert_allclose(pairs.difference, unit[[2, 3]] - unit[[0, 1]])
    pose[2:, 0] = 1.0  # at the same time, as in tables without times
    assert pair_pulses(pulses, pose, np.arange(8)).group.tolist() == [[2, 4]]


def test_pairs_are_forgotten_when_a_channel_is_left_out() -> None:
    pool = surveyed(CENTRE_M[np.newaxis], 0)
    usable = np.ones((1, 6), dtype=np.bool_)
    usable[0, 2] = False
    pulse = PulseBatch.detected(np.zeros(1), np.ones((1, 6)), np.ones((1, 6)))._replace(is_usable=usable)
    pool.add(500.0, np.array([24.0, 15.0, 0.0]), pulse)
    assert len(pool.pairs.group) > 100
    pool.pool()
    assert len(pool.pairs.group) < 10  # those of the last window, which are formed anew
    np.testing.assert_array_equal(pool.pairs.difference[:, 2], 0.0)
