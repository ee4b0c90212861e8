"""Bearings from known positions to one position with its covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic.angles import difference

FloatArray = NDArray[np.float64]

START_RANGES_M = np.geomspace(0.5, 100.0, 24)
"""Ranges along each bearing from which the search for the best position starts."""

INLIER_SIGMAS = 3.0
"""A bearing further off the fix than this many standard deviations is an outlier."""

MAX_CONDITION = 1e8
"""Worse-conditioned lines of sight (opened by less than about 0.01 degrees) give no fix."""


@dataclass(frozen=True, kw_only=True)
class Fix:
    """A position with its uncertainty.

    Attributes:
        position_m: Shape (2,), world frame.
        covariance_m2: Shape (2, 2). From the given standard deviations taken as independent; infinite on the diagonal
            where the lines of sight do not cross.
        is_inlier: Shape (n,), which bearings agree with the fix.
    """

    position_m: FloatArray
    covariance_m2: FloatArray
    is_inlier: NDArray[np.bool_]


def triangulate(positions_m: ArrayLike, bearings_rad: ArrayLike, std_rad: ArrayLike) -> Fix:
    r"""Find where the lines of sight meet, letting outliers go.

    Minimises :math:`\sum_k \rho((\beta_k - \mathrm{atan2}(y - y_k, x - x_k)) / \sigma_k)` with Cauchy's loss, then
    once more by least squares over the inliers. Errors common to all bearings are not averaged away by this: carry
    them beside it (`dirmusic.locating` does).

    Args:
        positions_m: Where each bearing was taken, world frame, shape (n, 2), n >= 2.
        bearings_rad: World-frame bearings, shape (n,).
        std_rad: Standard deviations, shape (n,), > 0.

    Returns:
        The fix. A single line of bearings gives a direction, not a fix: its covariance is infinite.

    Raises:
        ValueError: If shapes disagree, n < 2, or a value is not finite or not positive where it must be.
    """
    from scipy.optimize import least_squares  # here, so that a command line help need not wait for it

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
        return _misses(point, position, bearing, std)

    def jacobian(point: FloatArray) -> FloatArray:
        return _slopes(point, position, std)

    start = rough_crossing(position, bearing, std)
    robust = least_squares(residual, start, jacobian, loss="cauchy")
    is_inlier = np.abs(residual(robust.x)) <= INLIER_SIGMAS
    if is_inlier.sum() < 2:
        is_inlier[:] = True
    final = least_squares(lambda p: residual(p)[is_inlier], robust.x, lambda p: jacobian(p)[is_inlier])
    slopes = jacobian(final.x)[is_inlier]
    information = slopes.T @ slopes
    if not np.isfinite(final.x).all() or np.linalg.cond(information) > MAX_CONDITION:
        return Fix(
            position_m=robust.x, covariance_m2=np.diag(np.full(2, np.inf)).astype(np.float64), is_inlier=is_inlier
        )
    return Fix(
        position_m=final.x,
        covariance_m2=np.linalg.inv(information).astype(np.float64),
        is_inlier=np.abs(residual(final.x)) <= INLIER_SIGMAS,
    )


def _misses(point: FloatArray, position: FloatArray, bearing: FloatArray, std: FloatArray) -> FloatArray:
    """How far each bearing misses points (..., 2), in standard deviations, shape (..., n)."""
    sight = point[..., np.newaxis, :] - position
    return difference(bearing, np.arctan2(sight[..., 1], sight[..., 0])) / std


def _slopes(point: FloatArray, position: FloatArray, std: FloatArray) -> FloatArray:
    """Derivative (n, 2) of the misses by the point."""
    sight = point - position
    across = np.stack([sight[:, 1], -sight[:, 0]], axis=-1)
    return across / (np.maximum(np.square(sight).sum(axis=-1), 1e-12) * std)[:, np.newaxis]


def rough_crossing(position: FloatArray, bearing: FloatArray, std: FloatArray) -> FloatArray:
    """The best of many points along some of the bearings: never behind the array, whatever the outliers.

    Args:
        position: Where each bearing was taken, metres, world frame, shape (n, 2).
        bearing: World-frame bearings, radians, shape (n,).
        std: Standard deviations, radians, shape (n,), > 0.

    Returns:
        Shape (2,), metres: where an iteration may start.
    """
    chosen = np.unique(np.linspace(0, bearing.size - 1, 12).astype(int))
    ahead = np.stack([np.cos(bearing[chosen]), np.sin(bearing[chosen])], axis=-1)
    points = (position[chosen, np.newaxis] + START_RANGES_M[:, np.newaxis] * ahead[:, np.newaxis]).reshape(-1, 2)
    loss = np.log1p(np.square(_misses(points, position, bearing, std))).sum(axis=-1)
    return points[loss.argmin()]
