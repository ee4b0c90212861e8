"""Bearing estimators: their protocol, a table of the built-in ones, and two coarse ones for comparison."""

from functools import lru_cache
from typing import Protocol

import numpy as np

from dirmusic.angles import difference, wrap
from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD, GainManifold
from dirmusic.array.model import ArrayModel
from dirmusic.arrays import FloatArray
from dirmusic.bearing.maximum_likelihood import bearings_towards, maximum_likelihood
from dirmusic.bearing.sub_bands import sub_band_likelihood
from dirmusic.pulses.batch import UNKNOWN_STD_RAD, Bearings, PulseBatch


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


GRID_RAD = np.radians(np.arange(1.0, 361.0))
"""Search grid of the paper, in steps of 1 degree."""


def music(pulses: PulseBatch, array: ArrayModel) -> Bearings:
    r"""Estimate directions as in the paper: the peak of eq. (15), as printed, on a 1 degree grid.

    The noise subspace of a single pulse a is the orthogonal complement of a, so the peak is where
    :math:`\lVert g \rVert^2 \lVert a \rVert^2 - (g^T a)^2` is smallest. The standard deviation includes noise and
    rounding to the grid.

    References:
        Dir-MUSIC, eq. (13)-(15) and section 3.1.
    """
    gain, strengths_v = _grid_gain(array.manifold), pulses.strengths_v
    power = np.square(strengths_v).sum(axis=-1, keepdims=True) * np.square(gain).sum(axis=0)
    peak = (power - np.square(np.einsum("ke,ej->kj", strengths_v, gain))).argmin(axis=-1)
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


@lru_cache
def _grid_gain(manifold: GainManifold) -> FloatArray:
    return manifold.gain(GRID_RAD)


@lru_cache
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
