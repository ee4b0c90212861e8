"""Sensors of the robot in PDPatrol-v0."""

import numpy as np

from pdpatrol.envs.patrol_env import PatrolEnv


def test_lidar_measures_noisy_ranges_within_reach() -> None:
    env = PatrolEnv("one_source")
    observation, info = env.reset(seed=1)
    x, y, yaw = info["true_pose"]
    errors = []
    for beam, range_m in enumerate(observation["lidar"].tolist()):
        direction = np.array([np.cos(yaw + np.radians(10 * beam)), np.sin(yaw + np.radians(10 * beam))])
        along = np.arange(0.0, 12.0, 0.005)[:, np.newaxis] * direction + (x, y)
        hit = np.flatnonzero(env.scenario.yard.clearance(along) <= 0)
        if hit.size == 0:
            assert range_m == 12.0
        else:
            errors.append(range_m - 0.005 * hit[0])
    assert len(errors) > 10
    assert np.abs(errors).max() < 0.1
    assert 0.005 < np.std(errors) < 0.04
