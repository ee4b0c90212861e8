"""Maximum-likelihood bearings from strengths over the gain manifold, off the grid, with their deviation."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic.angles import wrap, wrapped
from dirmusic.array.element_errors import ManifoldPrior
from dirmusic.array.manifold import SEARCH_STEP_RAD, GainManifold, ManifoldTable
from dirmusic.array.model import ArrayModel
from dirmusic.array.pattern import cubic, cubic_slope
from dirmusic.compiled import Held, compiled, compiled_inner
from dirmusic.pulses.batch import LEAST_SHARE, NO_DIRECTION, UNKNOWN_STD_RAD, Bearings, PulseBatch
from dirmusic.pulses.strengths import dot

FloatArray = NDArray[np.float64]

REFINEMENTS = 2
"""Gauss-Newton steps after the first; without noise, two converge to 1e-9 rad."""

TINY = 1e-12
"""Prevents division by a vanishing squared slope, per radian squared."""

NO_ANSWER = (np.nan, np.nan, np.nan)
"""Azimuth, deviation and misfit of a row without strength."""


class Fit(NamedTuple):
    """Direction of each row, with manifold and data there.

    Attributes:
        azimuth_rad: Direction, not wrapped, shape (n_rows,).
        gain: g, shape (n_rows, n_elements).
        perpendicular: p, part of the slope orthogonal to the gain, shape (n_rows, n_elements).
        data: R g / (g^T g), sum of the strengths weighted by amplitude, shape (n_rows, n_elements).
        amplitude_energy: g^T R g / (g^T g)^2, sum of the squared amplitudes, shape (n_rows,).
    """

    azimuth_rad: FloatArray
    gain: FloatArray
    perpendicular: FloatArray
    data: FloatArray
    amplitude_energy: FloatArray


@compiled_inner
def look_up(azimuth_rad: float, table: ManifoldTable, gain: FloatArray, slope: FloatArray) -> None:
    """Interpolate gain and slope per radian of each element, by the cubic with the values and slopes of the table."""
    n, step_rad = table.gain.shape[0], 2.0 * np.pi / table.gain.shape[0]
    at = azimuth_rad / step_rad
    low = np.floor(at)
    t, i = at - low, int(low) % n
    j = (i + 1) % n
    for e in range(gain.size):
        from_slope, to_slope = step_rad * table.slope[i, e], step_rad * table.slope[j, e]
        gain[e] = cubic(t, table.gain[i, e], table.gain[j, e], from_slope, to_slope)
        slope[e] = cubic_slope(t, table.gain[i, e], table.gain[j, e], from_slope, to_slope) / step_rad


@compiled_inner
def _best_search_azimuth(covariance: FloatArray, unit_pairs: FloatArray, match: FloatArray) -> int:
    """Return the index of the search azimuth whose unit gain u has the largest u^T R u."""
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
def fit_covariances(covariance: FloatArray, table: ManifoldTable) -> Fit:
    """Find the best search azimuth of each pooled covariance R and refine it by Gauss-Newton within one search step.

    The amplitude is projected out: only the part of the slope orthogonal to the gain counts,
    :math:`p = (I - g g^T / g^T g) g'`. At a kink of the pattern (eq. (1) has one where its angle passes 0/360) the
    steps may end on the other side of it; the error is as large on either side.

    Args:
        covariance: Sum of the outer products of the strengths of the pulses of a row, shape (n_rows, n_elements,
            n_elements), V^2.
        table: Table of the manifold.
    """
    n_rows, n = covariance.shape[:2]
    fit = Fit(np.empty(n_rows), np.empty((n_rows, n)), np.empty((n_rows, n)), np.empty((n_rows, n)), np.empty(n_rows))
    match, slope = np.empty(table.unit_pairs.shape[1]), np.empty(n)
    for row in range(n_rows):
        gain, across, data = fit.gain[row], fit.perpendicular[row], fit.data[row]
        start_rad = SEARCH_STEP_RAD * _best_search_azimuth(covariance[row], table.unit_pairs, match)
        azimuth_rad = start_rad
        for _ in range(REFINEMENTS + 1):
            look_up(azimuth_rad, table, gain, slope)
            energy = dot(gain, gain)
            along = dot(gain, slope) / energy
            for e in range(n):
                across[e] = slope[e] - along * gain[e]
                data[e] = dot(covariance[row, e], gain) / energy
            fit.amplitude_energy[row] = dot(data, gain) / energy
            weight = (dot(across, across) + TINY) * fit.amplitude_energy[row]
            if weight > 0.0:
                azimuth_rad += dot(across, data) / weight
            azimuth_rad = min(max(azimuth_rad, start_rad - SEARCH_STEP_RAD), start_rad + SEARCH_STEP_RAD)
        fit.azimuth_rad[row] = azimuth_rad
    return fit


@compiled
def pool(strengths: FloatArray) -> FloatArray:
    """Sum the outer products of the pulses of each row, (n_rows, n_pulses, n_elements), to one matrix per row."""
    n_rows, n_pulses, n = strengths.shape
    pooled = np.zeros((n_rows, n, n))
    for row in range(n_rows):
        for k in range(n_pulses):
            for e in range(n):
                for f in range(n):
                    pooled[row, e, f] += strengths[row, k, e] * strengths[row, k, f]
    return pooled


class NoiseOfFit(NamedTuple):
    """Effect of noise on a fit.

    Attributes:
        data: Variance of the data, shape (n_rows, n_elements).
        bias: Expected contribution of noise to the sum of squared amplitudes, shape (n_rows,).
    """

    data: FloatArray
    bias: FloatArray


@compiled
def noise_of_pulses(fit: Fit, strengths: FloatArray, variance: FloatArray) -> NoiseOfFit:
    """Compute the effect of noise from strengths and their variances, each of shape (n_rows, n_pulses, n_elements)."""
    n_rows, n_pulses, n = strengths.shape
    noise = NoiseOfFit(np.zeros((n_rows, n)), np.zeros(n_rows))
    for row in range(n_rows):
        gain = fit.gain[row]
        energy = dot(gain, gain)
        for k in range(n_pulses):
            amplitude = dot(strengths[row, k], gain) / energy
            for e in range(n):
                noise.data[row, e] += amplitude * amplitude * variance[row, k, e]
                noise.bias[row] += variance[row, k, e] * gain[e] * gain[e] / (energy * energy)
    return noise


@compiled
def deviations(fit: Fit, noise: NoiseOfFit) -> FloatArray:
    """Compute the standard deviation of the azimuths by noise, shape (n_rows,)."""
    std_rad = np.empty(fit.azimuth_rad.size)
    for row in range(std_rad.size):
        across, energy = fit.perpendicular[row], fit.amplitude_energy[row]
        signal = max(energy - noise.bias[row], LEAST_SHARE * energy)
        variance = 0.0
        for e in range(across.size):
            variance += across[e] * across[e] * noise.data[row, e]
        std_rad[row] = min(np.sqrt(variance) / ((dot(across, across) + TINY) * signal), UNKNOWN_STD_RAD)
    return std_rad


@compiled
def misfits(fit: Fit, covariance: FloatArray) -> FloatArray:
    """Compute the share of the energy of each row that its direction does not explain, in [0, 1], shape (n_rows,)."""
    misfit = np.empty(fit.azimuth_rad.size)
    for row in range(misfit.size):
        energy = 0.0
        for e in range(covariance.shape[1]):
            energy += covariance[row, e, e]
        explained = fit.amplitude_energy[row] * dot(fit.gain[row], fit.gain[row])
        misfit[row] = min(max(1.0 - explained / energy, 0.0), 1.0) if energy > 0.0 else np.nan
    return misfit


@compiled
def bearings_of_pulses(
    strengths: FloatArray,
    variance: FloatArray,
    table: Held[ManifoldTable],
    silence: tuple[float, float, float],
) -> Bearings:
    """Compute maximum-likelihood directions of pooled pulses, with their deviations and misfits.

    Args:
        strengths: Strengths, shape (n_rows, n_pulses, n_elements).
        variance: Variance of the strengths, same shape; empty if unknown, and deviations are NaN.
        table: Table of the manifold.
        silence: Azimuth, deviation and misfit of rows without strength.

    Returns:
        Columns of shape (n_rows,), azimuths in (-pi, pi].
    """
    pooled = pool(strengths)
    fit = fit_covariances(pooled, table.value)
    std_rad = np.full(strengths.shape[0], np.nan)
    if variance.size == strengths.size:
        std_rad = deviations(fit, noise_of_pulses(fit, strengths, variance))
    misfit = misfits(fit, pooled)
    for row in range(misfit.size):
        silent = np.isnan(misfit[row])
        if silent:
            fit.azimuth_rad[row], std_rad[row], misfit[row] = silence
        else:
            fit.azimuth_rad[row] = wrapped(fit.azimuth_rad[row])
    return Bearings(fit.azimuth_rad, std_rad, misfit)


N_AZIMUTHS, N_SCALES, SPAN_SIGMAS = 61, 25, 5.0
"""Grid of the posterior: numbers of azimuths and amplitudes, and half width in standard deviations."""

ROWS_AT_ONCE = 128
"""Rows whose posteriors are computed together, in about 10 MB."""


def bearing_posterior(
    relative_strengths: FloatArray,
    relative_variance: FloatArray,
    start_rad: FloatArray,
    manifold: GainManifold,
    prior: ManifoldPrior,
) -> tuple[FloatArray, FloatArray]:
    r"""Compute mean and deviation of the azimuth, given strengths and a prior of the errors of the array.

    With strengths :math:`x_i = \alpha (g_i(\theta) + \Delta_i) + n_i`, azimuth and scale :math:`\beta = 1 / \alpha`
    unknown,

    .. math:: p(\theta \mid x) \propto \int \beta^{n - 1} \prod_i p_\Delta(\beta x_i - g_i(\theta)) \, d\beta

    where :math:`p_\Delta` is the density of error and noise of an element. Pulses from one direction share the error,
    so pool them first.

    Args:
        relative_strengths: Strengths over their estimated amplitude, near the gains; shape (n_rows, n_elements).
        relative_variance: Variance of these by noise, same shape.
        start_rad: Maximum-likelihood azimuths, shape (n_rows,).
        manifold: Nominal array.
        prior: Prior of its errors.

    Returns:
        Azimuths, not wrapped, and standard deviations, radians, each of shape (n_rows,).
    """
    mean, std = np.empty_like(start_rad), np.empty_like(start_rad)
    for first in range(0, start_rad.size, ROWS_AT_ONCE):
        rows = slice(first, first + ROWS_AT_ONCE)
        mean[rows], std[rows] = _sum_over_grid(
            relative_strengths[rows].T, relative_variance[rows].T, start_rad[rows], manifold, prior
        )
    return mean, std


def _sum_over_grid(
    strengths: FloatArray, noise: FloatArray, start_rad: FloatArray, manifold: GainManifold, prior: ManifoldPrior
) -> tuple[FloatArray, FloatArray]:
    """Compute the posterior of a few rows, elements on the first axis."""
    gain, slope = manifold.gain_and_slope(start_rad)
    variance = prior.variance(gain, slope) + noise
    energy = np.square(gain).sum(axis=0)
    perpendicular = slope - gain * ((gain * slope).sum(axis=0) / energy)
    turn = np.sqrt((np.square(perpendicular) * variance).sum(axis=0)) / np.square(perpendicular).sum(axis=0)
    half_rad = np.minimum(SPAN_SIGMAS * turn, np.pi)
    half_scale = np.minimum(SPAN_SIGMAS * np.sqrt((np.square(gain) * variance).sum(axis=0)) / energy, 0.9)

    off_rad = half_rad[:, np.newaxis] * np.linspace(-1, 1, N_AZIMUTHS)
    scale = 1 + half_scale[:, np.newaxis, np.newaxis] * np.linspace(-1, 1, N_SCALES)
    gain, slope = (x[..., np.newaxis] for x in manifold.gain_and_slope(start_rad[:, np.newaxis] + off_rad))
    mismatch = scale * strengths[:, :, np.newaxis, np.newaxis] - gain
    density = prior.log_density(mismatch, gain, slope, np.square(scale) * noise[:, :, np.newaxis, np.newaxis])
    log_weight = density.sum(axis=0) + (manifold.n_elements - 1) * np.log(scale)
    weight = np.exp(log_weight - log_weight.max(axis=(-1, -2), keepdims=True)).sum(axis=-1)
    weight /= weight.sum(axis=-1, keepdims=True)
    mean = (weight * off_rad).sum(axis=-1)
    spread = (weight * np.square(off_rad - mean[:, np.newaxis])).sum(axis=-1)
    return start_rad + mean, np.sqrt(spread)


class MaximumLikelihood:
    """Default estimator: maximum likelihood for each pulse; see `estimate_bearings`."""

    def __call__(self, pulses: PulseBatch, array: ArrayModel) -> Bearings:
        """Estimate the directions of pulses; see `BearingEstimator`."""
        strengths, variance = (
            np.ascontiguousarray(values[:, np.newaxis]) for values in (pulses.strengths_v, pulses.variance_v2)
        )
        return bearings_of_pulses(strengths, variance, array.manifold.held_table, NO_DIRECTION)


def estimate_bearings(
    strengths: ArrayLike,
    manifold: GainManifold,
    *,
    strength_variance: ArrayLike | None = None,
    prior: ManifoldPrior | None = None,
) -> Bearings:
    r"""Estimate the direction of pooled pulses of unknown amplitude, by maximum likelihood in white noise.

    .. math:: \hat\theta = \arg\max_\theta \frac{g(\theta)^T R \, g(\theta)}{\lVert g(\theta) \rVert^2},
              \quad R = \sum_k a_k a_k^T

    For one pulse this is the peak of eq. (15) with the gain normalised, which matters where the norm of the gain
    varies, as with four of six elements.

    Args:
        strengths: Strengths, shape (..., n_pulses, n_elements), volts, >= 0. The pulses of one row are pooled, as from
            one source.
        manifold: Nominal array.
        strength_variance: Variance of the strengths, V^2, >= 0; broadcasts to the shape of `strengths`.
        prior: Prior of the errors of the array. With it, azimuth and deviation are taken from the posterior over
            these errors, at several hundred times the cost.

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
    if a.size and not (a.min() >= 0.0 and a.max() < np.inf):
        broken = np.flatnonzero(~np.all(np.isfinite(a) & (a >= 0), axis=tuple(range(a.ndim - 1)))) + 1
        raise ValueError(
            f"`strengths` must be finite and >= 0 V, got others in channels {', '.join(map(str, broken))}; drop broken "
            "channels from the strengths, and from the manifold with `manifold.take`"
        )

    shape = a.shape[:-2]
    pulses = _in_rows(a)
    variance = np.empty((0, 0, 0))
    if strength_variance is not None:
        given = np.asarray(strength_variance, dtype=np.float64)
        variance = _in_rows(given if given.shape == a.shape else np.broadcast_to(given, a.shape))
    if prior is None:
        found = bearings_of_pulses(pulses, variance, manifold.held_table, NO_ANSWER)
        return Bearings(*(column.reshape(shape) for column in found))
    pooled = pool(pulses)
    fit = fit_covariances(pooled, manifold.table)
    noise = noise_of_pulses(fit, pulses, variance) if variance.size else None
    return _bearings_of_fit(fit, pooled, noise, manifold, prior, shape)


