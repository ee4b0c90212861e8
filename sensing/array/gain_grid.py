"""Gain of an element over azimuth, elevation and frequency as compiled loops read it: a grid, linear in between."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.pattern import Boresight
from dirmusic.array.spatial_pattern import SpatialPattern
from dirmusic.compiled import compiled

FloatArray = NDArray[np.float64]

STEP_RAD = math.radians(2.0)
N_AZIMUTHS, N_ELEVATIONS = 180, 91
"""Once round, and from straight down to straight up. Between two degrees a lobe 55 degrees wide is linear to 0.001."""


class GainGrid(NamedTuple):
    """Gains over a pattern's own angles.

    Attributes:
        gain: Shape (N_AZIMUTHS, N_ELEVATIONS, n_bands), the first azimuth ahead, the first elevation straight down;
            without azimuths and elevations, and one band, where the pattern is one in the plane.
        band_peak: Largest magnitude of what a pulse of 1 V is in each band, shape (n_bands,).
    """

    gain: FloatArray
    band_peak: FloatArray


NO_GRID = GainGrid(np.empty((0, 0, 1)), np.ones(1))
"""That of a pattern in the plane."""


def gain_grid(pattern: SpatialPattern, band_hz: FloatArray, band_peak: FloatArray) -> GainGrid:
    """The grid of a pattern.

    Args:
        pattern: Of the elements.
        band_hz: Frequency that each band stands for, shape (n_bands,).
        band_peak: As of `GainGrid`.
    """
    azimuth_rad = STEP_RAD * np.arange(N_AZIMUTHS)
    elevation_rad = STEP_RAD * np.arange(N_ELEVATIONS) - 0.5 * np.pi
    gain = pattern.gain(azimuth_rad[:, np.newaxis], elevation_rad, band_hz)
    return GainGrid(np.ascontiguousarray(np.moveaxis(gain, 0, -1)), band_peak)


@compiled
def look_up_gains(grid: GainGrid, boresight: Boresight, x: float, y: float, z: float, gain: FloatArray) -> None:
    """Gains of an element along a vector of any length.

    Args:
        grid: Of the element.
        boresight: Of the element.
        x: Component of the vector in the frame of the boresight, as y and z; z is up.
        y: As said.
        z: As said.
        gain: Becomes the gains, shape (n_bands,).
    """
    level = boresight.cos_azimuth * x + boresight.sin_azimuth * y
    left = boresight.cos_azimuth * y - boresight.sin_azimuth * x
    ahead = boresight.cos_elevation * level + boresight.sin_elevation * z
    up = boresight.cos_elevation * z - boresight.sin_elevation * level
    at = math.atan2(left, ahead) / STEP_RAD
    above = (math.atan2(up, math.hypot(left, ahead)) + 0.5 * math.pi) / STEP_RAD
    low = math.floor(at)
    share, i = at - low, int(low) % N_AZIMUTHS
    next_i = (i + 1) % N_AZIMUTHS
    j = min(max(int(above), 0), N_ELEVATIONS - 2)
    up_share = above - j
    for b in range(gain.size):
        below = (1.0 - share) * grid.gain[i, j, b] + share * grid.gain[next_i, j, b]
        beyond = (1.0 - share) * grid.gain[i, j + 1, b] + share * grid.gain[next_i, j + 1, b]
        gain[b] = (1.0 - up_share) * below + up_share * beyond
