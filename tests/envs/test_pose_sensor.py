"""The error of the believed pose neither grows nor dies out, and lasts as long as configured."""

import numpy as np
import pytest

from envs.core.motion import N_DRAWS, Motion, SensorParameters, move
from envs.scenario.robot_sensors import BatteryConfig, OdometryConfig, PoseSensorConfig


def read(motion: Motion, config: PoseSensorConfig, true_pose: np.ndarray, every_s: float, normal: np.ndarray) -> None:
    """Let the believed poses of all robots follow their true ones, (3,) or (n_robots, 3)."""
    n = len(motion.n_steps)
    senses, nobody = (
        SensorParameters.of(config, OdometryConfig(), BatteryConfig(), every_s),
        np.zeros(n, dtype=np.bool_),
    )
    move(motion, senses, np.tile(true_pose, (n, 1)), np.zeros((n, 2)), np.zeros(n), normal, nobody, nobody)


def errors(n: int, every_s: float) -> np.ndarray:
    motion, rng, seen = Motion.at_rest(1), np.random.default_rng(0), []
    for _ in range(n):
        read(motion, PoseSensorConfig(), np.zeros(3), every_s, rng.standard_normal((1, N_DRAWS)))
        seen.append(motion.pose[0].copy())
    return np.array(seen)


def test_the_spread_stays_as_configured_however_long_it_runs() -> None:
    seen = errors(60_000, 1.0)[30_000:]
    np.testing.assert_allclose(seen.std(axis=0), [0.05, 0.05, np.radians(0.5)], rtol=0.05)


def test_an_error_keeps_a_share_of_one_over_e_after_the_correlation_time() -> None:
    seen = errors(60_000, 1.0)[:, 0]
    assert np.corrcoef(seen[:-5], seen[5:])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.03)


def test_the_believed_heading_stays_in_the_half_open_turn() -> None:
    motion, config = Motion.at_rest(200), PoseSensorConfig(heading_std_deg=5.0)
    read(motion, config, np.array([0.0, 0.0, np.pi]), 5.0, np.random.default_rng(0).standard_normal((200, N_DRAWS)))
    headings = motion.pose[:, 2]
    assert ((headings > -np.pi) & (headings <= np.pi)).all()
    assert (headings < 0).any()


def test_a_robot_that_starts_anew_has_an_error_of_its_own_from_the_first_reading_on() -> None:
    motion, rng, still = Motion.at_rest(2), np.random.default_rng(1), (np.zeros((2, 3)), np.zeros((2, 2)), np.zeros(2))
    senses = SensorParameters.of(PoseSensorConfig(), OdometryConfig(), BatteryConfig(), 0.1)
    nobody, second = np.zeros(2, dtype=np.bool_), np.array([False, True])
    move(motion, senses, *still, rng.standard_normal((2, N_DRAWS)), nobody, nobody)
    before = motion.pose.copy()
    move(motion, senses, *still, rng.standard_normal((2, N_DRAWS)), second, nobody)
    assert np.abs(motion.pose - before)[0, 0] < 0.03
    assert np.abs(motion.pose - before)[1, 0] > 0.03
