"""Where the robot is by its own wheels and gyro alone: it drifts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, NonNegativeFloat

from dirmusic.angles import wrap

FloatArray = NDArray[np.float64]


class OdometryConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """Standard deviations of what makes odometry drift; defaults assumed, as of magnetic encoders and a MEMS gyro."""

    wheel_radius_error: NonNegativeFloat = 0.001
    """Share by which the wheels are larger or smaller than the robot believes, drawn once."""
    gyro_bias_deg_per_min: NonNegativeFloat = 0.05
    """Drawn once: what is left after the gyro was zeroed at the dock."""
    gyro_noise_deg_per_sqrt_min: NonNegativeFloat = 0.1
    """Angle random walk."""


class Odometry:
    """Dead reckoning: path length from the encoders, heading from the gyro.

    Args:
        config: What makes it drift.
        rng: All randomness.
        pose: Where it starts, x m, y m, yaw rad.
    """

    def __init__(self, config: OdometryConfig, rng: np.random.Generator, pose: FloatArray) -> None:
        self._rng = rng
        scale, bias = rng.standard_normal(2)
        self._metres_per_metre = 1.0 + config.wheel_radius_error * scale
        self._bias_radps = np.radians(config.gyro_bias_deg_per_min) / 60.0 * bias
        self._noise_rad_per_sqrt_s = np.radians(config.gyro_noise_deg_per_sqrt_min) / np.sqrt(60.0)
        self.pose: FloatArray = pose.copy()

    def move(self, rolled_m: float, turned_rad: float, elapsed_s: float) -> FloatArray:
        """Add what happened in `elapsed_s`.

        Args:
            rolled_m: Mean path of the two wheels' rims; forward is positive.
            turned_rad: Change of the true heading: an ideal gyro's integral.
            elapsed_s: Seconds.

        Returns:
            Pose since the start, shape (3,): x m, y m, yaw in (-pi, pi].
        """
        noise_rad = self._noise_rad_per_sqrt_s * np.sqrt(elapsed_s) * self._rng.standard_normal()
        turned = turned_rad + self._bias_radps * elapsed_s + noise_rad
        rolled = rolled_m * self._metres_per_metre
        x, y, yaw = self.pose
        along = yaw + 0.5 * turned
        self.pose = np.array([x + rolled * np.cos(along), y + rolled * np.sin(along), wrap(yaw + turned)])
        return self.pose
