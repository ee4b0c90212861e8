"""Shortest paths between places of a map that are near each other, found when they are needed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dirmusic.arrays import FloatArray, IntArray
from pdpatrol.missions.driving.site_map import SiteMap, distances_along


class Reach(NamedTuple):
    """Shortest paths from one cell to all cells around it.

    Attributes:
        within_m: Largest cost-weighted length of the paths.
        cells: Cells that are reached, ascending, shape (n,).
        cost_m: Cost-weighted path length to each, shape (n,).
        before: Index of the cell before each on its path, shape (n,).
    """

    within_m: float
    cells: IntArray
    cost_m: FloatArray
    before: IntArray

    def position(self, cell: int) -> int | None:
        """Return the index of a cell, or None if it is not reached."""
        at = int(np.searchsorted(self.cells, cell))
        return at if at < self.cells.size and self.cells[at] == cell else None

    def costs_m(self, cells: IntArray) -> FloatArray:
        """Return the cost-weighted path length to cells, same shape; infinite where it is not known."""
        at = np.minimum(np.searchsorted(self.cells, cells), self.cells.size - 1)
        return np.where(self.cells[at] == cells, self.cost_m[at], np.inf)

    def path(self, at: int) -> IntArray:
        """Return the cells from the start to the cell with an index, both included, shape (n,)."""
        indices = [at]
        while (before := int(self.before[indices[-1]])) != indices[-1]:
            indices.append(before)
        return self.cells[indices[::-1]]


class LocalPaths:
    """Shortest paths between cells of a map. The path from a cell to another one is that back, reversed.

    Args:
        site_map: The map.
    """

    def __init__(self, site_map: SiteMap) -> None:
        self._map = site_map
        self._reach: dict[int, Reach] = {}
        self._paths: dict[tuple[int, int], tuple[IntArray, float]] = {}

    def reach(self, cell: int, within_m: float) -> Reach:
        """Return the shortest paths from a free cell at least up to a cost-weighted length."""
        known = self._reach.get(cell)
        if known is None or known.within_m < within_m:
            known = self._reach[cell] = Reach(within_m, *self._map.reach_near(cell, within_m))
        return known

    def reach_to(self, first: int, last: int) -> Reach:
        """Return the shortest paths from a cell at least as far as to another one that is connected with it."""
        within_m, longest_m = (
            1.5 * self.direct_m(first, last),
            2.0 * self._map.yard.size_m[0] * self._map.yard.size_m[1],
        )
        while (reach := self.reach(first, within_m)).position(last) is None:
            if within_m > longest_m:
                raise ValueError(f"cells {first} and {last} are not connected")
            within_m *= 2.0
        return reach

    def direct_m(self, first: int, last: int) -> float:
        """Return the distance between two cells as the crow flies, a lower bound of the length of the path."""
        away_m = self._map.centres_m[first] - self._map.centres_m[last]
        return float(np.hypot(*away_m))

    def path(self, first: int, last: int) -> IntArray:
        """Return the cells of the shortest path between two cells that are connected, both included, shape (n,)."""
        cells = self._path(first, last)[0]
        return cells if cells[0] == first else cells[::-1]

    def length_m(self, first: int, last: int) -> float:
        """Return the length of the path between two cells, the same in both directions."""
        return self._path(first, last)[1]

    def _path(self, first: int, last: int) -> tuple[IntArray, float]:
        key = (min(first, last), max(first, last))
        if key not in self._paths:
            cells = self._found(first, last)
            self._paths[key] = cells, float(distances_along(self._map.centres_m[cells])[-1])
        return self._paths[key]

    def _found(self, first: int, last: int) -> IntArray:
        """Find a path, from the cell of which most paths are known."""
        known_m = [self._reach[cell].within_m if cell in self._reach else 0.0 for cell in (first, last)]
        if known_m[0] < known_m[1]:
            first, last = last, first
        reach = self.reach_to(first, last)
        return reach.path(int(np.searchsorted(reach.cells, last)))
