"""Joint estimation of the positions of several sources and of the errors of the array that detected them.

An array that differs from its data sheet turns bearings by degrees, by the same angle for all pulses from one azimuth.
Averaging does not help, and a covariance that assumes independent errors is wrong. But the robot turns and drives, so
the same source is seen at other azimuths, and its position can be separated from the element errors.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import OptimizeResult, minimize

from dirmusic.angles import difference
from dirmusic.array.element_errors import PATTERN_APART_RAD, EstimatedErrors, off_by_pattern
from dirmusic.array.model import ArrayModel
from dirmusic.array.pattern import as_boresights
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.locating.joint_kernels import (
    CostExpansion,
    FitData,
    NominalArray,
    Priors,
    deviation_spread,
    deviation_upside_down,
    evaluate,
)
from dirmusic.locating.plane_wave import ELEVATIONS_RAD, gains_in_space
from dirmusic.locating.protocol import PoseError
from dirmusic.pulses.batch import PulseBatch

POSITION_PRIOR_M = 60.0
"""Prior standard deviation of a source about the mean of the positions from which it was detected (assumed). It keeps
the covariance finite if all bearings lie on one line."""

HEIGHT_PRIOR_M = (1.5, 1.2)
"""Prior mean and standard deviation of a source's height above the ground (assumed): from cable boxes to bushings."""

ROBUST_SCALE = 3.0
"""Residual in standard deviations beyond which the loss is linear (soft L1)."""

MAX_STEPS, MAX_IDLE_STEPS, MIN_GAIN = 30, 3, 1e-6
"""Limits that end a fit: number of steps, number of consecutive rejected steps, and relative decrease of the cost per
step."""

UNEXPLAINED_PATTERN_SHARE = 0.25
"""Fraction of the pattern error that the states of the pattern do not explain and that is treated as noise. Measured on
computed helices: a sixth to a quarter, up to 45 degrees of elevation."""


@dataclass(frozen=True, kw_only=True)
class JointEstimate:
    """Joint estimate of the source positions and the array errors.

    Attributes:
        positions_m: Positions, world frame, shape (n_sources, 3).
        covariances_m2: Covariances of the positions, shape (n_sources, 3, 3), including the uncertainty of the array
            errors.
        errors: Errors of the elements; their covariance includes the uncertainty of the positions.
    """

    positions_m: FloatArray
    covariances_m2: FloatArray
    errors: EstimatedErrors


def locate_jointly(
    pulses: PulseBatch,
    pose: FloatArray,
    source: IntArray,
    start_m: FloatArray,
    array: ArrayModel,
    pose_error: PoseError,
) -> JointEstimate:
    r"""Compute the maximum a posteriori estimate of source positions and element errors.

    The element errors are gain errors e, pointing errors d and offsets o. A pulse of unknown amplitude :math:`\alpha`
    from a source at p, seen by element i at distance :math:`r_i` and array azimuth :math:`\theta_i`, has the strength
    :math:`\alpha ((1 + e_i) g(\theta_i - b_i - d_i) + o_i) / r_i`. The amplitude is projected out of every pulse.
    Offsets are part of the state if the array's spread includes them. The other errors are treated as noise:

    - Pose errors turn all elements alike and persist for seconds. They add variance along the direction in which the
      strengths change with azimuth, multiplied by the number of pulses that share the error.
    - Errors that no model explains persist for the same time, and add variance in every direction.
    - The pattern error is part of the state, see `joint_kernels`. Its unexplained remainder adds variance, multiplied
      by the number of pulses from one direction of the array.

    Args:
        pulses: Detected pulses, n rows; their scale does not matter, and channels that are not usable have no weight.
        pose: Estimated x m, y m, yaw rad at each pulse, world frame, shape (n, 3).
        source: Index of the source of each pulse, shape (n,), in [0, n_sources).
        start_m: Starting point of the fit, shape (n_sources, 3). Every source must have at least one pulse.
        array: The array's data sheet and spread. If its errors are known, their mean and covariance replace the spread.
        pose_error: Standard deviations and correlation time of the pose error.

    Returns:
        The estimate. Heights have a prior, and can be determined only at short range, where a source above or below the
        plane of the array makes the ranges and gains of the elements more alike. A level array cannot distinguish above
        from below: the likelier height is returned, and its variance includes the other one.
    """
    n_sources = start_m.shape[0]
    problem = JointProblem(pulses, pose, source, start_m, array, pose_error)
    state, hessian = problem.solve(problem.start)
    is_below = state[2 : 3 * n_sources : 3] < array.height_m
    if is_below.any():
        cost = problem.cost(state)
        other, other_hessian = problem.solve(problem.mirrored(state, is_below))
        if problem.cost(other) < cost:
            state, hessian = other, other_hessian
    n_places, covariance = 3 * n_sources, inverse(hessian)
    of_array = slice(n_places, state.size - problem.n_terms)
    return JointEstimate(
        positions_m=state[:n_places].reshape(-1, 3),
        covariances_m2=problem.place_covariances(state, covariance),
        errors=EstimatedErrors.of_states(state[of_array], covariance[of_array, of_array], array.manifold.n_elements),
    )


