"""Strengths in sub-bands, and estimation of bearings from them for a pattern that depends on frequency."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import toeplitz

from dirmusic.angles import wrapped
from dirmusic.array.manifold import SEARCH_STEP_RAD, GainManifold, ManifoldTable
from dirmusic.array.model import ArrayModel
from dirmusic.arrays import FloatArray
from dirmusic.bearing.maximum_likelihood import REFINEMENTS, TINY, look_up, maximum_likelihood
from dirmusic.compiled import Held, compiled, compiled_inner
from dirmusic.pulses.batch import LEAST_SHARE, NO_DIRECTION, UNKNOWN_STD_RAD, Bearings, PulseBatch
from dirmusic.pulses.strengths import dot


class SubBands:
    r"""Sub-bands in which the energy of a gate is measured.

    .. math:: E_b = x^T K_b x = \frac{2}{f_s} \int_{f_b}^{f_{b+1}} \lvert X(f) \rvert^2 df

    where X(f) is the spectrum of the samples of the gate. If the sub-bands cover all frequencies up to half the sample
    rate, their energies sum to that of the gate. Sub-bands narrower than sample rate / gate length have correlated
    noise.

    Args:
        edges_hz: Edges of the sub-bands, increasing, shape (n_bands + 1,).
        sample_rate_hz: Sample rate.
        n_samples: Length of a gate in samples.
        correlation: Autocorrelation of the noise at lags 0, 1, ..., shape (n_lags,): 1 at lag 0, and taken as 0 beyond
            the last lag.

    Attributes:
        lines: Cosines and sines whose squared inner products with a gate sum to the energies, shape (n_bands, n_lines,
            n_samples).
        noise_samples: Energy of the noise in each sub-band over the variance of one sample, shape (n_bands,).
        energy_spread: Argument of `strength_variance` for each sub-band, shape (n_bands,).
    """

    def __init__(self, edges_hz: ArrayLike, sample_rate_hz: float, n_samples: int, correlation: FloatArray) -> None:
        edges = np.asarray(edges_hz, dtype=np.float64)
        width_hz = np.diff(edges)
        n_lines = max(4, int(np.ceil(4 * n_samples * width_hz.max() / sample_rate_hz)))
        at = (np.arange(n_lines) + 0.5) / n_lines
        frequency_hz = edges[:-1, np.newaxis] + width_hz[:, np.newaxis] * at
        turn = 2 * np.pi * frequency_hz[..., np.newaxis] / sample_rate_hz * np.arange(n_samples)
        scale = np.sqrt(2 * width_hz / (n_lines * sample_rate_hz))[:, np.newaxis, np.newaxis]
        self.lines = np.ascontiguousarray(scale * np.concatenate([np.cos(turn), np.sin(turn)], axis=1))
        lags = correlation[:n_samples]
        self._noise = toeplitz(np.pad(lags, (0, n_samples - lags.size)))
        self._form = np.einsum("bli,blj->bij", self.lines, self.lines)
        product = self._form @ self._noise
        self.noise_samples: FloatArray = np.trace(product, axis1=1, axis2=2)
        self.energy_spread: FloatArray = np.einsum("bij,bji->b", product, product)

    def noise_on(self, pulse: FloatArray) -> FloatArray:
        """Compute the argument `noise_on_pulse` of `strength_variance` for each sub-band.

        Args:
            pulse: Waveform of a typical pulse, shape (n_samples,).
        """
        in_band = self._form @ pulse
        energy = in_band @ pulse
        return np.einsum("bi,ij,bj->b", in_band, self._noise, in_band) / energy


MOST_TILT = 2.0
"""Maximum change of the spectrum from one sub-band to the next, nepers of power. Assumed; limits the effect of noise in
weak sub-bands."""


class BandTables(NamedTuple):
    """Tabulated manifolds of all sub-bands, for compiled functions.

    Attributes:
        gain: Gains in the lower and the upper half of each sub-band, as in `ManifoldTable`, shape (n_bands, 2,
            TABLE_SIZE, n_elements).
        slope: Slopes of these gains per radian, same shape.
        unit: Gains of each sub-band towards the search azimuths, scaled to unit norm, shape (n_bands, n_elements,
            n_azimuths).
    """

    gain: FloatArray
    slope: FloatArray
    unit: FloatArray


@lru_cache(maxsize=64)
def band_tables(manifolds: tuple[GainManifold, ...]) -> Held[BandTables]:
    """Tabulate the manifolds of the sub-band halves."""
    gain, slope = (
        np.stack(each).reshape(-1, 2, *each[0].shape) for each in zip(*(m.table[:2] for m in manifolds), strict=True)
    )
    power = np.square([m.search_gain for m in manifolds]).reshape(-1, 2, *manifolds[0].search_gain.shape).sum(axis=1)
    unit = np.sqrt(power / power.sum(axis=1, keepdims=True))
    return Held(BandTables(gain, slope, np.ascontiguousarray(unit)))


def sub_band_likelihood(pulses: PulseBatch, array: ArrayModel) -> Bearings:
    r"""Estimate the directions of pulses from their strengths in sub-bands, with one free amplitude per sub-band.

    .. math:: \hat\theta = \arg\max_\theta \sum_b \frac{1}{\sigma_b^2}
              \frac{(a_b^T g_b(\theta))^2}{\lVert g_b(\theta) \rVert^2}

    This is a `BearingEstimator`. It assumes that the pattern in each sub-band is known, and nothing about the spectrum
    of the source. If the pattern changes over the receiver's band, a single manifold is right for one spectrum only,
    and bearings from it are biased. The slope of the spectrum within a sub-band is estimated from the amplitudes in the
    neighbouring sub-bands; the squared gain is the mean over the two halves of the sub-band, weighted accordingly.

    Without strengths in sub-bands or manifolds for them, the result is that of `maximum_likelihood`.
    """
    if not array.band_manifolds or 2 * pulses.band_strengths_v.shape[1] != len(array.band_manifolds):
        return maximum_likelihood(pulses, array)
    tables = band_tables(array.band_manifolds)
    return bearings_of_bands(pulses.band_strengths_v, pulses.band_variance_v2, tables)


@compiled_inner
def look_up_band(
    azimuth_rad: float, tables: BandTables, b: int, upper: float, gain: FloatArray, slope: FloatArray
) -> None:
    """Compute gain and slope of each element in sub-band b; `upper` is the share of power in the upper half of it."""
    n = gain.size
    half_gain, half_slope = np.empty(n), np.empty(n)
    gain[:], slope[:] = 0.0, 0.0
    for half in range(2):
        share = upper if half == 1 else 1.0 - upper
        look_up(
            azimuth_rad,
            ManifoldTable(tables.gain[b, half], tables.slope[b, half], tables.unit[b]),
            half_gain,
            half_slope,
        )
        for e in range(n):
            gain[e] += share * half_gain[e] * half_gain[e]
            slope[e] += share * half_gain[e] * half_slope[e]
    for e in range(n):
        gain[e] = np.sqrt(gain[e])
        slope[e] /= gain[e]


@compiled_inner
def upper_shares(power_v2: FloatArray, upper: FloatArray) -> None:
    """Estimate the share of power in the upper half of each sub-band from the neighbouring sub-bands.

    Args:
        power_v2: Power in each sub-band, shape (n_bands,).
        upper: Output: the shares, same shape.
    """
    n_bands = power_v2.size
    for b in range(n_bands):
        low, high = max(b - 1, 0), min(b + 1, n_bands - 1)
        tilt = 0.0
        if power_v2[low] > 0.0 and power_v2[high] > 0.0 and high > low:
            tilt = np.log(power_v2[high] / power_v2[low]) / (high - low)
        tilt = min(max(tilt, -MOST_TILT), MOST_TILT)
        upper[b] = 1.0 / (1.0 + np.exp(-0.5 * tilt))  # the halves are half a sub-band apart


@compiled_inner
def fit_bands(
    azimuth_rad: float,
    strengths: FloatArray,
    variance: FloatArray,
    trust: FloatArray,
    upper: FloatArray,
    power_v2: FloatArray,
    tables: BandTables,
) -> tuple[float, float, float, float, float]:
    """Fit one pulse at an azimuth.

    Args:
        azimuth_rad: Azimuth.
        strengths: Strengths, shape (n_bands, n_elements).
        variance: Variance of the strengths, same shape.
        trust: Inverse of the mean variance in each sub-band, shape (n_bands,).
        upper: Share of power in the upper half of each sub-band, shape (n_bands,).
        power_v2: Output: squared amplitude without the contribution of noise, shape (n_bands,).
        tables: Tables of the manifolds.

    Returns:
        Gauss-Newton step times the curvature; curvature of the likelihood; noise variance of the first value; curvature
        without the contribution of noise to the amplitudes; and weighted energy that the azimuth explains.
    """
    n_bands, n = strengths.shape
    gain, slope, across = np.empty(n), np.empty(n), np.empty(n)
    turn = weight = spread = signal = explained = 0.0
    for b in range(n_bands):
        look_up_band(azimuth_rad, tables, b, upper[b], gain, slope)
        energy = dot(gain, gain)
        along, amplitude = dot(gain, slope) / energy, dot(strengths[b], gain) / energy
        bias = 0.0
        for e in range(n):
            across[e] = slope[e] - along * gain[e]
            bias += variance[b, e] * gain[e] * gain[e] / (energy * energy)
            spread += (trust[b] * amplitude * across[e]) ** 2 * variance[b, e]
        squared = amplitude * amplitude
        turn += trust[b] * amplitude * dot(across, strengths[b])
        weight += trust[b] * squared * (dot(across, across) + TINY)
        power_v2[b] = max(squared - bias, LEAST_SHARE * squared)
        signal += trust[b] * power_v2[b] * (dot(across, across) + TINY)
        explained += trust[b] * squared * energy
    return turn, weight, spread, signal, explained


@compiled
def bearings_of_bands(strengths: FloatArray, variance: FloatArray, tables: Held[BandTables]) -> Bearings:
    """Compute maximum-likelihood directions of pulses, with their standard deviations and misfits.

    Args:
        strengths: Strengths, shape (n_pulses, n_bands, n_elements).
        variance: Variance of the strengths, same shape.
        tables: Tables of the manifolds.

    Returns:
        Columns of shape (n_pulses,), with azimuths in (-pi, pi]; `NO_DIRECTION` for pulses without strength.
    """
    of = tables.value
    n_pulses, n_bands, n = strengths.shape
    found = Bearings(np.empty(n_pulses), np.empty(n_pulses), np.empty(n_pulses), np.zeros(n_pulses))
    trust, upper, power_v2 = np.empty(n_bands), np.empty(n_bands), np.empty(n_bands)
    match = np.empty(of.unit.shape[2])
    for k in range(n_pulses):
        energy = 0.0
        match[:] = 0.0
        for b in range(n_bands):
            mean_v2 = variance[k, b].mean()
            trust[b] = 1.0 / mean_v2 if mean_v2 > 0.0 else 1.0
            energy += trust[b] * dot(strengths[k, b], strengths[k, b])
            for j in range(match.size):
                along = 0.0
                for e in range(n):
                    along += strengths[k, b, e] * of.unit[b, e, j]
                match[j] += trust[b] * along * along
        if energy == 0.0:
            found.azimuth_rad[k], found.std_rad[k], found.misfit[k] = NO_DIRECTION
            continue
        start_rad = SEARCH_STEP_RAD * int(np.argmax(match))
        azimuth_rad = start_rad
        upper[:] = 0.5
        turn = weight = spread = signal = explained = 0.0
        for _ in range(REFINEMENTS + 2):
            if weight > 0.0:
                azimuth_rad += turn / weight
            azimuth_rad = min(max(azimuth_rad, start_rad - SEARCH_STEP_RAD), start_rad + SEARCH_STEP_RAD)
            turn, weight, spread, signal, explained = fit_bands(
                azimuth_rad, strengths[k], variance[k], trust, upper, power_v2, of
            )
            upper_shares(power_v2, upper)
        found.azimuth_rad[k] = wrapped(azimuth_rad)
        found.std_rad[k] = min(np.sqrt(spread) / max(signal, TINY), UNKNOWN_STD_RAD)
        found.misfit[k] = min(max(1.0 - explained / energy, 0.0), 1.0)
    return found
