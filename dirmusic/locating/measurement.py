r"""Measurement model: the strengths that a source causes in the array, with derivatives and covariance.

Element i of the array receives a pulse of amplitude :math:`A` (volts in a unit-gain channel 1 m from the source) with
the strength :math:`A h_i`,

.. math:: h_i = \frac{F_i}{r_i} \left(
          (1 + e_i) \left(b_i (g(\psi_i - w f(\psi_i)) + \delta_i) + c_i\right) + o_i \right)

at distance :math:`r_i` and angle :math:`\psi_i` off its boresight, which is turned by the pointing error :math:`d_i`
and by the tilt of the mount. Pattern g, factor :math:`b_i` and offset :math:`c_i` come from the data sheet;
:math:`\delta_i` is the error of the pattern, and :math:`F_i` the effect of the wave reflected by the ground, see
`ground_wave`.

Assumed in the derivatives: the coefficient and the coherence of the ground wave change so slowly with the position that
only the gains towards source and image matter. The mount tilts by small angles: their products are neglected.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dirmusic.array.pattern import Boresight, PatternTable, gain_and_slopes_towards
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.compiled import compiled, compiled_inner, elementwise
from dirmusic.pulses.strengths import dot

N_PLACE = 3
"""Number of states of a source: x, y, and height above the ground."""

N_POSE, N_SHARED = 3, 5
"""Number of errors of the pose, and of these with the cosine and the sine of the phase of the ground wave."""

WIDENING, TILT_X, TILT_Y, GROUND = range(4)
"""Order of the states of the mount and the ground: relative widening of the beam, tilt of the array about its x and y
axes, and the logarithm of the relative permittivity of the ground, which does not reflect if this is 0 or less."""

N_COMMON = 4
"""Number of these states."""

N_HARMONICS = 5
"""Number of harmonics of the angle off the boresight in the error of the pattern. The constant hardly affects ratios of
gains. Assumed; with seven, results for computed helices hardly change."""

N_TERMS = 6 * N_HARMONICS
"""Number of states of the pattern error: cosine and sine coefficients of each harmonic in the plane, then those
multiplied by the sine of the elevation, then those multiplied by its square."""

LOG_PERMITTIVITY = (1e-6, 7.0)
"""Limits of the logarithm of the relative permittivity of the ground, for numerical safety; water has 4.4."""

COHERENCE_M = 0.3
"""Excess path at which the coherence of direct and ground wave has fallen to exp(-1/2): that of a pulse with an rms
bandwidth of 160 MHz (Dir-MUSIC, section 4.2)."""

GATE_M, GATE_SPREAD_M = 0.83, 0.17
"""Path beyond that to the nearest element at which half of the energy of a wave arrives after the end of the gate, and
its spread. Assumed: a gate for all channels that ends 3.5 ns after the strongest one has reached half its peak, and
pulses whose energy arrives 0.75 ns after it, with a deviation of 0.57 ns. A longer gate raises strengths of sources
above 5 m by up to 4 %."""

WAVELENGTH_M = 0.167
"""Wavelength at the middle of the band of the Dir-MUSIC paper, 1.8 GHz (assumed). It affects only how the interference
of direct and ground wave differs between elements and places."""

LEAST_UNEXPLAINED, MULTIPATH_M = 0.01, 10.0
"""Relative error of a strength near a source that no state explains, and typical excess path of a reflection, metres
(assumed): multipath is weaker than the direct wave by r / (r + excess path), so its errors grow with the range r."""

LEAST_GAIN, TINY_VARIANCE = 1e-3, 1e-8
"""Lower limits of a gain with its error, and of the variance of a strength of unit norm, for numerical safety."""

T_FREEDOM = 4.0
"""Degrees of freedom of Student's t distribution of the strengths of a pulse (Lange, Little and Taylor 1989): errors by
multipath differ from place to place, and outliers pull little. Assumed: as of the errors of positions."""

FAR_OFF = (-1e3, 1e-3, 1.0, 30.0)
"""Result of `compare` for a pulse from another direction: practically impossible."""


class PooledPulses(NamedTuple):
    """Pulses to be fitted, each the average of pulses of one place, heading and direction.

    Attributes:
        pose: Estimated pose of the robot, shape (n, 3).
        strengths: Strengths scaled to unit norm, 0 for channels that are not usable, shape (n, n_elements).
        variance: Noise variance of these strengths, shape (n, n_elements).
        is_usable: True for channels that are used, shape (n, n_elements).
        weakening: Factor by which the direct wave is weaker than in free sight, 1 or more, shape (n,).
    """

    pose: FloatArray
    strengths: FloatArray
    variance: FloatArray
    is_usable: BoolArray
    weakening: FloatArray


class NominalArray(NamedTuple):
    """The array as in its data sheet.

    Attributes:
        positions_m: Positions of the elements, shape (n_elements, 3).
        boresights: Fields of `Boresight`, shape (n_elements, 4).
        gain_factors: Factors of the gains, shape (n_elements,).
        gain_offsets: Offsets of the gains, shape (n_elements,).
        pattern: Pattern in the plane.
    """

    positions_m: FloatArray
    boresights: FloatArray
    gain_factors: FloatArray
    gain_offsets: FloatArray
    pattern: PatternTable


class Noise(NamedTuple):
    """Standard deviations of the errors that are not states.

    Attributes:
        position_m: Position of the robot.
        heading_rad: Heading of the robot.
        unexplained: Relative error of a strength that no state explains.
    """

    position_m: float
    heading_rad: float
    unexplained: float


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


@compiled_inner
def ground_wave(
    length_m: float, reflected_m: float, rise_m: float, nearest_m: float, log_permittivity: float
) -> tuple[float, float, float]:
    r"""Return the expected effect of the wave reflected by level ground.

    The polarisation of the source and the phase between both waves are unknown. With the Fresnel coefficients
    :math:`\Gamma` of the ground, the share G of the energy that arrives before the end of the gate, and the coherence
    c, the energy grows by the factor :math:`1 + \rho^2 x^2`, where x is the ratio of the gains and

    .. math:: \rho^2 = G \frac{\Gamma_\perp^2 + \Gamma_\parallel^2}{2} \left(\frac{r}{r_g}\right)^2
              \left(1 - \frac{c^2}{2}\right)

    The last factor is the second-order mean of the root of the energy. Interference changes a strength by
    :math:`\pm \rho_0 c\, x`, where :math:`\rho_0` is without that factor.

    Args:
        length_m: Length r of the direct path.
        reflected_m: Length :math:`r_g` of the reflected path.
        rise_m: Sum of the heights of source and element; its sign does not matter.
        nearest_m: Length of the direct path to the nearest element, whose pulse starts the gate.
        log_permittivity: Logarithm of the relative permittivity of the ground; values beyond `LOG_PERMITTIVITY` count
            as its limits.

    Returns:
        :math:`\rho^2`, its derivative by `log_permittivity`, and :math:`\rho_0 c`.
    """
    within = min(max(log_permittivity, LOG_PERMITTIVITY[0]), LOG_PERMITTIVITY[1])
    cosine, permittivity = abs(rise_m) / reflected_m, math.exp(within)
    root = math.sqrt(permittivity - 1.0 + cosine * cosine)
    across, along = cosine + root, permittivity * cosine + root
    perpendicular, parallel = (cosine - root) / across, (permittivity * cosine - root) / along
    slope = parallel * (2.0 * root * root - permittivity) / along**2 - perpendicular / across**2
    slope *= permittivity * cosine / root if within == log_permittivity else 0.0
    share = 0.5 * math.erfc((reflected_m - nearest_m - GATE_M) / (math.sqrt(2.0) * GATE_SPREAD_M))
    share *= (length_m / reflected_m) ** 2
    power = 0.5 * (perpendicular * perpendicular + parallel * parallel) * share
    coherence = math.exp(-0.5 * ((reflected_m - length_m) / COHERENCE_M) ** 2)
    of_mean = 1.0 - 0.5 * coherence * coherence
    return power * of_mean, slope * share * of_mean, math.sqrt(power) * coherence


class Gain(NamedTuple):
    """Gain of an element towards a point, and its derivatives.

    Attributes:
        gain: Gain with the pattern error.
        by_turn: Derivative by the azimuth of the point, per radian; with the other sign, by the pointing error.
        by_ahead: Derivative by the position of the point along x of the array frame, per metre.
        by_left: Derivative along y.
        by_up: Derivative along z.
        by_tilt_x: Derivative by the tilt about x, per radian.
        by_tilt_y: Derivative by the tilt about y.
        by_widening: Derivative by the widening of the beam.
    """

    gain: float
    by_turn: float
    by_ahead: float
    by_left: float
    by_up: float
    by_tilt_x: float
    by_tilt_y: float
    by_widening: float


@compiled_inner
def gain_of_point(
    pattern: PatternTable,
    boresight: Boresight,
    ahead: float,
    left: float,
    up: float,
    array_state: FloatArray,
    deviation: FloatArray,
    of_term: FloatArray,
) -> Gain:
    """Compute the gain of an element towards the point (ahead, left, up), array frame, metres from the element.

    Args:
        pattern: Pattern in the plane.
        boresight: Boresight of the element, with its pointing error.
        ahead: Position of the point along x.
        left: Position along y.
        up: Position along z.
        array_state: States of the array, of which widening and tilt are used.
        deviation: States of the pattern error, shape (N_TERMS,), or (0,) without.
        of_term: Output: derivatives by these states.
    """
    tilt_x, tilt_y, widening = array_state[TILT_X], array_state[TILT_Y], array_state[WIDENING]
    x, y, z = ahead + tilt_y * up, left - tilt_x * up, up + tilt_x * left - tilt_y * ahead
    level2 = max(x * x + y * y, 1e-4)
    level, square = math.sqrt(level2), level2 + z * z
    length = math.sqrt(square)
    gain, turn, rise, by_widening = gain_and_slopes_towards(
        pattern, boresight, x / length, y / length, z / length, widening
    )
    if deviation.size > 0:
        added, turn_added, rise_added = deviation_towards(
            deviation, boresight, x / length, y / length, z / length, of_term
        )
        gain, turn, rise = gain + added, turn + turn_added, rise + rise_added
    by_x = -turn * y / level2 - rise * z * x / (level * square)
    by_y = turn * x / level2 - rise * z * y / (level * square)
    by_z = rise * level / square
    return Gain(
        max(gain, LEAST_GAIN),
        turn,
        by_x - tilt_y * by_z,
        by_y + tilt_x * by_z,
        by_z + tilt_y * by_x - tilt_x * by_y,
        left * by_z - up * by_y,
        up * by_x - ahead * by_z,
        by_widening,
    )


class Prediction(NamedTuple):
    """Predicted strengths of one pulse compared with the measured ones; channels that are not usable are 0.

    Attributes:
        model: Predicted strengths for an amplitude of 1, shape (n_elements,).
        residual: Measured strengths minus predicted ones for the best amplitude, shape (n_elements,).
        slope: Derivative of the predicted strengths by the position and by the states of the array, shape (n_elements,
            N_PLACE + n_array_states), up to multiples of the model.
        covariance: Covariance of the measured strengths, shape (n_elements, n_elements).
        shared: Change of the measured strengths by one standard deviation of each error that neighbouring pulses share,
            shape (n_elements, N_SHARED + n_elements): x, y and heading of the pose, cosine and sine of the phase of the
            ground wave, multipath in each element.
    """

    model: FloatArray
    residual: FloatArray
    slope: FloatArray
    covariance: FloatArray
    shared: FloatArray


@compiled_inner
def empty_prediction(n_elements: int, n_states: int) -> Prediction:
    """Allocate a prediction."""
    return Prediction(
        np.empty(n_elements),
        np.empty(n_elements),
        np.empty((n_elements, n_states)),
        np.empty((n_elements, n_elements)),
        np.zeros((n_elements, N_SHARED + n_elements)),
    )


@compiled_inner
def remove_amplitude(model: FloatArray, change: FloatArray) -> None:
    """Remove, in place, the part of changes (n_elements, m) of the model that a change of the amplitude explains."""
    square, along = dot(model, model), np.zeros(change.shape[1])
    for e in range(model.size):
        for i in range(along.size):
            along[i] += model[e] / square * change[e, i]
    for e in range(model.size):
        for i in range(along.size):
            change[e, i] -= along[i] * model[e]


@compiled
def predict(
    k: int,
    state: FloatArray,
    place: int,
    array_state: FloatArray,
    pulses: PooledPulses,
    array: NominalArray,
    noise: Noise,
    predicted: Prediction,
) -> tuple[float, float, float]:
    """Predict the strengths of a pulse.

    Errors of the pose act like a displacement of the source or a turn of the array.

    Args:
        k: Row of the pulse.
        state: Positions of all sources, world frame with heights above the ground, metres, shape (3 n_sources,).
        place: Index of the first coordinate of the source.
        array_state: States of the array: `WIDENING` to `GROUND`, the errors of the elements by kind, and the states of
            the pattern error, see `N_TERMS`.
        pulses: The pulses.
        array: The array as in its data sheet.
        noise: Standard deviations of errors that are not states.
        predicted: Output.

    Returns:
        The amplitude, and the traces of two parts of the covariance: of errors that neighbouring pulses share, without
        that of the ground wave, which differs between both sides of the array's plane; and of the noise.
    """
    model, residual, slope, covariance, shared = predicted
    n, pose, usable = residual.size, pulses.pose[k], pulses.is_usable[k]
    gains, pointings, offsets, terms = N_COMMON, N_COMMON + n, N_COMMON + 2 * n, N_COMMON + 3 * n
    x, y, z, deviation = state[place] - pose[0], state[place + 1] - pose[1], state[place + 2], array_state[terms:]
    cos_yaw, sin_yaw = math.cos(pose[2]), math.sin(pose[2])
    of_term = np.zeros(deviation.size)
    model[:] = 0.0
    slope[:] = 0.0
    shared[:] = 0.0
    nearest_m = math.inf
    for e in range(n):
        if usable[e]:
            ahead = cos_yaw * x + sin_yaw * y - array.positions_m[e, 0]
            left = cos_yaw * y - sin_yaw * x - array.positions_m[e, 1]
            nearest_m = min(nearest_m, math.sqrt(ahead * ahead + left * left + (z - array.positions_m[e, 2]) ** 2))
    for e in range(n):
        if not usable[e]:
            continue
        of_array = slope[e, N_PLACE:]
        ahead = cos_yaw * x + sin_yaw * y - array.positions_m[e, 0]
        left = cos_yaw * y - sin_yaw * x - array.positions_m[e, 1]
        up, below = z - array.positions_m[e, 2], -z - array.positions_m[e, 2]
        level2 = max(ahead * ahead + left * left, 1e-4)
        square = level2 + up * up
        length, reflected_m = math.sqrt(square), math.sqrt(level2 + below * below)
        cos, sin, of = math.cos(array_state[pointings + e]), math.sin(array_state[pointings + e]), array.boresights[e]
        boresight = Boresight(cos * of[0] - sin * of[1], sin * of[0] + cos * of[1], of[2], of[3])
        direct = gain_of_point(array.pattern, boresight, ahead, left, up, array_state, deviation, of_array[terms:])
        image = gain_of_point(array.pattern, boresight, ahead, left, below, array_state, deviation, of_term)
        power, by_ground, coherent = ground_wave(length, reflected_m, -below, nearest_m, array_state[GROUND])
        energy = power * (image.gain / direct.gain) ** 2
        ground = math.sqrt(1.0 + energy)
        own, factor = 1.0 + array_state[gains + e], ground / length
        larger = array.gain_factors[e] * own * factor
        nominal = factor * (array.gain_factors[e] * direct.gain + array.gain_offsets[e])
        model[e] = own * nominal + factor * array_state[offsets + e]
        by_energy = model[e] / (1.0 + energy)
        by_direct, by_image = larger - by_energy * energy / direct.gain, by_energy * energy / image.gain
        by_ahead = by_direct * direct.by_ahead + by_image * image.by_ahead - model[e] * ahead / square
        by_left = by_direct * direct.by_left + by_image * image.by_left - model[e] * left / square
        turn = by_direct * direct.by_turn + by_image * image.by_turn
        slope[e, 0] = cos_yaw * by_ahead - sin_yaw * by_left
        slope[e, 1] = sin_yaw * by_ahead + cos_yaw * by_left
        slope[e, 2] = by_direct * direct.by_up - by_image * image.by_up - model[e] * up / square
        of_array[WIDENING] = by_direct * direct.by_widening + by_image * image.by_widening
        of_array[TILT_X] = by_direct * direct.by_tilt_x + by_image * image.by_tilt_x
        of_array[TILT_Y] = by_direct * direct.by_tilt_y + by_image * image.by_tilt_y
        of_array[GROUND] = 0.5 * by_energy * by_ground * (image.gain / direct.gain) ** 2
        of_array[gains + e], of_array[pointings + e], of_array[offsets + e] = nominal, -turn, factor
        for i in range(deviation.size):
            of_array[terms + i] = by_direct * of_array[terms + i] + by_image * of_term[i]
        shared[e, 0], shared[e, 1] = noise.position_m * slope[e, 0], noise.position_m * slope[e, 1]
        shared[e, 2], interference = noise.heading_rad * turn, math.sqrt(0.5) * larger * image.gain * coherent / ground
        phase = 2.0 * math.pi / WAVELENGTH_M * (reflected_m - length)
        shared[e, 3], shared[e, 4] = interference * math.cos(phase), interference * math.sin(phase)
    remove_amplitude(model, slope[:, : N_PLACE + N_COMMON])
    remove_amplitude(model, shared[:, :N_SHARED])
    amplitude = dot(pulses.strengths[k], model) / dot(model, model)
    by_shared, by_noise, range_m = 0.0, 0.0, math.hypot(x, y)
    unexplained = noise.unexplained * pulses.weakening[k] * range_m / (range_m + MULTIPATH_M)
    multipath = math.hypot(LEAST_UNEXPLAINED, unexplained)
    for e in range(n):
        residual[e] = pulses.strengths[k, e] - amplitude * model[e]
        for i in range(slope.shape[1]):
            slope[e, i] *= amplitude
        for i in range(N_SHARED):
            shared[e, i] *= amplitude
        shared[e, N_SHARED + e] = multipath * amplitude * model[e]
        for i in range(e + 1):
            covariance[e, i] = covariance[i, e] = dot(shared[e, :N_SHARED], shared[i, :N_SHARED])
        covariance[e, e] += shared[e, N_SHARED + e] ** 2
        by_shared += covariance[e, e] - shared[e, N_POSE] ** 2 - shared[e, N_POSE + 1] ** 2
        if usable[e]:
            by_noise += pulses.variance[k, e]
            covariance[e, e] += pulses.variance[k, e] + TINY_VARIANCE
        else:
            covariance[e, e] = 1.0
    return amplitude, by_shared, by_noise


@compiled_inner
def factorise(covariance: FloatArray) -> float:
    """Replace a covariance by its lower Cholesky factor, and return the logarithm of its determinant."""
    log_det = 0.0
    for i in range(covariance.shape[0]):
        for j in range(i + 1):
            total = covariance[i, j] - dot(covariance[i, :j], covariance[j, :j])
            covariance[i, j] = math.sqrt(total) if i == j else total / covariance[j, j]
        log_det += 2.0 * math.log(covariance[i, i])
    return log_det


@compiled_inner
def substitute(factor: FloatArray, model: FloatArray, residual: FloatArray, slope: FloatArray) -> None:
    """Multiply model, residual and slope, in place, by the inverse of a lower Cholesky factor."""
    for i in range(residual.size):
        root = factor[i, i]
        model[i] = (model[i] - dot(factor[i, :i], model[:i])) / root
        residual[i] = (residual[i] - dot(factor[i, :i], residual[:i])) / root
        for j in range(i):
            for m in range(slope.shape[1]):
                slope[i, m] -= factor[i, j] * slope[j, m]
        for m in range(slope.shape[1]):
            slope[i, m] /= root


@compiled
def whiten(predicted: Prediction) -> float:
    r"""Transform model, residual and slope, in place, so that the covariance becomes the identity; fit the amplitude.

    With the covariance C of all strengths and a flat prior of the amplitude, the density of the residual r is normal on
    the n - 1 dimensions across the unit vector u of the model, with

    .. math:: \chi^2 = r^T C^{-1} r - \frac{(u^T C^{-1} r)^2}{u^T C^{-1} u}, \quad |C_\perp| = |C| \, u^T C^{-1} u

    Changes of the residual along the model change neither. The covariance is replaced by its lower Cholesky factor.

    Returns:
        Logarithm of the determinant across the model.
    """
    model, residual, slope, covariance, _ = predicted
    log_det = factorise(covariance) - math.log(dot(model, model))
    substitute(covariance, model, residual, slope)
    remove_amplitude(model, residual.reshape(-1, 1))
    remove_amplitude(model, slope)
    return log_det + math.log(dot(model, model))


@elementwise
def t_cost(square: float, n_dimensions: float, t_freedom: float) -> float:
    """Return the negative log density of Student's t distribution at a squared distance, up to terms that are fixed."""
    return 0.5 * (t_freedom + n_dimensions) * math.log1p(square / t_freedom)


