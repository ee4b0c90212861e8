"""Tours: a short closed path past some stops, and stops that can be removed or moved to shorten it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from dirmusic.arrays import BoolArray, FloatArray, IntArray
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.planning.cover import TINY_RAD, coverage_of
from pdpatrol.missions.planning.detectability import Detectability
from pdpatrol.missions.planning.paths import LocalPaths
from pdpatrol.missions.planning.shortest_order import shortest_order, tour_bound

MIN_GAIN_M = 0.5
"""Smallest reduction of the tour length that justifies moving a stop. Assumed; less than a second of driving."""

MOST_SHIFT_M = 6.0
"""Largest distance along x and along y by which a stop is moved at a time. Assumed; with 3 m, tours of small yards
are 0.5 % longer."""

N_NEAREST = 10
"""Number of nearest stops to which the path from each stop is computed before it may become part of a tour."""

Leg = tuple[int, int]
"""First and last cell of a part of a tour without stops in between."""


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
        paths: Shortest paths between cells.
    """

    def __init__(self, site_map: SiteMap) -> None:
        self.dock = site_map.cell(site_map.route.dock_m)
        self.paths = LocalPaths(site_map)
        self._centres_m = site_map.centres_m

    def legs(self, stops: Sequence[int]) -> list[Leg]:
        """Return the legs of the tour past the stops in the given order."""
        return list(pairwise((self.dock, *stops, self.dock)))

    def length_m(self, stops: Sequence[int]) -> float:
        """Return the length of the tour past the stops in the given order."""
        return sum(self.paths.length_m(*leg) for leg in self.legs(stops))

    def in_order(self, stops: Sequence[int]) -> Tour:
        """Return the tour past the stops in the given order."""
        cells = [self.paths.path(*leg)[1:] for leg in self.legs(stops)]
        path = np.concatenate([[self.dock], *cells]) if len(stops) > 0 else np.array([self.dock])
        return Tour(np.array(stops, dtype=np.intp), path, self.length_m(stops))

    def shortest(self, stops: Sequence[int]) -> list[int]:
        """Return the stops in the order of a short tour past them, not longer than that in the given order.

        Up to a dozen stops, it is the shortest one. In its direction, the first stop has the smaller number.
        """
        cells, order = [self.dock, *stops], np.arange(len(stops) + 1)
        lengths_m, near = self._lengths_m(cells)
        least_m = np.inf
        while least_m > (length_m := self._fill(lengths_m, cells, order)):
            least_m, best = length_m, order
            order = shortest_order(order, lengths_m, near)
        found = [cells[k] for k in np.roll(best, -best.tolist().index(0))[1:]]
        return found if found[:1] <= found[-1:] else found[::-1]

    def bound_m(self, tour: Tour) -> float:
        """Return a lower bound of the lengths of all tours past the stops of a tour."""
        return tour_bound(self._lengths_m([self.dock, *tour.stops.tolist()])[0], tour.length_m)

    def _lengths_m(self, cells: Sequence[int]) -> tuple[FloatArray, IntArray]:
        """Return lower bounds of the path lengths between cells (n, n), and indices of the nearest cells to each.

        The paths to the nearest cells have their true lengths.
        """
        places_m = self._centres_m[cells]
        lengths_m = np.linalg.norm(places_m[:, np.newaxis] - places_m, axis=-1)
        near = np.argsort(lengths_m, axis=1, kind="stable")[:, 1 : N_NEAREST + 1]
        pairs = zip(np.repeat(np.arange(len(cells)), near.shape[1]).tolist(), near.ravel().tolist(), strict=True)
        for i, j in pairs:
            lengths_m[i, j] = lengths_m[j, i] = self.paths.length_m(cells[i], cells[j])
        by_length = np.argsort(np.take_along_axis(lengths_m, near, axis=1), axis=1, kind="stable")
        return lengths_m, np.take_along_axis(near, by_length, axis=1)

    def _fill(self, lengths_m: FloatArray, cells: Sequence[int], order: IntArray) -> float:
        """Enter the path lengths between cells in the given order, and return the length of that tour."""
        total_m = 0.0
        for i, j in pairwise((*order.tolist(), order[0])):
            lengths_m[i, j] = lengths_m[j, i] = self.paths.length_m(cells[i], cells[j])
            total_m += lengths_m[i, j]
        return total_m