def _in_rows(values: FloatArray) -> FloatArray:
    """Copy to the shape (n_rows, n_pulses, n_elements) and the memory layout for which the kernels are compiled."""
    return np.array(values).reshape(math.prod(values.shape[:-2]), *values.shape[-2:])


def bearings_from_covariance(
    covariance: ArrayLike,
    manifold: GainManifold,
    *,
    n_snapshots: int = 1,
    noise_variance: ArrayLike | None = None,
    prior: ManifoldPrior | None = None,
) -> Bearings:
    r"""Estimate the direction from a covariance of samples, for elements so close that the pulse has no delay.

    With more than about a centimetre between the elements, use gated strengths instead. Take samples from a gate around
    the pulse: those without it only add noise, by which the variance grows from the Cramer-Rao bound to
    :math:`(1 + n \sigma^2 / (E \lVert g \rVert^2))` times that, with E the energy of the pulse.

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
    if r.ndim < 2 or r.shape[-2:] != (n, n):
        raise ValueError(f"`covariance` must have shape (..., {n}, {n}) to match `manifold`, got {r.shape}")
    if not np.isfinite(r).all():
        raise ValueError("`covariance` must be finite; drop the broken record or channel first")
    if n_snapshots < 1:
        raise ValueError(f"`n_snapshots` must be 1 or more, got {n_snapshots}")

    shape = r.shape[:-2]
    total = np.array(n_snapshots * r.reshape(-1, n, n), order="C")
    fit = fit_covariances(total, manifold.table)
    noise = None
    if noise_variance is not None:
        variance = np.array(np.broadcast_to(np.asarray(noise_variance, dtype=np.float64), shape)).reshape(-1)
        energy = np.square(fit.gain).sum(axis=-1)
        each = np.repeat((variance * fit.amplitude_energy)[:, np.newaxis], n, axis=-1)
        noise = NoiseOfFit(each, n_snapshots * variance / energy)
    return _bearings_of_fit(fit, total, noise, manifold, prior, shape)


def _bearings_of_fit(
    fit: Fit,
    pooled: FloatArray,
    noise: NoiseOfFit | None,
    manifold: GainManifold,
    prior: ManifoldPrior | None,
    shape: tuple[int, ...],
) -> Bearings:
    """Compute bearings from a fit to pooled covariances; the deviation is NaN without noise and prior."""
    azimuth_rad, misfit = fit.azimuth_rad, misfits(fit, pooled)
    std_rad = np.full(azimuth_rad.shape, np.nan) if noise is None else deviations(fit, noise)
    if prior is not None:
        amplitude_energy = np.where(fit.amplitude_energy > 0, fit.amplitude_energy, 1.0)[:, np.newaxis]
        relative_variance = np.zeros_like(fit.data)
        if noise is not None:
            signal = np.maximum(amplitude_energy - noise.bias[:, np.newaxis], LEAST_SHARE * amplitude_energy)
            relative_variance = noise.data / np.square(signal)
        azimuth_rad, std_rad = bearing_posterior(
            fit.data / amplitude_energy, relative_variance, azimuth_rad, manifold, prior
        )
    silent = np.isnan(misfit)
    return Bearings(
        azimuth_rad=np.where(silent, np.nan, wrap(azimuth_rad)).reshape(shape),
        std_rad=np.where(silent, np.nan, std_rad).reshape(shape),
        misfit=misfit.reshape(shape),
    )
