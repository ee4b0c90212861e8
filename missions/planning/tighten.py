"""A shorter tour that hears enough: stops that the way makes needless are left out, others are moved."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pdpatrol.missions.planning.hearing import Hearing
from pdpatrol.missions.planning.looks import Looks, looks_from
from pdpatrol.missions.planning.tour import Tour, shortest_tour_of, tour_in_order
from pdpatrol.missions.planning.ways import Ways

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

MOVE_M = 3.0
"""How far a stop is moved at once (assumed)."""

LEAST_GAIN_M = 0.5
"""A stop is moved if that makes the tour so much shorter (assumed): a second of driving is worth no search."""


class Tightening:
    """Shortens a tour as long as it shows what is needed of every target.

    Args:
        hearing: Where targets are heard from.
        ways: Between cells of the map.
        dock: Cell where tours start and end.
        needed: What a tour has to show of each target.
        is_stop: Cells, as columns of `hearing`, that stops are moved to, shape (n_cells,).
        follow: Is told how many stops there are, whenever that changes.
    """

    def __init__(
        self,
        hearing: Hearing,
        ways: Ways,
        dock: int,
        needed: Looks,
        is_stop: BoolArray,
        follow: Callable[[int], None] = lambda _: None,
    ) -> None:
        self._hearing, self._ways, self._dock = hearing, ways, dock
        self._needed = needed
        self._stop_cells, self._stops_m = hearing.cells[is_stop], hearing.places_m[is_stop]
        self._follow = follow

    def hears_all(self, cells: IntArray) -> bool:
        """Whether some cells show what is needed of all targets that any place hears."""
        return bool(self._hears(cells, ~self._hearing.is_blind).all())

    def _hears(self, cells: IntArray, asked: BoolArray) -> BoolArray:
        """Of which targets that are asked for some cells show what is needed, shape (n_asked,)."""
        shown = looks_from(self._hearing, self._hearing.columns(np.unique(cells)), asked)
        return shown.meet(self._needed.take(asked))

    def tighten(self, tour: Tour) -> Tour:
        """A short tour of which no stop can be left out, in the best order.

        Args:
            tour: One that shows enough.
        """
        while True:
            tour = self.leave_out(tour)
            moved = self._with_moves(tour)
            if moved is None:
                return tour
            tour = moved

    def leave_out(self, tour: Tour) -> Tour:
        """The tour without stops that its way makes needless: until every one that is left is needed.

        A stop is needless if the shortest tour past all others hears everything.
        """
        while True:
            self._follow(tour.stops.size)
            shorter = next(filter(None, map(self._if_it_hears, self._rests_of(tour))), None)
            if shorter is None:
                return tour
            tour = shorter

    def _rests_of(self, tour: Tour) -> list[list[int]]:
        """The stops without each of them, first what hears all and is short in the same order: it is likely to do."""
        stops = tour.stops.tolist()
        rests = [stops[:k] + stops[k + 1 :] for k in range(len(stops))]
        in_order = [tour_in_order(self._ways, self._dock, rest) for rest in rests]
        worth = [(not self.hears_all(each.cells), each.length_m) for each in in_order]
        return [rests[k] for k in sorted(range(len(rests)), key=worth.__getitem__)]

    def _if_it_hears(self, stops: Sequence[int]) -> Tour | None:
        """The shortest tour of some stops if it hears everything."""
        tour = shortest_tour_of(self._ways, self._dock, stops)
        return tour if self.hears_all(tour.cells) else None

    def _with_moves(self, tour: Tour) -> Tour | None:
        """A shorter tour with stops moved, each at most once; None if no move helps."""
        best = tour
        for stop in tour.stops.tolist():
            if stop in best.stops:
                best = self._with_move(best, best.stops.tolist().index(stop)) or best
        return best if best.length_m < tour.length_m else None

    def _with_move(self, tour: Tour, k: int) -> Tour | None:
        """A shorter tour with stop k elsewhere nearby; None if there is none."""
        around = [self._dock, *tour.stops.tolist(), self._dock]
        before, here, after = around[k : k + 3]
        legs = [self._ways.between(start, end).cells for start, end in pairwise(around)]
        fixed = np.concatenate([[self._dock], *legs[:k], *legs[k + 2 :]])
        lacking = ~self._hearing.is_blind
        lacking[lacking] = ~self._hears(fixed, lacking)
        reach = self._ways.reach(before).length_m, self._ways.reach(after).length_m
        near = self._stops_m - self._hearing.places_m[self._hearing.columns(np.array(here))]
        cells = self._stop_cells[np.abs(near).max(axis=1) <= MOVE_M]
        detour_m = reach[0][cells] + reach[1][cells]
        order = np.argsort(detour_m, kind="stable")
        for cell in cells[order[detour_m[order] < reach[0][here] + reach[1][here] - LEAST_GAIN_M]].tolist():
            way = [self._ways.reach(end).cells(cell) for end in (before, after)]
            if cell not in around and self._hears(np.concatenate([fixed, *way]), lacking).all():
                moved = self._if_it_hears([*around[1 : k + 1], cell, *around[k + 2 : -1]])
                if moved is not None and moved.length_m < tour.length_m - LEAST_GAIN_M:
                    return moved
        return None
