"""Angles on the circle, for arrays; `kernels.wrapped` is the twin of `wrap` for compiled loops, tied by a test."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


def wrap(angle_rad: ArrayLike) -> FloatArray:
    """Bring angles of any shape into (-pi, pi]."""
    return -np.mod(np.pi - np.asarray(angle_rad, dtype=np.float64), 2 * np.pi) + np.pi


def difference(first_rad: ArrayLike, second_rad: ArrayLike) -> FloatArray:
    """Signed shortest turn from `second_rad` to `first_rad`, in (-pi, pi]; shapes broadcast."""
    return wrap(np.asarray(first_rad, dtype=np.float64) - np.asarray(second_rad, dtype=np.float64))


def circular_mean(angle_rad: ArrayLike) -> FloatArray:
    """Direction of the resultant over the last axis, in (-pi, pi]; undefined where it vanishes."""
    angle = np.asarray(angle_rad, dtype=np.float64)
    return np.arctan2(np.sin(angle).sum(axis=-1), np.cos(angle).sum(axis=-1))


def aperture(angle_rad: ArrayLike) -> float:
    """Width of the narrowest arc that holds all angles (n,): the aperture of lines of sight, in [0, 2 pi)."""
    angle = np.sort(wrap(angle_rad))
    if angle.size < 2:
        return 0.0
    gaps = np.append(np.diff(angle), angle[0] + 2 * np.pi - angle[-1])
    return float(2 * np.pi - gaps.max())
