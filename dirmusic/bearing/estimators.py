"""The seam for direction finding: what every bearing estimator promises."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import difference, wrap
from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD, GainManifold, ManifoldTable
from dirmusic.array.model import ArrayModel
from dirmusic.bearing.maximum_likelihood import TINY, MaximumLikelihood, look_up
from dirmusic.bearing.sub_bands import SubBandLikelihood
from dirmusic.compiled import Held, compiled
from dirmusic.kernels import dot, wrapped
from dirmusic.pulses.batch import LEAST_SHARE, NO_DIRECTION, UNKNOWN_STD_RAD, Bearings, PulseBatch

FloatArray = NDArray[np.float64]


class BearingEstimator(Protocol):
    """Turns the strengths of detected pulses into directions of arrival.

    An estimator knows the array's data sheet, never the truth. It is called once for all pulses of a control step, of
    one robot or of many: row i of the answer must depend on row i of the pulses alone, so that a mission does not
    depend on how many robots run beside it. Channels that are at fault are left out before the call, from the pulses
    and from the array alike, so that the number of elements may shrink in the course of a mission.
    """

    def __call__(self, pulses: PulseBatch, array: ArrayModel) -> Bearings:
        """Directions of the pulses.

        Args:
            pulses: What the receiver detected, n_pulses rows, n_pulses >= 0; its own direction columns are not set yet.
            array: Data sheet of the channels in use; `array.manifold` has an element for each strength of a pulse.

        Returns:
            Columns of shape (n_pulses,), all finite: azimuths in the array frame, radians; their standard deviations
            by noise and by the method itself, radians, > 0, pi where a pulse tells nothing; and the share of its energy
            that the direction does not explain, in [0, 1] (`bearings_towards` gives deviation by noise
            and misfit of any direction).
        """
        ...


@compiled
def spectrum_peaks_on_grid(strengths: FloatArray, gain: FloatArray) -> NDArray[np.intp]:
    r"""Grid direction at which eq. (15), as printed, peaks for each pulse.

    One pulse a leaves all of space but itself to the noise, so
    :math:`P(\theta) = 1 / (\lVert g \rVert^2 - (g^T a)^2 / \lVert a \rVert^2)`.

    Args:
        strengths: Shape (n_pulses, n_elements).
        gain: Towards the directions of the grid, not normalised, shape (n_elements, n_directions).

    Returns:
        Number of the direction, shape (n_pulses,); 0 for a pulse without any strength.

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
    r"""Given directions with their deviations by noise and their misfits.

    .. math:: \sigma^2 = \frac{\sum_i p_i^2 v_i}{\lVert p \rVert^4 \alpha^2}, \quad p = (I - g g^T / g^T g) g',
              \quad \alpha = g^T a / g^T g

    Args:
        azimuth_rad: Array frame, shape (n_pulses,).
        strengths: Shape (n_pulses, n_elements), volts.
        variance: Variance of the strengths, same shape.
        table: Of the manifold.

    Returns:
        Columns of shape (n_pulses,); `NO_DIRECTION` for a pulse without any strength.
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
"""Directions that the paper tries: every degree."""

GRID_STD_RAD = np.radians(1.0) / np.sqrt(12.0)
"""Deviation of a direction that is rounded to that grid."""


def bearings_towards(azimuth_rad: FloatArray, pulses: PulseBatch, array: ArrayModel) -> Bearings:
    """Directions that were found in some way, with what noise and manifold say of them.

    Args:
        azimuth_rad: Of each pulse, array frame, shape (n_pulses,).
        pulses: The pulses.
        array: Data sheet of their channels.

    Returns:
        The same directions, their deviations by noise alone, and the shares of energy that they do not explain. An
        estimator adds the deviation of its own method to the former.
    """
    return judge_directions(azimuth_rad, pulses.strengths_v, pulses.variance_v2, array.manifold.held_table)


class Music:
    """The paper's estimator: the peak of eq. (15), as printed, among the whole degrees.

    Its deviation is that of noise, and of rounding to the grid.

    References:
        Dir-MUSIC, eq. (15) and section 3.1.
    """

    def __call__(self, pulses: PulseBatch, array: ArrayModel) -> Bearings:
        """Directions of the pulses, as of `estimator.BearingEstimator`."""
        peak = spectrum_peaks_on_grid(pulses.strengths_v, _grid_gain(array.manifold))
        return _with_deviation(bearings_towards(GRID_RAD[peak], pulses, array), np.full(peak.size, GRID_STD_RAD))


class Strongest:
    """The boresight of the loudest element: what a person with one hand-held antenna finds; the floor under the others.

    Its deviation is that of noise, and the root mean square error over all directions from which this element is the
    loudest.
    """

    def __call__(self, pulses: PulseBatch, array: ArrayModel) -> Bearings:
        """Directions of the pulses, as of `estimator.BearingEstimator`."""
        loudest = pulses.strengths_v.argmax(axis=-1)
        boresight_rad = array.manifold.boresights_rad[loudest]
        return _with_deviation(bearings_towards(boresight_rad, pulses, array), _sector_std(array.manifold)[loudest])


def _with_deviation(found: Bearings, method_std_rad: FloatArray) -> Bearings:
    """The directions with the method's own deviation added; pulses without a direction stay so."""
    std_rad = np.minimum(np.hypot(found.std_rad, method_std_rad), UNKNOWN_STD_RAD)
    return found._replace(std_rad=np.where(found.std_rad > UNKNOWN_STD_RAD, found.std_rad, std_rad))


@lru_cache(maxsize=64)
def _grid_gain(manifold: GainManifold) -> FloatArray:
    return np.ascontiguousarray(manifold.gain(GRID_RAD))


@lru_cache(maxsize=64)
def _sector_std(manifold: GainManifold) -> FloatArray:
    """Root mean square error of each boresight over the directions in which its element is the loudest."""
    loudest = manifold.search_gain.argmax(axis=0)
    off_rad = difference(wrap(SEARCH_AZIMUTHS_RAD), manifold.boresights_rad[loudest])
    square = np.bincount(loudest, np.square(off_rad), minlength=manifold.n_elements)
    count = np.bincount(loudest, minlength=manifold.n_elements)
    return np.where(count > 0, np.sqrt(square / np.maximum(count, 1)), UNKNOWN_STD_RAD)


ESTIMATORS: dict[str, Callable[[], BearingEstimator]] = {
    "maximum_likelihood": MaximumLikelihood,
    "sub_bands": SubBandLikelihood,
    "music": Music,
    "strongest": Strongest,
}
"""By name, the best first."""


def method_std(estimator: BearingEstimator, array: ArrayModel) -> NDArray[np.float64]:
    """Deviation that an estimator states of itself where there is no noise, for each of `SEARCH_AZIMUTHS_RAD`, radians.

    Zero for maximum likelihood, about 17 degrees for the loudest of six elements.
    """
    strengths = array.manifold.gain(SEARCH_AZIMUTHS_RAD).T.copy()
    return estimator(PulseBatch.detected(np.zeros(len(strengths)), strengths, np.zeros_like(strengths)), array).std_rad
