"""The 95 % ellipse of a position: the contour within which the truth lies with that probability."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

CHI2_95 = float(-2.0 * np.log(0.05))
"""95 % quantile of chi-square with two degrees of freedom, whose distribution function is 1 - exp(-x / 2)."""


class Ellipse(NamedTuple):
    """Half-axes of an ellipse, and the direction of the longer one.

    Attributes:
        semi_major_m: Longer half-axis.
        semi_minor_m: Shorter half-axis.
        angle_rad: Direction of the longer half-axis, world frame, in (-pi, pi]; its opposite means the same.
    """

    semi_major_m: float
    semi_minor_m: float
    angle_rad: float


def ellipse95(covariance_m2: FloatArray) -> Ellipse:
    """Half-axes and direction of the 95 % ellipse of a position covariance, shape (2, 2)."""
    values, vectors = np.linalg.eigh(covariance_m2)
    return Ellipse(
        semi_major_m=float(np.sqrt(CHI2_95 * values[1])),
        semi_minor_m=float(np.sqrt(CHI2_95 * values[0])),
        angle_rad=float(np.arctan2(vectors[1, 1], vectors[0, 1])),
    )


def outline95(position_m: FloatArray, covariance_m2: FloatArray, n_points: int) -> FloatArray:
    """The 95 % ellipse of a position (2,) as a closed line, shape (n_points, 2); its last point is its first."""
    angle = np.linspace(0, 2 * np.pi, n_points)
    root = np.linalg.cholesky(CHI2_95 * covariance_m2)
    return position_m + np.stack([np.cos(angle), np.sin(angle)], axis=-1) @ root.T


def is_inside95(miss_m: FloatArray, covariance_m2: FloatArray) -> bool:
    """Whether a point so far from the position, shape (2,), lies within the 95 % ellipse of a covariance (2, 2)."""
    return bool(miss_m @ np.linalg.solve(covariance_m2, miss_m) <= CHI2_95)


def reaches95(position_m: FloatArray, covariance_m2: FloatArray, corner_m: FloatArray) -> bool:
    """Whether the 95 % ellipse of a position (2,) and its covariance (2, 2) has any point of a rectangle in it.

    Args:
        position_m: Centre of the ellipse.
        covariance_m2: Of the position.
        corner_m: Of the rectangle, opposite to the origin, shape (2,).
    """
    if np.all((position_m >= 0.0) & (position_m <= corner_m)):
        return True
    corners = corner_m * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    root = np.linalg.inv(np.linalg.cholesky(covariance_m2))  # makes the ellipse a circle
    starts = (corners - position_m) @ root.T
    edges = np.roll(starts, -1, axis=0) - starts
    along = np.clip(-(starts * edges).sum(axis=-1) / np.square(edges).sum(axis=-1), 0.0, 1.0)
    nearest = starts + along[:, np.newaxis] * edges
    return bool(np.square(nearest).sum(axis=-1).min() <= CHI2_95)
