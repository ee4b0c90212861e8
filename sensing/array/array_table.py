"""Array of a robot and its gains as compiled functions read them."""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.pattern import Boresight, PatternTable, as_boresights, tabulate
from dirmusic.array.spatial_pattern import SpatialPattern
from dirmusic.compiled import compiled_inner
from pdpatrol.sensing.array.helical_array import HelicalArray

FloatArray = NDArray[np.float64]

GRID_STEP_RAD = math.radians(2.0)
"""Step of `GainGrid`: a lobe 55 degrees wide is linear in between to 0.001."""


class GainGrid(NamedTuple):
    """Gain of an element over azimuth, elevation and frequency.

    Attributes:
        gain: Gains, shape (n_azimuths, n_elevations, n_bands), azimuths once around from 0, elevations from straight
            down to straight up; empty for a pattern in the plane.
        band_peak: Largest magnitude of a pulse of 1 V in each band, shape (n_bands,).
    """

    gain: FloatArray
    band_peak: FloatArray


def gain_grid(pattern: SpatialPattern, band_hz: FloatArray, band_peak: FloatArray) -> GainGrid:
    """Make the grid of a pattern.

    Args:
        pattern: Pattern of the elements.
        band_hz: Frequency of each band, shape (n_bands,).
        band_peak: Peaks as of `GainGrid`.
    """
    azimuth_rad, elevation_rad = GRID_STEP_RAD * np.arange(180), GRID_STEP_RAD * np.arange(91) - 0.5 * np.pi
    gain = pattern.gain(azimuth_rad[:, np.newaxis], elevation_rad, band_hz)
    return GainGrid(np.ascontiguousarray(np.moveaxis(gain, 0, -1)), band_peak)


@compiled_inner
def look_up_gains(grid: GainGrid, boresight: Boresight, x: float, y: float, z: float, gain: FloatArray) -> None:
    """Interpolate the gains of an element along a vector.

    Args:
        grid: Grid of the element.
        boresight: Boresight of the element.
        x: Component of the vector, array frame; its length does not matter.
        y: Component y.
        z: Component z, up.
        gain: Filled in, shape (n_bands,).
    """
    forward = boresight.cos_azimuth * x + boresight.sin_azimuth * y
    left = boresight.cos_azimuth * y - boresight.sin_azimuth * x
    ahead = boresight.cos_elevation * forward + boresight.sin_elevation * z
    up = boresight.cos_elevation * z - boresight.sin_elevation * forward
    azimuth = math.atan2(left, ahead) / GRID_STEP_RAD
    elevation = (math.atan2(up, math.hypot(left, ahead)) + 0.5 * math.pi) / GRID_STEP_RAD
    n_azimuths, n_elevations, n_bands = grid.gain.shape
    i, j = math.floor(azimuth), min(max(int(elevation), 0), n_elevations - 2)
    share, share_up = azimuth - i, elevation - j
    here, there = i % n_azimuths, (i + 1) % n_azimuths
    for b in range(n_bands):
        below = (1.0 - share) * grid.gain[here, j, b] + share * grid.gain[there, j, b]
        above = (1.0 - share) * grid.gain[here, j + 1, b] + share * grid.gain[there, j + 1, b]
        gain[b] = (1.0 - share_up) * below + share_up * above


class ArrayTable(NamedTuple):
    """Array of one robot.

    Attributes:
        elements_m: Positions of the elements, shape (n_elements, 3), array frame.
        boresights: Fields of `Boresight`, shape (n_elements, 4).
        gain_factors: Factors of the gains, shape (n_elements,).
        gain_offsets: Additions to the gains, shape (n_elements,).
        pattern: Pattern of all elements in the plane; unused where there is a grid.
        grid: Gains of all elements over all directions and frequencies; empty for a pattern in the plane.
    """

    elements_m: FloatArray
    boresights: FloatArray
    gain_factors: FloatArray
    gain_offsets: FloatArray
    pattern: PatternTable
    grid: GainGrid

    @classmethod
    def of(cls, array: HelicalArray, pattern: PatternTable | None = None, grid: GainGrid | None = None) -> Self:
        """Make the table of an array.

        Args:
            array: The array.
            pattern: Table of its pattern, for several arrays to share; None to make one.
            grid: Grid of a pattern over all directions and frequencies; None for a pattern in the plane.
        """
        return cls(
            elements_m=np.array(array.positions_m),
            boresights=np.array(as_boresights(array.boresights_rad, array.boresight_elevations_rad)),
            gain_factors=np.array(array.gain_factors),
            gain_offsets=np.array(array.gain_offsets),
            pattern=pattern or tabulate(array.cut),
            grid=grid or GainGrid(np.empty((0, 0, 1)), np.ones(1)),
        )
