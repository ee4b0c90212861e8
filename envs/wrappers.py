"""Other faces of the same observation, for learners."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from envs.patrol import Observation

Action = NDArray[np.float32]


class BearingsOnly(
    gymnasium.ObservationWrapper[Observation, Action, Observation], gymnasium.utils.RecordConstructorArgs
):
    """What a robot observes that knows neither map nor place: bearings as it faces them, lidar, and its own motion.

    Of PDPatrol's observation it keeps `lidar`, `velocity`, `heard`, `level`, `bearing_age` and `time_left`; `bearing`
    becomes cos and sin in the robot's frame: (1, 0) is ahead, (0, 1) to the left. What tells the place (`pose`,
    `waypoint`) and the antennas (`strengths`, `spectrum`) is left out.

    Args:
        env: PDPatrol.
    """

    KEYS = ("lidar", "velocity", "heard", "level", "bearing", "bearing_age", "time_left")

    def __init__(self, env: gymnasium.Env[Observation, Action]) -> None:
        gymnasium.utils.RecordConstructorArgs.__init__(self)
        super().__init__(env)
        whole = env.observation_space
        assert isinstance(whole, spaces.Dict)
        self.observation_space = spaces.Dict(  # pyright: ignore[reportAttributeAccessIssue]
            {key: whole[key] for key in self.KEYS}
        )

    def observation(self, observation: Observation) -> Observation:
        """The kept entries, the bearing turned into the robot's frame."""
        kept = {key: observation[key] for key in self.KEYS}
        (cos, sin), (ahead, left) = observation["pose"][2:], observation["bearing"]
        turned = np.array([cos * ahead + sin * left, cos * left - sin * ahead], dtype=np.float32)
        kept["bearing"] = np.clip(turned, -1.0, 1.0)
        return kept


class FlatObservation(
    gymnasium.ObservationWrapper[NDArray[np.float32], Action, Observation], gymnasium.utils.RecordConstructorArgs
):
    """One vector in [-1, 1] of all entries, each scaled by the bounds of its space, in the order of the space's keys.

    Args:
        env: PDPatrol, or `BearingsOnly` of it.

    Attributes:
        names: `key[index]` of each entry.
    """

    def __init__(self, env: gymnasium.Env[Observation, Action]) -> None:
        gymnasium.utils.RecordConstructorArgs.__init__(self)
        super().__init__(env)
        whole = env.observation_space
        assert isinstance(whole, spaces.Dict)
        boxes: dict[str, Any] = dict(whole.spaces)
        self._keys = tuple(boxes)
        self.names = tuple(f"{key}[{index}]" for key, box in boxes.items() for index in range(box.shape[0]))
        low, high = (np.concatenate([getattr(box, end) for box in boxes.values()]) for end in ("low", "high"))
        self._middle, self._half = 0.5 * (low + high), 0.5 * (high - low)
        self.observation_space = spaces.Box(-1.0, 1.0, (len(self.names),), np.float32)

    def observation(self, observation: Observation) -> NDArray[np.float32]:
        """All entries in one vector."""
        flat = (np.concatenate([observation[key] for key in self._keys]) - self._middle) / self._half
        return np.clip(flat, -1.0, 1.0, dtype=np.float32)
