"""Which pulses are worth locating with: those that look like one plane wave from one direction."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.bounds import perpendicular_slope
from dirmusic.array.manifold import GainManifold, nearest_search_azimuth
from dirmusic.array.model import ArrayModel
from dirmusic.bearing.estimators import BearingEstimator, method_std
from dirmusic.locating.elevation import misfits_in_space
from dirmusic.locating.rules import CredibilityRules
from dirmusic.pulses.batch import PulseBatch

FloatArray = NDArray[np.float64]


class MethodDeviation:
    """Deviation that an estimator states of its own method, towards the azimuth of each pulse.

    The estimator is called once for each set of usable channels.

    Args:
        estimator: Takes the bearings.
        array: Data sheet of all channels.
    """

    def __init__(self, estimator: BearingEstimator, array: ArrayModel) -> None:
        self._estimator = estimator
        self._array = array
        self._by_channels: dict[tuple[bool, ...], FloatArray] = {}

    def of(self, pulses: PulseBatch) -> FloatArray:
        """Deviations at the nearest search azimuths, shape (n_pulses,), radians; 0 for maximum likelihood."""
        std_rad = np.empty(pulses.n_pulses)
        nearest = nearest_search_azimuth(pulses.azimuth_rad)
        usable = [tuple(channels) for channels in pulses.is_usable.tolist()]
        for channels in dict.fromkeys(usable):
            rows = [k for k, of_pulse in enumerate(usable) if of_pulse == channels]
            std_rad[rows] = self._towards_search_azimuths(channels)[nearest[rows]]
        return std_rad

    def _towards_search_azimuths(self, channels: tuple[bool, ...]) -> FloatArray:
        if channels not in self._by_channels:
            self._by_channels[channels] = method_std(self._estimator, self._array.take(np.array(channels)))
        return self._by_channels[channels]


@lru_cache(maxsize=8)
def _energy_and_turning(manifold: GainManifold) -> tuple[FloatArray, FloatArray]:
    """Squared norm of the gains, and of what turns their unit vector, towards the search azimuths, (n_azimuths,)."""
    turning = perpendicular_slope(manifold.search_gain, manifold.search_slope)
    return np.square(manifold.search_gain).sum(axis=0), np.square(turning).sum(axis=0)


def is_credible(
    pulses: PulseBatch, array: ArrayModel, method_std_rad: FloatArray, rules: CredibilityRules
) -> NDArray[np.bool_]:
    r"""Whether each pulse looks like one plane wave from one direction in space, strong enough to tell which.

    The deviation is judged by what noise adds to that of the estimator's own method,
    :math:`\sigma^2 < \sigma_{method}^2 + \sigma_{max}^2`: an honest coarse estimator is as credible as a fine one.
    Pulses that met the end of the converter's scale in a usable channel are not credible: their strengths are wrong.

    Args:
        pulses: Pulses with their directions.
        array: The array's data sheet and spread.
        method_std_rad: Deviation that the estimator states of its own method for each pulse, shape (n_pulses,); see
            `MethodDeviation`.
        rules: Limits of deviation and misfit.

    Returns:
        Shape (n_pulses,).
    """
    manifold, spread = array.manifold, array.spread
    nearest = nearest_search_azimuth(pulses.azimuth_rad)
    energy, turning = _energy_and_turning(manifold)
    by_noise = np.square(pulses.std_rad) * turning[nearest] / energy[nearest]
    by_offset = manifold.n_elements * spread.offset**2 / energy[nearest]
    by_array = spread.gain**2 + spread.pointing_rad**2 + by_offset
    expected = by_noise + by_array + rules.misfit_floor
    limit = rules.misfit_factor * expected
    is_plane_wave = pulses.misfit < limit
    (others,) = np.nonzero(~is_plane_wave)
    if others.size:
        is_plane_wave[others] = misfits_in_space(pulses.take(others), manifold).min(axis=0) < limit[others]
    is_narrow = np.square(pulses.std_rad) < np.square(method_std_rad) + rules.max_std_rad**2
    return is_narrow & is_plane_wave & ~pulses.is_overdriven
