"""The planar lidar's noise."""

from __future__ import annotations

from pydantic import BaseModel, NonNegativeFloat


class LidarConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """Standard deviation of a range; the default is assumed, as of a small time-of-flight scanner."""

    range_std_m: NonNegativeFloat = 0.02
