"""Pool of pulses: groups and their averages, whatever the pieces in which the pulses arrive."""

import numpy as np
import pytest

from dirmusic.angles import difference
from dirmusic.arrays import FloatArray
from dirmusic.locating.protocol import PoseError
from dirmusic.locating.pulse_pool import PLACE_M, PulsePool, Visibility, group_numbers, pool_pulses
from dirmusic.pulses.batch import PulseBatch
from tests.dirmusic.locating.forward_model import ARRAY

POSE_ERROR = PoseError(position_m=0.05, heading_rad=0.01, correlation_s=3.0)
Detection = tuple[float, FloatArray, PulseBatch]


def noisy_pulses(azimuth_rad: FloatArray, noise_v: float, rng: np.random.Generator, time_s: float = 0.0) -> PulseBatch:
    """Make pulses of amplitudes from 0.5 to 2 V, from azimuths (n,), with the same noise in all channels."""
    amplitude_v = rng.uniform(0.5, 2.0, azimuth_rad.size)
    strengths_v = rng.normal(amplitude_v * ARRAY.manifold.gain(azimuth_rad), noise_v).T
    pulses = PulseBatch.detected(np.full(azimuth_rad.size, time_s), strengths_v, np.full(strengths_v.shape, noise_v**2))
    return pulses._replace(azimuth_rad=azimuth_rad, std_rad=noise_v / amplitude_v)


def mission() -> list[Detection]:
    """Drive for 40 s at 0.4 m/s with pulses of two sources at most poses, and of none at some."""
    rng, result = np.random.default_rng(2), []
    for k in range(400):
        pose = np.array([0.04 * k, 1.0, 0.005 * k])
        azimuth_rad = rng.choice([0.4, 2.0], rng.integers(0, 3)) + rng.normal(0.0, 0.01)
        result.append((0.1 * k, pose, noisy_pulses(azimuth_rad, 0.02, rng, 0.1 * k)))
    return result


def pooled(detections: list[Detection], sizes: list[int]) -> PulsePool:
    """Pool detections in pieces of given sizes, and the rest at once."""
    pool, ends = PulsePool(ARRAY, POSE_ERROR), set(np.cumsum(sizes).tolist())
    for k, detection in enumerate(detections):
        if k in ends:
            pool.pool()
        pool.add(*detection)
    pool.pool()
    return pool


