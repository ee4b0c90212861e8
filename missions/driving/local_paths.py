"""Shortest paths between places of a map that are near each other, found when they are needed."""

from __future__ import annotations

from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np

from dirmusic.arrays import FloatArray, IntArray
from dirmusic.compiled import compiled
from pdpatrol.missions.driving.site_map import CELL_M, SiteMap, distances_along

TIE = 1e-6
"""Largest relative change of path lengths by which one of several shortest paths is preferred, the same in both
directions."""


class Reach(NamedTuple):
    """Shortest paths from one cell to others.

    Attributes:
        cells: Cells that are reached, ascending, shape (n,).
        cost_m: Cost-weighted path length to each, shape (n,).
        before: Index of the cell before each on its path, shape (n,).
    """

    cells: IntArray
    cost_m: FloatArray
    before: IntArray

    def costs_m(self, cells: IntArray) -> FloatArray:
        """Return the cost-weighted path length to cells, same shape; infinite where it is not known."""
        at = np.minimum(np.searchsorted(self.cells, cells.astype(np.int32)), self.cells.size - 1)
        return np.where(self.cells[at] == cells, self.cost_m[at], np.inf)


class LocalPaths:
    """Shortest paths between cells of a map. The path from a cell to another one is that back, reversed.

    Args:
        site_map: The map.
    """

    def __init__(self, site_map: SiteMap) -> None:
        self._map, moves = site_map, site_map.moves
        self._moves = moves.indptr, moves.indices, moves.data
        n_cells = site_map.is_free.size
        self._ties = np.random.default_rng(0).uniform(0.0, 0.5 * TIE, n_cells)
        self._length_m, self._before = np.full(n_cells, np.inf), np.empty(n_cells, dtype=np.int32)
        self._paths: dict[tuple[int, int], tuple[IntArray, float, float]] = {}

    def reach(self, cell: int, other: int, within_m: float) -> Reach:
        """Return the shortest paths from a cell to those past which the way to another cell may be short enough.

        Args:
            cell: Where the paths start.
            other: The other cell.
            within_m: Largest sum of the cost-weighted path length and the distance to the other cell as the crow flies.
        """
        cells = _spread(
            self._moves, self._ties, self._map.centres_m, (cell, other), within_m, self._length_m, self._before
        )
        cells.sort()
        cost_m, before = self._length_m[cells].astype(np.float32), self._before[cells]
        self._length_m[cells] = np.inf
        return Reach(cells, cost_m, np.searchsorted(cells, before).astype(np.int32))

    def path(self, first: int, last: int) -> IntArray:
        """Return the cells of the shortest path between two cells, both included, shape (n,).

        Raises:
            ValueError: If the cells are not connected.
        """
        cells, _, _ = self._path(first, last)
        if cells.size == 0:
            raise ValueError(f"cells {first} and {last} are not connected")
        return cells if cells[0] == first else cells[::-1]

    def length_m(self, first: int, last: int) -> float:
        """Return the length of the path between two cells, the same in both directions; infinite if not connected."""
        return self._path(first, last)[1]

    def cost_m(self, first: int, last: int) -> float:
        """Return the cost-weighted length of the path between two cells; infinite if not connected."""
        return self._path(first, last)[2]

    def _path(self, first: int, last: int) -> tuple[IntArray, float, float]:
        key = (min(first, last), max(first, last))
        if key not in self._paths:
            cells, cost_m = _between(self._moves, self._ties, self._map.centres_m, key, self._length_m, self._before)
            length_m = float(distances_along(self._map.centres_m[cells])[-1]) if cells.size else np.inf
            self._paths[key] = cells, length_m, cost_m
        return self._paths[key]


@compiled
def _between(
    moves: tuple[IntArray, IntArray, FloatArray],
    ties: FloatArray,
    centres_m: FloatArray,
    ends: tuple[int, int],
    length_m: FloatArray,
    before: IntArray,
) -> tuple[IntArray, float]:
    """Find the shortest path between two cells: A* with the distance as the crow flies.

    Args:
        moves: Begin of the moves of each cell; end and cost of each move, at least its length.
        ties: Relative increase of the costs of all moves from and to each cell, shape (n_cells,).
        centres_m: Centres of the cells, shape (n_cells, 2).
        ends: First and last cell.
        length_m: Infinite, shape (n_cells,), and so again afterwards.
        before: Is overwritten, shape (n_cells,).

    Returns:
        The cells from the first to the last, none if they are not connected; the cost-weighted length.

    References:
        Hart, Nilsson and Raphael 1968.
    """
    begins, to, costs_m = moves
    (first, last), (x_m, y_m) = ends, centres_m[ends[1]]
    length_m[first], before[first] = 0.0, first
    reached, queue = [first], [(0.0, first)]
    while queue:
        _, cell = heappop(queue)
        if cell == last:
            break
        for k in range(begins[cell], begins[cell + 1]):
            end = np.intp(to[k])
            new_m = length_m[cell] + costs_m[k] * (1.0 + ties[cell] + ties[end])
            if new_m < length_m[end]:
                if length_m[end] == np.inf:
                    reached.append(end)
                length_m[end], before[end] = new_m, cell
                heappush(queue, (new_m + np.hypot(centres_m[end, 0] - x_m, centres_m[end, 1] - y_m), end))
    cost_m = length_m[last]
    path = [last] if cost_m < np.inf else [last][:0]
    while path and path[-1] != first:
        path.append(np.intp(before[path[-1]]))
    for cell in reached:
        length_m[cell] = np.inf
    return np.array(path)[::-1], cost_m


@compiled
def _spread(
    moves: tuple[IntArray, IntArray, FloatArray],
    ties: FloatArray,
    centres_m: FloatArray,
    ends: tuple[int, int],
    within_m: float,
    length_m: FloatArray,
    before: IntArray,
) -> IntArray:
    """Find the shortest paths from a cell, in steps of the length of the shortest move: Dijkstra with buckets.

    Args:
        moves: Begin of the moves of each cell; end and cost of each move, at least `CELL_M`.
        ties: Relative increase of the costs of all moves from and to each cell, shape (n_cells,).
        centres_m: Centres of the cells, shape (n_cells, 2).
        ends: Where the paths start, and the cell to which the way is to be short.
        within_m: Largest cost-weighted length of a path and the distance from its end to the other cell.
        length_m: Infinite, shape (n_cells,); is set to the length to each cell that is reached.
        before: Is set to the cell before each cell that is reached, shape (n_cells,).

    Returns:
        The cells that are reached, in no order.

    References:
        Dial 1969.
    """
    begins, to, costs_m = moves
    start, (x_m, y_m) = ends[0], centres_m[ends[1]]
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
                end = to[k]
                new_m = length_m[cell] + costs_m[k] * (1.0 + ties[cell] + ties[end])
                left_m = np.hypot(centres_m[end, 0] - x_m, centres_m[end, 1] - y_m)
                if new_m < length_m[end] and new_m + left_m <= within_m:
                    if length_m[end] == np.inf:
                        cells[n] = end
                        n += 1
                    length_m[end], before[end] = new_m, cell
        below_m += CELL_M
    return cells[:n].copy()
