"""Dead reckoning: right without errors, and drifting slowly with them."""

import numpy as np
import pytest

from dirmusic.angles import difference, wrap
from dirmusic.fitting import wrapped
from envs.odometry import Odometry, OdometryConfig
from envs.patrol import PatrolEnv

PERFECT = OdometryConfig(wheel_radius_error=0.0, gyro_bias_deg_per_min=0.0, gyro_noise_deg_per_sqrt_min=0.0)


def test_without_errors_it_follows_a_circle_and_closes_it() -> None:
    odometry, radius_m = Odometry(PERFECT, 0.1), 0.1
    odometry.start(0, np.array([1.0, 2.0, 0.3]), np.random.default_rng(0))
    for k in range(1, 101):
        rolled = np.full((1, 2), 2 * np.pi * 3.0 * k / 100 / radius_m)
        odometry.move(rolled, np.array([2 * np.pi * k / 100]), 0.1, np.ones(1))
    np.testing.assert_allclose(odometry.pose, [[1.0, 2.0, 0.3]], atol=1e-9)


def test_its_errors_are_those_of_wheels_and_gyro() -> None:
    straight, rng = Odometry(OdometryConfig(), 0.1, 400), np.random.default_rng(0)
    for row in range(400):
        straight.start(row, np.zeros(3), rng)
    for k in range(1, 601):
        straight.move(np.full((400, 2), 0.8 * k), np.zeros(400), 0.1, rng.standard_normal(400))
    x, y, yaw = straight.pose.T
    assert x.std() == pytest.approx(48 * 0.001, rel=0.15)
    assert np.degrees(yaw.std()) == pytest.approx(np.hypot(0.05, 0.1), rel=0.15)
    assert abs(y.mean()) < 4 * y.std() / 20


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
            if env.patrols.inspectors.readings.lidar_m[0, [0, 1, 2, 3, -1, -2, -3]].min() < 1.5:
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
