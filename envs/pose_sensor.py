"""What a localised robot believes of its pose: the truth, plus an error that lasts for seconds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, NonNegativeFloat, PositiveFloat

from dirmusic.angles import wrap

FloatArray = NDArray[np.float64]


class PoseSensorConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """Standard deviations of the pose and how long its error lasts; defaults assumed, as of a lidar in a known map."""

    position_std_m: NonNegativeFloat = 0.05
    heading_std_deg: NonNegativeFloat = 0.5
    correlation_s: PositiveFloat = 5.0


class PoseSensor:
    """First-order Gauss-Markov error on x, y and yaw.

    Args:
        config: Spread and correlation time.
        rng: All randomness.
    """

    def __init__(self, config: PoseSensorConfig, rng: np.random.Generator) -> None:
        self._std = np.array([config.position_std_m, config.position_std_m, np.radians(config.heading_std_deg)])
        self._correlation_s = config.correlation_s
        self._rng = rng
        self._error = self._std * rng.standard_normal(3)

    def read(self, true_pose: FloatArray, elapsed_s: float) -> FloatArray:
        """Believed pose (3,), x m, y m, yaw rad in (-pi, pi], `elapsed_s` after the last reading."""
        kept = np.exp(-elapsed_s / self._correlation_s)
        self._error = kept * self._error + np.sqrt(1 - kept**2) * self._std * self._rng.standard_normal(3)
        believed = true_pose + self._error
        believed[2] = wrap(believed[2])
        return believed
