"""Dead reckoning: right without errors, and drifting slowly with them; and the battery."""

import numpy as np
import pytest

from dirmusic.angles import difference, wrap
from dirmusic.kernels import wrapped
from envs.core.motion import N_DRAWS, Motion, SensorParameters, move
from envs.patrol_env import PatrolEnv
from envs.scenario.robot_sensors import BatteryConfig, OdometryConfig, PoseSensorConfig

PERFECT = OdometryConfig(wheel_radius_error=0.0, gyro_bias_deg_per_min=0.0, gyro_noise_deg_per_sqrt_min=0.0)


def reckoned(
    config: OdometryConfig, start: np.ndarray, wheels_rad: np.ndarray, yaw_rad: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Odometry (n_robots, 3) after steps of 0.1 s, from a start (3,) that is believed exactly.

    Wheels of 0.1 m and headings as they are truly turned, one after the other, shape (n_steps,).
    """
    n, sharp = 400, PoseSensorConfig(position_std_m=0.0, heading_std_deg=0.0)
    motion, senses = Motion.at_rest(n), SensorParameters.of(sharp, config, BatteryConfig(), 0.1)
    nobody, everybody = np.zeros(n, dtype=np.bool_), np.ones(n, dtype=np.bool_)
    for k, (wheel, yaw) in enumerate(zip([0.0, *wheels_rad], [start[2], *yaw_rad], strict=True)):
        true_pose, normal = np.tile([start[0], start[1], yaw], (n, 1)), rng.standard_normal((n, N_DRAWS))
        is_new = everybody if k == 0 else nobody
        move(motion, senses, true_pose, np.full((n, 2), wheel), np.zeros(n), normal, is_new, nobody)
        if k == 0:
            for row in range(n):
                motion.draw_odometry(row, config, 0.1, rng)
    return motion.odometry


def test_without_errors_it_follows_a_circle_and_closes_it() -> None:
    share = np.arange(1, 101) / 100
    start = np.array([1.0, 2.0, 0.3])
    wheels_rad, yaw_rad = 2 * np.pi * 3.0 * share / 0.1, 0.3 + 2 * np.pi * share
    ends = reckoned(PERFECT, start, wheels_rad, yaw_rad, np.random.default_rng(0))
    np.testing.assert_allclose(ends, np.tile(start, (400, 1)), atol=1e-9)


def test_its_errors_are_those_of_wheels_and_gyro() -> None:
    straight = 0.8 * np.arange(1, 601), np.zeros(600)
    x, y, yaw = reckoned(OdometryConfig(), np.zeros(3), *straight, np.random.default_rng(0)).T
    assert x.std() == pytest.approx(48 * 0.001, rel=0.15)
    assert np.degrees(yaw.std()) == pytest.approx(np.hypot(0.05, 0.1), rel=0.15)
    assert abs(y.mean()) < 4 * y.std() / 20


def test_the_battery_gives_what_motors_and_electronics_take_and_is_full_at_the_start() -> None:
    config = BatteryConfig(capacity_wh=10.0, idle_w=80.0)
    motion, senses = Motion.at_rest(2), SensorParameters.of(PoseSensorConfig(), PERFECT, config, 36.0)
    one, nobody, power_w = np.array([True, False]), np.zeros(2, dtype=np.bool_), np.array([20.0, 120.0])
    still = np.zeros((2, 3)), np.zeros((2, 2)), power_w, np.zeros((2, N_DRAWS))
    for expected in ([0.9, 0.8], [0.8, 0.6]):
        move(motion, senses, *still, nobody, nobody)
        np.testing.assert_allclose(motion.battery, expected)
    move(motion, senses, *still, one, nobody)
    np.testing.assert_allclose(motion.battery, [1.0, 0.4])
    move(motion, senses, *still, nobody, one)
    np.testing.assert_allclose(motion.battery, [1.0, 0.2])
    assert motion.time_s.tolist() == [0.0, 144.0]
    move(motion, senses, *still, nobody, one)
    assert motion.battery[1] == 0.0


def test_driven_about_the_yard_it_drifts_by_less_than_half_a_percent_of_the_way() -> None:
    drifts = []
    for seed in range(4):
        env = PatrolEnv("one_source")
        _, info = env.reset(seed=seed)
        rng = np.random.default_rng(seed)
        start, true_start, driven_m, before = info["odometry"], info["truth"]["pose"], 0.0, info["truth"]["pose"]
        wish = rng.uniform([0.4, -0.6], [1.0, 0.6], (60, 2)).astype(np.float32)
        for k in range(1200):
            action = wish[k // 20].copy()
            if env.simulation.robots.readings.lidar_m[0, [0, 1, 2, 3, -1, -2, -3]].min() < 1.5:
                action[1] = 0.9
            _, _, _, _, info = env.step(action)
            pose = info["truth"]["pose"]
            driven_m += float(np.hypot(*(pose[:2] - before[:2])))
            before = pose
        turn = float(difference(start[2], true_start[2]))
        cos, sin = np.cos(turn), np.sin(turn)
        moved, true_moved = info["odometry"][:2] - start[:2], before[:2] - true_start[:2]
        drifts.append(float(np.hypot(*(moved - np.array([[cos, -sin], [sin, cos]]) @ true_moved))) / driven_m)
        assert driven_m > 30
    assert max(drifts) < 0.005


def test_the_compiled_wrap_is_the_wrap() -> None:
    angles = np.concatenate([np.linspace(-20.0, 20.0, 1001), [np.pi, -np.pi, 3 * np.pi]])
    assert [wrapped(float(angle)) for angle in angles] == wrap(angles).tolist()
