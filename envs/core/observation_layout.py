"""The entries of an observation: their names, their bounds, and where each lies."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from envs.core.progress import MAX_BEARING_AGE_S
from robot_models.robots import LIDAR_BEAMS, LIDAR_RANGE_M, MAX_SPEED_MPS, MAX_YAW_RATE_RADPS

Float32Array = NDArray[np.float32]
Bounds = dict[str, tuple[Float32Array, Float32Array]]

SPECTRUM_AZIMUTHS_RAD = np.radians(np.arange(0.0, 360.0, 5.0))
"""Array-frame azimuths of the observed pseudo-spectrum."""

LEVEL_DECADES = 5.0
"""Highest level told, decades over the noise of one sample."""

POSE_MARGIN_M = 5.0
"""How far outside the yard a believed pose may lie."""


def observation_bounds(yard_m: tuple[float, float], n_elements: int, time_limit_s: float) -> Bounds:
    """Lowest and highest values of the entries of one robot, key by key in the order of the observation.

    Args:
        yard_m: Its size.
        n_elements: Of the array.
        time_limit_s: Of an episode.
    """
    size = np.asarray(yard_m)
    fastest = 2.0 * np.array([MAX_SPEED_MPS, MAX_YAW_RATE_RADPS])

    def box(lowest: ArrayLike, highest: ArrayLike, n: int) -> tuple[Float32Array, Float32Array]:
        low, high = (np.array(np.broadcast_to(end, n), dtype=np.float32) for end in (lowest, highest))
        return low, high

    return {
        "pose": box([-POSE_MARGIN_M, -POSE_MARGIN_M, -1, -1], [*(size + POSE_MARGIN_M), 1, 1], 4),
        "lidar": box(0, LIDAR_RANGE_M, LIDAR_BEAMS),
        "velocity": box(-fastest, fastest, 2),
        "heard": box(0, 1, 1),
        "strengths": box(0, 1, n_elements),
        "level": box(0, LEVEL_DECADES, 1),
        "spectrum": box(0, 1, SPECTRUM_AZIMUTHS_RAD.size),
        "bearing": box(-1, 1, 2),
        "bearing_age": box(0, MAX_BEARING_AGE_S, 1),
        "waypoint": box(0, size, 2),
        "time_left": box(0, time_limit_s, 1),
    }


class ObservationLayout:
    """Takes observations apart.

    Args:
        bounds: Of their entries.

    Attributes:
        low: Of all entries one after the other, shape (n_entries,).
        high: Likewise.
    """

    def __init__(self, bounds: Bounds) -> None:
        low, high = zip(*bounds.values(), strict=True)
        self.low, self.high = np.concatenate(low), np.concatenate(high)
        ends = np.cumsum([entry.size for entry in low]).tolist()
        places = [(..., slice(first, end)) for first, end in zip([0, *ends[:-1]], ends, strict=True)]
        self._places = list(zip(bounds, places, strict=True))

    def parts(self, shown: Float32Array) -> dict[str, Float32Array]:
        """An observation key by key, from all its entries along the last axis: of one robot, or a row for each."""
        return {key: shown[place] for key, place in self._places}
