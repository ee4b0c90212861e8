"""Driving at random for long in a yard with equipment: the physics stays sound, and the robot inside the fence."""
# pyright: reportAttributeAccessIssue=false

import numpy as np
import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.envs.patrol_env import STEP_S, PatrolEnv
from pdpatrol.envs.scenario.robot import RobotConfig


def drive_at_random(minutes: float, seed: int, robot: str = "inspector") -> set[str]:
    """Drive with a new command every second, check every step, and return what was touched."""
    scenario = load_scenario("transformer_bay").model_copy(update={"robot": RobotConfig(model=robot)})
    inner_m = scenario.robot.description.inner_radius_m
    task = scenario.task.model_copy(update={"time_limit_s": 60.0 * minutes})
    env = PatrolEnv(scenario.model_copy(update={"task": task, "sources": ()}), full_info=True)
    rng, size_m, touched, truncated, n_steps = np.random.default_rng(seed), scenario.yard.size_m, set[str](), False, 0
    env.reset(seed=seed)
    wish = rng.uniform([-0.7, -1.0], [1.0, 1.0], (round(60.0 * minutes), 2)).astype(np.float32)  # on the whole forward
    while not truncated:
        observation, _, terminated, truncated, info = env.step(wish[n_steps // round(1.0 / STEP_S)])
        n_steps += 1
        assert not terminated
        assert all(np.isfinite(value).all() for value in observation.values())
        assert env.observation_space.contains(observation)
        place_m = info["true_pose"][:2]
        assert (place_m > inner_m - 0.01).all()
        assert (place_m < np.subtract(size_m, inner_m - 0.01)).all()
        touched.update(info["touched_names"])
    assert env.simulation.robots.n_warnings().sum() == 0
    assert n_steps == round(60.0 * minutes / STEP_S)
    return touched


@pytest.mark.parametrize("robot", ["inspector", "crawler"])
def test_three_minutes_of_random_driving_are_sound(robot: str) -> None:
    drive_at_random(3.0, seed=0, robot=robot)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["inspector", "crawler"])
def test_one_hour_of_random_driving_is_sound(robot: str) -> None:
    touched = drive_at_random(60.0, seed=1, robot=robot)
    assert any(name.startswith("fence/") for name in touched)
    assert any(name.startswith("equipment/") for name in touched)
