"""From how far above pulses came, as far as a level array tells."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD, GainManifold, nearest_search_azimuth
from dirmusic.pulses.batch import PulseBatch

FloatArray = NDArray[np.float64]

ELEVATIONS_RAD = np.radians([0.0, 15.0, 30.0, 45.0, 60.0, 75.0])
"""Elevations at which waves are looked for, in even steps from zero (assumed): half a step makes gains err by 2 % at
most, less than elements do. Nearly overhead there is no direction in the plane."""


@lru_cache(maxsize=8)
def gains_in_space(manifold: GainManifold) -> FloatArray:
    """Towards `ELEVATIONS_RAD` and the search azimuths, shape (n_elevations, n_azimuths, n_elements)."""
    off_rad = SEARCH_AZIMUTHS_RAD[:, np.newaxis] - manifold.boresights_rad
    return manifold.response_in_space(off_rad, ELEVATIONS_RAD[:, np.newaxis, np.newaxis]).gain


def misfits_in_space(pulses: PulseBatch, manifold: GainManifold) -> FloatArray:
    """Share of the energy that the azimuth of each pulse leaves unexplained at each of `ELEVATIONS_RAD`.

    Seen from below, the gains of a level ring are more alike: what comes from above is no plane wave in the plane. The
    nearest search azimuth stands for that of the pulse: it is at most a degree off, and leaves 4e-4 unexplained.

    Args:
        pulses: Pulses with their directions.
        manifold: Of the array.

    Returns:
        Shape (n_elevations, n_pulses); 1 for pulses without any strength.
    """
    nearest = nearest_search_azimuth(pulses.azimuth_rad)
    gain = gains_in_space(manifold)[:, nearest] * pulses.is_usable
    strengths_v = pulses.strengths_v * pulses.is_usable
    explained = np.square(np.einsum("epc,pc->ep", gain, strengths_v)) / np.einsum("epc,epc->ep", gain, gain)
    energy = np.maximum(np.einsum("pc,pc->p", strengths_v, strengths_v), np.finfo(np.float64).tiny)
    return 1.0 - explained / energy
