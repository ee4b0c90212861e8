"""What a localised robot believes of its pose: the truth, plus an error that lasts for seconds."""

from __future__ import annotations

from pydantic import BaseModel, NonNegativeFloat, PositiveFloat


class PoseSensorConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """Standard deviations of the pose and how long its error lasts; defaults assumed, as of a lidar in a known map."""

    position_std_m: NonNegativeFloat = 0.05
    heading_std_deg: NonNegativeFloat = 0.5
    correlation_s: PositiveFloat = 5.0
