"""Strengths in sub-bands to bearings: maximum likelihood where the pattern depends on frequency, spectrum unknown."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.manifold import SEARCH_STEP_RAD, GainManifold, ManifoldTable
from dirmusic.array.model import ArrayModel
from dirmusic.bearing.bearings import LEAST_SHARE, UNKNOWN_STD_RAD, Bearings
from dirmusic.bearing.likelihood_kernels import REFINEMENTS, TINY, look_up
from dirmusic.bearing.maximum_likelihood import MaximumLikelihood
from dirmusic.compiled import Held, compiled
from dirmusic.kernels import dot, wrapped
from dirmusic.pulses.batch import NO_DIRECTION, PulseBatch

FloatArray = NDArray[np.float64]


MOST_TILT = 2.0
"""By how many nepers of power the spectrum is taken to change from the middle of a sub-band to that of the next, at
most: what noise makes of weak ones is no spectrum (assumed)."""


class BandTables(NamedTuple):
    """The manifolds of all sub-bands as compiled loops read them.

    Attributes:
        gain: As of `ManifoldTable`, of the lower and the upper half of each sub-band, shape (n_bands, 2, TABLE_SIZE,
            n_elements).
        slope: As of `ManifoldTable`, same shape.
        unit: Unit gains of each sub-band towards the search azimuths, shape (n_bands, n_elements, n_azimuths).
    """

    gain: FloatArray
    slope: FloatArray
    unit: FloatArray


@lru_cache(maxsize=64)
def band_tables(manifolds: tuple[GainManifold, ...]) -> Held[BandTables]:
    """Those of the manifolds of half sub-bands."""
    gain, slope = (
        np.stack(each).reshape(-1, 2, *each[0].shape) for each in zip(*(m.table[:2] for m in manifolds), strict=True)
    )
    power = np.square([m.search_gain for m in manifolds]).reshape(-1, 2, *manifolds[0].search_gain.shape).sum(axis=1)
    unit = np.sqrt(power / power.sum(axis=1, keepdims=True))
    return Held(BandTables(gain, slope, np.ascontiguousarray(unit)))


class SubBandLikelihood:
    r"""Each pulse on its own, off the grid, from its strengths in sub-bands, with an amplitude of its own in each.

    .. math:: \hat\theta = \arg\max_\theta \sum_b \frac{1}{\sigma_b^2}
              \frac{(a_b^T g_b(\theta))^2}{\lVert g_b(\theta) \rVert^2}

    What a source radiates in each sub-band is free; what the pattern is in each is taken from the data sheet. Where the
    pattern changes over the band, one manifold for all of it is wrong for any spectrum but one, and its bearings are
    biased. How the spectrum leans within a sub-band follows from the amplitudes found in its neighbours: the squared
    gain is the mean of those of its halves, weighted so.

    Pulses whose sub-bands were not read, and arrays without manifolds for them, are taken as `MaximumLikelihood` does.
    """

    def __init__(self) -> None:
        self._whole = MaximumLikelihood()

    def __call__(self, pulses: PulseBatch, array: ArrayModel) -> Bearings:
        """Directions of the pulses, shape (n_pulses,); as of `estimator.BearingEstimator`."""
        if not array.band_manifolds or 2 * pulses.band_strengths_v.shape[1] != len(array.band_manifolds):
            return self._whole(pulses, array)
        tables = band_tables(array.band_manifolds)
        return bearings_of_bands(pulses.band_strengths_v, pulses.band_variance_v2, tables, NO_DIRECTION)


class BandFit(NamedTuple):
    """What all sub-bands together say at one azimuth.

    Attributes:
        turn: By how much a better azimuth lies ahead, times `weight`.
        weight: Curvature of the likelihood.
        variance: Of `turn`, by noise.
        signal: Curvature without what noise adds to the amplitudes.
        explained: Weighted energy that the azimuth explains.
    """

    turn: float
    weight: float
    variance: float
    signal: float
    explained: float


@compiled
def look_up_band(
    azimuth_rad: float, tables: BandTables, b: int, upper: float, gain: FloatArray, slope: FloatArray
) -> None:
    """Gain and slope of each element, (n_elements,), in a sub-band of whose power `upper` comes in its upper half."""
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


@compiled
def upper_shares(power_v2: FloatArray, upper: FloatArray) -> None:
    """Share of the power of each sub-band in its upper half, by powers of the neighbours; each of shape (n_bands,)."""
    n_bands = power_v2.size
    for b in range(n_bands):
        low, high = max(b - 1, 0), min(b + 1, n_bands - 1)
        tilt = 0.0
        if power_v2[low] > 0.0 and power_v2[high] > 0.0 and high > low:
            tilt = np.log(power_v2[high] / power_v2[low]) / (high - low)
        tilt = min(max(tilt, -MOST_TILT), MOST_TILT)
        upper[b] = 1.0 / (1.0 + np.exp(-0.5 * tilt))  # the halves lie half a sub-band apart


class Weights(NamedTuple):
    """How sub-bands count in a fit; each of shape (n_bands,).

    Attributes:
        trust: One over the mean noise variance of the strengths.
        upper: Share of the power that comes in the upper half.
        power_v2: Becomes the squared amplitude, without what noise adds to it.
    """

    trust: FloatArray
    upper: FloatArray
    power_v2: FloatArray


@compiled
def fit_bands(
    azimuth_rad: float, strengths: FloatArray, variance: FloatArray, weights: Weights, tables: BandTables
) -> BandFit:
    """The fit to one pulse at an azimuth; strengths and variance (n_bands, n_elements)."""
    n_bands, n = strengths.shape
    trust = weights.trust
    gain, slope, across = np.empty(n), np.empty(n), np.empty(n)
    turn = weight = spread = signal = explained = 0.0
    for b in range(n_bands):
        look_up_band(azimuth_rad, tables, b, weights.upper[b], gain, slope)
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
        weights.power_v2[b] = max(squared - bias, LEAST_SHARE * squared)
        signal += trust[b] * weights.power_v2[b] * (dot(across, across) + TINY)
        explained += trust[b] * squared * energy
    return BandFit(turn, weight, spread, signal, explained)


@compiled
def bearings_of_bands(
    strengths: FloatArray, variance: FloatArray, tables: Held[BandTables], silence: tuple[float, float, float]
) -> Bearings:
    """Maximum-likelihood directions of pulses, with their deviations and misfits.

    Args:
        strengths: Shape (n_pulses, n_bands, n_elements).
        variance: Variance of the strengths, same shape.
        tables: Of the manifolds.
        silence: Azimuth, deviation and misfit of pulses without any strength.

    Returns:
        Columns of shape (n_pulses,), azimuths in (-pi, pi].
    """
    of = tables.value
    n_pulses, n_bands, n = strengths.shape
    found = Bearings(np.empty(n_pulses), np.empty(n_pulses), np.empty(n_pulses))
    weights, match = Weights(np.empty(n_bands), np.empty(n_bands), np.empty(n_bands)), np.empty(of.unit.shape[2])
    trust = weights.trust
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
            found.azimuth_rad[k], found.std_rad[k], found.misfit[k] = silence
            continue
        start_rad = SEARCH_STEP_RAD * int(np.argmax(match))
        azimuth_rad = start_rad
        weights.upper[:] = 0.5
        fit = fit_bands(azimuth_rad, strengths[k], variance[k], weights, of)
        for _ in range(REFINEMENTS + 1):
            if fit.weight > 0.0:
                azimuth_rad += fit.turn / fit.weight
            azimuth_rad = min(max(azimuth_rad, start_rad - SEARCH_STEP_RAD), start_rad + SEARCH_STEP_RAD)
            upper_shares(weights.power_v2, weights.upper)
            fit = fit_bands(azimuth_rad, strengths[k], variance[k], weights, of)
        found.azimuth_rad[k] = wrapped(azimuth_rad)
        found.std_rad[k] = min(np.sqrt(fit.variance) / max(fit.signal, TINY), UNKNOWN_STD_RAD)
        found.misfit[k] = min(max(1.0 - fit.explained / energy, 0.0), 1.0)
    return found
