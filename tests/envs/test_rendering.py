"""Pictures of PDPatrol-v0."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from pdpatrol.envs.patrol_env import PatrolEnv


@pytest.mark.parametrize("mode", ["rgb_array", "depth_array"])
def test_picture_shows_the_robot_and_check_env_passes(mode: str) -> None:
    env = gymnasium.make("pdpatrol:PDPatrol-v0", render_mode=mode)
    check_env(env.unwrapped, skip_render_check=False)
    env.reset(seed=0)
    picture = np.asarray(env.render())
    if mode == "rgb_array":
        assert picture.shape == (480, 640, 3)
        assert picture.dtype == np.uint8
        yellow = (picture[..., 0] > 150) & (picture[..., 1] > 100) & (picture[..., 2] < 80)
        assert yellow.sum() > 500  # hull of the robot
    else:
        assert picture.shape == (480, 640)
        assert picture.min() == pytest.approx(1.9, abs=0.5)  # metres from the camera to the robot
    env.close()
    env.close()


def test_unknown_render_mode_is_refused() -> None:
    with pytest.raises(ValueError, match="one of human, rgb_array, depth_array"):
        PatrolEnv(render_mode="ansi")
