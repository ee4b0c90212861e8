"""Positions from bearings alone: robust triangulation, and a fit whose covariance allows for correlated errors.

There are three kinds of bearing errors, and only the first averages out: noise, which is independent in each pulse;
errors of the method and the array, which pulses from nearly the same azimuth share; and pose errors, which pulses
within a few seconds share.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from dirmusic.angles import difference
from dirmusic.array.bounds import manifold_error_covariance, perpendicular_slope
from dirmusic.array.element_errors import EstimatedErrors
from dirmusic.array.model import ArrayModel
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.locating.joint_fit import (
    POSITION_PRIOR_M,
    ROBUST_SCALE,
    JointEstimate,
    inverse,
    with_height,
    with_height_covariance,
)
from dirmusic.locating.protocol import PoseError
from dirmusic.pulses.batch import PulseBatch

START_RANGES_M = np.geomspace(0.5, 100.0, 24)
"""Ranges along each bearing at which starting points for the search are tried."""

INLIER_SIGMAS = 3.0
"""Offset of a bearing from the position, in standard deviations, beyond which the bearing is an outlier."""

METHOD_ARC_RAD = np.radians(15.0)
"""Angle over which the correlation of the errors of an estimator's own method falls to 1/e (assumed). For rounding to
60 degree sectors it is 13 degrees."""


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
    loss, and then repeats the fit by least squares over the inliers. The covariance does not include errors that are
    common to all bearings; see `locate_by_bearings`.

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


def locate_by_bearings(
    pulses: PulseBatch,
    pose: FloatArray,
    source: IntArray,
    start_m: FloatArray,
    array: ArrayModel,
    pose_error: PoseError,
) -> JointEstimate:
    r"""Locate one source at a time by robust weighted least squares over bearings.

    The variance of a bearing that the estimator reports is split into noise, computed from the noise of the strengths,
    and the error of the method, which is the remainder. Errors of array and pose are added. The weight of a pulse is
    the inverse of the number of pulses that share its errors. With the Jacobian J, the weights W and the modelled
    covariance C of the errors, a position has the covariance

    .. math:: (J^T W J)^{-1} J^T W C W J (J^T W J)^{-1}

    so that errors common to many pulses do not average out, and errors common to all pulses cancel if the lines of
    sight come from all sides. Errors of tens of degrees also have a second-order effect on the position: the fit is
    repeated with the errors that move the position most, with either sign, and the mean of the two displacements is
    added to the covariance.

    Args:
        pulses: Pulses with their directions, n rows.
        pose: Estimated x m, y m, yaw rad at each pulse, world frame, shape (n, 3).
        source: Index of the source of each pulse, shape (n,), in [0, n_sources).
        start_m: Starting point of the fit, shape (n_sources, 3). Every source must have at least one pulse.
        array: The array's data sheet and spread.
        pose_error: Standard deviations and correlation time of the pose error.

    Returns:
        The estimate. Array errors and heights keep their priors, because bearings do not determine them.
    """
    positions_m, covariances_m2 = np.empty((len(start_m), 2)), np.empty((len(start_m), 2, 2))
    for k in range(len(start_m)):
        own = source == k
        problem = _BearingProblem(pulses.take(own), pose[own], start_m[k, :2], array, pose_error)
        positions_m[k] = problem.solve(start_m[k, :2])
        covariances_m2[k] = problem.covariance(positions_m[k])
    return JointEstimate(
        positions_m=with_height(positions_m),
        covariances_m2=with_height_covariance(covariances_m2),
        errors=EstimatedErrors.of_spread(array.spread, array.manifold.n_elements),
    )


class _BearingProblem:
    """Least-squares problem of one source: n normalised bearing residuals and 2 residuals of the position prior.

    Args:
        pulses: Pulses of one source, n rows.
        pose: Estimated pose at each pulse, shape (n, 3).
        start_m: Point at which the standard deviations are evaluated, shape (2,).
        array: The array's data sheet and spread.
        pose_error: Standard deviations and correlation time of the pose error.
    """

    def __init__(
        self, pulses: PulseBatch, pose: FloatArray, start_m: FloatArray, array: ArrayModel, pose_error: PoseError
    ) -> None:
        self._given = pulses, pose, array, pose_error
        self._bearing_rad = pulses.azimuth_rad + pose[:, 2]
        self._pose = pose
        self._mean_m = pose[:, :2].mean(axis=0)
        covariance = _error_covariance(start_m, *self._given)
        self._std_rad = np.sqrt(np.diag(covariance))
        n_alike = np.abs(covariance).sum(axis=0) / np.square(self._std_rad)
        self._weight = np.append(1.0 / n_alike, [1.0, 1.0])

    def solve(self, start_m: FloatArray, error: FloatArray | float = 0.0) -> FloatArray:
        """Return the best position, shape (2,), with an error, shape (n + 2,), added to the residuals."""

        def residual(point_m: FloatArray) -> FloatArray:
            return self._residual(point_m) + error

        found = least_squares(
            residual,
            start_m,
            self._slopes,
            loss=self._loss,  # pyright: ignore[reportArgumentType] - the stubs require a keyword that is never passed
            f_scale=ROBUST_SCALE,
            max_nfev=50,
        )
        return np.asarray(found.x, dtype=np.float64)

    def covariance(self, position_m: FloatArray) -> FloatArray:
        """Return the covariance of the best position, shape (2, 2)."""
        slopes, n = self._slopes(position_m), self._std_rad.size
        _, by_square, _ = self._loss(np.square(self._residual(position_m) / ROBUST_SCALE))
        errors = np.eye(n + 2)
        errors[:n, :n] = _error_covariance(position_m, *self._given) / np.multiply.outer(self._std_rad, self._std_rad)
        weighted = by_square[:, np.newaxis] * slopes
        moved = weighted @ inverse(slopes.T @ weighted)  # displacement per unit residual, shape (n + 2, 2)
        first_order = moved.T @ errors @ moved
        root = inverse(np.asarray(np.linalg.cholesky(first_order), dtype=np.float64))
        worst = np.sqrt(2) * root @ moved.T @ errors  # two errors, each a displacement of 1.4 std
        second_m = np.array(
            [0.5 * (self.solve(position_m, e) + self.solve(position_m, -e)) - position_m for e in worst]
        )
        mean_m = second_m.sum(axis=0)
        return first_order + 0.25 * np.multiply.outer(mean_m, mean_m) + 0.5 * second_m.T @ second_m

    def _residual(self, point_m: FloatArray) -> FloatArray:
        sight = point_m - self._pose[:, :2]
        miss_rad = difference(self._bearing_rad, np.arctan2(sight[:, 1], sight[:, 0]))
        return np.concatenate([miss_rad / self._std_rad, (point_m - self._mean_m) / POSITION_PRIOR_M])

    def _slopes(self, point_m: FloatArray) -> FloatArray:
        by_bearing = -_turn_per_metre(point_m, self._pose) / self._std_rad[:, np.newaxis]
        return np.concatenate([by_bearing, np.eye(2) / POSITION_PRIOR_M])

    def _loss(self, square: FloatArray) -> FloatArray:
        """Return the weighted soft L1 loss and its first two derivatives, shape (3, n + 2), for squared residuals.

        The loss of the position prior is quadratic.
        """
        root = np.sqrt(1.0 + square)
        loss = np.stack([2.0 * (root - 1.0), 1.0 / root, -0.5 / root**3])
        loss[:, -2:] = [square[-2:], [1.0, 1.0], [0.0, 0.0]]
        return self._weight * loss


def _turn_per_metre(point_m: FloatArray, pose: FloatArray) -> FloatArray:
    """Return the derivative, shape (n, 2), of the bearings from the poses to a point, at ranges of at least 0.3 m."""
    sight = point_m - pose[:, :2]
    square = np.maximum(np.square(sight).sum(axis=-1, keepdims=True), 0.3**2)
    return np.stack([-sight[:, 1], sight[:, 0]], axis=-1) / square


def _error_covariance(
    point_m: FloatArray, pulses: PulseBatch, pose: FloatArray, array: ArrayModel, pose_error: PoseError
) -> FloatArray:
    """Model the covariance, shape (n, n), of the errors of bearings to a source at a point, rad^2.

    One half of the variance of the method is common to pulses from nearly the same azimuth, the other half to those
    from nearly the same bearing (assumed): azimuths are known only to within the error of the method, and when the
    robot circles a source, the fit makes them look more alike than they are.
    """
    sight = point_m - pose[:, :2]
    bearing_rad = np.arctan2(sight[:, 1], sight[:, 0])
    azimuth_rad = bearing_rad - pose[:, 2]
    noise = np.minimum(_noise_variance(pulses, array), np.square(pulses.std_rad))
    method = np.sqrt(np.square(pulses.std_rad) - noise)
    by_azimuth, by_bearing = (
        np.exp(-np.abs(difference(angle[:, np.newaxis], angle)) / METHOD_ARC_RAD)
        for angle in (azimuth_rad, bearing_rad)
    )
    lag_s = np.abs(pulses.time_s[:, np.newaxis] - pulses.time_s)
    across = pose_error.position_m * _turn_per_metre(point_m, pose)
    by_pose = pose_error.heading_rad**2 + across @ across.T
    return (
        np.diag(noise)
        + 0.5 * np.multiply.outer(method, method) * (by_azimuth + by_bearing)
        + manifold_error_covariance(array.manifold, azimuth_rad, array.spread)
        + by_pose * np.exp(-lag_s / max(pose_error.correlation_s, 1e-9))
    )


def _noise_variance(pulses: PulseBatch, array: ArrayModel) -> FloatArray:
    """Return the noise variance of the maximum-likelihood bearing of each pulse, shape (n,), rad^2.

    At least 1 % of the energy of a pulse is taken as signal (assumed).
    """
    gain, slope = (of_all * pulses.is_usable.T for of_all in array.manifold.gain_and_slope(pulses.azimuth_rad))
    energy = np.square(gain).sum(axis=0)
    across = np.square(perpendicular_slope(gain, slope))
    amplitude = (gain * pulses.strengths_v.T).sum(axis=0) / energy
    by_noise = (np.square(gain) * pulses.variance_v2.T).sum(axis=0) / energy**2
    signal = np.maximum(np.square(amplitude) - by_noise, 0.01 * np.square(amplitude))
    return np.square(amplitude / (signal * across.sum(axis=0))) * (across * pulses.variance_v2.T).sum(axis=0)
