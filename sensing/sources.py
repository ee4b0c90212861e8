"""What radiates: discharges, and impulsive interferers from elsewhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class DischargeSource:
    """A point that radiates pulses at random times (a Poisson process) and equally in all directions.

    Attributes:
        name: How reports call it.
        position_m: Shape (3,), world frame.
        amplitude_v: Peak that one pulse would have in a unit-gain channel 1 m away, > 0.
        pulse_rate_hz: Mean number of pulses per second, >= 0.
    """

    name: str
    position_m: FloatArray
    amplitude_v: float
    pulse_rate_hz: float
