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
    """Dead reckoning: path length from the encoders, heading from the gyro; for each robot its own.

    Args:
        config: What makes it drift.
        n_robots: How many robots.

    Attributes:
        pose: Since the start, shape (n_robots, 3): x m, y m, yaw in (-pi, pi].
    """

    def __init__(self, config: OdometryConfig, n_robots: int = 1) -> None:
        self._config = config
        self.pose = np.zeros((n_robots, 3))
        self._metres_per_metre = np.ones(n_robots)
        self._bias_radps = np.zeros(n_robots)
        self._noise_rad_per_sqrt_s = np.radians(config.gyro_noise_deg_per_sqrt_min) / np.sqrt(60.0)

    def start(self, row: int, pose: FloatArray, rng: np.random.Generator) -> None:
        """Start one robot at a pose (3,), with errors of its own."""
        scale, bias = rng.standard_normal(2)
        self.pose[row] = pose
        self._metres_per_metre[row] = 1.0 + self._config.wheel_radius_error * scale
        self._bias_radps[row] = np.radians(self._config.gyro_bias_deg_per_min) / 60.0 * bias

    def move(self, rolled_m: FloatArray, turned_rad: FloatArray, elapsed_s: float, normal: FloatArray) -> None:
        """Add what happened in `elapsed_s`.

        Args:
            rolled_m: Mean path of the two wheels' rims, shape (n_robots,); forward is positive.
            turned_rad: Change of the true heading, an ideal gyro's integral, shape (n_robots,).
            elapsed_s: Seconds.
            normal: Standard normal draws, shape (n_robots,).
        """
        from envs.motion import reckon  # here, so that a command line help need not wait for the compiler

        turned = turned_rad + self._bias_radps * elapsed_s + (self._noise_rad_per_sqrt_s * elapsed_s**0.5) * normal
        self.pose = reckon(self.pose, rolled_m * self._metres_per_metre, turned)
        self.pose[:, 2] = wrap(self.pose[:, 2])