@elementwise
def t_weight(square: float, n_dimensions: float, t_freedom: float) -> float:
    """Return the weight of a residual in a fit by least squares, its derivative by half of the square; 1 on average."""
    return (t_freedom + n_dimensions) / (t_freedom + square)


@compiled_inner
def t_information(n_dimensions: float, t_freedom: float) -> float:
    """Return the Fisher information about the mean, relative to that of a normal distribution of the same scale."""
    return (t_freedom + n_dimensions) / (t_freedom + n_dimensions + 2.0)


class FixedErrors(NamedTuple):
    """Errors of pulses as predicted at one state, which a fit holds fixed.

    Attributes:
        factor: Lower Cholesky factor of the covariance of each pulse, shape (n, n_elements, n_elements).
        log_det: Logarithm of the determinant of the covariance across the model, shape (n,).
        weight: Effective number of independent pulses that each pulse stands for, shape (n,).
    """

    factor: FloatArray
    log_det: FloatArray
    weight: FloatArray


@compiled
def errors_at(
    state: FloatArray,
    source: IntArray,
    probability: FloatArray,
    repeats: FloatArray,
    pulses: PooledPulses,
    array: NominalArray,
    noise: Noise,
) -> FixedErrors:
    r"""Predict the errors of pulses at a state.

    The weight of a pulse is the probability that it came from its source, divided by the effective number of pulses
    that share its errors: with the trace S of the shared part of the covariance and the trace N of the noise,
    :math:`(N + S) / (N + m S)` for m pulses.

    Args:
        state: All states; the positions of the sources come first.
        source: Index of the source of each pulse, shape (n,).
        probability: Probability that each pulse came from this source, shape (n,).
        repeats: Effective number m of pulses that share the errors of each pulse, shape (n,).
        pulses: The pulses.
        array: The array as in its data sheet.
        noise: Standard deviations of errors that are not states.
    """
    n, n_elements = pulses.strengths.shape
    of_sources = N_PLACE * (int(source.max()) + 1)
    array_state, no_slope = state[of_sources:], np.empty((n_elements, 0))
    errors = FixedErrors(np.empty((n, n_elements, n_elements)), np.empty(n), np.empty(n))
    predicted = empty_prediction(n_elements, N_PLACE + array_state.size)
    model, residual, _, covariance, unused = predicted
    for k in range(n):
        _, shared, by_noise = predict(k, state, N_PLACE * source[k], array_state, pulses, array, noise, predicted)
        errors.weight[k] = probability[k] * (by_noise + shared) / (by_noise + repeats[k] * shared)
        errors.log_det[k] = whiten(Prediction(model, residual, no_slope, covariance, unused))
        errors.factor[k] = covariance
    return errors


