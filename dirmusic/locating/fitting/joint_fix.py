"""Positions of several sources and the errors of the array that detected them, estimated together.

An array that is not what its data sheet says turns every bearing by degrees, in common for all pulses from one
azimuth: averaging does not help, and a covariance that takes the errors as independent is wrong. But the robot turns
and drives, so the same error shows at other azimuths, and positions and element errors can be told apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic.angles import difference
from dirmusic.array.element_errors import PATTERN_APART_RAD, EstimatedErrors, off_by_pattern
from dirmusic.array.model import ArrayModel
from dirmusic.locating.elevation import ELEVATIONS_RAD, gains_in_space
from dirmusic.locating.fitting.joint_optimiser import JointOptimiser
from dirmusic.locating.fitting.pattern_deviation import SHARE_LEFT, deviation_spread, deviation_upside_down
from dirmusic.pulses.batch import PulseBatch

if TYPE_CHECKING:
    from dirmusic.locating.fitting.joint_kernels import Explained

FloatArray = NDArray[np.float64]

POSITION_PRIOR_M = 60.0
"""Assumed standard deviation of a source about the places of its detections: it keeps one line of bearings finite."""

HEIGHT_PRIOR_M = (1.5, 1.2)
"""Assumed mean and standard deviation of a source's height above the ground: cable boxes to bushings."""

ROBUST_SCALE = 3.0
"""Residuals beyond this many standard deviations are taken as outliers, softly (soft L1 loss)."""

LEAST_SPREAD = 1e-6
"""Least standard deviation of an error, gain or radian: so that one that has none is a state as well."""

MOST_APART = 50.0
"""Costs are taken to differ by no more: what is so much less likely does not count."""


@dataclass(frozen=True, kw_only=True)
class PoseError:
    """How wrong the robot's pose is: standard deviations, and the time over which the error stays the same."""

    position_m: float
    heading_rad: float
    correlation_s: float


@dataclass(frozen=True, kw_only=True)
class JointFix:
    """Sources and array, estimated together.

    Attributes:
        positions_m: Shape (n_sources, 3), world frame.
        covariances_m2: Shape (n_sources, 3, 3), with the uncertainty of the array's errors in it.
        errors: What the elements turned out to be off by, with the uncertainty of the positions in its covariance.
    """

    positions_m: FloatArray
    covariances_m2: FloatArray
    errors: EstimatedErrors


def locate_jointly(
    pulses: PulseBatch,
    pose: FloatArray,
    source: NDArray[np.intp],
    start_m: FloatArray,
    array: ArrayModel,
    pose_error: PoseError,
) -> JointFix:
    r"""Maximum a posteriori positions, and gain errors e, pointing errors d and offsets o of the elements.

    A pulse of unknown amplitude :math:`\alpha` from a source at p gives element i, at distance r_i and seeing p at
    array azimuth :math:`\theta_i`, the strength
    :math:`\alpha ((1 + e_i) g(\theta_i - b_i - d_i) + o_i) / r_i`. The amplitude is projected out of every pulse;
    offsets are a state where the array's spread has them. Pose errors turn all elements alike and stay the same for
    seconds: they widen the one direction in which the strengths move with azimuth, by as much as so many correlated
    pulses deserve. What no model explains stays as long, and widens every direction. What the pattern may be off by
    is a state as well, see `pattern_deviation`; the rest of it widens, for all pulses from one direction of the array.

    Args:
        pulses: Detected pulses, n rows; their scale does not matter, and channels that are not usable have no weight.
        pose: Believed x m, y m, yaw rad at each pulse, world frame, shape (n, 3).
        source: Which source each pulse belongs to, shape (n,), in [0, n_sources).
        start_m: Where to start, shape (n_sources, 3). Every source has at least one row.
        array: The array's data sheet and spread. Errors that are known of it, mean and covariance, take the place of
            the spread.
        pose_error: Spread and correlation of the pose.

    Returns:
        The fix. Heights are held by their prior, and show close by: a source above or below the plane of the array
        makes ranges and gains of the elements more alike. A level array cannot tell which; the likelier one is taken,
        and the variance of the height has the other in it.
    """
    n_sources = start_m.shape[0]
    problem = _problem(pulses, pose, source, start_m, array, pose_error)
    state, hessian = problem.fit.solve(problem.start)
    is_below = state[2 : 3 * n_sources : 3] < array.height_m
    if is_below.any():
        cost = problem.fit.cost(state)
        other, other_hessian = problem.fit.solve(_upside_down(state, is_below, problem.fit, array))
        if problem.fit.cost(other) < cost:
            state, hessian = other, other_hessian
    n_places, covariance = 3 * n_sources, _inverse(hessian)
    of_array = slice(n_places, state.size - problem.fit.n_terms)
    return JointFix(
        positions_m=state[:n_places].reshape(-1, 3),
        covariances_m2=_place_covariances(problem.fit, state, covariance, array),
        errors=EstimatedErrors.of_states(state[of_array], covariance[of_array, of_array], array.manifold.n_elements),
    )


