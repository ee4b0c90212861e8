"""Positions of several sources from bearings and their deviations alone, with an honest covariance.

Bearings are wrong in three ways, and only the first averages away: by noise, anew in every pulse; by method and array,
in common for pulses from nearly one azimuth; and by the pose, in common for seconds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import difference
from dirmusic.array.bounds import manifold_error_covariance, perpendicular_slope
from dirmusic.array.element_errors import EstimatedErrors
from dirmusic.array.model import ArrayModel
from dirmusic.locating.fitting.joint_fix import (
    POSITION_PRIOR_M,
    ROBUST_SCALE,
    JointFix,
    PoseError,
    with_height,
    with_height_covariance,
)
from dirmusic.pulses.batch import PulseBatch

FloatArray = NDArray[np.float64]

METHOD_ARC_RAD = np.radians(15.0)
"""Turn over which the errors of an estimator's own method decorrelate, by e (assumed); those of rounding to sectors of
60 degrees do within 13. Half of their variance goes with the azimuth and half with the bearing (assumed): azimuths are
known no better than the method tells, and a fit makes those of an orbit look more alike than they were."""

LEAST_RANGE_M = 0.3
"""Shorter ranges count as this one (assumed)."""

LEAST_SIGNAL_SHARE = 0.01
"""Share of a pulse's energy that is taken as signal at least, where it cannot be told from noise (assumed)."""

MAX_EVALUATIONS = 50
"""Of the residuals, for one position."""


def locate_by_bearings(
    pulses: PulseBatch,
    pose: FloatArray,
    source: NDArray[np.intp],
    start_m: FloatArray,
    array: ArrayModel,
    pose_error: PoseError,
) -> JointFix:
    r"""Robust weighted least squares, a source at a time, with the covariance that correlated errors leave.

    The variance of a pulse is what the noise in its strengths makes, at most the estimator's; the rest of the
    estimator's is of its method. Array and pose come on top. A pulse weighs as much as the pulses deserve that share
    its errors. With the slopes J, the weights W and the modelled covariance C of the errors, a position has the
    covariance

    .. math:: (J^T W J)^{-1} J^T W C W J (J^T W J)^{-1}

    so what is common to many pulses does not average away, and what is common to all of them cancels where lines of
    sight come from all sides. Errors of tens of degrees bend lines of sight to second order: the fit is repeated with
    the errors that move it most, and what it moves to either way alike is added.

    Args:
        pulses: Pulses with their directions, n rows.
        pose: Believed x m, y m, yaw rad at each pulse, world frame, shape (n, 3).
        source: Which source each pulse belongs to, shape (n,), in [0, n_sources).
        start_m: Where to start, shape (n_sources, 3). Every source has at least one row.
        array: The array's data sheet and spread.
        pose_error: Spread and correlation of the pose.

    Returns:
        The fix. The errors of the array are as its spread has them, and heights as their prior has them: bearings tell
        neither.
    """
    positions_m, covariances_m2 = np.empty((len(start_m), 2)), np.empty((len(start_m), 2, 2))
    for k in range(len(start_m)):
        own = source == k
        problem = _Problem(pulses.take(own), pose[own], start_m[k, :2], array, pose_error)
        positions_m[k] = problem.solve(start_m[k, :2])
        covariances_m2[k] = problem.covariance(positions_m[k])
    return JointFix(
        positions_m=with_height(positions_m),
        covariances_m2=with_height_covariance(covariances_m2),
        errors=EstimatedErrors.of_spread(array.spread, array.manifold.n_elements),
    )


