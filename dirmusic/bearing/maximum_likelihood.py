"""Maximum-likelihood estimation of bearings from strengths, refined between grid points, with standard deviations."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dirmusic.angles import wrap, wrapped
from dirmusic.array.bounds import perpendicular_slope
from dirmusic.array.element_errors import ManifoldPrior
from dirmusic.array.manifold import SEARCH_STEP_RAD, GainManifold, ManifoldTable
from dirmusic.array.model import ArrayModel
from dirmusic.array.pattern import cubic
from dirmusic.arrays import FloatArray, IntArray
from dirmusic.bearing.elevation import LEAST_CHANNELS, search_elevations
from dirmusic.bearing.spectrum import check_covariance
from dirmusic.compiled import Held, compiled, compiled_inner
from dirmusic.pulses.batch import LEAST_SHARE, NO_DIRECTION, UNKNOWN_STD_RAD, Bearings, PulseBatch
from dirmusic.pulses.strengths import broken_channels, dot

REFINEMENTS = 2
"""Number of Gauss-Newton steps after the first; without noise, two converge to 1e-9 rad."""

TINY = 1e-12
"""Smallest squared slope, per radian squared, to prevent division by zero."""


class Fit(NamedTuple):
    """Fit of one direction to each row of pooled pulses.

    Attributes:
        bearings: Directions, their standard deviations due to noise, and misfits, shape (n_rows,).
        strengths: Pooled strengths divided by their amplitude, and therefore close to the gains, shape
            (n_rows, n_elements).
        variance: Noise variance of `strengths`, same shape.
    """

    bearings: Bearings
    strengths: FloatArray
    variance: FloatArray


@compiled_inner
def look_up(azimuth_rad: float, table: ManifoldTable, gain: FloatArray, slope: FloatArray) -> None:
    """Interpolate the gain of each element and its slope per radian, by cubic Hermite interpolation of the table."""
    n, step_rad = table.gain.shape[0], 2.0 * np.pi / table.gain.shape[0]
    at = azimuth_rad / step_rad
    low = np.floor(at)
    t, i = at - low, int(low) % n
    j = (i + 1) % n
    for e in range(gain.size):
        from_slope, to_slope = step_rad * table.slope[i, e], step_rad * table.slope[j, e]
        gain[e], slope_per_step = cubic(t, table.gain[i, e], table.gain[j, e], from_slope, to_slope)
        slope[e] = slope_per_step / step_rad


@compiled_inner
def best_search_azimuth(covariance: FloatArray, unit_pairs: FloatArray, match: FloatArray) -> int:
    """Find the search azimuth whose unit gain u maximises u^T R u; `match` is scratch memory."""
    match[:] = 0.0
    pair = 0
    for e in range(covariance.shape[0]):
        for f in range(e + 1):
            weight = covariance[e, f] if e == f else covariance[e, f] + covariance[f, e]
            for j in range(match.size):
                match[j] += weight * unit_pairs[pair, j]
            pair += 1
    return int(np.argmax(match))


@compiled
def fit_pulses(
    strengths: FloatArray,
    variance: FloatArray,
    total_variance: FloatArray,
    held_table: Held[ManifoldTable],
    without_strength: tuple[float, float, float],
    given_rad: FloatArray,
) -> Fit:
    r"""Find the best search azimuth of each row of pulses and refine it by Gauss-Newton within one search step.

    The amplitude is projected out: only the component of the slope orthogonal to the gain matters,
    :math:`p = (I - g g^T / g^T g) g'`. For one pulse of variance v, the standard deviation due to noise is

    .. math:: \sigma^2 = \frac{\sum_i p_i^2 v_i}{\lVert p \rVert^4 \alpha^2}, \quad \alpha = g^T a / g^T g

    At a kink of the pattern (eq. (1) has one where its angle wraps from 360 to 0
    degrees), the steps may end on the other side of the kink; the error is equally large on either side.

    Args:
        strengths: Strengths, shape (n_rows, n_pulses, n_elements).
        variance: Variance of the strengths, same shape.
        total_variance: Sum of the variances of the pulses of a row, shape (n_rows, n_elements).
        held_table: Table of the manifold.
        without_strength: Azimuth, standard deviation and misfit to return for rows without strength.
        given_rad: Azimuths to use instead of the best ones, shape (n_rows,); empty to find the best ones.

    Returns:
        The fits, with azimuths in (-pi, pi].
    """
    n_rows, n_pulses, n = strengths.shape
    table, bearings = held_table.value, Bearings(np.empty(n_rows), np.empty(n_rows), np.empty(n_rows), np.zeros(n_rows))
    fit = Fit(bearings, np.zeros((n_rows, n)), np.zeros((n_rows, n)))
    covariance, match = np.empty((n, n)), np.empty(table.unit_pairs.shape[1])
    gain, slope, across = np.empty(n), np.empty(n), np.empty(n)
    for row in range(n_rows):
        pulses, data, noise = strengths[row], fit.strengths[row], fit.variance[row]
        total = 0.0
        for e in range(n):
            for f in range(n):
                covariance[e, f] = 0.0
                for k in range(n_pulses):
                    covariance[e, f] += pulses[k, e] * pulses[k, f]
            total += covariance[e, e]
        if not total > 0.0:
            bearings.azimuth_rad[row], bearings.std_rad[row], bearings.misfit[row] = without_strength
            continue
        if given_rad.size:
            start_rad = given_rad[row]
        else:
            start_rad = SEARCH_STEP_RAD * best_search_azimuth(covariance, table.unit_pairs, match)
        azimuth_rad, energy, amplitude_energy = start_rad, 0.0, 0.0
        for _ in range(REFINEMENTS + 1):
            look_up(azimuth_rad, table, gain, slope)
            energy = dot(gain, gain)
            along = dot(gain, slope) / energy
            for e in range(n):
                across[e] = slope[e] - along * gain[e]
                data[e] = dot(covariance[e], gain) / energy
            amplitude_energy = dot(data, gain) / energy
            weight = (dot(across, across) + TINY) * amplitude_energy
            if weight > 0.0 and given_rad.size == 0:
                azimuth_rad += dot(across, data) / weight
            azimuth_rad = min(max(azimuth_rad, start_rad - SEARCH_STEP_RAD), start_rad + SEARCH_STEP_RAD)
        for k in range(n_pulses):
            amplitude = dot(pulses[k], gain) / energy
            for e in range(n):
                noise[e] += amplitude * amplitude * variance[row, k, e]
        bias, spread = 0.0, 0.0  # expected contributions of noise to the squared amplitudes and to the slope of the fit
        for e in range(n):
            bias += total_variance[row, e] * gain[e] * gain[e] / (energy * energy)
            spread += across[e] * across[e] * noise[e]
        signal = max(amplitude_energy - bias, LEAST_SHARE * amplitude_energy)
        bearings.azimuth_rad[row] = wrapped(azimuth_rad)
        bearings.std_rad[row] = min(np.sqrt(spread) / ((dot(across, across) + TINY) * signal), UNKNOWN_STD_RAD)
        bearings.misfit[row] = min(max(1.0 - amplitude_energy * energy / total, 0.0), 1.0)
        for e in range(n):
            data[e] /= amplitude_energy
            noise[e] /= signal * signal
    return fit


def bearing_posterior(
    fit: Fit, manifold: GainManifold, prior: ManifoldPrior, rows: IntArray
) -> tuple[FloatArray, FloatArray]:
    r"""Compute mean and standard deviation of the azimuth, given strengths and a prior of the array errors.

    With strengths :math:`x_i = \alpha (g_i(\theta) + \Delta_i) + n_i`, and with azimuth and scale
    :math:`\beta = 1 / \alpha` unknown,

    .. math:: p(\theta \mid x) \propto \int \beta^{n - 1} \prod_i p_\Delta(\beta x_i - g_i(\theta)) \, d\beta

    where :math:`p_\Delta` is the density of an element's error plus noise. Pulses from one direction share the error,
    so pool them first. The posterior is summed over a grid that spans five standard deviations on either side.

    Args:
        fit: Maximum-likelihood fit.
        manifold: Nominal array.
        prior: Prior of the errors of the array.
        rows: Indices of the rows of the fit, shape (n,).

    Returns:
        Azimuths in (-pi, pi] and standard deviations, radians, each of shape (n,).
    """
    start_rad, strengths, noise = fit.bearings.azimuth_rad[rows], fit.strengths[rows].T, fit.variance[rows].T
    gain, slope = manifold.gain_and_slope(start_rad)
    variance = prior.variance(gain, slope) + noise
    energy, across = np.square(gain).sum(axis=0), np.square(perpendicular_slope(gain, slope))
    half_rad = np.minimum(5.0 * np.sqrt((across * variance).sum(axis=0)) / across.sum(axis=0), np.pi)
    half_scale = np.minimum(5.0 * np.sqrt((np.square(gain) * variance).sum(axis=0)) / energy, 0.9)

    off_rad = half_rad[:, np.newaxis] * np.linspace(-1, 1, 61)
    scale = 1 + half_scale[:, np.newaxis, np.newaxis] * np.linspace(-1, 1, 25)
    gain, slope = (x[..., np.newaxis] for x in manifold.gain_and_slope(start_rad[:, np.newaxis] + off_rad))
    mismatch = scale * strengths[:, :, np.newaxis, np.newaxis] - gain
    density = prior.log_density(mismatch, gain, slope, np.square(scale) * noise[:, :, np.newaxis, np.newaxis])
    log_weight = density.sum(axis=0) + (manifold.n_elements - 1) * np.log(scale)
    weight = np.exp(log_weight - log_weight.max(axis=(-1, -2), keepdims=True)).sum(axis=-1)
    weight /= weight.sum(axis=-1, keepdims=True)
    mean = (weight * off_rad).sum(axis=-1)
    spread = (weight * np.square(off_rad - mean[:, np.newaxis])).sum(axis=-1)
    return wrap(start_rad + mean), np.sqrt(spread)


def bearings_towards(azimuth_rad: FloatArray, pulses: PulseBatch, array: ArrayModel) -> Bearings:
    """Compute the misfit of directions found by any method, and their standard deviation due to noise.

    Args:
        azimuth_rad: Direction of each pulse, array frame, shape (n_pulses,).
        pulses: Pulses.
        array: Nominal array of the channels of the pulses.

    Returns:
        The directions with their standard deviations due to noise alone; an estimator adds the error of its method.
    """
    strengths, variance = np.ascontiguousarray(pulses.strengths_v), np.ascontiguousarray(pulses.variance_v2)
    pulse, noise, table = strengths[:, np.newaxis], variance[:, np.newaxis], array.manifold.held_table
    return fit_pulses(pulse, noise, variance, table, NO_DIRECTION, azimuth_rad).bearings


def in_plane_likelihood(pulses: PulseBatch, array: ArrayModel) -> Bearings:
    """Estimate the direction of each pulse in the plane of the array by maximum likelihood."""
    return bearings_towards(np.empty(0), pulses, array)


def maximum_likelihood(pulses: PulseBatch, array: ArrayModel) -> Bearings:
    """Estimate the direction of each pulse by maximum likelihood: the default `BearingEstimator`.

    Only pulses that no direction in the plane explains are compared with directions above it.
    """
    found = in_plane_likelihood(pulses, array)
    if array.manifold.n_elements >= LEAST_CHANNELS:
        search_elevations(found, pulses, array)
    return found


def estimate_bearings(
    strengths: ArrayLike,
    manifold: GainManifold,
    *,
    strength_variance: ArrayLike | None = None,
    prior: ManifoldPrior | None = None,
) -> Bearings:
    r"""Estimate the direction of pooled pulses of unknown amplitudes by maximum likelihood in white noise.

    .. math:: \hat\theta = \arg\max_\theta \frac{g(\theta)^T R \, g(\theta)}{\lVert g(\theta) \rVert^2},
              \quad R = \sum_k a_k a_k^T

    For one pulse this is the peak of eq. (15) with normalised gain. Normalisation matters where the norm of the gain
    varies with azimuth, as when only four of six elements are used.

    Args:
        strengths: Strengths, shape (..., n_pulses, n_elements), volts, >= 0. The n_pulses pulses are pooled, on the
            assumption that they come from one source.
        manifold: Nominal array.
        strength_variance: Variance of the strengths, V^2, >= 0; broadcasts to the shape of `strengths`.
        prior: Prior of the errors of the array. With it, azimuth and standard deviation describe the posterior,
            marginalised over these errors, at several hundred times the cost.

    Returns:
        Bearings of the leading shape (...).

    Raises:
        ValueError: If the shape does not match the manifold, or a strength is negative or not finite.

    References:
        Dir-MUSIC, eq. (15).
    """
    a = np.asarray(strengths, dtype=np.float64)
    if a.ndim < 2 or a.shape[-1] != manifold.n_elements:
        raise ValueError(
            f"`strengths` must have shape (..., n_pulses, {manifold.n_elements}) to match `manifold`, got {a.shape}"
        )
    if broken := broken_channels(np.isfinite(a) & (a >= 0.0)):
        raise ValueError(
            f"`strengths` must be finite and >= 0 V, got others in channels {broken}; drop broken channels from the "
            "strengths, and from the manifold with `manifold.take`"
        )

    unknown = np.nan if prior is None else 0.0
    variance = np.broadcast_to(unknown if strength_variance is None else strength_variance, a.shape)
    return _find_bearings(a, variance, variance.sum(axis=-2), manifold, prior)


def bearings_from_covariance(
    covariance: ArrayLike,
    manifold: GainManifold,
    *,
    n_snapshots: int = 1,
    noise_variance: ArrayLike | None = None,
    prior: ManifoldPrior | None = None,
) -> Bearings:
    r"""Estimate the direction from a covariance of samples, for elements so close that delays are negligible.

    If the elements are more than about a centimetre apart, use gated strengths instead. Take samples only from a gate
    around the pulse: samples without signal only add noise, and increase the variance to
    :math:`(1 + n \sigma^2 / (E \lVert g \rVert^2))` times the Cramer-Rao bound, where E is the energy of the pulse.

    Args:
        covariance: Result of `sample_covariance`, shape (..., n_elements, n_elements), V^2.
        manifold: Nominal array.
        n_snapshots: Number of samples in the covariance, >= 1.
        noise_variance: Variance of one noise sample, the same in all channels, V^2; broadcasts to (...).
        prior: Prior of the errors of the array; see `estimate_bearings`.

    Returns:
        Bearings of the leading shape (...). The misfit includes the noise of all samples.

    Raises:
        ValueError: If the shape does not match the manifold, or a value is not finite.
    """
    r = np.asarray(covariance, dtype=np.float64)
    n = manifold.n_elements
    if check_covariance(r) != n:
        raise ValueError(f"`covariance` must have shape (..., {n}, {n}) to match `manifold`, got {r.shape}")
    if n_snapshots < 1:
        raise ValueError(f"`n_snapshots` must be 1 or more, got {n_snapshots}")

    values, vectors = np.linalg.eigh(n_snapshots * r)
    root = np.sqrt(np.maximum(values, 0.0))[..., np.newaxis]
    components = root * np.swapaxes(vectors, -1, -2)  # equivalent to the strengths of n pulses
    unknown = np.nan if prior is None else 0.0
    variance_v2 = np.asarray(unknown if noise_variance is None else noise_variance)[..., np.newaxis, np.newaxis]
    variance = np.broadcast_to(variance_v2, r.shape)
    return _find_bearings(components, variance, n_snapshots * variance[..., 0, :], manifold, prior)


def _find_bearings(
    strengths: FloatArray,
    variance: FloatArray,
    total_variance: FloatArray,
    manifold: GainManifold,
    prior: ManifoldPrior | None,
) -> Bearings:
    """Compute bearings of the leading shape (...) by `fit_pulses` or, with a prior, from the posterior.

    Arguments as in `fit_pulses`, with more leading axes. A variance of NaN makes the standard deviation NaN.
    """
    shape = strengths.shape[:-2]
    pulses, noise, total_noise = (
        np.array(values, dtype=np.float64, order="C").reshape(math.prod(shape), *values.shape[len(shape) :])
        for values in (strengths, variance, total_variance)
    )
    fit = fit_pulses(pulses, noise, total_noise, manifold.held_table, (np.nan, np.nan, np.nan), np.empty(0))
    if prior is not None:
        seen = np.flatnonzero(np.isfinite(fit.bearings.misfit))
        for first in range(0, seen.size, 128):  # chunks that take about 10 MB
            rows = seen[first : first + 128]
            fit.bearings.azimuth_rad[rows], fit.bearings.std_rad[rows] = bearing_posterior(fit, manifold, prior, rows)
    return Bearings(*(column.reshape(shape) for column in fit.bearings))
