"""Bearing estimators: their protocol, a table of the built-in ones, and two coarse ones for comparison."""

from __future__ import annotations

from functools import lru_cache
from typing import Protocol

import numpy as np

from dirmusic.angles import difference, wrap, wrapped
from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD, GainManifold, ManifoldTable
from dirmusic.array.model import ArrayModel
from dirmusic.arrays import FloatArray, IntArray
from dirmusic.bearing.maximum_likelihood import TINY, look_up, maximum_likelihood
from dirmusic.bearing.sub_bands import sub_band_likelihood
from dirmusic.compiled import Held, compiled
from dirmusic.pulses.batch import LEAST_SHARE, NO_DIRECTION, UNKNOWN_STD_RAD, Bearings, PulseBatch
from dirmusic.pulses.strengths import dot


class BearingEstimator(Protocol):
    """Estimator of directions of arrival from the strengths of pulses.

    An estimator is called once for all pulses of a control step, of one or many robots. Row i of the result must depend
    only on row i of the pulses, so that a mission does not depend on the number of robots. Faulty channels are removed
    from the pulses and the array before the call, so the number of elements may decrease during a mission.
    """

    def __call__(self, pulses: PulseBatch, array: ArrayModel) -> Bearings:
        """Estimate the directions of pulses.

        Args:
            pulses: Detected pulses, n_pulses >= 0; their direction columns are not set.
            array: Nominal array of the channels in use, with one element per strength of a pulse.

        Returns:
            Directions in the array frame, shape (n_pulses,), all finite. The standard deviation must be positive and
            include noise and the error of the method; it is pi for a pulse without strength. `bearings_towards`
            computes the misfit of given directions, and their standard deviation due to noise.
        """
        ...


@compiled
def spectrum_peaks_on_grid(strengths: FloatArray, gain: FloatArray) -> IntArray:
    r"""Find, for each pulse, the grid direction at which eq. (15), as printed, has its peak.

    The noise subspace of a single pulse a is the orthogonal complement of a, so
    :math:`P(\theta) = 1 / (\lVert g \rVert^2 - (g^T a)^2 / \lVert a \rVert^2)`.

    Args:
        strengths: Strengths, shape (n_pulses, n_elements).
        gain: Gains towards the directions of the grid, not normalised, shape (n_elements, n_directions).

    Returns:
        Index of the direction, shape (n_pulses,); 0 for a pulse without strength.

    References:
        Dir-MUSIC, eq. (13)-(15).
    """
    (n_pulses, n), n_directions = strengths.shape, gain.shape[1]
    peak = np.zeros(n_pulses, np.intp)
    for k in range(n_pulses):
        energy, deepest = dot(strengths[k], strengths[k]), np.inf
        if energy == 0.0:
            continue
        for j in range(n_directions):
            norm = match = 0.0
            for e in range(n):
                norm += gain[e, j] * gain[e, j]
                match += gain[e, j] * strengths[k, e]
            null = norm - match * match / energy
            if null < deepest:
                deepest, peak[k] = null, j
    return peak


@compiled
def judge_directions(
    azimuth_rad: FloatArray, strengths: FloatArray, variance: FloatArray, table: Held[ManifoldTable]
) -> Bearings:
    r"""Compute the misfit of given directions, and their standard deviation due to noise.

    .. math:: \sigma^2 = \frac{\sum_i p_i^2 v_i}{\lVert p \rVert^4 \alpha^2}, \quad p = (I - g g^T / g^T g) g',
              \quad \alpha = g^T a / g^T g

    Args:
        azimuth_rad: Directions, array frame, shape (n_pulses,).
        strengths: Strengths, shape (n_pulses, n_elements), volts.
        variance: Variance of the strengths, same shape.
        table: Table of the manifold.

    Returns:
        Columns of shape (n_pulses,); `NO_DIRECTION` for a pulse without strength.
    """
    n_pulses, n = strengths.shape
    found = Bearings(np.empty(n_pulses), np.empty(n_pulses), np.empty(n_pulses))
    gain, slope = np.empty(n), np.empty(n)
    for k in range(n_pulses):
        total = dot(strengths[k], strengths[k])
        if total == 0.0:
            found.azimuth_rad[k], found.std_rad[k], found.misfit[k] = NO_DIRECTION
            continue
        look_up(azimuth_rad[k], table.value, gain, slope)
        energy = dot(gain, gain)
        along, amplitude = dot(gain, slope) / energy, dot(gain, strengths[k]) / energy
        perpendicular = spread = bias = 0.0
        for e in range(n):
            p = slope[e] - along * gain[e]
            perpendicular += p * p
            spread += p * p * variance[k, e]
            bias += variance[k, e] * gain[e] * gain[e] / (energy * energy)
        square = amplitude * amplitude
        signal = max(square - bias, LEAST_SHARE * square) / max(abs(amplitude), TINY)
        found.azimuth_rad[k] = wrapped(azimuth_rad[k])
        found.std_rad[k] = min(np.sqrt(spread) / ((perpendicular + TINY) * max(signal, TINY)), UNKNOWN_STD_RAD)
        found.misfit[k] = min(max(1.0 - square * energy / total, 0.0), 1.0)
    return found


