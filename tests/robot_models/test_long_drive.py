"""Long random drives in a yard with equipment: the physics stays valid, and the robot stays inside the fence."""

import numpy as np
import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.envs.patrol_env import STEP_S, PatrolEnv
from pdpatrol.envs.scenario.robot import RobotConfig
from pdpatrol.robot_models.description.robot_description import SHIPPED


@pytest.mark.parametrize("robot", SHIPPED)
@pytest.mark.parametrize("minutes", [3, pytest.param(60, marks=pytest.mark.slow)])
def test_random_driving_is_sound(robot: str, minutes: int) -> None:
    """The command changes every second, and every step is checked."""
    scenario = load_scenario("transformer_bay").model_copy(update={"robot": RobotConfig(model=robot)})
    inner_m = scenario.robot.description.inner_radius_m
    task = scenario.task.model_copy(update={"time_limit_s": 60.0 * minutes})
    env = PatrolEnv(scenario.model_copy(update={"task": task, "sources": ()}), full_info=True)
    wish = np.random.default_rng(1).uniform([-0.7, -1.0], [1.0, 1.0], (60 * minutes, 2)).astype(np.float32)
    truncated, touched = False, set[str]()
    env.reset(seed=1)
    for action in np.repeat(wish, round(1.0 / STEP_S), axis=0):
        assert not truncated
        observation, _, terminated, truncated, info = env.step(action)
        assert not terminated
        assert all(np.isfinite(value).all() for value in observation.values())
        assert env.observation_space.contains(observation)
        place_m = info["true_pose"][:2]
        assert (place_m > inner_m - 0.01).all()
        assert (place_m < np.subtract(scenario.yard.size_m, inner_m - 0.01)).all()
        touched.update(name.partition("/")[0] for name in info["touched_names"])
    assert truncated
    assert env.simulation.robots.n_warnings().sum() == 0
    assert minutes < 60 or touched == {"fence", "equipment"}
