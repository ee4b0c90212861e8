"""Where the robot is by its own wheels and gyro alone: it drifts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, NonNegativeFloat

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
        wheel_radius_m: That the robot believes in.
        n_robots: How many robots.

    Attributes:
        pose: Since the start, shape (n_robots, 3): x m, y m, yaw in (-pi, pi].
    """

    def __init__(self, config: OdometryConfig, wheel_radius_m: float, n_robots: int = 1) -> None:
        from envs.motion import reckon  # here, so that a command line help need not wait for the compiler

        self._reckon = reckon
        self._config, self._wheel_radius_m = config, wheel_radius_m
        self.pose = np.zeros((n_robots, 3))
        self._wheels_rad, self._yaw_rad = np.zeros((n_robots, 2)), np.zeros(n_robots)
        self._metres_per_radian = np.full(n_robots, wheel_radius_m)
        self._bias_radps = np.zeros(n_robots)
        self._noise_rad_per_sqrt_s = float(np.radians(config.gyro_noise_deg_per_sqrt_min)) / 60.0**0.5

    def start(self, row: int, pose: FloatArray, rng: np.random.Generator) -> None:
        """Start one robot at a pose (3,), with errors of its own; its next reading is the first."""
        scale, bias = rng.standard_normal(2)
        self.pose[row] = pose
        self._metres_per_radian[row] = self._wheel_radius_m * (1.0 + self._config.wheel_radius_error * scale)
        self._bias_radps[row] = np.radians(self._config.gyro_bias_deg_per_min) / 60.0 * bias

    def move(self, wheels_rad: FloatArray, yaw_rad: FloatArray, elapsed_s: float, normal: FloatArray) -> None:
        """Add what happened in `elapsed_s`.

        Args:
            wheels_rad: Angles of left and right wheel, shape (n_robots, 2).
            yaw_rad: True heading, shape (n_robots,): its change is an ideal gyro's integral.
            elapsed_s: Seconds.
            normal: Standard normal draws, shape (n_robots,).
        """
        self.pose = self._reckon(
            self.pose,
            wheels_rad,
            self._wheels_rad,
            yaw_rad,
            self._yaw_rad,
            self._metres_per_radian,
            self._bias_radps * elapsed_s,
            self._noise_rad_per_sqrt_s * elapsed_s**0.5,
            normal,
        )
        self._wheels_rad, self._yaw_rad = wheels_rad, yaw_rad
