"""The search for the direction that explains strengths best, in compiled loops; see `maximum_likelihood`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.manifold import SEARCH_STEP_RAD, ManifoldTable
from dirmusic.bearing.bearings import LEAST_SHARE, UNKNOWN_STD_RAD, Bearings
from dirmusic.compiled import Held, compiled
from dirmusic.kernels import cubic, cubic_slope, dot, wrapped

FloatArray = NDArray[np.float64]

REFINEMENTS = 2
"""How often the manifold is linearised anew on the way from the best search azimuth; without noise, two end within
1e-9 rad."""

TINY = 1e-12
"""Keeps a slope that vanishes from being divided by, unitless per radian squared."""

NO_ANSWER = (np.nan, np.nan, np.nan)
"""Azimuth, deviation and misfit of a row without any strength."""


class Fit(NamedTuple):
    """A direction for each row, and what the manifold and the data are there.

    Attributes:
        azimuth_rad: The direction, not wrapped, shape (n_rows,).
        gain: g, shape (n_rows, n_elements).
        perpendicular: p, the part of the slope across the gain, shape (n_rows, n_elements).
        data: R g / (g^T g): the strengths, weighted by amplitude and summed, shape (n_rows, n_elements).
        amplitude_energy: g^T R g / (g^T g)^2: the sum of the squared amplitudes, shape (n_rows,).
    """

    azimuth_rad: FloatArray
    gain: FloatArray
    perpendicular: FloatArray
    data: FloatArray
    amplitude_energy: FloatArray


@compiled
def look_up(azimuth_rad: float, table: ManifoldTable, gain: FloatArray, slope: FloatArray) -> None:
    """Gain and slope per radian of each element: the cubic through the table's values and slopes."""
    n, step_rad = table.gain.shape[0], 2.0 * np.pi / table.gain.shape[0]
    at = azimuth_rad / step_rad
    low = np.floor(at)
    t, i = at - low, int(low) % n
    j = (i + 1) % n
    for e in range(gain.size):
        from_slope, to_slope = step_rad * table.slope[i, e], step_rad * table.slope[j, e]
        gain[e] = cubic(t, table.gain[i, e], table.gain[j, e], from_slope, to_slope)
        slope[e] = cubic_slope(t, table.gain[i, e], table.gain[j, e], from_slope, to_slope) / step_rad


@compiled
def _best_search_azimuth(covariance: FloatArray, unit_pairs: FloatArray, match: FloatArray) -> int:
    """Number of the search azimuth whose unit gain u has the largest u^T R u."""
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
    """The best search azimuth of each pooled covariance R, refined by Gauss-Newton within one step of the search.

    The amplitude is projected out: only the part of the slope across the gain counts,
    :math:`p = (I - g g^T / g^T g) g'`. Where the pattern has a kink (eq. (1) has one where its angle passes 0/360) the
    steps may end to the other side of it than the very peak; the errors there are as large either way.

    Args:
        covariance: Sum over the pulses of a row of the outer products of their strengths, shape (n_rows, n_elements,
            n_elements), V^2.
        table: Of the manifold.
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
    """Sum of the outer products of the pulses of each row, (n_rows, n_pulses, n_elements) to one matrix a row."""
    n_rows, n_pulses, n = strengths.shape
    pooled = np.zeros((n_rows, n, n))
    for row in range(n_rows):
        for k in range(n_pulses):
            for e in range(n):
                for f in range(n):
                    pooled[row, e, f] += strengths[row, k, e] * strengths[row, k, f]
    return pooled


class NoiseOfFit(NamedTuple):
    """What noise does to a fit.

    Attributes:
        data: Variance of the data, shape (n_rows, n_elements).
        bias: What noise adds to the sum of squared amplitudes, shape (n_rows,).
    """

    data: FloatArray
    bias: FloatArray


@compiled
def noise_of_pulses(fit: Fit, strengths: FloatArray, variance: FloatArray) -> NoiseOfFit:
    """From strengths and their variances, each of shape (n_rows, n_pulses, n_elements)."""
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
    """Standard deviation of the azimuths from noise alone, shape (n_rows,)."""
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
    """Share of the energy of each row that its direction does not explain, in [0, 1], shape (n_rows,)."""
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
    """Maximum-likelihood directions of pooled pulses, with their deviations and misfits.

    Args:
        strengths: Shape (n_rows, n_pulses, n_elements).
        variance: Variance of the strengths, same shape; empty where it is not known, and deviations are NaN.
        table: Of the manifold.
        silence: Azimuth, deviation and misfit of rows without any strength.

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


@compiled
def pulse_spectra(strengths: FloatArray, unit_gain: FloatArray, least_null: float) -> FloatArray:
    """See `spectrum.pulse_spectrum`; a row of zeros has a spectrum of zeros."""
    n_pulses, n, n_angles = unit_gain.shape
    spectrum, match = np.zeros((n_pulses, n_angles)), np.empty(n_angles)
    for k in range(n_pulses):
        energy = dot(strengths[k], strengths[k])
        if energy == 0.0:
            continue
        match[:] = 0.0
        for e in range(n):
            for j in range(n_angles):
                match[j] += strengths[k, e] * unit_gain[k, e, j]
        for j in range(n_angles):
            spectrum[k, j] = 1.0 / max(1.0 - match[j] * match[j] / energy, least_null)
    return spectrum