class JointProblem:
    """Optimisation problem of `locate_jointly`, with errors scaled by their spread.

    `locate_jointly` describes the arguments.

    Attributes:
        start: Initial state of the fit, shape (n_states,).
        n_places: Number of states that are coordinates of sources.
        n_terms: Number of states that describe the pattern error.
    """

    def __init__(
        self,
        pulses: PulseBatch,
        pose: FloatArray,
        source: IntArray,
        start_m: FloatArray,
        array: ArrayModel,
        pose_error: PoseError,
    ) -> None:
        manifold, n_sources = array.manifold, start_m.shape[0]
        n_kinds = 3 if array.spread.offset > 0 else 2
        n_errors = n_kinds * manifold.n_elements
        known = array.errors or EstimatedErrors.of_spread(array.spread, manifold.n_elements)
        errors, covariance = known.state[:n_errors], known.covariance[:n_errors]
        of_elements = np.maximum(np.sqrt(np.diag(covariance)), 1e-6)  # errors without a spread are states, too
        of_pattern = deviation_spread(array)
        of_places = np.tile([POSITION_PRIOR_M, POSITION_PRIOR_M, HEIGHT_PRIOR_M[1]], n_sources)
        detected_from_m = [pose[source == k, :2].mean(axis=0) for k in range(n_sources)]
        priors = Priors(
            mean=np.concatenate([with_height(detected_from_m).ravel(), errors, np.zeros(of_pattern.size)]),
            spread=np.concatenate([of_places, of_elements, of_pattern]),
            decorrelation=_decorrelation(covariance[:, :n_errors], of_elements, 3 * n_sources, of_pattern.size),
            position_m=pose_error.position_m,
            heading_rad=pose_error.heading_rad,
            robust_scale=ROBUST_SCALE,
        )
        nominal = NominalArray(
            array.positions_m,
            as_boresights(manifold.boresights_rad, manifold.boresight_elevations_rad),
            manifold.gain_factors,
            manifold.gain_offsets,
            manifold.pattern_table,
        )
        data = _fit_data(pulses, pose, source, start_m, array, pose_error)
        self.start: FloatArray = np.concatenate([start_m.ravel(), errors, np.zeros(of_pattern.size)])
        self.n_places, self.n_terms = 3 * n_sources, of_pattern.size
        self._array_height_m = array.height_m
        self._scale = np.concatenate([np.ones(self.n_places), priors.spread[self.n_places :]])
        self._arguments = n_kinds, self.n_terms, data, nominal, priors
        self._known_x: FloatArray = np.empty(0)
        self._known: CostExpansion

    def solve(self, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the best state, shape (n_states,), and the Hessian there, shape (n_states, n_states)."""
        last_cost, n_idle = np.inf, 0

        def stop(intermediate_result: OptimizeResult) -> None:
            """End the iteration if a step gains too little, or several steps in a row were rejected."""
            nonlocal last_cost, n_idle
            cost = float(intermediate_result.fun)
            if cost == last_cost:
                n_idle += 1
            elif last_cost - cost < MIN_GAIN * cost:
                raise StopIteration
            else:
                n_idle = 0
            if n_idle >= MAX_IDLE_STEPS:
                raise StopIteration
            last_cost = cost

        found = minimize(
            lambda x: self._at(x).cost,
            start / self._scale,
            method="trust-exact",
            jac=lambda x: self._scale * self._at(x).gradient,
            hess=lambda x: np.multiply.outer(self._scale, self._scale) * self._at(x).hessian,
            callback=stop,
            options={"maxiter": MAX_STEPS, "initial_trust_radius": 10.0, "max_trust_radius": 1000.0},
        )
        best = np.asarray(found.x, dtype=np.float64)
        return best * self._scale, self._at(best).hessian

    def cost(self, state: FloatArray) -> float:
        """Return the negative log posterior density of a state, shape (n_states,), up to a constant."""
        return self._at(state / self._scale).cost

    def hessian(self, state: FloatArray) -> FloatArray:
        """Return the Hessian at a state, shape (n_states, n_states)."""
        return self._at(state / self._scale).hessian

    def _at(self, x: FloatArray) -> CostExpansion:
        """Evaluate a scaled state; the result is cached, because the optimiser requests its parts one by one."""
        if not np.array_equal(self._known_x, x):
            self._known_x, self._known = x.copy(), evaluate(self._scale * x, *self._arguments)
        return self._known

    def mirrored(self, state: FloatArray, chosen: BoolArray) -> FloatArray:
        """Mirror some sources of a state in the plane of the array; if all are mirrored, so is the pattern error."""
        mirrored, rows = state.copy(), 3 * np.flatnonzero(chosen) + 2
        mirrored[rows] = 2.0 * self._array_height_m - mirrored[rows]
        if chosen.all():
            of_pattern = slice(state.size - self.n_terms, None)
            mirrored[of_pattern] = deviation_upside_down(mirrored[of_pattern])
        return mirrored

    def place_covariances(self, state: FloatArray, covariance: FloatArray) -> FloatArray:
        """Return the covariance of each position, including the uncertainty about the side of the array's plane.

        Args:
            state: The solution, shape (n_states,).
            covariance: Covariance of all states, shape (n_states, n_states).

        Returns:
            Covariances, shape (n_sources, 3, 3).
        """
        n_sources, covariance = self.n_places // 3, covariance.copy()
        cost = self.cost(state)
        for k in range(n_sources):
            mirrored = self.mirrored(state, np.eye(n_sources, dtype=np.bool_)[k])
            if mirrored[3 * k + 2] > 0.0:
                share = 1.0 / (1.0 + np.exp(min(self.cost(mirrored) - cost, 50.0)))  # larger differences are negligible
                variance_m2 = share * (1.0 - share) * (mirrored[3 * k + 2] - state[3 * k + 2]) ** 2
                covariance[3 * k + 2, 3 * k + 2] += variance_m2
        block: IntArray = 3 * np.arange(n_sources, dtype=np.intp)[:, np.newaxis] + np.arange(3, dtype=np.intp)
        return covariance[block[:, :, np.newaxis], block[:, np.newaxis, :]]


def with_height(places_m: ArrayLike) -> FloatArray:
    """Append the prior mean of the height to horizontal positions, shape (..., 2); the result is (..., 3)."""
    places = np.asarray(places_m, dtype=np.float64)
    return np.concatenate([places, np.full((*places.shape[:-1], 1), HEIGHT_PRIOR_M[0])], axis=-1)


def with_height_covariance(covariances_m2: FloatArray) -> FloatArray:
    """Append the prior variance of the height to horizontal covariances, (..., 2, 2); the result is (..., 3, 3)."""
    in_space = np.zeros((*covariances_m2.shape[:-2], 3, 3))
    in_space[..., :2, :2], in_space[..., 2, 2] = covariances_m2, HEIGHT_PRIOR_M[1] ** 2
    return in_space


def inverse(matrix: NDArray[np.floating[Any]]) -> FloatArray:
    """Invert a matrix and return it as float64."""
    return np.linalg.inv(matrix).astype(np.float64)


def _decorrelation(covariance: FloatArray, spread: FloatArray, n_places: int, n_terms: int) -> FloatArray:
    """Build the decorrelation matrix of `Priors`; only the errors of the elements are correlated."""
    correlation = covariance / np.multiply.outer(spread, spread)
    np.fill_diagonal(correlation, 1.0)
    decorrelation, of_errors = np.eye(n_places + spread.size + n_terms), slice(n_places, n_places + spread.size)
    decorrelation[of_errors, of_errors] = inverse(np.linalg.cholesky(correlation))
    return decorrelation


def _fit_data(
    pulses: PulseBatch,
    pose: FloatArray,
    source: IntArray,
    start_m: FloatArray,
    array: ArrayModel,
    pose_error: PoseError,
) -> FitData:
    """Compute the weights and the weighted strengths of pulses; unexplained errors persist as long as pose errors."""
    usable_v = pulses.strengths_v * pulses.is_usable
    norm_v = np.linalg.norm(usable_v, axis=-1, keepdims=True)
    strengths, variance = usable_v / norm_v, pulses.variance_v2 / norm_v**2
    repeats = _correlated_pulses(pulses.time_s, source, pose_error.correlation_s)
    floor = array.spread.unexplained**2 * np.square(strengths) * repeats[:, np.newaxis]
    if array.spread.pattern > 0.0:
        of_largest = _pattern_variance(pose, source, start_m, array)
        floor += (of_largest * np.square(strengths).max(axis=-1))[:, np.newaxis]
    weight = pulses.is_usable / np.sqrt(variance + floor + 1e-8)
    return FitData(np.ascontiguousarray(pose), source, weight, weight * strengths, repeats)


def _correlated_pulses(time_s: FloatArray, source: IntArray, correlation_s: float) -> FloatArray:
    """Compute, for each pulse, the effective number of pulses of its source that share its pose error.

    Returns:
        Shape (n,), >= 1.
    """
    lag = np.abs(time_s[:, np.newaxis] - time_s) / max(correlation_s, 1e-9)
    return (np.exp(-lag) * (source[:, np.newaxis] == source)).sum(axis=-1)


def _pattern_variance(pose: FloatArray, source: IntArray, start_m: FloatArray, array: ArrayModel) -> FloatArray:
    """Return the variance of the strengths due to pattern errors that are not in the state, shape (n,).

    The variance is in units of the largest squared strength. The error is a fraction of the largest gain in the plane;
    all gains are smaller off the plane, so it matters more there. All pulses from one direction of the array share the
    error, so the variance is multiplied by their number.
    """
    sight_m = start_m[source, :2] - pose[:, :2]
    azimuth_rad = np.arctan2(sight_m[:, 1], sight_m[:, 0]) - pose[:, 2]
    height_m2 = (HEIGHT_PRIOR_M[0] - array.height_m) ** 2 + HEIGHT_PRIOR_M[1] ** 2
    sin2 = height_m2 / (height_m2 + np.square(sight_m).sum(axis=-1))
    largest: FloatArray = gains_in_space(array.manifold).max(axis=(1, 2))
    of_largest = np.asarray(np.interp(np.arcsin(np.sqrt(sin2)), ELEVATIONS_RAD, largest[0] / largest), np.float64)
    apart = np.abs(difference(azimuth_rad[:, np.newaxis], azimuth_rad)) / PATTERN_APART_RAD
    repeats = (np.exp(-apart) * (source[:, np.newaxis] == source)).sum(axis=-1)
    share = UNEXPLAINED_PATTERN_SHARE * array.spread.pattern * of_largest
    return np.square(share) * off_by_pattern(sin2) * repeats
