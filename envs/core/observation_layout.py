"""The observation: its entries by name, their bounds, and where each lies."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pdpatrol.envs.core.progress import MAX_BEARING_AGE_S
from pdpatrol.robot_models.sensors import LIDAR_BEAMS, LIDAR_RANGE_M

Float32Array = NDArray[np.float32]

SPECTRUM_AZIMUTHS_RAD = np.radians(np.arange(0.0, 360.0, 5.0))
"""Array-frame azimuths of the observed pseudo-spectrum."""

LEVEL_DECADES = 5.0
"""Highest observed level, decades over the noise of one sample."""

POSE_MARGIN_M = 5.0
"""How far outside the yard a believed pose may lie."""


class Entries(NamedTuple):
    """Something for each entry of the observation, in the order in which they lie; `PatrolEnv` says what they mean.

    As bounds, pairs of the lowest and the highest values, each of shape (size,); as places, the numbers of their first
    values.
    """

    pose: Any
    lidar: Any
    velocity: Any
    heard: Any
    strengths: Any
    level: Any
    spectrum: Any
    bearing: Any
    bearing_age: Any
    waypoint: Any
    time: Any


def observation_bounds(
    yard_m: tuple[float, float], limits: tuple[float, float], n_elements: int, time_limit_s: float
) -> Entries:
    """Lowest and highest values of the entries of one robot.

    Args:
        yard_m: Size of the yard.
        limits: Greatest speed, m/s, and greatest yaw rate, rad/s, that can be commanded.
        n_elements: Of the array.
        time_limit_s: Of an episode.
    """
    size = np.asarray(yard_m)
    fastest = 2.0 * np.array(limits)

    def box(lowest: ArrayLike, highest: ArrayLike, n: int) -> tuple[Float32Array, Float32Array]:
        low, high = (np.array(np.broadcast_to(end, n), dtype=np.float32) for end in (lowest, highest))
        return low, high

    return Entries(
        pose=box([-POSE_MARGIN_M, -POSE_MARGIN_M, -1, -1], [*(size + POSE_MARGIN_M), 1, 1], 4),
        lidar=box(0, LIDAR_RANGE_M, LIDAR_BEAMS),
        velocity=box(-fastest, fastest, 2),
        heard=box(0, 1, 1),
        strengths=box(0, 1, n_elements),
        level=box(0, LEVEL_DECADES, 1),
        spectrum=box(0, 1, SPECTRUM_AZIMUTHS_RAD.size),
        bearing=box(-1, 1, 2),
        bearing_age=box(0, MAX_BEARING_AGE_S, 1),
        waypoint=box(0, size, 2),
        time=box(0, time_limit_s, 1),
    )


class ObservationLayout:
    """Where the entries of an observation lie.

    Args:
        bounds: Of the entries.

    Attributes:
        bounds: As given.
        places: Number of the first value of each entry.
        low: Lowest values of all entries one after the other, shape (n_entries,).
        high: Highest values, shape (n_entries,).
    """

    def __init__(self, bounds: Entries) -> None:
        self.bounds = bounds
        low, high = zip(*bounds, strict=True)
        self.low, self.high = np.concatenate(low), np.concatenate(high)
        ends = np.cumsum([entry.size for entry in low]).tolist()
        self.places = Entries(0, *ends[:-1])
        self._slices = [
            (name, (..., slice(first, end)))
            for (name, first), end in zip(self.places._asdict().items(), ends, strict=True)
        ]

    def parts(self, observation: Float32Array) -> dict[str, Float32Array]:
        """An observation by name, from all its entries along the last axis: of one robot, or a row for each."""
        return {name: observation[part] for name, part in self._slices}
