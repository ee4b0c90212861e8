"""Cost that `locate_jointly` minimises, with its gradient and Hessian, as compiled loops over the pulses.

The error of the elements' pattern relative to the data sheet is part of the state. All elements are of the same design
and share it. It is a function of the angle off the boresight, with one part in the plane, one that grows with the sine
of the elevation and one that grows with the square of the sine. Driving around a source, or past it at a constant
array azimuth, determines this error. If it were treated as noise, every pulse would count as new information.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dirmusic.array.element_errors import OFF_PLANE
from dirmusic.array.model import ArrayModel
from dirmusic.array.pattern import Boresight, PatternTable, gain_and_slopes_towards
from dirmusic.arrays import FloatArray, IntArray
from dirmusic.compiled import compiled, compiled_inner
from dirmusic.pulses.strengths import dot

N_PLACE = 3
"""Number of states per source: x, y, and height above the ground."""

N_HARMONICS = 7
"""Number of harmonics of the angle off the boresight, without the constant, which hardly affects bearings."""

N_TERMS = 6 * N_HARMONICS
"""Number of states of the pattern error: cosine and sine coefficients of each harmonic in the plane, then those
multiplied by the sine of the elevation, then those multiplied by its square."""


class FitData(NamedTuple):
    """Pulses to be fitted, one per row.

    Attributes:
        pose: Pose of the robot at each pulse, shape (n, 3).
        source: Index of the source of each pulse, shape (n,).
        weight: Inverse of the standard deviation of each strength; 0 for channels that are not usable, shape
            (n, n_elements).
        strengths: Strengths scaled to unit norm, times the weight, shape (n, n_elements).
        repeats: Effective number of pulses that share the pose error, shape (n,).
    """

    pose: FloatArray
    source: IntArray
    weight: FloatArray
    strengths: FloatArray
    repeats: FloatArray


class NominalArray(NamedTuple):
    """The array as in its data sheet.

    Attributes:
        positions_m: Positions of the elements, shape (n_elements, 3).
        boresights: Fields of `Boresight`, shape (n_elements, 4); `evaluate` turns them by the pointing errors of the
            state.
        gain_factors: Factors of the gains, shape (n_elements,).
        gain_offsets: Offsets of the gains, shape (n_elements,).
        pattern: Pattern in the plane.
    """

    positions_m: FloatArray
    boresights: FloatArray
    gain_factors: FloatArray
    gain_offsets: FloatArray
    pattern: PatternTable


class Priors(NamedTuple):
    """Prior of the states, standard deviations of the pose, and scale of the robust loss.

    Attributes:
        mean: Prior mean of each state, shape (n_states,).
        spread: Prior standard deviation of each state, shape (n_states,).
        decorrelation: Matrix that makes the states, divided by their spread, independent and of unit variance: the
            inverse of the lower Cholesky factor of their correlation, shape (n_states, n_states).
        position_m: Standard deviation of the robot's position.
        heading_rad: Standard deviation of the robot's heading.
        robust_scale: Residual in standard deviations beyond which the loss is linear (soft L1).
    """

    mean: FloatArray
    spread: FloatArray
    decorrelation: FloatArray
    position_m: float
    heading_rad: float
    robust_scale: float


def deviation_spread(array: ArrayModel) -> FloatArray:
    """Return the prior standard deviation of each state of the pattern error, in units of gain, shape (N_TERMS,).

    The result is empty if the spread does not include a pattern error.
    """
    if array.spread.pattern == 0.0:
        return np.empty(0)
    level = array.spread.pattern * array.manifold.table.gain.max() / math.sqrt(N_HARMONICS)
    return level * np.repeat([1.0, OFF_PLANE, OFF_PLANE], 2 * N_HARMONICS)


def deviation_upside_down(states: FloatArray) -> FloatArray:
    """Mirror a pattern error in the plane of the array; its states have the shape (N_TERMS,) or (0,)."""
    in_plane, by_sine, by_square = np.split(states, 3)
    return np.concatenate([in_plane, -by_sine, by_square])


@compiled_inner
def deviation_towards(
    states: FloatArray, boresight: Boresight, x: float, y: float, z: float, terms: FloatArray
) -> tuple[float, float, float]:
    """Return the error of the gain along a unit vector, and its derivatives by azimuth and elevation, per radian.

    Args:
        states: States of the pattern error, see `N_TERMS`.
        boresight: Boresight of the element.
        x: Forward component of the vector, array frame.
        y: Left component.
        z: Upward component.
        terms: Output: derivative of the gain by each state, shape (N_TERMS,).
    """
    gain, by_azimuth, by_elevation = 0.0, 0.0, 0.0
    n, level = states.size // 3, max(math.hypot(x, y), 1e-9)
    cos_off = (boresight.cos_azimuth * x + boresight.sin_azimuth * y) / level
    sin_off = (boresight.cos_azimuth * y - boresight.sin_azimuth * x) / level
    cos, sin = 1.0, 0.0
    for m in range(n // 2):
        cos, sin = cos * cos_off - sin * sin_off, sin * cos_off + cos * sin_off
        by_cos, by_sin = 0.0, 0.0
        for part, share, by_sine in ((0, 1.0, 0.0), (1, z, 1.0), (2, z * z, 2.0 * z)):
            of_cos, of_sin = part * n + 2 * m, part * n + 2 * m + 1
            terms[of_cos], terms[of_sin] = share * cos, share * sin
            by_cos += share * states[of_cos]
            by_sin += share * states[of_sin]
            by_elevation += level * by_sine * (states[of_cos] * cos + states[of_sin] * sin)
        gain += by_cos * cos + by_sin * sin
        by_azimuth += (m + 1) * (by_sin * cos - by_cos * sin)
    return gain, by_azimuth, by_elevation


@compiled
def linearise(
    k: int,
    state: FloatArray,
    data: FitData,
    array: NominalArray,
    priors: Priors,
    residual: FloatArray,
    slope: FloatArray,
    scratch: FloatArray,
) -> None:
    """Compute the residuals of pulse k and their derivatives; see `locate_jointly` for the model.

    The derivatives treat the projections that remove amplitude and pose errors as constant.

    Args:
        k: Row of the pulse.
        state: Positions of all sources (x, y and height of each), then element errors by kind (gain, pointing, and
            offset if the array has any), then the states of the pattern error, see `N_TERMS`, if it has any.
        data: The pulses.
        array: The array as in its data sheet, with boresights turned by the pointing errors.
        priors: Standard deviations of the pose.
        residual: Output: measured minus modelled strengths, in standard deviations, shape (n_elements,).
        slope: Output: derivative of the residuals by the position of the source, the errors of all elements, one kind
            after the other, and the states of the pattern error; shape (n_elements, N_PLACE + n_kinds n_elements +
            n_terms).
        scratch: Memory for intermediate results, shape (9 + n_terms, n_elements).
    """
    n_elements, n_terms = data.weight.shape[1], scratch.shape[0] - 9
    n_sources = (state.size - (slope.shape[1] - N_PLACE)) // N_PLACE
    n_kinds = (slope.shape[1] - N_PLACE - n_terms) // n_elements
    place, errors, deviation = N_PLACE * data.source[k], N_PLACE * n_sources, state[state.size - n_terms :]
    x, y = state[place] - data.pose[k, 0], state[place + 1] - data.pose[k, 1]
    cos_yaw, sin_yaw = math.cos(data.pose[k, 2]), math.sin(data.pose[k, 2])
    range_m = math.hypot(x, y)
    model, turn, rise, by_x, by_y = scratch[0], scratch[1], scratch[2], scratch[3], scratch[4]
    by_height, by_gain, by_pointing, by_offset = scratch[5], scratch[6], scratch[7], scratch[8]
    by_term = scratch[9:]
    for e in range(n_elements):
        forward = cos_yaw * x + sin_yaw * y - array.positions_m[e, 0]
        left = cos_yaw * y - sin_yaw * x - array.positions_m[e, 1]
        height = state[place + 2] - array.positions_m[e, 2]
        horizontal = max(forward * forward + left * left, 1e-4)
        square, sideways = horizontal + height * height, math.sqrt(horizontal)
        length = math.sqrt(square)
        of = array.boresights[e]
        boresight = Boresight(of[0], of[1], of[2], of[3])
        gain, by_azimuth, by_elevation = gain_and_slopes_towards(
            array.pattern, boresight, forward / length, left / length, height / length
        )
        if n_terms > 0:
            added, added_by_azimuth, added_by_elevation = deviation_towards(
                deviation, boresight, forward / length, left / length, height / length, by_term[:, e]
            )
            gain += added
            by_azimuth += added_by_azimuth
            by_elevation += added_by_elevation
        factor = array.gain_factors[e]
        gain = factor * gain + array.gain_offsets[e]
        spreading = data.weight[k, e] * max(range_m, 1e-2) / length
        larger = (1.0 + state[errors + e]) * spreading
        for i in range(n_terms):
            by_term[i, e] *= larger * factor
        offset = state[errors + 2 * n_elements + e] if n_kinds > 2 else 0.0
        model[e] = larger * gain + offset * spreading
        turn[e], rise[e] = larger * factor * by_azimuth, larger * factor * by_elevation
        away = (model[e] + rise[e] * height / sideways) / square
        ahead, aside = -turn[e] * left / horizontal - away * forward, turn[e] * forward / horizontal - away * left
        by_x[e], by_y[e] = cos_yaw * ahead - sin_yaw * aside, sin_yaw * ahead + cos_yaw * aside
        by_height[e] = (rise[e] * sideways - model[e] * height) / square
        by_gain[e], by_pointing[e], by_offset[e] = gain * spreading, -turn[e], spreading
    energy = dot(model, model)
    amplitude = dot(data.strengths[k], model) / energy
    # change of the strengths with errors of the pose: sideways or in heading, and towards the source
    near_m, height = max(range_m, 0.3), state[place + 2] - array.positions_m[0, 2]
    turn_variance = priors.heading_rad**2 + (priors.position_m / near_m) ** 2
    rise_variance = (priors.position_m * height / (near_m * near_m + height * height)) ** 2
    for vector in (turn, rise):
        along = dot(vector, model) / energy
        for e in range(n_elements):
            vector[e] = amplitude * (vector[e] - along * model[e])
    turn_share = _to_unit(turn, turn_variance * data.repeats[k])
    along = dot(rise, turn)
    for e in range(n_elements):
        rise[e] -= along * turn[e]
    rise_share = _to_unit(rise, rise_variance * data.repeats[k])
    for e in range(n_elements):
        residual[e] = data.strengths[k, e] - amplitude * model[e]
    _remove_pose_error(residual, turn, turn_share, rise, rise_share)
    n_errors = n_kinds * n_elements
    for i in range(N_PLACE + n_terms):
        vector, column = (scratch[3 + i], i) if i < N_PLACE else (by_term[i - N_PLACE], i + n_errors)
        _differentiate(vector, model, energy, amplitude)
        _remove_pose_error(vector, turn, turn_share, rise, rise_share)
        for e in range(n_elements):
            slope[e, column] = vector[e]
    column_of_one = by_x  # reuses memory that is no longer needed
    for i in range(n_elements):
        for e in range(n_elements):
            column_of_one[e] = -amplitude * ((1.0 if e == i else 0.0) - model[i] * model[e] / energy)
        _remove_pose_error(column_of_one, turn, turn_share, rise, rise_share)
        for e in range(n_elements):
            slope[e, N_PLACE + i] = by_gain[i] * column_of_one[e]
            slope[e, N_PLACE + n_elements + i] = by_pointing[i] * column_of_one[e]
            if n_kinds > 2:
                slope[e, N_PLACE + 2 * n_elements + i] = by_offset[i] * column_of_one[e]


@compiled_inner
def _differentiate(vector: FloatArray, model: FloatArray, energy: float, amplitude: float) -> None:
    """Convert, in place, a change of the model to the change of the residuals, with the amplitude projected out."""
    along = dot(vector, model) / energy
    for e in range(vector.size):
        vector[e] = -amplitude * (vector[e] - along * model[e])


@compiled_inner
def _to_unit(vector: FloatArray, variance: float) -> float:
    """Scale a change of the strengths to unit norm, and return the fraction of a residual along it to remove.

    Args:
        vector: Change per unit error, whitened by the noise, shape (n_elements,).
        variance: Variance of the error.
    """
    energy = max(dot(vector, vector), 1e-12)
    for e in range(vector.size):
        vector[e] /= math.sqrt(energy)
    return 1.0 - 1.0 / math.sqrt(1.0 + variance * energy)


@compiled_inner
def _remove_pose_error(
    vector: FloatArray, turn: FloatArray, turn_share: float, rise: FloatArray, rise_share: float
) -> None:
    """Subtract from a vector, in place, the part that pose errors explain."""
    by_turn, by_rise = turn_share * dot(vector, turn), rise_share * dot(vector, rise)
    for e in range(vector.size):
        vector[e] -= by_turn * turn[e] + by_rise * rise[e]


class CostExpansion(NamedTuple):
    """Cost of a state, its gradient, shape (n_states,), and its Hessian, shape (n_states, n_states)."""

    cost: float
    gradient: FloatArray
    hessian: FloatArray


@compiled
def evaluate(
    state: FloatArray, n_kinds: int, n_terms: int, data: FitData, array: NominalArray, priors: Priors
) -> CostExpansion:
    r"""Compute the cost of the robust fit at a state, with its gradient and Gauss-Newton Hessian.

    .. math:: C = \sum_i s^2 (\sqrt{1 + (f_i / s)^2} - 1)

    The sum is over the residuals f of all pulses in all channels; the cost of the priors is added.
    """
    n, n_elements = data.weight.shape
    n_errors = n_kinds * n_elements + n_terms
    n_own, errors = N_PLACE + n_errors, state.size - n_errors
    n_sources, scale = errors // N_PLACE, priors.robust_scale
    own_gradient, own_hessian = np.zeros((n_sources, n_own)), np.zeros((n_sources, n_own, n_own))
    gradient, hessian, cost = np.zeros(state.size), np.zeros((state.size, state.size)), 0.0
    residual, slope = np.empty(n_elements), np.empty((n_elements, n_own))
    scratch = np.empty((9 + n_terms, n_elements))
    turned = array.boresights.copy()
    for e in range(n_elements):
        cos, sin = math.cos(state[errors + n_elements + e]), math.sin(state[errors + n_elements + e])
        turned[e, 0], turned[e, 1] = (
            cos * array.boresights[e, 0] - sin * array.boresights[e, 1],
            sin * array.boresights[e, 0] + cos * array.boresights[e, 1],
        )
    real = NominalArray(array.positions_m, turned, array.gain_factors, array.gain_offsets, array.pattern)
    for k in range(n):
        linearise(k, state, data, real, priors, residual, slope, scratch)
        sums, squares = own_gradient[data.source[k]], own_hessian[data.source[k]]
        for e in range(n_elements):
            root = math.sqrt(1.0 + (residual[e] / scale) ** 2)
            cost += scale * scale * (root - 1.0)
            first, second, row_slope = residual[e] / root, 1.0 / (root * root * root), slope[e]
            for i in range(n_own):
                sums[i] += first * row_slope[i]
                weighted = second * row_slope[i]
                for j in range(i + 1):
                    squares[i, j] += weighted * row_slope[j]
    for s in range(n_sources):
        for i in range(n_own):
            row = N_PLACE * s + i if i < N_PLACE else errors + i - N_PLACE
            gradient[row] += own_gradient[s, i]
            for j in range(i + 1):
                column = N_PLACE * s + j if j < N_PLACE else errors + j - N_PLACE
                hessian[row, column] += own_hessian[s, i, j]
    cost += _add_prior(state, priors, gradient, hessian)
    for i in range(state.size):
        for j in range(i):
            hessian[j, i] = hessian[i, j]
    return CostExpansion(cost, gradient, hessian)


@compiled_inner
def _add_prior(state: FloatArray, priors: Priors, gradient: FloatArray, hessian: FloatArray) -> float:
    """Return the prior's cost of a state, and add its gradient and the lower triangle of its Hessian in place."""
    scale, cost = priors.robust_scale, 0.0
    for i in range(state.size):
        row, residual = priors.decorrelation[i], 0.0
        for j in range(i + 1):
            residual += row[j] * ((state[j] - priors.mean[j]) / priors.spread[j])
        root = math.sqrt(1.0 + (residual / scale) ** 2)
        cost += scale * scale * (root - 1.0)
        for j in range(i + 1):
            gradient[j] += residual / root * row[j] / priors.spread[j]
            for k in range(j + 1):
                hessian[j, k] += row[j] * row[k] / (root * root * root) / (priors.spread[j] * priors.spread[k])
    return cost
