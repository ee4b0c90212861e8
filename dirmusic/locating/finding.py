"""A located discharge."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dirmusic.locating.ellipse import ellipse95

FloatArray = NDArray[np.float64]
State = Literal["candidate", "confirmed", "outside", "ghost"]


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A discharge as located so far.

    Attributes:
        id: Stays with it through the mission; counts from 1.
        state: `candidate` until the rules confirm it; `outside` where its 95 % ellipse lies beyond the fence; `ghost`
            where nothing comes from it though the robot was near and in sight of it.
        position_m: Shape (3,), world frame.
        covariance_m2: Shape (3, 3), the array's common error included.
        n_bearings: Pulses that belong to it; where there is a map, those detected in sight of it.
        first_detected_s: When its first pulse came.
        last_detected_s: When its latest pulse came, in sight of it or not.
        confirmed_s: When it was first confirmed, or None.
        aperture_rad: Angle on plan over which its lines of sight spread, seen from the finding.
        nearest_m: Least distance on plan from which it was detected.
        level_db: Strength that its louder pulses would have 1 m away, dB over 1 V; NaN until it was detected in sight.

    Raises:
        ValueError: If the id is below 1, if position or covariance are not finite or of another shape, or if the
            covariance is not positive definite.
    """

    id: int
    state: State
    position_m: FloatArray
    covariance_m2: FloatArray
    n_bearings: int
    first_detected_s: float
    last_detected_s: float
    confirmed_s: float | None
    aperture_rad: float
    nearest_m: float
    level_db: float

    def __post_init__(self) -> None:
        """Refuse an id below 1, which would be read as "no finding", and impossible positions and covariances."""
        if self.id < 1:
            raise ValueError(f"finding: `id` must be at least 1, got {self.id}")
        for name, shape in (("position_m", (3,)), ("covariance_m2", (3, 3))):
            value = getattr(self, name)
            if np.shape(value) != shape or not np.isfinite(value).all():
                raise ValueError(f"finding {self.id}: `{name}` must be finite with shape {shape}, got {value!r}")
        if np.linalg.eigvalsh(self.covariance_m2)[0] <= 0:
            raise ValueError(
                f"finding {self.id}: `covariance_m2` must be positive definite, got {self.covariance_m2!r}"
            )

    @cached_property
    def semi_major_m(self) -> float:
        """Longer half-axis of the 95 % ellipse, on plan."""
        return ellipse95(self.covariance_m2[:2, :2]).semi_major_m

    @property
    def height_std_m(self) -> float:
        """Standard deviation of its height."""
        return float(np.sqrt(self.covariance_m2[2, 2]))
