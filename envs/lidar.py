"""The planar lidar's noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, NonNegativeFloat

FloatArray = NDArray[np.float64]


class LidarConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """Standard deviation of a range; the default is assumed, as of a small time-of-flight scanner."""

    range_std_m: NonNegativeFloat = 0.02


def measured(true_m: FloatArray, reach_m: float, config: LidarConfig, normal: FloatArray) -> FloatArray:
    """Ranges as the lidar tells them: noise on what it hits, nothing beyond its reach; all of one shape.

    Args:
        true_m: Ranges.
        reach_m: Of the lidar; where nothing is hit it tells this.
        config: Its noise.
        normal: Standard normal draws.
    """
    noisy = np.minimum(np.maximum(true_m + config.range_std_m * normal, 0.0), reach_m)
    return np.where(true_m < reach_m, noisy, reach_m)