@compiled_inner
def whiten_again(
    factor: FloatArray, amplitude: float, predicted: Prediction, is_usable: BoolArray
) -> tuple[float, float, float]:
    """Transform model, residual and slope, in place, as `whiten` does, with a covariance that is held fixed.

    Args:
        factor: Lower Cholesky factor of the covariance.
        amplitude: Amplitude at which the slope was predicted.
        predicted: The prediction.
        is_usable: True for usable channels.

    Returns:
        Square and number of dimensions of the residual, and the factor of the slope for the best amplitude.
    """
    model, residual, slope, _, _ = predicted
    substitute(factor, model, residual, slope)
    refined = 1.0 + dot(model, residual) / (dot(model, model) * amplitude)
    remove_amplitude(model, residual.reshape(-1, 1))
    remove_amplitude(model, slope)
    return dot(residual, residual), is_usable.sum() - 1.0, refined


class CostExpansion(NamedTuple):
    """Cost of a state and its derivatives.

    Attributes:
        cost: Cost.
        gradient: Gradient, shape (n_states,).
        hessian: Expected Hessian, shape (n_states, n_states).
    """

    cost: float
    gradient: FloatArray
    hessian: FloatArray


@compiled
def expand(
    state: FloatArray,
    errors: FixedErrors,
    source: IntArray,
    pulses: PooledPulses,
    array: NominalArray,
    noise: Noise,
    t_freedom: float,
) -> CostExpansion:
    r"""Compute the cost of the fit at a state, with its gradient and expected Hessian.

    The strengths of a pulse have Student's t distribution of :math:`\nu` degrees of freedom on the d dimensions across
    the model:

    .. math:: \sum_k w_k \left(\frac{\nu + d_k}{2} \log (1 + \chi_k^2 / \nu) + \frac{1}{2} \log |C_{\perp k}|\right)

    The sum is over the pulses; their weights and covariances are fixed.

    Args:
        state: All states; the positions of the sources come first.
        errors: Weights and covariances.
        source: Index of the source of each pulse, shape (n,).
        pulses: The pulses.
        array: The array as in its data sheet.
        noise: Standard deviations of errors that are not states.
        t_freedom: Degrees of freedom; infinite for a normal distribution.
    """
    n, n_elements = pulses.strengths.shape
    n_sources = int(source.max()) + 1
    of_sources = N_PLACE * n_sources
    array_state, n_own = state[of_sources:], state.size - of_sources + N_PLACE
    own_gradient, own_hessian = np.zeros((n_sources, n_own)), np.zeros((n_sources, n_own, n_own))
    cost = 0.0
    predicted = empty_prediction(n_elements, n_own)
    _, residual, slopes, _, _ = predicted
    for k in range(n):
        s = source[k]
        amplitude, _, _ = predict(k, state, N_PLACE * s, array_state, pulses, array, noise, predicted)
        square, n_dimensions, refined = whiten_again(errors.factor[k], amplitude, predicted, pulses.is_usable[k])
        weight = errors.weight[k] * t_weight(square, n_dimensions, t_freedom) * refined
        sharpness = t_information(n_dimensions, t_freedom) * refined
        cost += errors.weight[k] * (t_cost(square, n_dimensions, t_freedom) + 0.5 * errors.log_det[k])
        for e in range(n_elements):
            slope = slopes[e]
            for i in range(n_own):
                weighted, row = weight * slope[i], own_hessian[s, i]
                own_gradient[s, i] -= weighted * residual[e]
                for j in range(i + 1):
                    row[j] += weighted * sharpness * slope[j]
    gradient, hessian = np.zeros(state.size), np.zeros((state.size, state.size))
    for s in range(n_sources):
        for i in range(n_own):
            row = N_PLACE * s + i if i < N_PLACE else of_sources + i - N_PLACE
            gradient[row] += own_gradient[s, i]
            for j in range(i + 1):
                column = N_PLACE * s + j if j < N_PLACE else of_sources + j - N_PLACE
                hessian[row, column] += own_hessian[s, i, j]
    for i in range(state.size):
        for j in range(i):
            hessian[j, i] = hessian[i, j]
    return CostExpansion(cost, gradient, hessian)


