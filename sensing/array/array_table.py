"""Arrays of several robots as compiled loops read them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from sensing.array.helical_array import HelicalArray

FloatArray = NDArray[np.float64]

TABLE_SIZE = 3600
"""Steps of 0.1 degrees, between which a cubic is exact to 1e-10 wherever the pattern is smooth."""


class Boresight(NamedTuple):
    """Direction of a boresight, array frame."""

    cos_azimuth: float
    sin_azimuth: float
    cos_elevation: float
    sin_elevation: float


class ArrayTable(NamedTuple):
    """The arrays of several robots, of one size and pattern, as compiled loops read them.

    Attributes:
        elements_m: Where the elements sit, shape (n_robots, n_elements, 3), array frame.
        boresights: Fields of `Boresight`, shape (n_robots, n_elements, 4).
        gain_factors: Shape (n_robots, n_elements).
        gain_offsets: Shape (n_robots, n_elements).
        pattern_gain: Gain over the angle off boresight, `TABLE_SIZE` even steps once round from 0.
        pattern_slope: Slope of that per step.
    """

    elements_m: FloatArray
    boresights: FloatArray
    gain_factors: FloatArray
    gain_offsets: FloatArray
    pattern_gain: FloatArray
    pattern_slope: FloatArray

    @classmethod
    def of(cls, arrays: Sequence[HelicalArray]) -> Self:
        """A row for each array."""
        n, n_elements, step_rad = len(arrays), arrays[0].n_elements, 2 * np.pi / TABLE_SIZE
        gain, slope = arrays[0].pattern.gain_and_slope(step_rad * np.arange(TABLE_SIZE))
        elements_m, boresights = np.empty((n, n_elements, 3)), np.empty((n, n_elements, len(Boresight._fields)))
        factors, offsets = np.empty((n, n_elements)), np.empty((n, n_elements))
        table = cls(elements_m, boresights, factors, offsets, gain, step_rad * slope)
        for row, array in enumerate(arrays):
            table.replace(row, array)
        return table

    def replace(self, row: int, array: HelicalArray) -> None:
        """Another array for one robot."""
        self.elements_m[row] = array.positions_m
        angles_rad = array.boresights_rad, array.boresight_elevations_rad
        self.boresights[row] = np.stack([f(angle) for angle in angles_rad for f in (np.cos, np.sin)], axis=-1)
        self.gain_factors[row], self.gain_offsets[row] = array.gain_factors, array.gain_offsets