GRID_RAD = np.radians(np.arange(1.0, 361.0))
"""Search grid of the paper, in steps of 1 degree."""


def bearings_towards(azimuth_rad: FloatArray, pulses: PulseBatch, array: ArrayModel) -> Bearings:
    """Compute the misfit of directions found by any method, and their standard deviation due to noise.

    Args:
        azimuth_rad: Direction of each pulse, array frame, shape (n_pulses,).
        pulses: Pulses.
        array: Nominal array of the channels of the pulses.

    Returns:
        The directions with their standard deviations due to noise alone; an estimator adds the error of its method.
    """
    return judge_directions(azimuth_rad, pulses.strengths_v, pulses.variance_v2, array.manifold.held_table)


def music(pulses: PulseBatch, array: ArrayModel) -> Bearings:
    """Estimate directions as in the paper: the peak of eq. (15), as printed, on a 1 degree grid.

    The standard deviation includes noise and rounding to the grid.

    References:
        Dir-MUSIC, eq. (15) and section 3.1.
    """
    peak = spectrum_peaks_on_grid(pulses.strengths_v, _grid_gain(array.manifold))
    rounding_std_rad = np.radians(1.0) / np.sqrt(12.0)
    return _with_deviation(bearings_towards(GRID_RAD[peak], pulses, array), rounding_std_rad)


def strongest(pulses: PulseBatch, array: ArrayModel) -> Bearings:
    """Estimate the direction as the boresight of the strongest element, as with a hand-held antenna.

    The standard deviation includes noise and the rms error over all directions in which this element is the strongest.
    """
    element = pulses.strengths_v.argmax(axis=-1)
    boresight_rad = array.manifold.boresights_rad[element]
    return _with_deviation(bearings_towards(boresight_rad, pulses, array), _sector_std(array.manifold)[element])


def _with_deviation(found: Bearings, method_std_rad: FloatArray | float) -> Bearings:
    """Add the standard deviation of the method, except for pulses without a direction."""
    std_rad = np.minimum(np.hypot(found.std_rad, method_std_rad), UNKNOWN_STD_RAD)
    return found._replace(std_rad=np.where(found.std_rad > UNKNOWN_STD_RAD, found.std_rad, std_rad))


@lru_cache(maxsize=64)
def _grid_gain(manifold: GainManifold) -> FloatArray:
    return np.ascontiguousarray(manifold.gain(GRID_RAD))


@lru_cache(maxsize=64)
def _sector_std(manifold: GainManifold) -> FloatArray:
    """Compute the rms error of each boresight over the directions in which its element is the strongest."""
    element = manifold.search_gain.argmax(axis=0)
    off_rad = difference(wrap(SEARCH_AZIMUTHS_RAD), manifold.boresights_rad[element])
    square = np.bincount(element, np.square(off_rad), minlength=manifold.n_elements)
    count = np.bincount(element, minlength=manifold.n_elements)
    return np.where(count > 0, np.sqrt(square / np.maximum(count, 1)), UNKNOWN_STD_RAD)


ESTIMATORS: dict[str, BearingEstimator] = {
    "maximum_likelihood": maximum_likelihood,
    "sub_bands": sub_band_likelihood,
    "music": music,
    "strongest": strongest,
}
"""Built-in estimators by name, the most accurate first."""


def method_std(estimator: BearingEstimator, array: ArrayModel) -> FloatArray:
    """Compute the standard deviation that an estimator returns without noise, for each of `SEARCH_AZIMUTHS_RAD`.

    The result is in radians. It is zero for `maximum_likelihood`, and about 17 degrees for `strongest` with six
    elements.
    """
    strengths = array.manifold.gain(SEARCH_AZIMUTHS_RAD).T.copy()
    return estimator(PulseBatch.detected(np.zeros(len(strengths)), strengths, np.zeros_like(strengths)), array).std_rad
