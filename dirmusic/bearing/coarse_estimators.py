"""Estimators that maximum likelihood is compared with: the paper's grid, and the loudest element."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import difference, wrap
from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD, GainManifold
from dirmusic.array.model import ArrayModel
from dirmusic.bearing.bearings import UNKNOWN_STD_RAD, Bearings
from dirmusic.pulses.batch import PulseBatch

FloatArray = NDArray[np.float64]

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
    from dirmusic.bearing import direction_kernels  # loads the compiler

    table = array.manifold.held_table
    return direction_kernels.bearings_towards(azimuth_rad, pulses.strengths_v, pulses.variance_v2, table)


class Music:
    """The paper's estimator: the peak of eq. (15), as printed, among the whole degrees.

    Its deviation is that of noise, and of rounding to the grid.

    References:
        Dir-MUSIC, eq. (15) and section 3.1.
    """

    def __call__(self, pulses: PulseBatch, array: ArrayModel) -> Bearings:
        """Directions of the pulses, as of `estimator.BearingEstimator`."""
        from dirmusic.bearing.direction_kernels import spectrum_peaks_on_grid  # loads the compiler

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