@compiled
def shared_scores(
    state: FloatArray,
    errors: FixedErrors,
    source: IntArray,
    pulses: PooledPulses,
    array: NominalArray,
    noise: Noise,
    t_freedom: float,
) -> FloatArray:
    """Compute the change of the gradient of the cost by errors that pulses share; arguments as in `expand`.

    For Student's t distribution, it is scaled so that its mean square is the information in `CostExpansion.hessian`.

    Returns:
        Change by one standard deviation of each shared error, shape (n, N_SHARED + n_elements, n_states); see
        `Prediction.shared`.
    """
    n, n_elements = pulses.strengths.shape
    of_sources = N_PLACE * (int(source.max()) + 1)
    array_state = state[of_sources:]
    predicted = empty_prediction(n_elements, N_PLACE + array_state.size)
    model, residual, slopes, _, shared = predicted
    scores = np.zeros((n, shared.shape[1], state.size))
    for k in range(n):
        place = N_PLACE * source[k]
        amplitude, _, _ = predict(k, state, place, array_state, pulses, array, noise, predicted)
        substitute(errors.factor[k], np.copy(model), np.copy(residual), shared)
        square, n_dimensions, refined = whiten_again(errors.factor[k], amplitude, predicted, pulses.is_usable[k])
        of_t = t_weight(square, n_dimensions, t_freedom) * t_information(n_dimensions, t_freedom)
        weight = errors.weight[k] * math.sqrt(of_t) * refined
        for i in range(slopes.shape[1]):
            column = place + i if i < N_PLACE else of_sources + i - N_PLACE
            for e in range(n_elements):
                for j in range(shared.shape[1]):
                    scores[k, j, column] -= weight * slopes[e, i] * shared[e, j]
    return scores


