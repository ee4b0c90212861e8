"""Arrays of several robots as compiled loops read them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.pattern import Boresight, PatternTable, as_boresights, tabulate
from pdpatrol.sensing.array.gain_grid import NO_GRID, GainGrid
from pdpatrol.sensing.array.helical_array import HelicalArray

FloatArray = NDArray[np.float64]


class ArrayTable(NamedTuple):
    """The arrays of several robots, of one size and pattern, as compiled loops read them.

    Attributes:
        elements_m: Where the elements sit, shape (n_robots, n_elements, 3), array frame.
        boresights: Fields of `Boresight`, shape (n_robots, n_elements, 4).
        gain_factors: Shape (n_robots, n_elements).
        gain_offsets: Shape (n_robots, n_elements).
        pattern: Of all elements, in the plane; does not count where there is a grid.
        grid: Of all elements, over all directions and frequencies; empty where the pattern is one in the plane.
    """

    elements_m: FloatArray
    boresights: FloatArray
    gain_factors: FloatArray
    gain_offsets: FloatArray
    pattern: PatternTable
    grid: GainGrid

    @classmethod
    def of(cls, arrays: Sequence[HelicalArray], grid: GainGrid = NO_GRID) -> Self:
        """A row for each array; with the grid of their pattern, if it is over all directions."""
        n, n_elements = len(arrays), arrays[0].n_elements
        elements_m, boresights = np.empty((n, n_elements, 3)), np.empty((n, n_elements, len(Boresight._fields)))
        factors, offsets = np.empty((n, n_elements)), np.empty((n, n_elements))
        table = cls(elements_m, boresights, factors, offsets, tabulate(arrays[0].cut), grid)
        for row, array in enumerate(arrays):
            table.replace(row, array)
        return table

    def replace(self, row: int, array: HelicalArray) -> None:
        """Another array for one robot."""
        self.elements_m[row] = array.positions_m
        self.boresights[row] = as_boresights(array.boresights_rad, array.boresight_elevations_rad)
        self.gain_factors[row], self.gain_offsets[row] = array.gain_factors, array.gain_offsets
