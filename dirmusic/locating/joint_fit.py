"""Joint estimation of the positions of several sources and of the array that detected them.

An array that differs from its data sheet turns bearings by degrees, by the same angle for all pulses from one azimuth.
Averaging does not help, and a covariance that assumes independent errors is wrong. But the robot turns and drives, so
the same source is seen at other azimuths, and its position can be separated from the errors of the array.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag
from scipy.optimize import OptimizeResult, minimize
from scipy.spatial.distance import cdist
from scipy.special import expit

from dirmusic.array.element_errors import N_KINDS, EstimatedErrors
from dirmusic.array.model import ArrayModel
from dirmusic.array.pattern import as_boresights
from dirmusic.arrays import FloatArray, IntArray
from dirmusic.locating.measurement import (
    GROUND,
    N_COMMON,
    N_HARMONICS,
    N_PLACE,
    N_POSE,
    N_SHARED,
    N_TERMS,
    T_FREEDOM,
    TILT_X,
    TILT_Y,
    CostExpansion,
    FixedErrors,
    Noise,
    NominalArray,
    PooledPulses,
    errors_at,
    expand,
    misfits,
    shared_scores,
    t_cost,
)
from dirmusic.locating.protocol import PoseError

POSITION_PRIOR_M = 60.0
"""Prior standard deviation of a source about the mean of the positions from which it was detected (assumed). It keeps
the covariance finite if all bearings lie on one line."""

HEIGHT_PRIOR_M = (2.0, 2.0)
"""Prior mean and standard deviation of the height of a source above the ground, metres (assumed): from cable boxes to
the bushings of large transformers. With 1.5 and 1.2 m, heights of 4 to 8 m were 0.3 m too low."""

LEVEL_PRIOR_DB = (-5.0, 6.0)
"""Prior mean and standard deviation of the level of a discharge at 1 m, dB relative to 1 V (assumed). While all lines
of sight are nearly parallel, it limits the range."""

LEAST_HEIGHT_M, AMBIGUOUS_M, LEAST_OTHER_SIDE = 0.2, 2.0, 1e-3
"""Least height from which sources are sought on the other side of the plane of the array, and the height above which
and probability below which they are not (assumed)."""

WIDENING_PRIOR = 0.15
"""Prior standard deviation of the relative widening of the beam (assumed): that of helices which differ by half a turn
or 15 % in frequency (Kraus, Antennas, 1988, section 7-9: the beam width falls with the root of the axial length)."""

TILT_PRIOR_RAD = np.radians(1.0)
"""Prior standard deviation of the tilt of the array about each axis (assumed): wheels, tyres and uneven ground."""

YAW_PRIOR_RAD = np.radians(1.0)
"""Prior standard deviation of the common yaw of the mount, which adds to the pointing error of each element (assumed):
a bracket 0.3 m wide that is 5 mm off."""

GROUND_PRIOR = (np.log(6.0), 0.8)
"""Prior mean and standard deviation of the logarithm of the relative permittivity of the ground (assumed). Dry gravel
has 3.5 (ITU-R P.527), asphalt 6, wet soil 24 (ITU-R P.2040-3). With a mean of ln 9, the median error of 90 positions
changes by less than a tenth."""

PATTERN_DECAY = 1.5
"""Exponent of the decay of the prior of the pattern error with the harmonic, as for a gain with a smooth slope.
Assumed; between 1 and 1.5, errors of positions with computed helices change by less than a fifth."""

PATTERN_OFF_PLANE = np.array([1.0, 1.0, 3.0])
"""Prior of the pattern error in the plane, times the sine of the elevation, and times its square, relative to that in
the plane. Measured on computed helices."""

LEAST_UNEXPLAINED, MOST_UNEXPLAINED, LEAST_PATTERN = 0.01, 1.0, 0.003
"""Limits of the estimated standard deviations of unexplained errors and of the pattern error (assumed)."""

UNEXPLAINED_STEPS = 2.0 ** np.array([-1.0, -0.5, -0.25, 0.0, 0.25, 0.5, 1.0])
UNEXPLAINED_PRIOR = (0.04, 1.0)
"""Factors of unexplained errors that are tried in one round; prior median, and standard deviation of the logarithm
(assumed)."""

MULTIPATH_APART_M = 2.0
"""Distance over which the correlation of errors by multipath decays by a factor of e. In random yards of the simulator
(6400 poses around 120 sources), the errors of a channel at equal heading have a correlation of 0.5 at 0.4 m, 0.4 at 1
m, 0.2 at 2.5 m and less than 0.1 beyond 4 m; less after a turn of more than 40 degrees, which is neglected."""

LEAST_FREEDOM = 0.2
"""Least share of the data that is taken to remain for the estimate of unexplained errors (assumed)."""

DESCENTS = 2
"""Number of descents of a fit, each with the covariances at the state where the last one ended (assumed). On 30 surveys
of sources near the plane of the array, three of four positions are within 0.1 mm of those of five descents; within 14
mm after one."""

MAX_STEPS, MAX_IDLE_STEPS, MIN_GAIN = 30, 3, 0.003
"""Limits that end a fit: number of steps, number of consecutive rejected steps, and decrease of the cost by a step that
is so small that the next one would gain much less."""


DB = 20.0 / np.log(10.0)
"""Decibels per natural logarithm of an amplitude."""


class ErrorLevels(NamedTuple):
    """Standard deviations of errors that are estimated from the data (empirical Bayes).

    Attributes:
        unexplained: Relative error of a strength that no state explains.
        pattern: Error of the pattern in the plane, relative to the largest gain.
    """

    unexplained: float
    pattern: float


@dataclass(frozen=True, kw_only=True)
class JointEstimate:
    """Joint estimate of sources and array.

    Attributes:
        positions_m: Positions, world frame, shape (n_sources, 3).
        covariances_m2: Covariances of the positions, shape (n_sources, 3, 3), including the uncertainty of the array.
        errors: Errors of the elements, with the yaw of the mount in their pointing; their covariance includes the
            uncertainty of the positions.
        state: All states: the positions, then the states of the array, see `measurement.predict`; shape (n_states,).
        covariance: Covariance of all states, shape (n_states, n_states).
        cautious_covariance: Covariance in which pulses from one place count as one, for the association, shape
            (n_states, n_states); it is larger.
        levels: Estimated error levels.
    """

    positions_m: FloatArray
    covariances_m2: FloatArray
    errors: EstimatedErrors
    state: FloatArray
    covariance: FloatArray
    cautious_covariance: FloatArray
    levels: ErrorLevels


class StatePrior(NamedTuple):
    """Normal prior of states.

    Attributes:
        mean: Mean, shape (n_states,).
        information: Inverse of the covariance, shape (n_states, n_states).
        root: Scale of the states for the optimiser, shape (n_states, n_states): a root of the covariance, but 1 m for
            positions.
    """

    mean: FloatArray
    information: FloatArray
    root: FloatArray


class Posterior(NamedTuple):
    """Posterior density of the states.

    Attributes:
        prior: Prior of the states.
        errors: Errors of the pulses as predicted at a state.
        cost: Negative log density up to a constant, at a state, with given errors of the pulses.
    """

    prior: StatePrior
    errors: Callable[[FloatArray], FixedErrors]
    cost: Callable[[FloatArray, FixedErrors], CostExpansion]

    def at(self, state: FloatArray) -> CostExpansion:
        """Return the cost of a state with the errors there."""
        return self.cost(state, self.errors(state))


class Optimum(NamedTuple):
    """Most probable state.

    Attributes:
        state: The state, shape (n_states,).
        expansion: Cost and derivatives there.
        weight: Effective number of independent pulses that each pulse stands for, shape (n,).
        covariance: Inverse of the Hessian, shape (n_states, n_states).
        n_fitted: Effective number of states that the data determine (MacKay 1992, eq. (2.24)).
        posterior: The posterior density.
    """

    state: FloatArray
    expansion: CostExpansion
    weight: FloatArray
    covariance: FloatArray
    n_fitted: float
    posterior: Posterior


def descend(posterior: Posterior, start: FloatArray) -> FloatArray:
    """Find the most probable state by a trust region, with the errors of pulses fixed to those at the start.

    Args:
        posterior: Posterior density of the states.
        start: Starting point, shape (n_states,).
    """
    root, errors, last_cost, n_idle = posterior.prior.root, posterior.errors(start), np.inf, 0

    def stop(intermediate_result: OptimizeResult) -> None:
        """End the iteration if a step gains too little, or several steps in a row were rejected."""
        nonlocal last_cost, n_idle
        now = float(intermediate_result.fun)
        n_idle = n_idle + 1 if now == last_cost else 0
        if n_idle >= MAX_IDLE_STEPS or 0.0 < last_cost - now < MIN_GAIN:
            raise StopIteration
        last_cost = now

    @lru_cache(maxsize=1)  # the optimiser requests its parts one by one
    def cost(scaled: bytes) -> CostExpansion:
        return posterior.cost((root @ np.frombuffer(scaled)).astype(np.float64), errors)

    found = minimize(
        lambda x: cost(x.tobytes()).cost,
        np.linalg.solve(root, start),
        method="trust-exact",
        jac=lambda x: cost(x.tobytes()).gradient @ root,
        hess=lambda x: root.T @ cost(x.tobytes()).hessian @ root,
        callback=stop,
        options={"maxiter": MAX_STEPS, "initial_trust_radius": 10.0, "max_trust_radius": 1000.0},
    )
    return (root @ found.x).astype(np.float64)


class JointFit:
    r"""Maximum a posteriori fit of source positions and of the array; see `measurement` for the model.

    The states and their priors are the positions (`POSITION_PRIOR_M`, `HEIGHT_PRIOR_M`), widening, tilt and yaw of the
    mount, the ground reflection, the errors of the elements (spread of the data sheet, or the errors known from earlier
    missions) and the error of the pattern. The levels of unexplained errors and of the pattern error are estimated:
    after each fit, the first is set to the value with the largest restricted likelihood of the residuals, and the
    second by a step of the evidence approximation (MacKay, Bayesian interpolation, Neural Computation 4, 1992,
    section 4):

    .. math:: \tau^2 \leftarrow \frac{\sum_m c_m^2 / s_m^2}{\sum_m 1 - P_{mm} / (\tau s_m)^2}

    Args:
        pulses: Pooled pulses; their scale does not matter.
        level_db: Level of each pulse at the array, dB relative to 1 V, shape (n,).
        time_s: Time of each pulse, shape (n,).
        source: Index of the source of each pulse, shape (n,), in [0, n_sources); every source has a pulse.
        probability: Probability that the pulse came from this source, shape (n,).
        array: The array's data sheet and spread, and its errors if they are known.
        pose_error: Standard deviations and correlation time of the pose error.
    """

    def __init__(
        self,
        pulses: PooledPulses,
        level_db: FloatArray,
        time_s: FloatArray,
        source: IntArray,
        probability: FloatArray,
        array: ArrayModel,
        pose_error: PoseError,
    ) -> None:
        self._pulses, self._source, self._probability = pulses, source, probability
        self._level_db = level_db
        self._array, self._nominal, self._pose_error = array, nominal_array(array), pose_error
        lag = np.abs(time_s[:, np.newaxis] - time_s) / max(pose_error.correlation_s, 1e-9)
        apart = cdist(pulses.pose[:, :2], pulses.pose[:, :2]) / MULTIPATH_APART_M
        self._of_pose, self._of_multipath = np.exp(-lag), np.exp(-apart) * (source[:, np.newaxis] == source)
        self._repeats = np.maximum(self._of_multipath @ probability, 1.0)
        detected_from_m = [pulses.pose[source == k, :2].mean(axis=0) for k in range(int(source.max()) + 1)]
        self._places_m = with_height(detected_from_m).ravel()

    def solve(
        self, start_m: FloatArray, array_state: FloatArray | None, levels: ErrorLevels, rounds: int
    ) -> JointEstimate:
        """Fit all states.

        Args:
            start_m: Starting points of the positions, world frame, shape (n_sources, 3).
            array_state: Starting point of the states of the array; None for their prior mean.
            levels: Starting values of the error levels.
            rounds: Number of times that the error levels are estimated and the states fitted again.

        Returns:
            The estimate. A level array hardly distinguishes above from below: the likelier height is returned, and its
            variance includes the other one.
        """
        if array_state is None:
            array_state = array_prior(self._array, levels).mean
        optimum = self._minimise(np.concatenate([start_m.ravel(), array_state]), levels)
        heights = slice(2, self._places_m.size, N_PLACE)

        def rank(found: Optimum) -> tuple[int, float]:
            """Prefer sources above the ground, then the lower cost."""
            return int((found.state[heights] < 0.0).sum()), found.expansion.cost

        if (optimum.state[heights] < AMBIGUOUS_M).any() and self._may_be_mirrored(optimum):
            both = optimum, self._minimise(self._mirrored(optimum.state), levels)
            optimum = min(both, key=rank)
        if (optimum.state[heights] < 0.0).any():
            above = optimum.state.copy()
            above[heights] = np.where(above[heights] < 0.0, 2.0 * self._array.height_m - above[heights], above[heights])
            optimum = min(optimum, self._minimise(above, levels), key=rank)
        for _ in range(rounds):
            levels = self._estimate_levels(optimum, levels)
            optimum = self._minimise(optimum.state, levels)
        n, of_elements = self._places_m.size, slice(self._places_m.size + N_COMMON, -N_TERMS)
        more = self._height_errors(optimum, levels)
        covariance = self._with_shared_errors(optimum, levels) + more
        return JointEstimate(
            positions_m=optimum.state[:n].reshape(-1, N_PLACE),
            covariances_m2=np.array([covariance[k : k + N_PLACE, k : k + N_PLACE] for k in range(0, n, N_PLACE)]),
            errors=EstimatedErrors(state=optimum.state[of_elements], covariance=covariance[of_elements, of_elements]),
            state=optimum.state,
            covariance=covariance,
            cautious_covariance=optimum.covariance + more,
            levels=levels,
        )

    def _estimate_levels(self, optimum: Optimum, levels: ErrorLevels) -> ErrorLevels:
        """Estimate the error levels from the residuals and the pattern error of a fit with other levels."""
        unexplained = self._estimate_unexplained(optimum, levels)
        of_pattern = pattern_scale(self._array)
        variance = np.diag(optimum.covariance)[-N_TERMS:]
        n_fitted = N_TERMS - np.sum(variance / np.square(levels.pattern * of_pattern))
        pattern = np.sqrt(np.square(optimum.state[-N_TERMS:] / of_pattern).sum() / max(n_fitted, 1.0))
        return ErrorLevels(
            float(np.clip(unexplained, LEAST_UNEXPLAINED, MOST_UNEXPLAINED)), max(float(pattern), LEAST_PATTERN)
        )

    def _estimate_unexplained(self, optimum: Optimum, levels: ErrorLevels) -> float:
        weight, freedom = optimum.weight, self._pulses.is_usable.sum(axis=-1) - 1.0
        left = max(1.0 - optimum.n_fitted / (weight @ freedom), LEAST_FREEDOM)

        def cost(unexplained: float) -> float:
            """Return the negative log restricted likelihood of a level."""
            data = self._source, self._pulses, self._nominal, self._noise(unexplained)
            misfit, log_det = misfits(optimum.state, *data)
            loss = t_cost(misfit, freedom, T_FREEDOM)
            off = np.log(unexplained / UNEXPLAINED_PRIOR[0]) / UNEXPLAINED_PRIOR[1]
            return float(weight @ (loss + 0.5 * left * log_det) + 0.5 * off**2)

        trials = np.clip(levels.unexplained * UNEXPLAINED_STEPS, LEAST_UNEXPLAINED, MOST_UNEXPLAINED)
        return min(trials.tolist(), key=cost)

    def _noise(self, unexplained: float) -> Noise:
        return Noise(self._pose_error.position_m, self._pose_error.heading_rad, unexplained)

    def _posterior(self, levels: ErrorLevels) -> Posterior:
        """Return the posterior density for given error levels."""
        of_array = array_prior(self._array, levels)
        place_std_m = np.tile([POSITION_PRIOR_M, POSITION_PRIOR_M, HEIGHT_PRIOR_M[1]], self._places_m.size // N_PLACE)
        prior = StatePrior(
            np.concatenate([self._places_m, of_array.mean]),
            block_diag(np.diag(place_std_m**-2.0), of_array.information),
            block_diag(np.eye(place_std_m.size), of_array.root),
        )
        data = self._pulses, self._nominal, self._noise(levels.unexplained)

        def errors(state: FloatArray) -> FixedErrors:
            return errors_at(state, self._source, self._probability, self._repeats, *data)

        def cost(state: FloatArray, errors: FixedErrors) -> CostExpansion:
            expansion = self._with_level_prior(state, expand(state, errors, self._source, *data, T_FREEDOM))
            off = state - prior.mean
            return expansion._replace(
                cost=expansion.cost + 0.5 * off @ prior.information @ off,
                gradient=expansion.gradient + prior.information @ off,
                hessian=expansion.hessian + prior.information,
            )

        return Posterior(prior, errors, cost)

    def _with_level_prior(self, state: FloatArray, expansion: CostExpansion) -> CostExpansion:
        """Add the prior of the mean level of each source to the cost; it depends on the range."""
        cost, gradient, hessian = expansion.cost, expansion.gradient, expansion.hessian
        sight_m = state[: self._places_m.size].reshape(-1, N_PLACE)[self._source, :2] - self._pulses.pose[:, :2]
        range2_m2 = np.maximum(np.square(sight_m).sum(axis=-1), 0.1)
        for k in range(self._places_m.size // N_PLACE):
            own, at = self._source == k, slice(N_PLACE * k, N_PLACE * k + 2)
            share = self._probability[own] / self._probability[own].sum()
            level_db = share @ (self._level_db[own] + 10.0 * np.log10(range2_m2[own]))
            off, slope = (
                (level_db - LEVEL_PRIOR_DB[0]) / LEVEL_PRIOR_DB[1],
                DB * (share / range2_m2[own]) @ sight_m[own],
            )
            slope /= LEVEL_PRIOR_DB[1]
            cost += 0.5 * off**2
            gradient[at] += off * slope
            hessian[at, at] += np.multiply.outer(slope, slope)
        return expansion._replace(cost=cost)

    def _minimise(self, start: FloatArray, levels: ErrorLevels) -> Optimum:
        """Find the most probable state: the covariances are held fixed for a descent, and predicted anew after it."""
        posterior, state = self._posterior(levels), start
        for _ in range(DESCENTS):
            state = descend(posterior, state)
        errors = posterior.errors(state)
        expansion = posterior.cost(state, errors)
        covariance = np.linalg.inv(expansion.hessian).astype(np.float64)
        n_fitted = state.size - float((covariance * posterior.prior.information).sum())
        return Optimum(state, expansion, errors.weight, covariance, n_fitted, posterior)

    def _with_shared_errors(self, optimum: Optimum, levels: ErrorLevels) -> FloatArray:
        r"""Return the covariance of the states, with the errors that pulses share, shape (n_states, n_states).

        The weights of the pulses allow for these errors only roughly. With the Hessian H of the cost and the covariance
        G of its gradient, the covariance of the estimate is :math:`H^{-1} G H^{-1}` (Godambe 1960; sandwich estimator).
        """
        data = self._source, self._pulses, self._nominal, self._noise(levels.unexplained), T_FREEDOM
        errors = optimum.posterior.errors(optimum.state)
        share = errors.weight / np.maximum(self._probability, 1e-9)
        difference = expand(optimum.state, errors._replace(weight=errors.weight * (share - 1.0)), *data).hessian
        of_ground = (self._source[:, np.newaxis] == self._source).astype(np.float64)
        for k, scores in enumerate(shared_scores(optimum.state, errors, *data).swapaxes(0, 1)):
            correlation = self._of_pose if k < N_POSE else of_ground if k < N_SHARED else self._of_multipath
            difference += scores.T @ (correlation - np.eye(len(correlation))) @ scores
        covariance = optimum.covariance + optimum.covariance @ difference @ optimum.covariance
        return 0.5 * (covariance + covariance.T)

    def _mirrored(self, state: FloatArray) -> FloatArray:
        """Mirror low sources in the plane of the array, with the tilt and the pattern error."""
        mirrored, n = state.copy(), self._places_m.size
        height_m = mirrored[2:n:N_PLACE]
        other_m = np.maximum(2.0 * self._array.height_m - height_m, LEAST_HEIGHT_M)
        height_m[:] = np.where(height_m < AMBIGUOUS_M, other_m, height_m)
        mirrored[n + TILT_X : n + TILT_Y + 1] *= -1.0
        mirrored[-N_TERMS:].reshape(3, -1)[1] *= -1.0
        return mirrored

    def _other_side(self, optimum: Optimum, k: int) -> tuple[FloatArray, float]:
        """Return a state with a source on the other side of the array's plane, and its probability.

        The optimum there is approximated by one Newton step from the mirrored height.
        """
        other = optimum.state.copy()
        other[N_PLACE * k + 2] = max(2.0 * self._array.height_m - other[N_PLACE * k + 2], LEAST_HEIGHT_M)
        there = optimum.posterior.at(other)
        other = other - np.linalg.solve(there.hessian, there.gradient)
        return other, float(expit(optimum.expansion.cost - optimum.posterior.at(other).cost))

    def _may_be_mirrored(self, optimum: Optimum) -> bool:
        """Return whether a source may be on the other side of the array's plane, or lies below the ground."""
        heights_m = optimum.state[2 : self._places_m.size : N_PLACE]
        return any(
            height_m < 0.0 or (height_m < AMBIGUOUS_M and self._other_side(optimum, k)[1] > LEAST_OTHER_SIDE)
            for k, height_m in enumerate(heights_m)
        )

    def _height_errors(self, optimum: Optimum, levels: ErrorLevels) -> FloatArray:
        r"""Return the covariance of errors of the heights beyond the optimum, shape (n_states, n_states).

        These are the side of the array's plane, and the vertical scale: off the plane, a common error of the pattern is
        hardly distinguished from a factor of all heights above the array. Measured on computed helices: this factor has
        a standard deviation of about :math:`\tau`.
        """
        result = np.zeros_like(optimum.covariance)
        for k in range(self._places_m.size // N_PLACE):
            own = slice(N_PLACE * k, N_PLACE * (k + 1))
            height_m = optimum.state[own][2]
            if height_m < AMBIGUOUS_M:
                other, share = self._other_side(optimum, k)
                off_m = (other - optimum.state)[own]
                result[own, own] = min(share, 0.5) * np.outer(off_m, off_m)
            result[own, own][2, 2] += (levels.pattern * (height_m - self._array.height_m)) ** 2
        return result


def pattern_scale(array: ArrayModel) -> FloatArray:
    """Return the prior standard deviations of the states of the pattern error for a level of 1, shape (N_TERMS,)."""
    decay = np.repeat(np.arange(1.0, N_HARMONICS + 1.0), 2) ** -PATTERN_DECAY
    decay *= array.manifold.table.gain.max() / np.sqrt(0.5 * np.square(decay).sum())
    return np.multiply.outer(PATTERN_OFF_PLANE, decay).ravel()


def array_prior(array: ArrayModel, levels: ErrorLevels) -> StatePrior:
    """Return the prior of the states of the array; errors known from earlier missions include the yaw of the mount."""
    n = array.manifold.n_elements
    known = array.errors or EstimatedErrors.of_spread(array.spread, n)
    errors = known.covariance + 1e-12 * np.eye(N_KINDS * n)
    if array.errors is None:
        errors[n : 2 * n, n : 2 * n] += YAW_PRIOR_RAD**2
    common = np.array([WIDENING_PRIOR, TILT_PRIOR_RAD, TILT_PRIOR_RAD, GROUND_PRIOR[1]])
    pattern = levels.pattern * pattern_scale(array)
    mean = np.concatenate([np.zeros(N_COMMON), known.state, np.zeros(N_TERMS)])
    mean[GROUND] = GROUND_PRIOR[0]
    information = block_diag(np.diag(common**-2.0), np.linalg.inv(errors), np.diag(pattern**-2.0))
    return StatePrior(mean, information, block_diag(np.diag(common), np.linalg.cholesky(errors), np.diag(pattern)))


def nominal_array(array: ArrayModel) -> NominalArray:
    """Return the data sheet for compiled functions."""
    manifold = array.manifold
    return NominalArray(
        array.positions_m,
        as_boresights(manifold.boresights_rad, manifold.boresight_elevations_rad),
        manifold.gain_factors,
        manifold.gain_offsets,
        manifold.pattern_table,
    )


def with_height(places_m: ArrayLike) -> FloatArray:
    """Append the prior mean of the height to horizontal positions, shape (..., 2); the result is (..., 3)."""
    places = np.asarray(places_m, dtype=np.float64)
    return np.concatenate([places, np.full((*places.shape[:-1], 1), HEIGHT_PRIOR_M[0])], axis=-1)


def with_height_covariance(covariances_m2: FloatArray) -> FloatArray:
    """Append the prior variance of the height to horizontal covariances, (..., 2, 2); the result is (..., 3, 3)."""
    in_space = np.zeros((*covariances_m2.shape[:-2], 3, 3))
    in_space[..., :2, :2], in_space[..., 2, 2] = covariances_m2, HEIGHT_PRIOR_M[1] ** 2
    return in_space
