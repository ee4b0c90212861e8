"""Other faces of the same observation, for learners; each is a function of rows, and a wrapper of one environment."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from pdpatrol.envs.patrol_env import Observation

Action = NDArray[np.float32]

BEARINGS_ONLY_KEYS = ("lidar", "velocity", "heard", "level", "bearing", "bearing_age", "time")


def bearings_only(observation: Observation) -> Observation:
    """What a robot observes that knows neither map nor place: bearings as it faces them, lidar, and its own motion.

    Args:
        observation: PDPatrol's, each entry of shape (..., n); leading axes batch, such as the rows of the vector
            environment.

    Returns:
        `lidar`, `velocity`, `heard`, `level`, `bearing_age` and `time` as they are, and `bearing` as cos and sin
        in the robot's frame: (1, 0) is ahead, (0, 1) to the left, zeros before the first.
    """
    kept = {key: observation[key] for key in BEARINGS_ONLY_KEYS}
    pose, bearing = observation["pose"], observation["bearing"]
    cos, sin, ahead, left = pose[..., 2], pose[..., 3], bearing[..., 0], bearing[..., 1]
    turned = np.stack([cos * ahead + sin * left, cos * left - sin * ahead], axis=-1)
    kept["bearing"] = np.clip(turned, -1.0, 1.0, dtype=np.float32)
    return kept


def bearings_only_space(whole: spaces.Space[Any]) -> spaces.Dict:
    """The space of what `bearings_only` makes of one observation of the space `whole`."""
    assert isinstance(whole, spaces.Dict)
    return spaces.Dict({key: whole[key] for key in BEARINGS_ONLY_KEYS})


class Flattener:
    """All entries of an observation in one vector, each scaled to [-1, 1] by the bounds of its space.

    Args:
        whole: A `Dict` of boxes of one axis: the space of one observation.

    Attributes:
        names: `key[index]` of each entry of the vector, in the order of the space's keys.
        space: Of the vector.
    """

    def __init__(self, whole: spaces.Space[Any]) -> None:
        assert isinstance(whole, spaces.Dict)
        boxes: dict[str, Any] = dict(whole.spaces)
        self._keys = tuple(boxes)
        self.names = tuple(f"{key}[{index}]" for key, box in boxes.items() for index in range(box.shape[0]))
        low, high = (np.concatenate([getattr(box, end) for box in boxes.values()]) for end in ("low", "high"))
        self._middle, self._half = 0.5 * (low + high), 0.5 * (high - low)
        self.space = spaces.Box(-1.0, 1.0, (len(self.names),), np.float32)

    def __call__(self, observation: Observation) -> NDArray[np.float32]:
        """The vector, shape (..., n_entries), of an observation with entries of shape (..., n); leading axes batch."""
        flat = (np.concatenate([observation[key] for key in self._keys], axis=-1) - self._middle) / self._half
        return np.clip(flat, -1.0, 1.0, dtype=np.float32)


class BearingsOnly(
    gymnasium.ObservationWrapper[Observation, Action, Observation], gymnasium.utils.RecordConstructorArgs
):
    """PDPatrol as `bearings_only` tells it: without `pose`, `waypoint`, `strengths` and `spectrum`.

    Args:
        env: PDPatrol.
    """

    def __init__(self, env: gymnasium.Env[Observation, Action]) -> None:
        gymnasium.utils.RecordConstructorArgs.__init__(self)
        super().__init__(env)
        self.observation_space = bearings_only_space(env.observation_space)  # pyright: ignore[reportAttributeAccessIssue]

    def observation(self, observation: Observation) -> Observation:
        """The kept entries, the bearing turned into the robot's frame."""
        return bearings_only(observation)


class FlatObservation(
    gymnasium.ObservationWrapper[NDArray[np.float32], Action, Observation], gymnasium.utils.RecordConstructorArgs
):
    """PDPatrol with one vector in [-1, 1] for an observation; see `Flattener`.

    Args:
        env: PDPatrol, or `BearingsOnly` of it.

    Attributes:
        names: `key[index]` of each entry.
    """

    def __init__(self, env: gymnasium.Env[Observation, Action]) -> None:
        gymnasium.utils.RecordConstructorArgs.__init__(self)
        super().__init__(env)
        self._flatten = Flattener(env.observation_space)
        self.names, self.observation_space = self._flatten.names, self._flatten.space

    def observation(self, observation: Observation) -> NDArray[np.float32]:
        """All entries in one vector."""
        return self._flatten(observation)
