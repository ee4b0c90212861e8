"""Tours: the shortest closed path past some stops, and stops that can be removed or moved to shorten it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse.csgraph import connected_components, depth_first_order

from dirmusic.arrays import BoolArray, FloatArray, IntArray
from pdpatrol.missions.driving.site_map import SiteMap, distances_along
from pdpatrol.missions.planning.cover import TINY_RAD, coverage
from pdpatrol.missions.planning.detectability import Detectability

MIN_GAIN_M = 0.5
"""Smallest reduction of the tour length that justifies moving a stop. Assumed; less than a second of driving."""


class Tour(NamedTuple):
    """A closed path from the dock past stops and back.

    Attributes:
        stops: Cells of the stops in order, without the dock, shape (n_stops,).
        cells: All cells on the path, shape (n,); the dock's cell is the first and the last.
        length_m: Length of the path.
    """

    stops: IntArray
    cells: IntArray
    length_m: float


class ShortestTours:
    """Shortest tours past cells of a map. The paths between cells are found once.

    Args:
        site_map: The map, with the dock.

    Attributes:
        dock: Cell where tours start and end.
        reach: Function that returns all shortest paths from a cell.
    """

    def __init__(self, site_map: SiteMap) -> None:
        self.dock = site_map.cell(site_map.route.dock_m)
        self.reach = cache(lambda cell: site_map.reach(site_map.centres_m[cell]))
        self._length_m = cache(lambda first, last: distances_along(self.reach(first).path(last))[-1])

    def length_m(self, first: int, last: int) -> float:
        """Return the length of the path between two cells, the same in both directions."""
        return self._length_m(min(first, last), max(first, last))

    def lengths_m(self, cells: Sequence[int]) -> FloatArray:
        """Return the lengths of the paths between all of some cells, shape (n, n), symmetric."""
        lengths_m = np.zeros((len(cells), len(cells)))
        for i, j in combinations(range(len(cells)), 2):
            lengths_m[i, j] = lengths_m[j, i] = self.length_m(cells[i], cells[j])
        return lengths_m

    def in_order(self, stops: Sequence[int]) -> Tour:
        """Return the tour past the stops in the given order."""
        legs = list(pairwise((self.dock, *stops, self.dock)))
        cells = [self.reach(start).cells(end)[1:] for start, end in legs]
        length_m = sum(self.length_m(*leg) for leg in legs)
        return Tour(np.array(stops, dtype=np.intp), np.concatenate([[self.dock], *cells]), length_m)

    def shortest(self, stops: Sequence[int]) -> Tour:
        """Return the shortest tour past all stops, in the direction in which the first stop has the smaller number."""
        cells = [self.dock, *stops]
        order = [cells[k] for k in shortest_order(self.lengths_m(cells))[1:]]
        return self.in_order(order if order[:1] <= order[-1:] else order[::-1])


def shortest_order(lengths_m: FloatArray) -> tuple[int, ...]:
    r"""Return the order of the shortest closed tour past n places, starting at the first, in either direction.

    .. math:: \min \sum_{i < j} d_{ij} x_{ij}, \quad \sum_j x_{ij} = 2, \quad \sum_{i \in S, j \notin S} x_{ij} \geq 2

    for each set S of places that formed a separate tour in an earlier solution: such conditions are added until a
    single tour remains. A search ends after 10 000 nodes (assumed; twenty stops take a few).

    Args:
        lengths_m: Path lengths between the places, symmetric, shape (n, n).

    References:
        Dantzig, Fulkerson and Johnson 1954.
    """
    n = len(lengths_m)
    if n <= 3:
        return tuple(range(n))
    first, second = np.triu_indices(n, 1)
    place = np.arange(n)[:, np.newaxis]
    constraints = [LinearConstraint((first == place) | (second == place), 2.0, 2.0)]
    while True:
        solution = milp(
            lengths_m[first, second],
            integrality=[1],
            bounds=Bounds(0.0, 1.0),
            constraints=constraints,
            options={"mip_rel_gap": 0.0, "node_limit": 10_000},
        )
        joined = np.zeros((n, n))
        joined[first, second] = np.asarray(solution.x) > 0.5
        n_tours, tour = connected_components(joined, directed=False)
        if n_tours == 1:
            order = depth_first_order(joined, 0, directed=False, return_predecessors=False)
            return tuple(order.tolist())
        for k in range(n_tours):
            constraints.append(LinearConstraint((tour[first] == k) != (tour[second] == k), 2.0))


class TourShortener:
    """Optimiser that shortens a tour by removing and moving stops, while it still covers every target as required.

    Args:
        detectability: Places from which targets are detectable.
        tours: Tours on the map.
        required: Coverage that a tour must offer, shape (n_targets, 3), as returned by `coverage`.
        is_stop: Mask of the columns of `detectability` that stops may be moved to, shape (n_cells,).
        progress: Called with the number of stops whenever it changes.
    """

    def __init__(
        self,
        detectability: Detectability,
        tours: ShortestTours,
        required: FloatArray,
        is_stop: BoolArray,
        progress: Callable[[int], None],
    ) -> None:
        self._detectability, self._tours, self._required = detectability, tours, required
        self._stop_cells, self._stops_m = detectability.cells[is_stop], detectability.places_m[is_stop]
        self._progress = progress

    def shorten(self, tour: Tour) -> Tour:
        """Return a short tour, in the best order, of which no stop can be removed.

        Args:
            tour: A tour that covers all targets as required.
        """
        moved: Tour | None = tour
        while moved is not None:
            tour = self._without_needless_stops(moved)
            moved = self._with_moves(tour)
        return tour

    def _covers(self, cells: IntArray, targets: BoolArray) -> BoolArray:
        """Return which of some targets, given by mask, are covered as required."""
        offered = coverage(self._detectability, cells, targets)
        return np.asarray((offered >= self._required[targets] - TINY_RAD).all(axis=1))

    def _covers_all(self, tour: Tour) -> bool:
        return bool(self._covers(tour.cells, ~self._detectability.is_blind).all())

    def _without_needless_stops(self, tour: Tour) -> Tour:
        """Remove stops until the shortest tour past all others would not cover every target.

        The most promising stop is tried first: the one without which the tour, in its present order, still covers every
        target and is shortest.
        """
        while True:
            stops = tour.stops.tolist()
            self._progress(len(stops))
            rests = [self._tours.in_order(stops[:k] + stops[k + 1 :]) for k in range(len(stops))]
            rests.sort(key=lambda rest: (not self._covers_all(rest), rest.length_m))
            shortest = (self._tours.shortest(rest.stops.tolist()) for rest in rests)
            shorter = next(filter(self._covers_all, shortest), None)
            if shorter is None:
                return tour
            tour = shorter

    def _with_moves(self, tour: Tour) -> Tour | None:
        """Return a shorter tour with stops moved, each at most once; None if no move helps."""
        best = tour
        for stop in tour.stops.tolist():
            if stop in best.stops:
                best = self._with_move(best, best.stops.tolist().index(stop)) or best
        return best if best.length_m < tour.length_m else None

    def _with_move(self, tour: Tour, k: int) -> Tour | None:
        """Return a shorter tour with stop k moved by at most 3 m (assumed) along x and y; None if no move helps."""
        tours = self._tours
        around = [tours.dock, *tour.stops.tolist(), tours.dock]
        before, here, after = around[k : k + 3]
        legs = [tours.reach(start).cells(end) for start, end in pairwise(around)]
        kept = np.concatenate([[tours.dock], *legs[:k], *legs[k + 2 :]])
        lacking = ~self._detectability.is_blind
        lacking[lacking] = ~self._covers(kept, lacking)
        offset_m = self._stops_m - self._detectability.places_m[self._detectability.columns(np.array(here))]
        cells = self._stop_cells[np.abs(offset_m).max(axis=1) <= 3.0]
        detour_m = tours.reach(before).length_m + tours.reach(after).length_m
        cells = cells[np.argsort(detour_m[cells], kind="stable")]
        for cell in cells[detour_m[cells] < detour_m[here] - MIN_GAIN_M].tolist():
            detour = [tours.reach(end).cells(cell) for end in (before, after)]
            if cell not in around and self._covers(np.concatenate([kept, *detour]), lacking).all():
                moved = tours.shortest([*around[1 : k + 1], cell, *around[k + 2 : -1]])
                if self._covers_all(moved) and moved.length_m < tour.length_m - MIN_GAIN_M:
                    return moved
        return None