def expected_covariances(
    pulses: PulseBatch,
    pose: FloatArray,
    source: NDArray[np.intp],
    positions_m: FloatArray,
    array: ArrayModel,
    pose_error: PoseError,
) -> FloatArray:
    """Covariances that `locate_jointly` tells of sources at known places, heard by an array as its data sheet says.

    With the strengths that its model expects, that is the bound of any fix by it. Arguments are as there, with the
    places of the sources, shape (n_sources, 3), in that of the start. Returns shape (n_sources, 3, 3), square metres.
    """
    problem = _problem(pulses, pose, source, positions_m, array, pose_error)
    covariance = _inverse(problem.fit.hessian(problem.start))
    return _place_covariances(problem.fit, problem.start, covariance, array)


class _Problem(NamedTuple):
    """What `locate_jointly` solves, and the state where it starts."""

    fit: JointOptimiser
    start: FloatArray


def _problem(
    pulses: PulseBatch,
    pose: FloatArray,
    source: NDArray[np.intp],
    start_m: FloatArray,
    array: ArrayModel,
    pose_error: PoseError,
) -> _Problem:
    from dirmusic.locating.fitting.joint_kernels import Beliefs  # loads the compiler

    n_sources, n_elements = start_m.shape[0], array.manifold.n_elements
    n_kinds = 3 if array.spread.offset > 0 else 2
    known = array.errors or EstimatedErrors.of_spread(array.spread, n_elements)
    errors, covariance = known.state[: n_kinds * n_elements], known.covariance[: n_kinds * n_elements]
    of_elements = np.maximum(np.sqrt(np.diag(covariance)), LEAST_SPREAD)
    of_pattern = deviation_spread(array)
    of_places = np.tile([POSITION_PRIOR_M, POSITION_PRIOR_M, HEIGHT_PRIOR_M[1]], n_sources)
    detected_from_m = [pose[source == k, :2].mean(axis=0) for k in range(n_sources)]
    beliefs = Beliefs(
        mean=np.concatenate([with_height(detected_from_m).ravel(), errors, np.zeros(of_pattern.size)]),
        spread=np.concatenate([of_places, of_elements, of_pattern]),
        decorrelation=_decorrelation(covariance[:, : errors.size], of_elements, 3 * n_sources, of_pattern.size),
        position_m=pose_error.position_m,
        heading_rad=pose_error.heading_rad,
        robust_scale=ROBUST_SCALE,
    )
    explained = _explained(pulses, pose, source, start_m, array, pose_error)
    start = np.concatenate([start_m.ravel(), errors, np.zeros(of_pattern.size)])
    return _Problem(JointOptimiser(explained, array, beliefs, n_kinds, 3 * n_sources, of_pattern.size), start)


def _decorrelation(covariance: FloatArray, spread: FloatArray, n_places: int, n_terms: int) -> FloatArray:
    """Of places, of errors, and of what the pattern is off by; all but errors are independent. See `Beliefs`."""
    correlation = covariance / np.multiply.outer(spread, spread)
    np.fill_diagonal(correlation, 1.0)
    decorrelation, of_errors = np.eye(n_places + spread.size + n_terms), slice(n_places, n_places + spread.size)
    decorrelation[of_errors, of_errors] = _inverse(np.linalg.cholesky(correlation))
    return decorrelation


def _inverse(matrix: NDArray[np.floating[Any]]) -> FloatArray:
    return np.linalg.inv(matrix).astype(np.float64)


def _place_covariances(fit: JointOptimiser, state: FloatArray, covariance: FloatArray, array: ArrayModel) -> FloatArray:
    """Of the place of each source, shape (n_sources, 3, 3), with what is not known of its side of the array's plane.

    Args:
        fit: The problem.
        state: Its solution, shape (n_states,).
        covariance: Of all states, shape (n_states, n_states).
        array: Of which the height counts.
    """
    n_sources, covariance = fit.n_places // 3, covariance.copy()
    cost = fit.cost(state)
    for k in range(n_sources):
        mirrored = _upside_down(state, np.eye(n_sources, dtype=np.bool_)[k], fit, array)
        if mirrored[3 * k + 2] > 0.0:
            share = 1.0 / (1.0 + np.exp(min(fit.cost(mirrored) - cost, MOST_APART)))
            covariance[3 * k + 2, 3 * k + 2] += share * (1.0 - share) * (mirrored[3 * k + 2] - state[3 * k + 2]) ** 2
    block: NDArray[np.intp] = 3 * np.arange(n_sources, dtype=np.intp)[:, np.newaxis] + np.arange(3, dtype=np.intp)
    return covariance[block[:, :, np.newaxis], block[:, np.newaxis, :]]


