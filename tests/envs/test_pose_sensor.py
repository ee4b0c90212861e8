"""The error of the believed pose neither grows nor dies out, and lasts as long as configured."""

import numpy as np
import pytest

from envs.pose_sensor import PoseSensor, PoseSensorConfig


def errors(n: int, every_s: float) -> np.ndarray:
    sensor, rng = PoseSensor(PoseSensorConfig()), np.random.default_rng(0)
    return np.array([sensor.read(np.zeros((1, 3)), every_s, rng.standard_normal((1, 3)))[0] for _ in range(n)])


def test_the_spread_stays_as_configured_however_long_it_runs() -> None:
    read = errors(60_000, 1.0)[30_000:]
    np.testing.assert_allclose(read.std(axis=0), [0.05, 0.05, np.radians(0.5)], rtol=0.05)


def test_an_error_keeps_a_share_of_one_over_e_after_the_correlation_time() -> None:
    read = errors(60_000, 1.0)[:, 0]
    assert np.corrcoef(read[:-5], read[5:])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.03)


def test_the_believed_heading_stays_in_the_half_open_turn() -> None:
    sensor, rng = PoseSensor(PoseSensorConfig(heading_std_deg=5.0), 200), np.random.default_rng(0)
    headings = sensor.read(np.tile([0.0, 0.0, np.pi], (200, 1)), 5.0, rng.standard_normal((200, 3)))[:, 2]
    assert ((headings > -np.pi) & (headings <= np.pi)).all()
    assert (headings < 0).any()


def test_a_robot_that_starts_anew_has_an_error_of_its_own_from_the_first_reading_on() -> None:
    sensor, rng = PoseSensor(PoseSensorConfig(), 2), np.random.default_rng(1)
    before = sensor.read(np.zeros((2, 3)), 0.1, rng.standard_normal((2, 3)))
    sensor.start(np.array([1]))
    after = sensor.read(np.zeros((2, 3)), 0.1, rng.standard_normal((2, 3)))
    assert np.abs(after - before)[0, 0] < 0.03
    assert np.abs(after - before)[1, 0] > 0.03