class _Problem:
    """Bearings of one source as residuals, each over its own deviation; the last two rows are the prior.

    Args:
        pulses: Of one source, n rows.
        pose: Shape (n, 3).
        start_m: Where the deviations are taken, shape (2,).
        array: The array's data sheet and spread.
        pose_error: Spread and correlation of the pose.
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
        """The best position (2,), with an error (n + 2,) added to the residuals."""
        from scipy.optimize import least_squares  # here, so that a command line help need not wait for it

        def residual(point_m: FloatArray) -> FloatArray:
            return self._residual(point_m) + error

        found = least_squares(
            residual,
            start_m,
            self._slopes,
            loss=self._loss,  # pyright: ignore[reportArgumentType] - the stubs want a keyword that is never given
            f_scale=ROBUST_SCALE,
            max_nfev=MAX_EVALUATIONS,
        )
        return np.asarray(found.x, dtype=np.float64)

    def covariance(self, position_m: FloatArray) -> FloatArray:
        """Covariance (2, 2) of the best position."""
        slopes, n = self._slopes(position_m), self._std_rad.size
        _, by_square, _ = self._loss(np.square(self._residual(position_m) / ROBUST_SCALE))
        errors = np.eye(n + 2)
        errors[:n, :n] = _error_covariance(position_m, *self._given) / np.multiply.outer(self._std_rad, self._std_rad)
        weighted = by_square[:, np.newaxis] * slopes
        moved = weighted @ _inverse(slopes.T @ weighted)  # by unit residuals, shape (n + 2, 2)
        first_order = moved.T @ errors @ moved
        root = _inverse(np.asarray(np.linalg.cholesky(first_order), dtype=np.float64))
        worst = np.sqrt(2) * root @ moved.T @ errors  # two errors, each moving it by 1.4 deviations
        bend_m = np.array([0.5 * (self.solve(position_m, e) + self.solve(position_m, -e)) - position_m for e in worst])
        mean_m = bend_m.sum(axis=0)
        return first_order + 0.25 * np.multiply.outer(mean_m, mean_m) + 0.5 * bend_m.T @ bend_m

    def _residual(self, point_m: FloatArray) -> FloatArray:
        sight = point_m - self._pose[:, :2]
        miss_rad = difference(self._bearing_rad, np.arctan2(sight[:, 1], sight[:, 0]))
        return np.concatenate([miss_rad / self._std_rad, (point_m - self._mean_m) / POSITION_PRIOR_M])

    def _slopes(self, point_m: FloatArray) -> FloatArray:
        by_bearing = -_turn_per_metre(point_m, self._pose) / self._std_rad[:, np.newaxis]
        return np.concatenate([by_bearing, np.eye(2) / POSITION_PRIOR_M])

    def _loss(self, square: FloatArray) -> FloatArray:
        """Weighted soft L1 of squared residuals (n + 2,) and its derivatives, shape (3, n + 2); the prior is normal."""
        root = np.sqrt(1.0 + square)
        loss = np.stack([2.0 * (root - 1.0), 1.0 / root, -0.5 / root**3])
        loss[:, -2:] = [square[-2:], [1.0, 1.0], [0.0, 0.0]]
        return self._weight * loss


def _inverse(matrix: FloatArray) -> FloatArray:
    return np.linalg.inv(matrix).astype(np.float64)


def _turn_per_metre(point_m: FloatArray, pose: FloatArray) -> FloatArray:
    """Derivative (n, 2) of the directions from the poses to a point, by the point."""
    sight = point_m - pose[:, :2]
    square = np.maximum(np.square(sight).sum(axis=-1, keepdims=True), LEAST_RANGE_M**2)
    return np.stack([-sight[:, 1], sight[:, 0]], axis=-1) / square


def _error_covariance(
    point_m: FloatArray, pulses: PulseBatch, pose: FloatArray, array: ArrayModel, pose_error: PoseError
) -> FloatArray:
    """Modelled covariance (n, n) of the errors of bearings to a source at a point, rad^2."""
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
    """Variance that noise in the strengths makes in the likeliest bearing of each pulse, shape (n,), rad^2."""
    gain, slope = (of_all * pulses.is_usable.T for of_all in array.manifold.gain_and_slope(pulses.azimuth_rad))
    energy = np.square(gain).sum(axis=0)
    across = np.square(perpendicular_slope(gain, slope))
    amplitude = (gain * pulses.strengths_v.T).sum(axis=0) / energy
    by_noise = (np.square(gain) * pulses.variance_v2.T).sum(axis=0) / energy**2
    signal = np.maximum(np.square(amplitude) - by_noise, LEAST_SIGNAL_SHARE * np.square(amplitude))
    return np.square(amplitude / (signal * across.sum(axis=0))) * (across * pulses.variance_v2.T).sum(axis=0)
