"""What the pulses in view show of the channels at a glance, in a compiled loop."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@compiled
def stuck_channels(strengths: FloatArray, stuck_spread: float) -> BoolArray:
    """Which channels say the same for every pulse.

    Args:
        strengths: Of the pulses, shape (n_pulses, n_elements), volts.
        stuck_spread: A channel whose strengths spread by less than this share of the largest is stuck.

    Returns:
        Whether each channel is stuck, shape (n_elements,).
    """
    n_pulses, n_elements = strengths.shape
    is_stuck = np.empty(n_elements, np.bool_)
    for e in range(n_elements):
        lowest = highest = strengths[0, e]
        for k in range(1, n_pulses):
            lowest, highest = min(lowest, strengths[k, e]), max(highest, strengths[k, e])
        is_stuck[e] = highest > 0.0 and highest - lowest < stuck_spread * highest
    return is_stuck
