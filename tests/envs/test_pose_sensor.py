"""The error of the believed pose neither grows nor dies out, and lasts as long as configured."""

import numpy as np
import pytest

from envs.pose_sensor import PoseSensor, PoseSensorConfig


def errors(n: int, every_s: float) -> np.ndarray:
    sensor = PoseSensor(PoseSensorConfig(), np.random.default_rng(0))
    return np.array([sensor.read(np.zeros(3), every_s) for _ in range(n)])


def test_the_spread_stays_as_configured_however_long_it_runs() -> None:
    read = errors(60_000, 1.0)[30_000:]
    np.testing.assert_allclose(read.std(axis=0), [0.05, 0.05, np.radians(0.5)], rtol=0.05)


def test_an_error_keeps_a_share_of_one_over_e_after_the_correlation_time() -> None:
    read = errors(60_000, 1.0)[:, 0]
    assert np.corrcoef(read[:-5], read[5:])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.03)


def test_the_believed_heading_stays_in_the_half_open_turn() -> None:
    sensor = PoseSensor(PoseSensorConfig(heading_std_deg=5.0), np.random.default_rng(0))
    headings = np.array([sensor.read(np.array([0.0, 0.0, np.pi]), 5.0)[2] for _ in range(200)])
    assert ((headings > -np.pi) & (headings <= np.pi)).all()
    assert (headings < 0).any()
