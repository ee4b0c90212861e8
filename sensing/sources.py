"""What radiates: discharges, and impulsive interferers from elsewhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


NANOSECONDS = 9
"""Digits of a second to which interval and shot are compared: a shot on the edge of two intervals is fired once."""


@dataclass(frozen=True, kw_only=True)
class DischargeSource:
    """A point that radiates pulses equally in all directions: at random times (a Poisson process), or a few shots.

    Attributes:
        name: How reports call it.
        position_m: Shape (3,), world frame.
        amplitude_v: Peak that one pulse would have in a unit-gain channel 1 m away, > 0.
        pulse_rate_hz: Mean number of pulses per second, >= 0.
        n_shots: How many pulses a discharge gun fires, evenly at the pulse rate; None for a source that goes on.
        first_shot_s: When it fires the first.
    """

    name: str
    position_m: FloatArray
    amplitude_v: float
    pulse_rate_hz: float
    n_shots: int | None = None
    first_shot_s: float = 0.0

    def emissions(self, start_s: float, duration_s: float, rng: np.random.Generator) -> FloatArray:
        """When it radiates within `duration_s` from `start_s` on, seconds, shape (n_pulses,)."""
        if self.n_shots is None:
            return start_s + duration_s * rng.random(rng.poisson(self.pulse_rate_hz * duration_s))
        shot_s = np.round(self.first_shot_s + np.arange(self.n_shots) / self.pulse_rate_hz, NANOSECONDS)
        end_s = round(start_s + duration_s, NANOSECONDS)
        return shot_s[(shot_s >= round(start_s, NANOSECONDS)) & (shot_s < end_s)]
