"""Tours: a short closed path past some stops, and stops that can be removed or moved to shorten it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.compiled import compiled
from pdpatrol.missions.driving.local_paths import LocalPaths, Reach
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.planning.cover import TINY_RAD, coverage_of, coverage_of_one
from pdpatrol.missions.planning.detectability import Detectability
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
        self.n_cells = site_map.is_free.size
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
        self._where = detectability.first, detectability.column, detectability.aspect_rad
        self._column = np.zeros(tours.n_cells, dtype=np.intp)
        self._column[detectability.cells] = np.arange(detectability.cells.size)
        pairs = np.ones(detectability.column.size, dtype=np.bool_), detectability.column, detectability.first
        self._targets_of = csr_array(pairs, shape=(detectability.first.size - 1, detectability.cells.size)).tocsc()
        self._stops = list[int]()  # of the present tour
        self._n_passes = np.zeros(detectability.cells.size, dtype=np.intp)  # of the present tour over each cell

    def shorten(self, stops: Sequence[int]) -> list[int]:
        """Return the stops of a short tour, of which none can be left out.

        Args:
            stops: Stops of a tour that covers all targets as required, in the best order.
        """
        self._stops = list(stops)
        self._n_passes[:] = 0
        self._pass(self._tours.legs(self._stops))
        settled = set[tuple[int, ...]]()
        is_changed = True
        while is_changed:
            is_changed = self._remove_stops()
            is_changed |= self._replace_stops(1, settled)
            is_changed |= self._replace_stops(2, settled)
            is_changed |= self._reorder()
        return self._stops

    def _lacking(self, targets: IntArray) -> IntArray:
        """Return those of some targets, given by index, that the present tour does not cover as required."""
        offered = coverage_of(self._detectability, self._n_passes > 0, targets)
        return targets[(offered < self._required[targets] - TINY_RAD).any(axis=1)]

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
        is_seen = np.zeros(self._targets_of.shape[0], dtype=np.bool_)
        is_seen[self._targets_of[:, np.unique(self._columns(legs))].indices] = True
        return np.flatnonzero(is_seen)

    def _covers(self, old: Sequence[Leg], new: Sequence[Leg], targets: IntArray) -> bool:
        """Return whether the present tour would cover some targets with other legs."""
        self._pass(old, times=-1)
        self._pass(new)
        is_covered = self._lacking(targets).size == 0
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

    def _remove_stops(self) -> bool:
        """Leave out stops until each of them is needed, and return whether any was left out.

        The stop comes first without which the tour is shortest.
        """
        n_before, gains_m = len(self._stops), [self._gain_m(k) for k in range(len(self._stops))]
        while gains_m and (gain_m := max(gains_m)) > -np.inf:
            k = gains_m.index(gain_m)
            if self._change(self._stops[:k] + self._stops[k + 1 :]):
                del gains_m[k]
                for near in range(max(k - 1, 0), min(k + 1, len(gains_m))):
                    gains_m[near] = self._gain_m(near)
                self._progress(len(self._stops))
            else:
                gains_m[k] = -np.inf
        return len(self._stops) < n_before

    def _gain_m(self, k: int) -> float:
        """Return by how much the present tour is shorter without stop k."""
        length_m, (before, here, after) = self._tours.paths.length_m, self._around(k)
        return length_m(before, here) + length_m(here, after) - length_m(before, after)

    def _reorder(self) -> bool:
        """Take the stops in the best order if the tour then covers all targets; return whether it becomes shorter."""
        ordered = self._tours.shortest(self._stops)
        is_shorter = self._tours.length_m(ordered) < self._tours.length_m(self._stops) - MIN_GAIN_M
        return is_shorter and self._change(ordered)

    def _replace_stops(self, n_stops: int, settled: set[tuple[int, ...]]) -> bool:
        """Replace each stop, or each two successive stops, by one stop where this helps, and return whether it does.

        Args:
            n_stops: Number of stops that are replaced.
            settled: Stops, with those around them, that no stop replaces; more are added.
        """
        is_better = False
        for around in [self._around(k, n_stops) for k in range(len(self._stops) - n_stops + 1)]:
            old = list(around[1:-1])
            k = self._stops.index(old[0]) if old[0] in self._stops else 0
            now = self._around(k, n_stops)
            if self._stops[k : k + n_stops] == old and now not in settled:
                is_replaced = self._replace(k, n_stops)
                is_better |= is_replaced
                if not is_replaced:
                    settled.add(now)
        return is_better

    def _replace(self, k: int, n_stops: int) -> bool:
        """Replace some stops from stop k on by one nearby with which the tour is faster, and return whether one is."""
        around = self._around(k, n_stops)
        old, seen = list(pairwise(around)), self._seen_from(list(pairwise(around)))
        cells, reaches = self._better_places(around)
        self._pass(old, times=-1)
        lacking = self._lacking(seen)
        places = _covering(cells, reaches, self._n_passes > 0, self._column, self._where, self._required, lacking)
        self._pass(old)
        for place in places.tolist():
            if place not in self._stops and self._change([*self._stops[:k], place, *self._stops[k + n_stops :]]):
                return True
        return False

    def _better_places(self, around: Sequence[int]) -> tuple[IntArray, tuple[Reach, Reach]]:
        """Return the places near some stops past which the path is faster than past them, the shortest path first.

        Args:
            around: The stops, with the stops or docks before and after them.

        Returns:
            The places, and the paths from the stops or docks before and after them.
        """
        paths, (before, *stops, after) = self._tours.paths, around
        stops_m = self._detectability.places_m[self._detectability.columns(np.array(stops))]
        low_m, high_m = stops_m.min(axis=0) - MOST_SHIFT_M, stops_m.max(axis=0) + MOST_SHIFT_M
        cells = self._stop_cells[((self._stops_m >= low_m) & (self._stops_m <= high_m)).all(axis=1)]
        within_m = sum(paths.cost_m(*leg) for leg in pairwise(around)) + (len(stops) - 1) * self._halt_m - MIN_GAIN_M
        reaches = paths.reach(before, after, within_m), paths.reach(after, before, within_m)
        cost_m = reaches[0].costs_m(cells) + reaches[1].costs_m(cells)
        is_better = cost_m < within_m
        return cells[is_better][np.argsort(cost_m[is_better], kind="stable")], reaches


@compiled
def _covering(
    places: IntArray,
    reaches: tuple[Reach, Reach],
    is_passed: BoolArray,
    column_of: IntArray,
    where: tuple[IntArray, IntArray, FloatArray],
    required: FloatArray,
    targets: IntArray,
) -> IntArray:
    """Return the places past which a tour covers some targets as required.

    Args:
        places: Cells, shape (n,).
        reaches: Paths from the stop before and from that after the place to the places.
        is_passed: Mask of the columns that the rest of the tour passes, shape (n_cells,).
        column_of: Column of each cell of the map.
        where: First pair of each target, column of each pair, and its aspect; see `Detectability`.
        required: Coverage that each target requires, shape (n_targets, 3).
        targets: Indices of the targets.
    """
    covers = np.ones(places.size, np.bool_)
    passed = np.empty(reaches[0].cells.size + reaches[1].cells.size, np.intp)
    for k in range(places.size):
        n = 0
        for reach in reaches:
            at = np.searchsorted(reach.cells, places[k])
            while True:
                column = column_of[reach.cells[at]]
                if not is_passed[column]:
                    passed[n], is_passed[column] = column, True
                    n += 1
                if reach.before[at] == at:
                    break
                at = reach.before[at]
        for target in targets:
            if (coverage_of_one(*where, is_passed, target) < required[target] - TINY_RAD).any():
                covers[k] = False
                break
        is_passed[passed[:n]] = False
    return places[covers]
