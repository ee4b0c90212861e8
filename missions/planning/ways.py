"""Ways between places of the map, each found once."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdpatrol.missions.driving.site_map import ShortestPaths, SiteMap, path_length

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


class Way(NamedTuple):
    """The way between two cells.

    Attributes:
        cells: Numbers of the cells from one end to the other, both included, shape (n,).
        length_m: Its length.
    """

    cells: IntArray
    length_m: float


class Ways:
    """The ways that the robot takes between cells of its map, each as it finds it from where it starts.

    Args:
        site_map: The map.
    """

    def __init__(self, site_map: SiteMap) -> None:
        self._map = site_map
        self._reached: dict[int, ShortestPaths] = {}
        self._known: dict[tuple[int, int], Way] = {}

    def reach(self, cell: int) -> ShortestPaths:
        """All ways from a cell."""
        if cell not in self._reached:
            self._reached[cell] = self._map.reach(self._map.centres_m[cell])
        return self._reached[cell]

    def between(self, first: int, last: int) -> Way:
        """The way from a cell to another that can be reached from it."""
        if (first, last) not in self._known:
            cells = self.reach(first).cells(last)
            self._known[first, last] = Way(cells, path_length(self._map.centres_m[cells]))
        return self._known[first, last]

    def length_m(self, first: int, last: int) -> float:
        """Length of the way between two cells, the same there and back."""
        return self.between(min(first, last), max(first, last)).length_m

    def lengths_m(self, cells: Sequence[int]) -> FloatArray:
        """Lengths of the ways between all of some cells, shape (n, n), symmetric."""
        lengths_m = np.zeros((len(cells), len(cells)))
        for i, j in combinations(range(len(cells)), 2):
            lengths_m[i, j] = lengths_m[j, i] = self.length_m(cells[i], cells[j])
        return lengths_m
