"""What `locate_jointly` minimises, in one compiled loop over the pulses: its cost, gradient and Hessian."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.pattern import Boresight, PatternTable, gain_and_slopes_towards
from dirmusic.compiled import compiled
from dirmusic.kernels import dot
from dirmusic.locating.fitting.pattern_deviation import deviation_towards

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

N_PLACE = 3
"""States of a source: x, y, and height above the ground."""


class Explained(NamedTuple):
    """What the fit is to explain, one pulse a row.

    Attributes:
        pose: Shape (n, 3).
        source: Shape (n,).
        weight: One over the deviation of each strength; 0 for channels that are not usable, shape (n, n_elements).
        strengths: Scaled to unit norm, times the weight, shape (n, n_elements).
        repeats: How many pulses share its pose error, shape (n,).
    """

    pose: FloatArray
    source: IntArray
    weight: FloatArray
    strengths: FloatArray
    repeats: FloatArray


class NominalArray(NamedTuple):
    """The array of the data sheet.

    Attributes:
        positions_m: Shape (n_elements, 3).
        boresights: Fields of `Boresight`, shape (n_elements, 4); `evaluate` turns them by the errors of the state.
        gain_factors: Shape (n_elements,).
        gain_offsets: Shape (n_elements,).
        pattern: In the plane.
    """

    positions_m: FloatArray
    boresights: FloatArray
    gain_factors: FloatArray
    gain_offsets: FloatArray
    pattern: PatternTable


class Beliefs(NamedTuple):
    """What is known beforehand.

    Attributes:
        mean: Of each state, shape (n_states,).
        spread: Standard deviation of each state, shape (n_states,).
        decorrelation: What makes states over their spread independent and of unit variance: the inverse of the lower
            Cholesky factor of their correlation, shape (n_states, n_states); the identity where they are independent.
        position_m: Standard deviation of the robot's position.
        heading_rad: Standard deviation of its heading.
        robust_scale: Residuals beyond so many deviations are taken as outliers, softly (soft L1 loss).
    """

    mean: FloatArray
    spread: FloatArray
    decorrelation: FloatArray
    position_m: float
    heading_rad: float
    robust_scale: float


class Linear(NamedTuple):
    """A pulse about one state; rows are elements.

    Attributes:
        miss: What the model leaves unexplained, in deviations, shape (n_elements,).
        slope: Its derivative by the place of the source and the errors of all elements, one kind after the other;
            then by what their pattern is off by; shape (n_elements, N_PLACE + n_kinds n_elements + n_terms).
    """

    miss: FloatArray
    slope: FloatArray


class Quadratic(NamedTuple):
    """What is minimised, about one state.

    Attributes:
        cost: Its value.
        gradient: Shape (n_states,).
        hessian: Shape (n_states, n_states), after Gauss and Newton.
    """

    cost: float
    gradient: FloatArray
    hessian: FloatArray


@compiled
def linearise(
    k: int, state: FloatArray, data: Explained, array: NominalArray, beliefs: Beliefs, at: Linear, room: FloatArray
) -> None:
    """Fill in `at` for pulse k; see `locate_jointly` for the model.

    The derivative takes what projects the amplitude out, and what pose errors explain away, as constant.

    Args:
        k: Row of the pulse.
        state: Places of all sources, x, y and height of each, then errors by kind: gain, pointing, offset or not; then
            the terms of `pattern_deviation`, or none.
        data: The pulses.
        array: Of the data sheet, its boresights turned by their errors.
        beliefs: Deviations of the pose.
        at: Becomes the result.
        room: For intermediate results, shape (9 + n_terms, n_elements).
    """
    n_elements, n_terms = data.weight.shape[1], room.shape[0] - 9
    n_sources = (state.size - (at.slope.shape[1] - N_PLACE)) // N_PLACE
    n_kinds = (at.slope.shape[1] - N_PLACE - n_terms) // n_elements
    place, errors, deviation = N_PLACE * data.source[k], N_PLACE * n_sources, state[state.size - n_terms :]
    x, y = state[place] - data.pose[k, 0], state[place + 1] - data.pose[k, 1]
    cos_yaw, sin_yaw = math.cos(data.pose[k, 2]), math.sin(data.pose[k, 2])
    range_m = math.hypot(x, y)
    model, turn, rise, by_x, by_y, by_height, by_gain, by_pointing, by_offset = room[:9]
    by_term = room[9:]
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
            off_by = deviation_towards(
                deviation, boresight, forward / length, left / length, height / length, by_term[:, e]
            )
            gain += off_by.gain
            by_azimuth += off_by.by_azimuth
            by_elevation += off_by.by_elevation
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
    # how the strengths move when the pose is wrong: sideways or in heading, and towards the source
    near_m, height = max(range_m, 0.3), state[place + 2] - array.positions_m[0, 2]
    turn_variance = beliefs.heading_rad**2 + (beliefs.position_m / near_m) ** 2
    rise_variance = (beliefs.position_m * height / (near_m * near_m + height * height)) ** 2
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
        at.miss[e] = data.strengths[k, e] - amplitude * model[e]
    _tolerate(at.miss, turn, turn_share, rise, rise_share)
    for place_column, vector in enumerate((by_x, by_y, by_height)):
        column = at.slope[:, place_column]
        _explain(vector, model, energy, amplitude, column)
        _tolerate(column, turn, turn_share, rise, rise_share)
    for i in range(n_terms):
        column = at.slope[:, N_PLACE + n_kinds * n_elements + i]
        _explain(by_term[i], model, energy, amplitude, column)
        _tolerate(column, turn, turn_share, rise, rise_share)
    one = by_x  # is not needed any more
    for i in range(n_elements):
        for e in range(n_elements):
            one[e] = -amplitude * ((1.0 if e == i else 0.0) - model[i] * model[e] / energy)
        _tolerate(one, turn, turn_share, rise, rise_share)
        for e in range(n_elements):
            at.slope[e, N_PLACE + i] = by_gain[i] * one[e]
            at.slope[e, N_PLACE + n_elements + i] = by_pointing[i] * one[e]
            if n_kinds > 2:
                at.slope[e, N_PLACE + 2 * n_elements + i] = by_offset[i] * one[e]


@compiled
def _explain(vector: FloatArray, model: FloatArray, energy: float, amplitude: float, by_miss: FloatArray) -> None:
    """From a change of the model that of the miss, with the amplitude projected out."""
    along = dot(vector, model) / energy
    for e in range(vector.size):
        by_miss[e] = -amplitude * (vector[e] - along * model[e])


@compiled
def _to_unit(vector: FloatArray, variance: float) -> float:
    """Scale a change of the strengths by unit error to unit norm; the share of a miss along it that is tolerated.

    Args:
        vector: Whitened by the noise, shape (n_elements,).
        variance: Of that error.
    """
    energy = max(dot(vector, vector), 1e-12)
    for e in range(vector.size):
        vector[e] /= math.sqrt(energy)
    return 1.0 - 1.0 / math.sqrt(1.0 + variance * energy)


@compiled
def _tolerate(vector: FloatArray, turn: FloatArray, turn_share: float, rise: FloatArray, rise_share: float) -> None:
    """Take from a vector what pose errors explain away."""
    by_turn, by_rise = turn_share * dot(vector, turn), rise_share * dot(vector, rise)
    for e in range(vector.size):
        vector[e] -= by_turn * turn[e] + by_rise * rise[e]


@compiled
def evaluate(
    state: FloatArray, n_kinds: int, n_terms: int, data: Explained, array: NominalArray, beliefs: Beliefs
) -> Quadratic:
    r"""The cost of the robust fit about a state.

    .. math:: C = \sum_i s^2 (\sqrt{1 + (f_i / s)^2} - 1)

    over the misses f of all pulses in all channels, and of the states from what is believed of them.
    """
    n, n_elements = data.weight.shape
    n_errors = n_kinds * n_elements + n_terms
    n_own, errors = N_PLACE + n_errors, state.size - n_errors
    n_sources, scale = errors // N_PLACE, beliefs.robust_scale
    own_gradient, own_hessian = np.zeros((n_sources, n_own)), np.zeros((n_sources, n_own, n_own))
    gradient, hessian, cost = np.zeros(state.size), np.zeros((state.size, state.size)), 0.0
    at, room = Linear(np.empty(n_elements), np.empty((n_elements, n_own))), np.empty((9 + n_terms, n_elements))
    turned = array.boresights.copy()
    for e in range(n_elements):
        cos, sin = math.cos(state[errors + n_elements + e]), math.sin(state[errors + n_elements + e])
        turned[e, 0], turned[e, 1] = (
            cos * array.boresights[e, 0] - sin * array.boresights[e, 1],
            sin * array.boresights[e, 0] + cos * array.boresights[e, 1],
        )
    real = NominalArray(array.positions_m, turned, array.gain_factors, array.gain_offsets, array.pattern)
    for k in range(n):
        linearise(k, state, data, real, beliefs, at, room)
        sums, squares = own_gradient[data.source[k]], own_hessian[data.source[k]]
        for e in range(n_elements):
            root = math.sqrt(1.0 + (at.miss[e] / scale) ** 2)
            cost += scale * scale * (root - 1.0)
            first, second, slope = at.miss[e] / root, 1.0 / (root * root * root), at.slope[e]
            for i in range(n_own):
                sums[i] += first * slope[i]
                weighted = second * slope[i]
                for j in range(i + 1):
                    squares[i, j] += weighted * slope[j]
    for s in range(n_sources):
        for i in range(n_own):
            row = N_PLACE * s + i if i < N_PLACE else errors + i - N_PLACE
            gradient[row] += own_gradient[s, i]
            for j in range(i + 1):
                column = N_PLACE * s + j if j < N_PLACE else errors + j - N_PLACE
                hessian[row, column] += own_hessian[s, i, j]
    cost += _believe(state, beliefs, gradient, hessian)
    for i in range(state.size):
        for j in range(i):
            hessian[j, i] = hessian[i, j]
    return Quadratic(cost, gradient, hessian)


@compiled
def _believe(state: FloatArray, beliefs: Beliefs, gradient: FloatArray, hessian: FloatArray) -> float:
    """Cost of a state by what is believed of it; adds to gradient and to the lower half of the Hessian."""
    scale, cost = beliefs.robust_scale, 0.0
    for i in range(state.size):
        row, miss = beliefs.decorrelation[i], 0.0
        for j in range(i + 1):
            miss += row[j] * ((state[j] - beliefs.mean[j]) / beliefs.spread[j])
        root = math.sqrt(1.0 + (miss / scale) ** 2)
        cost += scale * scale * (root - 1.0)
        for j in range(i + 1):
            gradient[j] += miss / root * row[j] / beliefs.spread[j]
            for k in range(j + 1):
                hessian[j, k] += row[j] * row[k] / (root * root * root) / (beliefs.spread[j] * beliefs.spread[k])
    return cost
