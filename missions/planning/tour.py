"""Tours: the shortest closed path past some stops, and stops that can be removed or moved to shorten it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, depth_first_order

from pdpatrol.missions.driving.site_map import ShortestPaths, SiteMap, path_length
from pdpatrol.missions.planning.cover import Coverage, coverage_from
from pdpatrol.missions.planning.detectability import Detectability

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

NODE_LIMIT = 10_000
"""Nodes of a search after which the best tour so far counts. Assumed; twenty stops take a few nodes."""

MOVE_M = 3.0
"""Largest distance by which a stop is moved in one step. Assumed."""

MIN_GAIN_M = 0.5
"""Reduction of the tour that justifies moving a stop. Assumed; less than a second of driving."""


class CellPaths:
    """Paths between cells of a map, each found once.

    Args:
        site_map: The map.
    """

    def __init__(self, site_map: SiteMap) -> None:
        self._map = site_map
        self._reached: dict[int, ShortestPaths] = {}
        self._lengths_m: dict[tuple[int, int], float] = {}

    def reach(self, cell: int) -> ShortestPaths:
        """Return all shortest paths from a cell."""
        if cell not in self._reached:
            self._reached[cell] = self._map.reach(self._map.centres_m[cell])
        return self._reached[cell]

    def length_m(self, first: int, last: int) -> float:
        """Return the length of the path between two cells, the same in both directions."""
        ends = min(first, last), max(first, last)
        if ends not in self._lengths_m:
            self._lengths_m[ends] = path_length(self.reach(ends[0]).path(ends[1]))
        return self._lengths_m[ends]

    def lengths_m(self, cells: Sequence[int]) -> FloatArray:
        """Return the lengths of the paths between all of some cells, shape (n, n), symmetric."""
        lengths_m = np.zeros((len(cells), len(cells)))
        for i, j in combinations(range(len(cells)), 2):
            lengths_m[i, j] = lengths_m[j, i] = self.length_m(cells[i], cells[j])
        return lengths_m


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


def tour_in_order(paths: CellPaths, dock: int, stops: Sequence[int]) -> Tour:
    """Return the tour past the stops in the given order."""
    legs = list(pairwise((dock, *stops, dock)))
    cells = [paths.reach(start).cells(end)[1:] for start, end in legs]
    length_m = sum(paths.length_m(*leg) for leg in legs)
    return Tour(np.array(stops, dtype=np.intp), np.concatenate([[dock], *cells]).astype(np.intp), length_m)


def shortest_tour_of(paths: CellPaths, dock: int, stops: Sequence[int]) -> Tour:
    """Return the shortest tour past all stops, in the direction in which the first stop has the smaller number."""
    cells = [dock, *stops]
    order = [cells[k] for k in shortest_order(paths.lengths_m(cells))[1:]]
    return tour_in_order(paths, dock, order if order[:1] <= order[-1:] else order[::-1])


def shortest_order(lengths_m: FloatArray) -> tuple[int, ...]:
    r"""Return the order of the shortest closed tour past n places, starting at the first, in either direction.

    .. math:: \min \sum_{i < j} d_{ij} x_{ij}, \quad \sum_j x_{ij} = 2, \quad \sum_{i \in S, j \notin S} x_{ij} \geq 2

    for all sets S of places that a solution without that condition has joined to a separate tour: such conditions are
    added until there is one tour.

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
    degree = csr_array(((first == place) | (second == place)).astype(np.float64))
    constraints = [LinearConstraint(degree, 2.0, 2.0)]
    while True:
        solution = milp(
            lengths_m[first, second],
            integrality=np.ones(first.size, dtype=np.intp),
            bounds=Bounds(0.0, 1.0),
            constraints=constraints,
            options={"mip_rel_gap": 0.0, "node_limit": NODE_LIMIT},
        )
        chosen = np.flatnonzero(np.asarray(solution.x) > 0.5)
        joined = csr_array((np.ones(chosen.size), (first[chosen], second[chosen])), shape=(n, n))
        n_tours, tour = connected_components(joined, directed=False)
        if n_tours == 1:
            order = depth_first_order(joined, 0, directed=False, return_predecessors=False)
            return tuple(order.tolist())
        for k in range(n_tours):
            leaves = (tour[first] == k) != (tour[second] == k)
            constraints.append(LinearConstraint(csr_array(leaves[np.newaxis].astype(np.float64)), 2.0, np.inf))