def _upside_down(state: FloatArray, chosen: NDArray[np.bool_], fit: JointOptimiser, array: ArrayModel) -> FloatArray:
    """A state with some of the sources mirrored in the plane of the array; with all of them, its deviation as well."""
    mirrored, rows = state.copy(), 3 * np.flatnonzero(chosen) + 2
    mirrored[rows] = 2.0 * array.height_m - mirrored[rows]
    if chosen.all():
        mirrored[state.size - fit.n_terms :] = deviation_upside_down(mirrored[state.size - fit.n_terms :])
    return mirrored


def with_height(places_m: ArrayLike) -> FloatArray:
    """Places on plan (..., 2) at the height of which nothing is known, shape (..., 3)."""
    places = np.asarray(places_m, dtype=np.float64)
    return np.concatenate([places, np.full((*places.shape[:-1], 1), HEIGHT_PRIOR_M[0])], axis=-1)


def with_height_covariance(covariances_m2: FloatArray) -> FloatArray:
    """Covariances on plan (..., 2, 2) with that of a height of which nothing is known, shape (..., 3, 3)."""
    in_space = np.zeros((*covariances_m2.shape[:-2], 3, 3))
    in_space[..., :2, :2], in_space[..., 2, 2] = covariances_m2, HEIGHT_PRIOR_M[1] ** 2
    return in_space


def _correlated_pulses(time_s: FloatArray, source: NDArray[np.intp], correlation_s: float) -> FloatArray:
    """For each pulse, how many of the same source share its pose error, shape (n,), >= 1."""
    lag = np.abs(time_s[:, np.newaxis] - time_s) / max(correlation_s, 1e-9)
    return (np.exp(-lag) * (source[:, np.newaxis] == source)).sum(axis=-1)


def _pattern_variance(pose: FloatArray, source: NDArray[np.intp], start_m: FloatArray, array: ArrayModel) -> FloatArray:
    """Variance of strengths, in units of the largest squared, by what the pattern is off by in no state; shape (n,).

    It is off by a share of the largest gain in the plane; from above all gains are smaller, and it counts for more. It
    is the same whenever a source is seen in one direction of the array, however often: pulses from there share it.
    """
    sight_m = start_m[source, :2] - pose[:, :2]
    azimuth_rad = np.arctan2(sight_m[:, 1], sight_m[:, 0]) - pose[:, 2]
    height_m2 = (HEIGHT_PRIOR_M[0] - array.height_m) ** 2 + HEIGHT_PRIOR_M[1] ** 2
    sin2 = height_m2 / (height_m2 + np.square(sight_m).sum(axis=-1))
    largest: FloatArray = gains_in_space(array.manifold).max(axis=(1, 2))
    of_largest = np.asarray(np.interp(np.arcsin(np.sqrt(sin2)), ELEVATIONS_RAD, largest[0] / largest), np.float64)
    apart = np.abs(difference(azimuth_rad[:, np.newaxis], azimuth_rad)) / PATTERN_APART_RAD
    repeats = (np.exp(-apart) * (source[:, np.newaxis] == source)).sum(axis=-1)
    return np.square(SHARE_LEFT * array.spread.pattern * of_largest) * off_by_pattern(sin2) * repeats


def _explained(
    pulses: PulseBatch,
    pose: FloatArray,
    source: NDArray[np.intp],
    start_m: FloatArray,
    array: ArrayModel,
    pose_error: PoseError,
) -> Explained:
    """Weights and weighted strengths of pulses; the floor stays for as long as the pose error does."""
    from dirmusic.locating.fitting.joint_kernels import Explained

    usable_v = pulses.strengths_v * pulses.is_usable
    norm_v = np.linalg.norm(usable_v, axis=-1, keepdims=True)
    strengths, variance = usable_v / norm_v, pulses.variance_v2 / norm_v**2
    repeats = _correlated_pulses(pulses.time_s, source, pose_error.correlation_s)
    floor = array.spread.unexplained**2 * np.square(strengths) * repeats[:, np.newaxis]
    if array.spread.pattern > 0.0:
        of_largest = _pattern_variance(pose, source, start_m, array)
        floor += (of_largest * np.square(strengths).max(axis=-1))[:, np.newaxis]
    weight = pulses.is_usable / np.sqrt(variance + floor + 1e-8)
    return Explained(np.ascontiguousarray(pose), source, weight, weight * strengths, repeats)
