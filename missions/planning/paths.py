"""Shortest paths between places of a map that are near each other, found when they are needed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dirmusic.arrays import FloatArray, IntArray
from dirmusic.compiled import compiled
from pdpatrol.missions.driving.site_map import CELL_M, SiteMap, distances_along

TIE = 1e-6
"""Largest relative change of path lengths by which one of several shortest paths is preferred, the same in both
directions."""

MOST_CELLS = 10_000_000
"""Number of cells to which paths are kept, 16 bytes each. Older paths are found again when they are needed."""


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
        at = int(np.searchsorted(self.cells, np.int32(cell)))
        return at if at < self.cells.size and self.cells[at] == cell else None

    def costs_m(self, cells: IntArray) -> FloatArray:
        """Return the cost-weighted path length to cells, same shape; infinite where it is not known."""
        at = np.minimum(np.searchsorted(self.cells, cells.astype(np.int32)), self.cells.size - 1)
        return np.where(self.cells[at] == cells, self.cost_m[at], np.inf)

    def path(self, at: int) -> IntArray:
        """Return the cells from the start to the cell with an index, both included, shape (n,)."""
        indices = [at]
        while (before := int(self.before[indices[-1]])) != indices[-1]:
            indices.append(before)
        return self.cells[indices[::-1]].astype(np.intp)


class LocalPaths:
    """Shortest paths between cells of a map. The path from a cell to another one is that back, reversed.

    Args:
        site_map: The map.
    """

    def __init__(self, site_map: SiteMap) -> None:
        self._map = site_map
        n_cells = site_map.is_free.size
        self._ties = np.random.default_rng(0).uniform(0.0, 0.5 * TIE, n_cells)
        self._length_m, self._before = np.full(n_cells, np.inf), np.empty(n_cells, dtype=np.int32)
        self._reach: dict[int, Reach] = {}
        self._paths: dict[tuple[int, int], tuple[IntArray, float]] = {}

    def reach(self, cell: int, within_m: float) -> Reach:
        """Return the shortest paths from a free cell at least up to a cost-weighted length."""
        known = self._reach.pop(cell, None)
        if known is None or known.within_m < within_m:
            known = self._search(cell, within_m)
        self._reach[cell] = known  # the last one that is dropped
        n_cells = sum(reach.cells.size for reach in self._reach.values())
        while n_cells > MOST_CELLS and len(self._reach) > 1:
            n_cells -= self._reach.pop(next(iter(self._reach))).cells.size
        return known

    def _search(self, cell: int, within_m: float) -> Reach:
        moves = self._map.moves
        cells = _spread(
            (moves.indptr, moves.indices, moves.data), self._ties, cell, within_m, self._length_m, self._before
        )
        cells.sort()
        cost_m, before = self._length_m[cells].astype(np.float32), self._before[cells]
        self._length_m[cells] = np.inf
        return Reach(within_m, cells, cost_m, np.searchsorted(cells, before).astype(np.int32))

    def reach_to(self, first: int, last: int) -> Reach:
        """Return the shortest paths from a cell at least as far as to another one that is connected with it."""
        within_m, longest_m = 1.5 * self.direct_m(first, last), 2.0 * CELL_M * self._ties.size
        while (reach := self.reach(first, within_m)).position(last) is None:
            if within_m > longest_m:
                raise ValueError(f"cells {first} and {last} are not connected")
            within_m = max(2.0 * within_m, 1.0)
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
            cells = cells if cells[0] == key[0] else cells[::-1]
            self._paths[key] = cells, float(distances_along(self._map.centres_m[cells])[-1])
        return self._paths[key]

    def _found(self, first: int, last: int) -> IntArray:
        """Find a path, from the cell of which most paths are known."""
        known_m = [self._reach[cell].within_m if cell in self._reach else 0.0 for cell in (first, last)]
        if known_m[0] < known_m[1]:
            first, last = last, first
        reach = self.reach_to(first, last)
        return reach.path(int(np.searchsorted(reach.cells, np.int32(last))))


@compiled
def _spread(
    moves: tuple[IntArray, IntArray, FloatArray],
    ties: FloatArray,
    start: int,
    within_m: float,
    length_m: FloatArray,
    before: IntArray,
) -> IntArray:
    """Find the shortest paths from a cell, in steps of the length of the shortest move: Dijkstra with buckets.

    Args:
        moves: Begin of the moves of each cell; end and cost of each move, at least `CELL_M`.
        ties: Relative increase of the costs of all moves from and to each cell, shape (n_cells,).
        start: Where the paths start.
        within_m: Largest cost-weighted length of the paths.
        length_m: Infinite, shape (n_cells,); is set to the length to each cell that is reached.
        before: Is set to the cell before each cell that is reached, shape (n_cells,).

    Returns:
        The cells that are reached, in no order.

    References:
        Dial 1969.
    """
    begins, ends, costs_m = moves
    cells = np.empty(length_m.size, np.int32)
    cells[0], length_m[start], before[start] = start, 0.0, start
    n_done, n, below_m = 0, 1, CELL_M
    while n_done < n:
        first = n_done
        for k in range(first, n):
            if length_m[cells[k]] < below_m:
                cells[k], cells[n_done] = cells[n_done], cells[k]
                n_done += 1
        for cell in cells[first:n_done]:
            for k in range(begins[cell], begins[cell + 1]):
                end = ends[k]
                new_m = length_m[cell] + costs_m[k] * (1.0 + ties[cell] + ties[end])
                if new_m < length_m[end] and new_m <= within_m:
                    if length_m[end] == np.inf:
                        cells[n] = end
                        n += 1
                    length_m[end], before[end] = new_m, cell
        below_m += CELL_M
    return cells[:n].copy()