class TourShortener:
    """Shortens a tour as long as it covers every target as required.

    Args:
        detectability: Where targets are detectable from.
        paths: Paths between cells of the map.
        dock: Cell where tours start and end.
        required: Coverage that a tour must offer.
        is_stop: Mask of the columns of `detectability` that stops may be moved to, shape (n_cells,).
        progress: Called with the number of stops whenever it changes.
    """

    def __init__(
        self,
        detectability: Detectability,
        paths: CellPaths,
        dock: int,
        required: Coverage,
        is_stop: BoolArray,
        progress: Callable[[int], None],
    ) -> None:
        self._detectability, self._paths, self._dock = detectability, paths, dock
        self._required = required
        self._stop_cells, self._stops_m = detectability.cells[is_stop], detectability.places_m[is_stop]
        self._progress = progress

    def covers_all(self, cells: IntArray) -> bool:
        """Return True if some cells cover all detectable targets as required."""
        return bool(self._covers(cells, ~self._detectability.is_blind).all())

    def _covers(self, cells: IntArray, targets: BoolArray) -> BoolArray:
        """Return which of some targets, given by mask, are covered as required."""
        offered = coverage_from(self._detectability, self._detectability.columns(np.unique(cells)), targets)
        return offered.satisfies(self._required.take(targets))

    def shorten(self, tour: Tour) -> Tour:
        """Return a short tour, in the best order, of which no stop can be removed.

        Args:
            tour: A tour that covers all targets as required.
        """
        while True:
            tour = self._without_needless_stops(tour)
            moved = self._with_moves(tour)
            if moved is None:
                return tour
            tour = moved

    def _without_needless_stops(self, tour: Tour) -> Tour:
        """Remove stops until the shortest tour past all others would not cover every target."""
        while True:
            self._progress(tour.stops.size)
            shorter = next(filter(None, map(self._if_it_covers, self._with_one_stop_less(tour))), None)
            if shorter is None:
                return tour
            tour = shorter

    def _with_one_stop_less(self, tour: Tour) -> list[list[int]]:
        """Return the stops without each of them, the most promising first: it covers all and is short as it stands."""
        stops = tour.stops.tolist()
        rests = [stops[:k] + stops[k + 1 :] for k in range(len(stops))]
        in_order = [tour_in_order(self._paths, self._dock, rest) for rest in rests]
        cost = [(not self.covers_all(each.cells), each.length_m) for each in in_order]
        return [rests[k] for k in sorted(range(len(rests)), key=cost.__getitem__)]

    def _if_it_covers(self, stops: Sequence[int]) -> Tour | None:
        """Return the shortest tour of some stops if it covers all targets."""
        tour = shortest_tour_of(self._paths, self._dock, stops)
        return tour if self.covers_all(tour.cells) else None

    def _with_moves(self, tour: Tour) -> Tour | None:
        """Return a shorter tour with stops moved, each at most once; None if no move helps."""
        best = tour
        for stop in tour.stops.tolist():
            if stop in best.stops:
                best = self._with_move(best, best.stops.tolist().index(stop)) or best
        return best if best.length_m < tour.length_m else None

    def _with_move(self, tour: Tour, k: int) -> Tour | None:
        """Return a shorter tour with stop k moved nearby; None if no move helps."""
        around = [self._dock, *tour.stops.tolist(), self._dock]
        before, here, after = around[k : k + 3]
        legs = [self._paths.reach(start).cells(end) for start, end in pairwise(around)]
        kept = np.concatenate([[self._dock], *legs[:k], *legs[k + 2 :]])
        lacking = ~self._detectability.is_blind
        lacking[lacking] = ~self._covers(kept, lacking)
        reach_m = self._paths.reach(before).length_m, self._paths.reach(after).length_m
        off_m = self._stops_m - self._detectability.places_m[self._detectability.columns(np.array(here))]
        cells = self._stop_cells[np.abs(off_m).max(axis=1) <= MOVE_M]
        detour_m = reach_m[0][cells] + reach_m[1][cells]
        order = np.argsort(detour_m, kind="stable")
        limit_m = reach_m[0][here] + reach_m[1][here] - MIN_GAIN_M
        for cell in cells[order[detour_m[order] < limit_m]].tolist():
            detour = [self._paths.reach(end).cells(cell) for end in (before, after)]
            if cell not in around and self._covers(np.concatenate([kept, *detour]), lacking).all():
                moved = self._if_it_covers([*around[1 : k + 1], cell, *around[k + 2 : -1]])
                if moved is not None and moved.length_m < tour.length_m - MIN_GAIN_M:
                    return moved
        return None