class TourShortener:
    """Optimiser that shortens a tour by removing and moving stops, while it still covers every target as required.

    Args:
        detectability: Places from which targets are detectable.
        tours: Tours on the map.
        required: Coverage that a tour must offer, shape (n_targets, 3), as returned by `coverage`.
        is_stop: Mask of the columns of `detectability` that stops may be moved to, shape (n_cells,).
        halt_m: Length of the path on which the robot drives for as long as it takes to halt.
        progress: Called with the number of stops whenever it changes.
    """

    def __init__(
        self,
        detectability: Detectability,
        tours: ShortestTours,
        required: FloatArray,
        is_stop: BoolArray,
        halt_m: float,
        progress: Callable[[int], None],
    ) -> None:
        self._detectability, self._tours, self._required = detectability, tours, required
        self._stop_cells, self._stops_m = detectability.cells[is_stop], detectability.places_m[is_stop]
        self._halt_m, self._progress = halt_m, progress
        pairs = np.ones(detectability.column.size, dtype=np.bool_), detectability.column, detectability.first
        self._targets_of = csr_array(pairs, shape=(detectability.first.size - 1, detectability.cells.size)).tocsc()
        self._stops = list[int]()  # of the present tour
        self._n_passes = np.zeros(detectability.cells.size, dtype=np.intp)  # of the present tour over each cell

    def shorten(self, stops: Sequence[int]) -> list[int]:
        """Return the stops of a short tour, in the best order, of which no stop can be removed.

        Args:
            stops: Stops of a tour that covers all targets as required, in the best order.
        """
        self._stops = list(stops)
        self._n_passes[:] = 0
        self._pass(self._tours.legs(self._stops))
        self._remove_needless_stops()
        while self._replace_stops(1) or self._replace_stops(2):
            self._remove_needless_stops()
        return self._stops

    def _is_covered(self, targets: IntArray) -> BoolArray:
        """Return which of some targets, given by index, the present tour covers as required."""
        offered = coverage_of(self._detectability, self._n_passes > 0, targets)
        return np.asarray((offered >= self._required[targets] - TINY_RAD).all(axis=1))

    def _columns(self, legs: Sequence[Leg]) -> IntArray:
        """Return the columns of the cells of legs, shape (n,)."""
        if not legs:
            return np.empty(0, dtype=np.intp)
        return self._detectability.columns(np.concatenate([self._tours.paths.path(*leg) for leg in legs]))

    def _pass(self, legs: Sequence[Leg], times: int = 1) -> None:
        """Add legs to the present tour, or take them out with `times=-1`."""
        np.add.at(self._n_passes, self._columns(legs), times)

    def _seen_from(self, legs: Sequence[Leg]) -> IntArray:
        """Return the indices of the targets that are detectable from legs."""
        return np.unique(self._targets_of[:, np.unique(self._columns(legs))].indices)

    def _covers(self, old: Sequence[Leg], new: Sequence[Leg], targets: IntArray) -> bool:
        """Return whether the present tour would cover some targets with other legs."""
        self._pass(old, times=-1)
        self._pass(new)
        is_covered = bool(self._is_covered(targets).all())
        self._pass(new, times=-1)
        self._pass(old)
        return is_covered

    def _change(self, stops: list[int]) -> bool:
        """Make a tour the present one if it covers all targets, and return whether it does."""
        now, then = (Counter(tuple(sorted(leg)) for leg in self._tours.legs(each)) for each in (self._stops, stops))
        old, new = list((now - then).elements()), list((then - now).elements())
        if not self._covers(old, new, self._seen_from(old)):
            return False
        self._pass(old, times=-1)
        self._pass(new)
        self._stops = stops
        return True

    def _around(self, k: int, n_stops: int = 1) -> tuple[int, ...]:
        """Return some stops from stop k on, with the stops or docks before and after them."""
        return (self._tours.dock, *self._stops, self._tours.dock)[k : k + n_stops + 2]

    def _remove_needless_stops(self) -> None:
        """Remove stops until the best tour past all others would not cover every target."""
        needed = set[tuple[int, ...]]()
        while self._remove_a_stop(needed):
            self._progress(len(self._stops))

    def _remove_a_stop(self, needed: set[tuple[int, ...]]) -> bool:
        """Remove the most promising stop: the one without which the tour, still covering all targets, is shortest.

        Args:
            needed: Stops, with those around them, that the present tour needs; more are added.
        """
        length_m, gains_m = self._tours.paths.length_m, list[float]()
        for before, here, after in map(self._around, range(len(self._stops))):
            gains_m.append(length_m(before, here) + length_m(here, after) - length_m(before, after))
        by_gain = np.argsort(-np.array(gains_m), kind="stable").tolist()
        for k in by_gain:
            before, here, after = around = self._around(k)
            old = [(before, here), (here, after)]
            is_needless = around not in needed and self._covers(old, [(before, after)], self._seen_from(old))
            if is_needless and self._change(self._tours.shortest(self._stops[:k] + self._stops[k + 1 :])):
                return True
            needed.add(around)
        return any(self._change(self._tours.shortest(self._stops[:k] + self._stops[k + 1 :])) for k in by_gain)

    def _replace_stops(self, n_stops: int) -> bool:
        """Replace each stop, or each two successive stops, by one stop where this helps, and return whether it does."""
        is_better = False
        for around in [self._around(k, n_stops) for k in range(len(self._stops) - n_stops + 1)]:
            old = list(around[1:-1])
            k = self._stops.index(old[0]) if old[0] in self._stops else 0
            if self._stops[k : k + n_stops] == old:
                is_better |= self._replace(k, n_stops)
        return is_better

    def _replace(self, k: int, n_stops: int) -> bool:
        """Replace some stops from stop k on by one nearby with which the tour is faster, and return whether one is."""
        around = self._around(k, n_stops)
        old, longest_m = list(pairwise(around)), self._tours.length_m(self._stops) + self._allowed_m(n_stops)
        seen = self._seen_from(old)
        self._pass(old, times=-1)
        lacking = seen[~self._is_covered(seen)]
        self._pass(old)
        for cell in self._better_places(around):
            if cell not in self._stops and self._covers(old, [(around[0], cell), (cell, around[-1])], lacking):
                changed = self._tours.shortest([*self._stops[:k], cell, *self._stops[k + n_stops :]])
                if self._tours.length_m(changed) < longest_m and self._change(changed):
                    return True
        return False

    def _allowed_m(self, n_stops: int) -> float:
        """Return by how much the tour may become longer when one stop replaces some; it must be faster."""
        return (n_stops - 1) * self._halt_m - MIN_GAIN_M

    def _better_places(self, around: Sequence[int]) -> list[int]:
        """Return the places near some stops past which the path may be faster than past them, the shortest path first.

        Args:
            around: The stops, with the stops or docks before and after them.
        """
        paths, (before, *stops, after) = self._tours.paths, around
        stops_m = self._detectability.places_m[self._detectability.columns(np.array(stops))]
        low_m, high_m = stops_m.min(axis=0) - MOST_SHIFT_M, stops_m.max(axis=0) + MOST_SHIFT_M
        cells = self._stop_cells[((self._stops_m >= low_m) & (self._stops_m <= high_m)).all(axis=1)]
        costs_m = [paths.reach_to(before, stops[-1]).costs_m(cells), paths.reach_to(after, stops[0]).costs_m(cells)]
        old_m = sum(float(paths.reach_to(*leg).costs_m(np.array([leg[1]]))[0]) for leg in pairwise(around))
        cost_m = np.sum(costs_m, axis=0)
        is_better = cost_m < old_m + self._allowed_m(len(stops))
        return cells[is_better][np.argsort(cost_m[is_better], kind="stable")].tolist()