@compiled
def misfits(
    state: FloatArray, source: IntArray, pulses: PooledPulses, array: NominalArray, noise: Noise
) -> tuple[FloatArray, FloatArray]:
    """Compute squares of whitened residuals and log determinants, both (n,), at one state; arguments as in `expand`."""
    n, n_elements = pulses.strengths.shape
    errors = N_PLACE * (int(source.max()) + 1)
    array_state, misfit, log_det = state[errors:], np.empty(n), np.empty(n)
    predicted, no_slope = empty_prediction(n_elements, N_PLACE + array_state.size), np.empty((n_elements, 0))
    model, residual, _, covariance, unused = predicted
    for k in range(n):
        predict(k, state, N_PLACE * source[k], array_state, pulses, array, noise, predicted)
        log_det[k] = whiten(Prediction(model, residual, no_slope, covariance, unused))
        misfit[k] = dot(residual, residual)
    return misfit, log_det


@compiled
def compare(
    rows: IntArray,
    place_m: FloatArray,
    array_state: FloatArray,
    uncertainty: FloatArray,
    pulses: PooledPulses,
    array: NominalArray,
    noise: Noise,
    azimuth_rad: FloatArray,
    result: FloatArray,
) -> None:
    """Compare pulses with the prediction for one source.

    Args:
        rows: Rows of the pulses, shape (n,).
        place_m: Position of the source, shape (3,).
        array_state: States of the array, see `predict`.
        uncertainty: Covariance of the position and these states, shape (N_PLACE + n_states, N_PLACE + n_states).
        pulses: The pulses.
        array: The array as in its data sheet.
        noise: Standard deviations of errors that are not states.
        azimuth_rad: Estimated direction of each of these pulses, array frame, shape (n,).
        result: Output, shape (n, 4): log density of the strengths on the unit sphere, amplitude, standard deviation of
            the bearing in radians, and offset of the bearing in standard deviations. For a pulse from more than 60
            degrees off: `FAR_OFF`.
    """
    n_elements, n_own = pulses.strengths.shape[1], uncertainty.shape[0]
    predicted, spread, turn = empty_prediction(n_elements, n_own), np.empty(n_own), np.empty((n_elements, 1))
    model, residual, slope, covariance, unused = predicted
    for i in range(rows.size):
        k = rows[i]
        x, y = place_m[0] - pulses.pose[k, 0], place_m[1] - pulses.pose[k, 1]
        if math.cos(math.atan2(y, x) - pulses.pose[k, 2] - azimuth_rad[i]) < 0.5 and x * x + y * y > 1.0:
            for column in range(result.shape[1]):
                result[i, column] = FAR_OFF[column]
            continue
        amplitude, _, _ = predict(k, place_m, 0, array_state, pulses, array, noise, predicted)
        freedom = -1
        for e in range(n_elements):
            freedom += pulses.is_usable[k, e]
            turn[e, 0] = x * slope[e, 1] - y * slope[e, 0]
            spread[:] = 0.0
            for m in range(n_own):
                if slope[e, m] != 0.0:  # errors of other elements have no influence
                    for j in range(n_own):
                        spread[j] += slope[e, m] * uncertainty[m, j]
            for f in range(e + 1):
                covariance[e, f] = covariance[f, e] = covariance[e, f] + dot(spread, slope[f])
        log_det = whiten(Prediction(model, residual, turn, covariance, unused))
        misfit, information = dot(residual, residual), max(dot(turn[:, 0], turn[:, 0]), 1e-6)
        result[i, 0] = -0.5 * (misfit + log_det + freedom * math.log(2.0 * math.pi))
        result[i, 1], result[i, 2] = amplitude, 1.0 / math.sqrt(information)
        result[i, 3] = dot(turn[:, 0], residual) / math.sqrt(information)


