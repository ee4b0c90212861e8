"""Position from bearings alone: robust triangulation, by which the Locator initiates candidates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from dirmusic.angles import difference
from dirmusic.arrays import BoolArray, FloatArray

START_RANGES_M = np.geomspace(0.5, 100.0, 24)
"""Ranges along each bearing at which starting points for the search are tried."""

INLIER_SIGMAS = 3.0
"""Offset of a bearing from the position, in standard deviations, beyond which the bearing is an outlier."""


@dataclass(frozen=True, kw_only=True)
class PositionEstimate:
    """A position with its uncertainty.

    Attributes:
        position_m: Position, world frame, shape (2,).
        covariance_m2: Covariance if the bearing errors are independent, shape (2, 2); infinite on the diagonal if the
            lines of sight do not cross.
        is_inlier: True for bearings that agree with the position, shape (n,).
    """

    position_m: FloatArray
    covariance_m2: FloatArray
    is_inlier: BoolArray


def triangulate(positions_m: ArrayLike, bearings_rad: ArrayLike, std_rad: ArrayLike) -> PositionEstimate:
    r"""Estimate the position where lines of sight cross, excluding outliers.

    The function minimises :math:`\sum_k \rho((\beta_k - \mathrm{atan2}(y - y_k, x - x_k)) / \sigma_k)` with the Cauchy
    loss, and then repeats the fit by least squares over the inliers. The covariance does not include errors that many
    bearings share: those of the array, which pulses from nearly the same azimuth share, and those of poses.

    Args:
        positions_m: Position from which each bearing was taken, world frame, shape (n, 2), n >= 2.
        bearings_rad: World-frame bearings, shape (n,).
        std_rad: Standard deviations, shape (n,), > 0.

    Returns:
        The position. Its covariance is infinite if all lines of sight are parallel to within about 0.01 degrees.

    Raises:
        ValueError: If shapes disagree, n < 2, a value is not finite, or a standard deviation is not positive.
    """
    position, bearing, std = (np.asarray(a, dtype=np.float64) for a in (positions_m, bearings_rad, std_rad))
    n = bearing.size
    if n < 2 or position.shape != (n, 2) or bearing.shape != (n,) or std.shape != (n,):
        raise ValueError(
            f"need positions (n, 2), bearings (n,) and standard deviations (n,) with n >= 2, "
            f"got {position.shape}, {bearing.shape} and {std.shape}"
        )
    if not (np.isfinite(position).all() and np.isfinite(bearing).all() and np.isfinite(std).all() and (std > 0).all()):
        raise ValueError(
            "positions and bearings must be finite and standard deviations positive; drop the others first"
        )

    def residual(point: FloatArray) -> FloatArray:
        return _offsets(point, position, bearing, std)

    def jacobian(point: FloatArray) -> FloatArray:
        sight = point - position
        across = np.stack([sight[:, 1], -sight[:, 0]], axis=-1)
        return across / (np.maximum(np.square(sight).sum(axis=-1), 1e-12) * std)[:, np.newaxis]

    start = rough_crossing(position, bearing, std)
    robust = least_squares(residual, start, jacobian, loss="cauchy")
    is_inlier = np.abs(residual(robust.x)) <= INLIER_SIGMAS
    if is_inlier.sum() < 2:
        is_inlier[:] = True
    final = least_squares(lambda p: residual(p)[is_inlier], robust.x, lambda p: jacobian(p)[is_inlier])
    slopes = jacobian(final.x)[is_inlier]
    information = slopes.T @ slopes
    if not np.isfinite(final.x).all() or np.linalg.cond(information) > 1e8:
        unbounded_m2 = np.diag(np.full(2, np.inf)).astype(np.float64)
        return PositionEstimate(position_m=robust.x, covariance_m2=unbounded_m2, is_inlier=is_inlier)
    return PositionEstimate(
        position_m=final.x,
        covariance_m2=np.linalg.inv(information).astype(np.float64),
        is_inlier=np.abs(residual(final.x)) <= INLIER_SIGMAS,
    )


def rough_crossing(position: FloatArray, bearing: FloatArray, std: FloatArray) -> FloatArray:
    """Return the best of many points along some of the bearings, as the starting point of an iteration.

    The points lie in the directions of the bearings, so that outliers cannot put the start behind the array.

    Args:
        position: Position from which each bearing was taken, metres, world frame, shape (n, 2).
        bearing: World-frame bearings, radians, shape (n,).
        std: Standard deviations, radians, shape (n,), > 0.

    Returns:
        The point, metres, shape (2,).
    """
    chosen = np.unique(np.linspace(0, bearing.size - 1, 12).astype(int))
    ahead = np.stack([np.cos(bearing[chosen]), np.sin(bearing[chosen])], axis=-1)
    points = (position[chosen, np.newaxis] + START_RANGES_M[:, np.newaxis] * ahead[:, np.newaxis]).reshape(-1, 2)
    loss = np.log1p(np.square(_offsets(points, position, bearing, std))).sum(axis=-1)
    return points[loss.argmin()]


def _offsets(point: FloatArray, position: FloatArray, bearing: FloatArray, std: FloatArray) -> FloatArray:
    """Return the offset of each bearing from each point, shape (..., 2), in standard deviations, shape (..., n)."""
    sight = point[..., np.newaxis, :] - position
    return difference(bearing, np.arctan2(sight[..., 1], sight[..., 0])) / std
