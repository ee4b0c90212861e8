"""Ways between places of the map, each found once."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from missions.driving.shortest_tour import path_length
from missions.driving.site_map import ShortestPaths, SiteMap

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
    """The ways that the robot takes between cells of its map: comfortable ones, the same there and back.

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
            if first in self._reached or (last not in self._reached and first <= last):
                cells = self.reach(first).cells(last)
            else:
                cells = self.reach(last).cells(first)[::-1]
            length_m = path_length(self._map.centres_m[cells])
            self._known[first, last], self._known[last, first] = Way(cells, length_m), Way(cells[::-1], length_m)
        return self._known[first, last]

    def lengths_m(self, cells: Sequence[int]) -> FloatArray:
        """Lengths of the ways between all of some cells, shape (n, n), symmetric."""
        lengths_m = np.zeros((len(cells), len(cells)))
        for i, j in combinations(range(len(cells)), 2):
            lengths_m[i, j] = lengths_m[j, i] = self.between(cells[i], cells[j]).length_m
        return lengths_m
