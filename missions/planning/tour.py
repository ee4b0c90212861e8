"""Tours: the shortest closed path past some stops, and stops that can be removed or moved to shorten it."""

from __future__ import annotations

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
from pdpatrol.missions.planning.shortest_order import short_order, shortest_order

MIN_GAIN_M = 0.5
"""Smallest reduction of the tour length that justifies moving a stop. Assumed; less than a second of driving."""

MOST_SHIFT_M = 3.0
"""Largest distance along x and along y by which a stop is moved at a time. Assumed; it may be moved again."""


class Tour(NamedTuple):
    """A closed path from the dock past stops and back.

    Attributes:
        stops: Cells of the stops in order, without the dock, shape (n_stops,).
        cells: All cells on the path, shape (n,); the dock's cell is the first and the last.
        length_m: Length of the path.
        bound_m: Lower bound of the length of all tours past these stops.
    """

    stops: IntArray
    cells: IntArray
    length_m: float
    bound_m: float


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

    def in_order(self, stops: Sequence[int], bound_m: float = 0.0) -> Tour:
        """Return the tour past the stops in the given order."""
        legs = list(pairwise((self.dock, *stops, self.dock)))
        cells = [self.paths.path(*leg)[1:] for leg in legs]
        length_m = sum(self.paths.length_m(*leg) for leg in legs)
        return Tour(np.array(stops, dtype=np.intp), np.concatenate([[self.dock], *cells]), length_m, bound_m)

    def _direct_m(self, cells: Sequence[int]) -> FloatArray:
        """Return the distances between cells as the crow flies, shape (n, n)."""
        places_m = self._centres_m[cells]
        return np.linalg.norm(places_m[:, np.newaxis] - places_m, axis=-1)

    def short(self, stops: Sequence[int]) -> Tour:
        """Return a short tour past all stops, in an order that ignores obstacles."""
        cells = np.array([self.dock, *stops])
        order = np.array(short_order(self._direct_m(cells.tolist())))
        return self.in_order(cells[np.roll(order, -order.tolist().index(0))][1:].tolist())

    def shortest(self, stops: Sequence[int]) -> Tour:
        """Return the shortest tour past all stops, in the direction in which the first stop has the smaller number."""
        cells = [self.dock, *stops]
        found = shortest_order(self._direct_m(cells), lambda i, j: self.paths.length_m(cells[i], cells[j]))
        order = [cells[k] for k in found.order[1:]]
        return self.in_order(order if order[:1] <= order[-1:] else order[::-1], found.bound)


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
        pairs = np.ones(detectability.column.size, dtype=np.bool_), detectability.column, detectability.first
        self._targets_of = csr_array(pairs, shape=(detectability.first.size - 1, detectability.cells.size)).tocsc()
        self._n_passes = np.zeros(detectability.cells.size, dtype=np.intp)  # of the present tour over each cell
        self._settled = set[tuple[int, ...]]()  # stops with their neighbours for which no move helped

    def shorten(self, tour: Tour) -> Tour:
        """Return a short tour, of which no stop can be removed.

        Args:
            tour: A tour that covers all targets as required.
        """
        while True:
            self._n_passes[:] = 0
            stops = [self._tours.dock, *tour.stops.tolist(), self._tours.dock]
            for leg in pairwise(stops):
                self._pass(leg)
            self._remove_needless_stops(stops)
            self._move_stops(stops)
            changed = self._tours.in_order(stops[1:-1], tour.bound_m)
            shortest = self._tours.shortest(stops[1:-1])
            is_better = shortest.length_m < changed.length_m and self._covers_all(shortest)
            best = shortest if is_better else changed._replace(bound_m=shortest.bound_m)
            if best.length_m >= tour.length_m - MIN_GAIN_M and set(best.stops.tolist()) == set(tour.stops.tolist()):
                return tour._replace(bound_m=best.bound_m)
            tour = best

    def _covers_all(self, tour: Tour) -> bool:
        is_seen = np.zeros(self._n_passes.size, dtype=np.bool_)
        is_seen[self._detectability.columns(tour.cells)] = True
        return bool(self._is_covered(is_seen, np.arange(len(self._required))).all())

    def _is_covered(self, is_seen: BoolArray, targets: IntArray) -> BoolArray:
        """Return which of some targets, given by index, are covered as required."""
        offered = coverage_of(self._detectability, is_seen, targets)
        return np.asarray((offered >= self._required[targets] - TINY_RAD).all(axis=1))

    def _pass(self, *legs: tuple[int, int], times: int = 1) -> IntArray:
        """Add legs to the present tour, or take them out with `times=-1`, and return their columns."""
        columns = self._detectability.columns(np.concatenate([self._tours.paths.path(*leg) for leg in legs]))
        np.add.at(self._n_passes, columns, times)
        return columns

    def _replace(self, old: Sequence[tuple[int, int]], new: Sequence[tuple[int, int]], targets: IntArray) -> bool:
        """Replace legs of the present tour if it still covers some targets, and return whether it does."""
        self._pass(*old, times=-1)
        self._pass(*new)
        if self._is_covered(self._n_passes > 0, targets).all():
            return True
        self._pass(*new, times=-1)
        self._pass(*old)
        return False

    def _seen_from(self, legs: Sequence[tuple[int, int]]) -> IntArray:
        """Return the indices of the targets that are detectable from legs."""
        columns = self._detectability.columns(np.concatenate([self._tours.paths.path(*leg) for leg in legs]))
        return np.unique(self._targets_of[:, np.unique(columns)].indices)

    def _remove_needless_stops(self, stops: list[int]) -> None:
        """Remove stops, those first without which the tour is shortest, until each is needed in the present order."""
        length_m, needed = self._tours.paths.length_m, set[tuple[int, ...]]()
        while True:
            self._progress(len(stops) - 2)
            around = [tuple(stops[k - 1 : k + 2]) for k in range(1, len(stops) - 1)]
            tried = [
                (length_m(before, after) - length_m(before, here) - length_m(here, after), here)
                for before, here, after in around
                if (before, here, after) not in needed
            ]
            n_stops = len(stops)
            for _, here in sorted(tried):
                k = stops.index(here, 1)
                before, _, after = stops[k - 1 : k + 2]
                old = ((before, here), (here, after))
                if self._replace(old, [(before, after)], self._seen_from(old)):
                    del stops[k]
                else:
                    needed.add((before, here, after))
            if len(stops) == n_stops:
                return

    def _move_stops(self, stops: list[int]) -> None:
        """Move stops to places from which the tour is shorter, each at most once."""
        for here in stops[1:-1]:
            k = stops.index(here, 1)
            around = tuple(stops[k - 1 : k + 2])
            if around not in self._settled:
                place = self._better_place(*around, taken=stops)
                if place is None:
                    self._settled.add(around)
                else:
                    stops[k] = place

    def _better_place(self, before: int, here: int, after: int, taken: Sequence[int]) -> int | None:
        """Move the present tour from a stop to a better place nearby and return this place; None if there is none."""
        paths, old = self._tours.paths, ((before, here), (here, after))
        offset_m = self._stops_m - self._detectability.places_m[self._detectability.columns(np.array(here))]
        cells = self._stop_cells[np.abs(offset_m).max(axis=1) <= MOST_SHIFT_M]
        detour_m = np.zeros(cells.size + 1)
        for end in (before, after):
            detour_m += paths.reach_to(end, here).costs_m(np.append(cells, here))
        is_better = detour_m[:-1] < detour_m[-1] - MIN_GAIN_M
        better = cells[is_better][np.argsort(detour_m[:-1][is_better], kind="stable")]
        length_m = sum(paths.length_m(*leg) for leg in old)
        seen = self._seen_from(old)
        self._pass(*old, times=-1)
        lacking = seen[~self._is_covered(self._n_passes > 0, seen)]
        self._pass(*old)
        for cell in better.tolist():
            new = ((before, cell), (cell, after))
            is_shorter = cell not in taken and sum(paths.length_m(*leg) for leg in new) < length_m - MIN_GAIN_M
            if is_shorter and self._replace(old, new, lacking):
                return cell
        return None