def assert_equal(first: PulsePool, second: PulsePool) -> None:
    """Check that two pools hold the same."""
    np.testing.assert_array_equal(second.group, first.group)
    np.testing.assert_array_equal(second.listened, first.listened)
    np.testing.assert_allclose(second.listened_s, first.listened_s, atol=1e-6)
    np.testing.assert_array_equal(second.places_m, first.places_m)
    for one, other in zip((*first.groups, *first.pairs), (*second.groups, *second.pairs), strict=True):
        np.testing.assert_allclose(other, one, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("sizes", [[1] * 399, [7] * 50, [120, 1, 200]], ids=["one by one", "sevens", "few"])
def test_pooling_in_pieces_equals_pooling_at_once(sizes: list[int]) -> None:
    """The pieces in which pulses arrive do not matter."""
    assert_equal(pooled(mission(), []), pooled(mission(), sizes))


def test_settled_groups_never_change() -> None:
    """Groups of past windows stay, and so do the numbers of their pulses."""
    pool = PulsePool(ARRAY, POSE_ERROR)
    for k, detection in enumerate(mission()):
        settled, n = pool.groups.take(slice(pool.n_settled)), pool.n_settled
        group = pool.group[pool.group < n]
        pool.add(*detection)
        if k % 5 == 0:
            pool.pool()
        for before, now in zip(settled, pool.groups, strict=True):
            np.testing.assert_array_equal(now[:n], before)
        np.testing.assert_array_equal(pool.group[: group.size], group)
    assert 0 < pool.n_settled < len(pool.groups.time_s)


def test_group_is_the_average_of_its_pulses() -> None:
    """Mean and variance equal those of the pulses one by one, weighted by their noise in each usable channel."""
    rng = np.random.default_rng(4)
    pulses = noisy_pulses(np.array([0.2, 3.1, 0.21, -3.1, 0.19]), 0.01, rng)
    is_usable = np.ones((5, 6), dtype=np.bool_)
    is_usable[0, 2] = is_usable[1, 4] = is_usable[3, 4] = False
    pulses = pulses._replace(is_usable=is_usable, time_s=np.arange(5.0))
    pose = np.array([[0.0, 1.0, 3.1], [5.0, 5.0, 0.0], [0.2, 1.0, -3.1], [5.0, 5.0, 0.0], [0.1, 1.0, np.pi]])
    number = np.array([0, 1, 0, 1, 0])
    groups = pool_pulses(pulses, pose, np.array([3, 8, 3, 8, 3]), number)
    for row in range(2):
        own = np.flatnonzero(number == row)
        total, weight, by_bearing = np.zeros(6), np.zeros(6), np.zeros(2)
        for k in own:
            norm = np.linalg.norm(pulses.strengths_v[k] * is_usable[k])
            precision = is_usable[k] * norm**2 / pulses.variance_v2[k]
            total, weight = total + precision * pulses.strengths_v[k] / norm, weight + precision
            by_bearing += np.array([1.0, pulses.time_s[k]]) / pulses.std_rad[k] ** 2
        mean = np.divide(total, weight, out=np.zeros(6), where=weight > 0)
        norm = np.linalg.norm(mean)
        np.testing.assert_allclose(groups.strengths[row], mean / norm)
        np.testing.assert_array_equal(groups.is_usable[row], weight > 0)
        np.testing.assert_allclose(groups.variance[row][weight > 0], 1 / weight[weight > 0] / norm**2)
        assert groups.std_rad[row] == pytest.approx(by_bearing[0] ** -0.5)
        assert groups.time_s[row] == pytest.approx(by_bearing[1] / by_bearing[0])
        assert groups.n_pulses[row] == own.size
    assert abs(difference(groups.azimuth_rad[1], np.pi)) < 0.1
    assert abs(difference(groups.pose[0, 2], np.pi)) < 0.1
    np.testing.assert_array_equal(groups.place, [3, 8])


def test_groups_separate_heading_level_and_direction() -> None:
    """Pulses differing by more than a sector in one respect are not pooled; less accurate directions pool wider."""
    pulses = noisy_pulses(np.array([0.01, 0.02, 0.2, 0.02, 0.02]), 1e-3, np.random.default_rng(5))
    norm_v = np.linalg.norm(pulses.strengths_v, axis=-1, keepdims=True)
    strengths_v = 1.2 * pulses.strengths_v / norm_v * np.array([[1.0], [1.0], [1.0], [0.25], [1.0]])
    pulses = pulses._replace(strengths_v=strengths_v, std_rad=np.full(5, 0.01))
    pose = np.array([[0.0, 0.0, 0.01 + turn] for turn in (0.0, 0.0, 0.0, 0.0, 0.2)])
    same = np.zeros(5, dtype=np.intp)
    np.testing.assert_array_equal(group_numbers(pulses, pose, same, same), [0, 0, 1, 2, 3])
    rough = pulses._replace(std_rad=np.full(5, 0.3))
    np.testing.assert_array_equal(group_numbers(rough, pose, same, same), [0, 0, 0, 1, 2])
    np.testing.assert_array_equal(group_numbers(pulses, pose, same, np.arange(5)), np.arange(5))


def test_faulty_channel_is_left_out_of_earlier_pulses() -> None:
    """Two channels are swapped from the start. Once they are not usable, all directions are as from the others."""
    rng, pool, true_rad = np.random.default_rng(4), PulsePool(ARRAY, POSE_ERROR), np.array([-0.6, -2.4])
    for k in range(200):
        pulses = noisy_pulses(true_rad, 0.01, rng)
        strengths_v = pulses.strengths_v[:, [1, 0, 2, 3, 4, 5]]
        is_usable = np.ones(6, dtype=np.bool_)
        is_usable[:2] = k < 100
        pulses = pulses._replace(strengths_v=strengths_v, is_usable=np.broadcast_to(is_usable, strengths_v.shape))
        if k < 100:  # the faulty channels turn them
            pulses = pulses._replace(azimuth_rad=pulses.azimuth_rad + 0.5)
        pool.add(0.1 * k, np.zeros(3), pulses)
        has_fault = pool.pool()
        assert has_fault == (k == 100)
    groups = pool.groups
    assert not groups.is_usable[:, :2].any()
    assert groups.is_usable[:, 2:].all()
    np.testing.assert_allclose(np.linalg.norm(groups.strengths, axis=1), 1.0)
    off_rad = np.abs(difference(groups.azimuth_rad[:, np.newaxis], true_rad)).min(axis=1)
    assert off_rad.max() < 0.1


def test_every_second_is_listened_to() -> None:
    """One place is recorded for each second of the mission, with or without pulses."""
    detections = [(at, pose, PulseBatch.none(6)) for at, pose, _ in mission()]
    pool = pooled(detections, [55, 100])
    np.testing.assert_allclose(pool.listened_s, np.arange(40.0))
    np.testing.assert_allclose(pool.places_m[pool.listened, 0], 0.4 * np.arange(40), atol=PLACE_M)
    assert pool.groups.time_s.size == pool.group.size == 0
    slow = PulsePool(ARRAY, POSE_ERROR)
    for at in (3.0, 3.5, 7.2):
        slow.add(at, np.zeros(3), PulseBatch.none(6))
        slow.pool()
    np.testing.assert_allclose(slow.listened_s, [3.0, 7.0])


def test_transmission_is_that_of_the_map_for_all_places() -> None:
    """Known places are not asked again, and new ones are added; without a map all is visible."""
    asked: list[int] = []

    def sight(places_m: FloatArray, target_m: FloatArray, within_m: float) -> FloatArray:
        asked.append(len(places_m))
        return 1.0 / (1.0 + np.linalg.norm(places_m - target_m, axis=-1) + within_m)

    pool, target_m = PulsePool(ARRAY, POSE_ERROR), np.array([5.0, 2.0, 1.5])
    visibility = Visibility(pool, sight)
    for detection in mission()[:200]:
        pool.add(*detection)
        pool.pool()
        visibility.transmission(target_m, 0.6)
    assert sum(asked) == len(pool.places_m)
    expected = sight(pool.places_m, target_m, 0.6)
    np.testing.assert_allclose(visibility.transmission(target_m, 0.6), expected)
    assert (Visibility(pool, None).transmission(target_m, 0.6) == 1.0).all()
