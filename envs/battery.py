"""How much is left in the robot's battery."""

from __future__ import annotations

from pydantic import BaseModel, PositiveFloat


class BatteryConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """What the battery holds, and what takes from it all the time.

    The defaults are assumed: a 24 V, 20 Ah pack, and a fast digitiser with its computer.
    """

    capacity_wh: PositiveFloat = 480.0
    idle_w: PositiveFloat = 80.0
