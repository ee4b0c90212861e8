"""Bearing estimator: the sum of the boresights, weighted by the strengths."""

import numpy as np

from dirmusic import ArrayModel, Bearings, PulseBatch, bearings_towards
from dirmusic.angles import circular_mean, difference
from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD

NOISE_FACTOR = 1.2
"""Error of the sum due to noise, relative to that of the most likely direction; found by simulation."""


class VectorSum:
    """Estimator without a search, which subtracts the squint of the helix, a few degrees in all directions."""

    def __call__(self, pulses: PulseBatch, array: ArrayModel) -> Bearings:
        """Estimate azimuths with their standard deviation due to noise and method, and their misfit."""
        boresights_rad = array.manifold.boresights_rad
        without_noise = difference(weighted_sum(array.manifold.search_gain.T, boresights_rad), SEARCH_AZIMUTHS_RAD)
        squint_rad = circular_mean(without_noise)
        method_std_rad = np.sqrt(np.square(difference(without_noise, squint_rad)).mean())
        azimuth_rad = weighted_sum(pulses.strengths_v, boresights_rad) - squint_rad
        found = bearings_towards(azimuth_rad, pulses, array)
        return found._replace(std_rad=np.minimum(np.hypot(NOISE_FACTOR * found.std_rad, method_std_rad), np.pi))


def weighted_sum(strengths: np.ndarray, boresights_rad: np.ndarray) -> np.ndarray:
    """Compute the direction of the sum of boresights (n_elements,) weighted by strengths (n, n_elements)."""
    x, y = np.cos(boresights_rad), np.sin(boresights_rad)
    return np.arctan2((strengths * y).sum(axis=-1), (strengths * x).sum(axis=-1))
