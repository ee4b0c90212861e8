"""From source to element: spreading and delay along the direct path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dirmusic.gain_delay import SPEED_OF_LIGHT_MPS

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Paths:
    """Direct paths from one source to each element; every array has shape (n_elements,).

    Attributes:
        spreading: Amplitude over that at 1 m: one over the range in metres, in three dimensions.
        delay_s: Travel time.
        azimuth_rad: Horizontal direction in which each element sees the source, world frame.
        elevation_rad: Elevation at which it does.
    """

    spreading: FloatArray
    delay_s: FloatArray
    azimuth_rad: FloatArray
    elevation_rad: FloatArray


def direct_paths(elements_m: FloatArray, source_m: FloatArray) -> Paths:
    """Free-space paths from `source_m` (3,) to elements (n_elements, 3), world frame, metres."""
    sight = source_m - elements_m
    range_m = np.linalg.norm(sight, axis=-1)
    return Paths(
        spreading=1.0 / range_m,
        delay_s=range_m / SPEED_OF_LIGHT_MPS,
        azimuth_rad=np.arctan2(sight[:, 1], sight[:, 0]),
        elevation_rad=np.arctan2(sight[:, 2], np.hypot(sight[:, 0], sight[:, 1])),
    )
