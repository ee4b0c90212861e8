"""A located discharge."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dirmusic.locating.ellipse import ellipse95

FloatArray = NDArray[np.float64]
State = Literal["candidate", "confirmed", "outside", "echo"]


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A discharge as located so far.

    Attributes:
        id: Stays with it through the mission; counts from 1.
        state: `candidate` until the rules confirm it; `outside` where its 95 % ellipse lies beyond the fence; `echo`
            where nothing comes from it though the robot was near and in sight of it.
        position_m: Shape (2,), world frame.
        covariance_m2: Shape (2, 2), the array's common error included.
        n_bearings: Pulses that belong to it; where there is a map, those detected in sight of it.
        first_detected_s: When its first pulse came.
        fixed_s: When it was first confirmed, or None.
        aperture_rad: Angle over which its lines of sight spread, seen from the finding.
        nearest_m: Least distance from which it was detected.
        level_db: Strength that its louder pulses would have 1 m away, dB over 1 V; NaN until it was detected in sight.
    """

    id: int
    state: State
    position_m: FloatArray
    covariance_m2: FloatArray
    n_bearings: int
    first_detected_s: float
    fixed_s: float | None
    aperture_rad: float
    nearest_m: float
    level_db: float

    @property
    def semi_major_m(self) -> float:
        """Longer half-axis of the 95 % ellipse."""
        return ellipse95(self.covariance_m2).semi_major_m