@compiled
def position_slopes(
    place_m: FloatArray, array_state: FloatArray, pulses: PooledPulses, array: NominalArray, slopes: FloatArray
) -> None:
    """Compute the derivatives of predicted strengths by the position of the source, up to multiples of the strengths.

    Args:
        place_m: Position of the source, shape (3,).
        array_state: States of the array, see `predict`.
        pulses: The pulses.
        array: The array as in its data sheet.
        slopes: Output, shape (n, n_elements, N_PLACE).
    """
    predicted = empty_prediction(pulses.strengths.shape[1], N_PLACE + array_state.size)
    for k in range(pulses.pose.shape[0]):
        predict(k, place_m, 0, array_state, pulses, array, Noise(0.0, 0.0, 0.0), predicted)
        slopes[k] = predicted.slope[:, :N_PLACE]


@compiled
def whiten_residuals(
    place_m: FloatArray,
    array_state: FloatArray,
    pulses: PooledPulses,
    array: NominalArray,
    noise: Noise,
    residuals: FloatArray,
    slopes: FloatArray,
    log_det: FloatArray,
) -> None:
    """Compute whitened residuals of pulses for one source, and their derivatives by its position.

    Args:
        place_m: Position of the source, shape (3,).
        array_state: States of the array, see `predict`.
        pulses: The pulses.
        array: The array as in its data sheet.
        noise: Standard deviations of errors that are not states.
        residuals: Output, shape (n, n_elements).
        slopes: Output: derivative of the predicted strengths, shape (n, n_elements, N_PLACE).
        log_det: Output: logarithm of the determinant of the covariance across the model, shape (n,).
    """
    n_elements = pulses.strengths.shape[1]
    predicted = empty_prediction(n_elements, N_PLACE + array_state.size)
    for k in range(pulses.pose.shape[0]):
        predict(k, place_m, 0, array_state, pulses, array, noise, predicted)
        log_det[k] = whiten(predicted)
        residuals[k] = predicted.residual
        slopes[k] = predicted.slope[:, :N_PLACE]
