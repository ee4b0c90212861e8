"""How much is left in the robot's battery."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, PositiveFloat


class BatteryConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """What the battery holds, and what takes from it all the time.

    The defaults are assumed: a 24 V, 20 Ah pack, and a fast digitiser with its computer.
    """

    capacity_wh: PositiveFloat = 480.0
    idle_w: PositiveFloat = 80.0


class Battery:
    """Counts what is taken, for each robot.

    Args:
        config: What it holds.
        n_robots: How many robots.

    Attributes:
        used_wh: Taken so far, shape (n_robots,).
        left: Share that is left, in [0, 1], shape (n_robots,).
    """

    def __init__(self, config: BatteryConfig, n_robots: int = 1) -> None:
        from envs.motion import drain  # here, so that a command line help need not wait for the compiler

        self._drain = drain
        self._config = config
        self.used_wh, self.left = np.zeros(n_robots), np.ones(n_robots)

    def charge(self, rows: NDArray[np.intp]) -> None:
        """Fill up the batteries of some robots."""
        self.used_wh[rows], self.left[rows] = 0.0, 1.0

    def drain(self, motor_power_w: NDArray[np.float64], elapsed_s: float) -> None:
        """Take what motors, shape (n_robots,), and electronics need for a while."""
        hours = elapsed_s / 3600.0
        self._drain(self.used_wh, self.left, self._config.capacity_wh, self._config.idle_w + motor_power_w, hours)
