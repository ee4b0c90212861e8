"""How much is left in the robot's battery."""

from __future__ import annotations

from pydantic import BaseModel, PositiveFloat


class BatteryConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """What the battery holds, and what takes from it all the time.

    The defaults are assumed: a 24 V, 20 Ah pack, and a fast digitiser with its computer.
    """

    capacity_wh: PositiveFloat = 480.0
    idle_w: PositiveFloat = 80.0


class Battery:
    """Counts what is taken.

    Args:
        config: What it holds.
    """

    def __init__(self, config: BatteryConfig) -> None:
        self._config = config
        self.used_wh = 0.0

    @property
    def left(self) -> float:
        """Share that is left, in [0, 1]."""
        return max(1.0 - self.used_wh / self._config.capacity_wh, 0.0)

    def drain(self, motor_power_w: float, elapsed_s: float) -> None:
        """Take what motors and electronics need for a while."""
        self.used_wh += (self._config.idle_w + motor_power_w) * elapsed_s / 3600.0
