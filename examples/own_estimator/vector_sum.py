"""A bearing estimator of one's own: each element pulls towards its boresight, by the strength that it received."""

import numpy as np

from dirmusic import ArrayModel, Bearings, PulseBatch, bearings_towards
from dirmusic.angles import circular_mean, difference
from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD

NOISE_FACTOR = 1.2
"""By how much noise moves the sum more than it moves the likeliest direction (found by simulation)."""


class VectorSum:
    """Needs no search. The helix squints: the sum is off by the same few degrees everywhere, which is taken out."""

    def __call__(self, pulses: PulseBatch, array: ArrayModel) -> Bearings:
        """Azimuths, with the deviation by noise and by the method, and the energy that they leave unexplained."""
        looks_rad = array.manifold.boresights_rad
        without_noise = difference(summed(array.manifold.search_gain.T, looks_rad), SEARCH_AZIMUTHS_RAD)
        squint_rad = circular_mean(without_noise)
        method_std_rad = np.sqrt(np.square(difference(without_noise, squint_rad)).mean())
        azimuth_rad = summed(pulses.strengths_v, looks_rad) - squint_rad
        found = bearings_towards(azimuth_rad, pulses, array)
        return found._replace(std_rad=np.minimum(np.hypot(NOISE_FACTOR * found.std_rad, method_std_rad), np.pi))


def summed(strengths: np.ndarray, looks_rad: np.ndarray) -> np.ndarray:
    """Direction of the sum of the boresights (n_elements,), weighted by strengths (n, n_elements); shape (n,)."""
    return np.arctan2((strengths * np.sin(looks_rad)).sum(axis=-1), (strengths * np.cos(looks_rad)).sum(axis=-1))
