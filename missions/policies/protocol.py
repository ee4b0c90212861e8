"""What a policy is: policy(observation, findings, site_map) -> action, and how it reads an observation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from dirmusic import Finding
from envs.patrol_env import Observation
from missions.driving.site_map import SiteMap

FloatArray = NDArray[np.float64]
Action = NDArray[np.float32]


class Policy(Protocol):
    """What the runner drives."""

    phase: str
    """What it is doing, in a word or two."""

    unreachable: tuple[int, ...]
    """Waypoints it has given up, numbered from 1: there was no way to them, or they took too long."""

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """The next action in [-1, 1]^2, or None to end the mission."""
        ...


@runtime_checkable
class SeesTruth(Protocol):
    """Mark of a policy that the runner tells the truth."""

    def reveal(self, truth: dict[str, Any]) -> None:
        """Take in `info["truth"]`."""
        ...


def believed_pose(observation: Observation) -> FloatArray:
    """X and y in metres and yaw in radians, world frame, shape (3,)."""
    x, y, cos, sin = observation["pose"].astype(np.float64)
    return np.array([x, y, np.arctan2(sin, cos)])


def time_of(observation: Observation, site_map: SiteMap) -> float:
    """Seconds since the mission began."""
    return site_map.task.time_limit_s - float(observation["time_left"][0])
