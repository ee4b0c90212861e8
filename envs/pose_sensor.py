"""What a localised robot believes of its pose: the truth, plus an error that lasts for seconds."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, NonNegativeFloat, PositiveFloat

FloatArray = NDArray[np.float64]


class PoseSensorConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """Standard deviations of the pose and how long its error lasts; defaults assumed, as of a lidar in a known map."""

    position_std_m: NonNegativeFloat = 0.05
    heading_std_deg: NonNegativeFloat = 0.5
    correlation_s: PositiveFloat = 5.0


class PoseSensor:
    """First-order Gauss-Markov error on x, y and yaw, for each robot its own.

    Args:
        config: Spread and correlation time.
        n_robots: How many robots.

    Attributes:
        error: Of the last reading, shape (n_robots, 3); NaN before the first.
    """

    N_DRAWS = 3
    """Standard normal draws that a reading of one robot takes."""

    def __init__(self, config: PoseSensorConfig, n_robots: int = 1) -> None:
        from envs.motion import believed_poses  # here, so that a command line help need not wait for the compiler

        self._believed_poses = believed_poses
        self._std = np.array([config.position_std_m, config.position_std_m, np.radians(config.heading_std_deg)])
        self._correlation_s = config.correlation_s
        self.error = np.full((n_robots, 3), np.nan)

    def start(self, rows: NDArray[np.intp]) -> None:
        """Forget the error of some robots: their next reading is the first."""
        self.error[rows] = np.nan

    def read(self, true_pose: FloatArray, elapsed_s: float, normal: FloatArray) -> FloatArray:
        """Believed poses, `elapsed_s` after the last reading.

        Args:
            true_pose: x m, y m, yaw rad, shape (n_robots, 3).
            elapsed_s: Seconds.
            normal: Draws, shape (n_robots, N_DRAWS).

        Returns:
            Shape (n_robots, 3), yaw in (-pi, pi].
        """
        kept = math.exp(-elapsed_s / self._correlation_s)
        return self._believed_poses(true_pose, self.error, kept, self._std, normal)
