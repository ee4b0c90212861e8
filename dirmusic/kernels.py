"""Small compiled functions that loops of several packages share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled

FloatArray = NDArray[np.float64]


@compiled
def wrapped(angle_rad: float) -> float:
    """`angles.wrap` of a single angle: into (-pi, pi]."""
    return -((np.pi - angle_rad) % (2.0 * np.pi)) + np.pi


@compiled
def dot(first: FloatArray, second: FloatArray) -> float:
    """Scalar product of two rows, (n,), added up one by one."""
    total = 0.0
    for e in range(first.size):
        total += first[e] * second[e]
    return total
