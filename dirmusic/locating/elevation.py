"""From how far above pulses came, as far as a level array tells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.manifold import GainManifold
from dirmusic.pulses.batch import PulseBatch

FloatArray = NDArray[np.float64]

ELEVATIONS_RAD = np.radians([0.0, 15.0, 30.0, 45.0, 60.0, 75.0])
"""Elevations at which waves are looked for, in even steps from zero (assumed): half a step makes gains err by 2 % at
most, less than elements do. Nearly overhead there is no direction in the plane."""


def misfits_in_space(pulses: PulseBatch, manifold: GainManifold) -> FloatArray:
    """Share of the energy that the azimuth of each pulse leaves unexplained at each of `ELEVATIONS_RAD`.

    Seen from below, the gains of a level ring are more alike: what comes from above is no plane wave in the plane.

    Args:
        pulses: Pulses with their directions.
        manifold: Of the array.

    Returns:
        Shape (n_elevations, n_pulses); 1 for pulses without any strength.
    """
    off_rad = pulses.azimuth_rad[:, np.newaxis] - manifold.boresights_rad
    gain = manifold.response_in_space(off_rad, ELEVATIONS_RAD[:, np.newaxis, np.newaxis]).gain * pulses.is_usable
    strengths_v = pulses.strengths_v * pulses.is_usable
    explained = np.square((gain * strengths_v).sum(axis=-1)) / np.square(gain).sum(axis=-1)
    energy = np.maximum(np.square(strengths_v).sum(axis=-1), np.finfo(np.float64).tiny)
    return 1.0 - explained / energy
