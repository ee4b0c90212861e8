"""Arithmetic of angles on the circle. `wrapped` is the scalar version of `wrap`, for compiled loops."""

import numpy as np
from numpy.typing import ArrayLike

from dirmusic.arrays import FloatArray
from dirmusic.compiled import compiled


def wrap(angle_rad: ArrayLike) -> FloatArray:
    """Wrap angles, of any shape, to (-pi, pi]."""
    return -np.mod(np.pi - np.asarray(angle_rad, dtype=np.float64), 2 * np.pi) + np.pi


def difference(first_rad: ArrayLike, second_rad: ArrayLike) -> FloatArray:
    """Compute the signed difference from `second_rad` to `first_rad`, in (-pi, pi]; shapes broadcast."""
    return wrap(np.subtract(first_rad, second_rad, dtype=np.float64))


def azimuth_of(vector: FloatArray) -> FloatArray:
    """Compute the azimuth of vectors (..., 2 or 3) from their first two components, in [-pi, pi], shape (...)."""
    return np.arctan2(vector[..., 1], vector[..., 0])


def unit_vector(azimuth_rad: FloatArray) -> FloatArray:
    """Compute the horizontal unit vectors in the directions of azimuths (...), shape (..., 2)."""
    return np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad)], axis=-1)


def circular_mean(angle_rad: ArrayLike) -> FloatArray:
    """Compute the circular mean over the last axis, in (-pi, pi]; undefined where the vector sum vanishes."""
    angle = np.asarray(angle_rad, dtype=np.float64)
    return np.arctan2(np.sin(angle).sum(axis=-1), np.cos(angle).sum(axis=-1))


def aperture(angle_rad: ArrayLike) -> float:
    """Compute the width of the narrowest arc that contains all angles, shape (n,); the result is in [0, 2 pi)."""
    angle = np.sort(wrap(angle_rad))
    if angle.size < 2:
        return 0.0
    gaps = np.append(np.diff(angle), angle[0] + 2 * np.pi - angle[-1])
    return float(2 * np.pi - gaps.max())


@compiled
def wrapped(angle_rad: float) -> float:
    """Wrap one angle to (-pi, pi]."""
    return -((np.pi - angle_rad) % (2.0 * np.pi)) + np.pi
