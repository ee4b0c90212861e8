"""Small compiled functions that kernels of several packages share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled, compiled_inner

FloatArray = NDArray[np.float64]


@compiled
def wrapped(angle_rad: float) -> float:
    """Bring one angle into (-pi, pi]."""
    return -((np.pi - angle_rad) % (2.0 * np.pi)) + np.pi


@compiled
def dot(first: FloatArray, second: FloatArray) -> float:
    """Compute the scalar product of two rows (n,), term by term."""
    total = 0.0
    for e in range(first.size):
        total += first[e] * second[e]
    return total


@compiled_inner
def cubic(share: float, start: float, end: float, start_slope: float, end_slope: float) -> float:
    """Interpolate between two points by the cubic with their values and slopes; `share` in [0, 1]."""
    rise = end - start
    square, cube = 3.0 * rise - 2.0 * start_slope - end_slope, start_slope + end_slope - 2.0 * rise
    return start + share * (start_slope + share * (square + share * cube))


@compiled_inner
def cubic_slope(share: float, start: float, end: float, start_slope: float, end_slope: float) -> float:
    """Compute the slope of `cubic` per unit of `share`."""
    rise = end - start
    square, cube = 3.0 * rise - 2.0 * start_slope - end_slope, start_slope + end_slope - 2.0 * rise
    return start_slope + share * (2.0 * square + 3.0 * share * cube)
