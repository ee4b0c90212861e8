"""Which pulses are worth locating with: those that look like one plane wave from one direction."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.bounds import perpendicular_slope
from dirmusic.array.model import ArrayModel
from dirmusic.locating.rules import CredibilityRules
from dirmusic.pulses.batch import PulseBatch


def is_credible(pulses: PulseBatch, array: ArrayModel, rules: CredibilityRules) -> NDArray[np.bool_]:
    """Whether each pulse looks like one plane wave from one direction, strong enough to tell which.

    Pulses that met the end of the converter's scale in a usable channel are not credible: their strengths are wrong.

    Args:
        pulses: Pulses with their directions.
        array: The array's data sheet and spread.
        rules: Limits of deviation and misfit.

    Returns:
        Shape (n_pulses,).
    """
    manifold, spread = array.manifold, array.spread
    gain = manifold.gain(pulses.azimuth_rad)
    slope = perpendicular_slope(gain, manifold.derivative(pulses.azimuth_rad))
    by_noise = np.square(pulses.std_rad) * np.square(slope).sum(axis=0) / np.square(gain).sum(axis=0)
    by_offset = manifold.n_elements * spread.offset**2 / np.square(gain).sum(axis=0)
    by_array = spread.gain**2 + spread.pointing_rad**2 + by_offset
    expected = by_noise + by_array + rules.misfit_floor
    is_plane_wave = pulses.misfit < rules.misfit_factor * expected
    return (pulses.std_rad < rules.max_std_rad) & is_plane_wave & ~pulses.is_overdriven
