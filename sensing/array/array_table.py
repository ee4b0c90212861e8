"""Tables of an antenna array and its gains, for compiled functions."""

import math
from typing import NamedTuple, Self

import numpy as np

from dirmusic.array.pattern import Boresight, PatternTable, as_boresights, frame_of_boresight
from dirmusic.array.spatial_pattern import SpatialPattern
from dirmusic.arrays import FloatArray
from dirmusic.compiled import compiled_inner
from pdpatrol.sensing.array.helical_array import HelicalArray
from pdpatrol.sensing.radio.geometry import Vector

GRID_STEP_RAD = math.radians(2.0)
"""Step of the grid of gains. Linear interpolation of a lobe 55 degrees wide is accurate to 0.001."""


def gain_grid(pattern: SpatialPattern, band_hz: FloatArray) -> FloatArray:
    """Tabulate the gain of an element over azimuth, elevation and frequency, as in `ArrayTable.grid`."""
    azimuth_rad, elevation_rad = GRID_STEP_RAD * np.arange(180), GRID_STEP_RAD * np.arange(91) - 0.5 * np.pi
    gain = pattern.gain(azimuth_rad[:, np.newaxis], elevation_rad, band_hz)
    return np.ascontiguousarray(np.moveaxis(gain, 0, -1))


@compiled_inner
def look_up_gains(grid: FloatArray, boresight: Boresight, x: float, y: float, z: float, gain: FloatArray) -> None:
    """Interpolate the gains of an element along a vector.

    Args:
        grid: Gains, as in `ArrayTable.grid`.
        boresight: Boresight of the element.
        x: Component x of the vector, of any length, array frame.
        y: Component y.
        z: Component z, up.
        gain: Filled in, shape (n_bands,).
    """
    _, left, ahead, up = frame_of_boresight(boresight, x, y, z)
    azimuth = math.atan2(left, ahead) / GRID_STEP_RAD
    elevation = (math.atan2(up, math.hypot(left, ahead)) + 0.5 * math.pi) / GRID_STEP_RAD
    n_azimuths, n_elevations, n_bands = grid.shape
    i, j = math.floor(azimuth), min(int(elevation), n_elevations - 2)
    share, share_up = azimuth - i, elevation - j
    here, there = i % n_azimuths, (i + 1) % n_azimuths
    for b in range(n_bands):
        below = (1.0 - share) * grid[here, j, b] + share * grid[there, j, b]
        above = (1.0 - share) * grid[here, j + 1, b] + share * grid[there, j + 1, b]
        gain[b] = (1.0 - share_up) * below + share_up * above


class ArrayTable(NamedTuple):
    """Antenna array of one robot.

    Attributes:
        elements_m: Positions of the elements, shape (n_elements, 3), array frame.
        middle_m: Mean position of the elements.
        boresights: Fields of `Boresight`, shape (n_elements, 4).
        gain_factors: Factors of the gains, shape (n_elements,).
        gain_offsets: Offsets added to the gains, shape (n_elements,).
        pattern: Pattern of all elements in the plane; unused if there is a grid.
        grid: Gain of every element over all directions and frequencies, shape (n_azimuths, n_elevations, n_bands).
            Azimuths run once around from 0, elevations from straight down to straight up. Empty for a pattern in the
            plane.
        band_peak: Largest magnitude of a pulse of 1 V in each band, shape (n_bands,).
    """

    elements_m: FloatArray
    middle_m: Vector
    boresights: FloatArray
    gain_factors: FloatArray
    gain_offsets: FloatArray
    pattern: PatternTable
    grid: FloatArray
    band_peak: FloatArray

    @classmethod
    def of(cls, array: HelicalArray, pattern: PatternTable, grid: FloatArray, band_peak: FloatArray) -> Self:
        """Make the table of an array; for the other arguments, see the attributes."""
        return cls(
            array.positions_m,
            Vector(*array.positions_m.mean(axis=0).tolist()),
            as_boresights(array.boresights_rad, array.boresight_elevations_rad),
            array.gain_factors.copy(),
            array.gain_offsets.copy(),
            pattern,
            grid,
            band_peak,
        )
