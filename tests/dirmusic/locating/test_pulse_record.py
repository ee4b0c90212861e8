"""Pooled pulses from one place and direction: their noise, and which pulses are pooled."""

import numpy as np
import pytest

from dirmusic.locating.pulse_record import PulseRecord, choose_evenly, pool_pulses
from dirmusic.pulses.batch import PulseBatch
from tests.dirmusic.scenes import RING, detected, record_of


def noisy_pulses(azimuth_rad: np.ndarray, noise_v: float, rng: np.random.Generator) -> PulseBatch:
    """Make pulses of amplitudes from 0.5 to 2 V, from azimuths (n,), with the same noise in all channels."""
    amplitude_v = rng.uniform(0.5, 2.0, azimuth_rad.size)
    strengths_v = rng.normal(amplitude_v * RING.gain(azimuth_rad), noise_v).T
    return detected(strengths_v, noise_v)._replace(azimuth_rad=azimuth_rad, std_rad=noise_v / amplitude_v)


def test_pooled_pulse_has_the_stated_noise() -> None:
    n_groups = 2000
    group = np.repeat(np.arange(n_groups), 20)
    pulses = noisy_pulses(np.full(group.size, 0.7), 0.02, np.random.default_rng(3))
    one_each, pose = pool_pulses(pulses, np.zeros((group.size, 3)), group)
    assert one_each.n_pulses == len(pose) == n_groups
    shares = RING.gain(0.7) / np.linalg.norm(RING.gain(0.7))
    off = one_each.strengths_v - shares
    across = off - np.outer(off @ shares, shares)
    expected = one_each.variance_v2.mean() * 5.0
    assert np.square(across).sum(axis=-1).mean() == pytest.approx(expected, rel=0.05)
    assert np.linalg.norm(across.mean(axis=0)) < 4.0 * np.sqrt(expected / n_groups)


def test_pooling_weights_by_noise_and_usable_channels() -> None:
    pulses = noisy_pulses(np.array([0.2, 3.0, 0.2, -3.0, 0.2]), 1e-6, np.random.default_rng(4))
    is_usable = np.ones((5, 6), dtype=np.bool_)
    is_usable[0, 2] = is_usable[1, 4] = is_usable[3, 4] = False
    pose = np.array([[0.0, 1.0, 3.1], [5.0, 5.0, 0.0], [0.2, 1.0, -3.1], [5.0, 5.0, 0.0], [0.1, 1.0, np.pi]])
    one_each, poses = pool_pulses(pulses._replace(is_usable=is_usable), pose, np.array([9, 4, 9, 4, 9]))
    np.testing.assert_array_equal(one_each.is_usable, [[True, True, True, True, False, True], [True] * 6])
    assert abs(one_each.azimuth_rad[0]) == pytest.approx(np.pi, abs=0.15)  # the mean of 3.0 and -3.0
    assert one_each.azimuth_rad[1] == pytest.approx(0.2)
    assert (one_each.std_rad < [pulses.std_rad[[1, 3]].min(), pulses.std_rad[[0, 2, 4]].min()]).all()
    assert poses[1, 1] == pytest.approx(1.0)
    assert np.cos(poses[1, 2]) < -0.99


def record_along(poses: np.ndarray, step_s: float) -> PulseRecord:
    """Record one pulse from straight ahead at each pose (n, 3)."""
    pulse = noisy_pulses(np.zeros(1), 0.01, np.random.default_rng(0))
    return record_of(*((step_s * k, pose, pulse) for k, pose in enumerate(poses)))


def test_pulses_pool_by_place_heading_and_time() -> None:
    steps = np.multiply.outer([[0.0, 0.0, 0.0], [0.0, 0.0, np.radians(2.0)], [0.5, 0.0, 0.0]], np.arange(100))
    standing, turning, driving = steps.transpose(0, 2, 1)
    n_pooled = [
        record_along(poses, 0.01).pooled(np.arange(100), 120)[0].n_pulses for poses in (standing, turning, driving)
    ]
    assert n_pooled == [1, 40, 100]
    assert record_along(standing, 1.0).pooled(np.arange(100), 120)[0].n_pulses == 20
    assert record_along(driving, 0.01).pooled(np.arange(100), 30)[0].n_pulses == 30


@pytest.mark.parametrize("n", [10, 160, 161, 2000])
def test_even_choice_is_stable_under_additions(n: int) -> None:
    numbers = 3 * np.arange(n)
    chosen = choose_evenly(numbers, 160)
    assert chosen.size == min(n, 160)
    assert (np.diff(chosen) > 0).all()
    assert np.diff(chosen, prepend=-1, append=3 * n).max() <= 4 * 3 * n / chosen.size
    assert np.isin(choose_evenly(3 * np.arange(n + 5), 160), chosen).sum() >= chosen.size - 5
