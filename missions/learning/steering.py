"""Who steers in the open yard: actions for many robots at once, from bearings and lidar alone."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pdpatrol.envs.patrol_env import Observation

Actions = NDArray[np.float32]

HOLD_STEPS = 10
"""For how many steps a random action is kept (assumed): a second, as the missions' `random` does."""

TURN_PER_RAD = 1.5
"""Share of the yaw rate limit for each radian to the side (assumed): full turn from 40 degrees on."""


class Steering(Protocol):
    """Decides for all rows; starts with the episodes of all rows."""

    def __call__(self, observation: Observation) -> Actions:
        """Actions, shape (n_robots, 2), in [-1, 1], from what `pdpatrol.envs.wrappers.bearings_only` tells."""
        ...


class RandomSteering:
    """Drive at random, changing its mind once a second: the floor under all others."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng, self._n, self._actions = rng, 0, np.zeros((0, 2), dtype=np.float32)

    def __call__(self, observation: Observation) -> Actions:
        """A random action for each row, kept for a second."""
        if self._n % HOLD_STEPS == 0:
            self._actions = self._rng.uniform(-1.0, 1.0, (len(observation["bearing"]), 2)).astype(np.float32)
        self._n += 1
        return self._actions


def towards_last_bearing(observation: Observation) -> Actions:
    """Turn towards the last bearing and drive as far as it is ahead; stand before the first. Written by hand."""
    ahead, left = observation["bearing"][..., 0], observation["bearing"][..., 1]
    turn = np.clip(TURN_PER_RAD * np.arctan2(left, ahead), -1.0, 1.0)
    return np.stack([np.clip(ahead, 0.0, 1.0), turn], axis=-1).astype(np.float32)
