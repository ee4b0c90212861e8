"""Simpler observations for reinforcement learning: functions on batches, and wrappers of a single environment."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs
from gymnasium.wrappers import TransformObservation
from numpy.typing import NDArray

from pdpatrol.envs.observation import Observation

Action = NDArray[np.float32]

BEARINGS_ONLY_KEYS = ("lidar", "velocity", "detected", "level", "bearing", "bearing_age", "time")


def bearings_only(observation: Observation) -> Observation:
    """Keep only the entries that are available to a robot without a map or a known position.

    Args:
        observation: Observation of `PatrolEnv`, each entry of shape (..., n) with any leading axes.

    Returns:
        `lidar`, `velocity`, `detected`, `level`, `bearing_age` and `time` unchanged, and `bearing` as cos and sin in
        the robot's frame: (1, 0) is ahead, (0, 1) is to the left, and zeros stand for no bearing so far.
    """
    kept = {key: observation[key] for key in BEARINGS_ONLY_KEYS}
    pose, bearing = observation["pose"], observation["bearing"]
    cos, sin, ahead, left = pose[..., 2], pose[..., 3], bearing[..., 0], bearing[..., 1]
    turned = np.stack([cos * ahead + sin * left, cos * left - sin * ahead], axis=-1)
    kept["bearing"] = np.clip(turned, -1.0, 1.0, dtype=np.float32)
    return kept


def bearings_only_space(whole: spaces.Space[Any]) -> spaces.Dict:
    """Return the space of the observations that `bearings_only` returns, given the original space."""
    assert isinstance(whole, spaces.Dict)
    return spaces.Dict({key: whole[key] for key in BEARINGS_ONLY_KEYS})


class Flattener:
    """Function that flattens observations to vectors, each entry scaled to [-1, 1] by the bounds of its space.

    Args:
        whole: Space of one observation, a `Dict` of one-dimensional boxes.

    Attributes:
        names: `key[index]` of each entry of the vector, in the order of the space's keys.
        space: Space of the vectors.
    """

    def __init__(self, whole: spaces.Space[Any]) -> None:
        assert isinstance(whole, spaces.Dict)
        self._keys, flat = tuple(whole.spaces), spaces.flatten_space(whole)
        assert isinstance(flat, spaces.Box)
        self.names = tuple(f"{key}[{index}]" for key in whole for index in range(spaces.flatdim(whole[key])))
        self._middle, self._half = 0.5 * (flat.low + flat.high), 0.5 * (flat.high - flat.low)
        self.space = spaces.Box(-1.0, 1.0, flat.shape)

    def __call__(self, observation: Observation) -> NDArray[np.float32]:
        """Flatten observations with entries of shape (..., n) to vectors of shape (..., n_entries)."""
        flat = (np.concatenate([observation[key] for key in self._keys], axis=-1) - self._middle) / self._half
        return np.clip(flat, -1.0, 1.0, dtype=np.float32)


class BearingsOnly(TransformObservation[Observation, Action, Observation]):
    """Wrapper that applies `bearings_only`.

    Args:
        env: A `PatrolEnv`, possibly wrapped.
    """

    def __init__(self, env: gymnasium.Env[Observation, Action]) -> None:
        RecordConstructorArgs.__init__(self)
        space: Any = bearings_only_space(env.observation_space)
        super().__init__(env, bearings_only, space)


class FlatObservation(TransformObservation[NDArray[np.float32], Action, Observation]):
    """Wrapper that applies `Flattener`.

    Args:
        env: A `PatrolEnv`, possibly wrapped, for instance in `BearingsOnly`.

    Attributes:
        names: `key[index]` of each entry of the vector.
    """

    def __init__(self, env: gymnasium.Env[Observation, Action]) -> None:
        RecordConstructorArgs.__init__(self)
        flatten = Flattener(env.observation_space)
        super().__init__(env, flatten, flatten.space)
        self.names = flatten.names
