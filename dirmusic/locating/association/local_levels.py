"""Local levels: pulses of one time and one direction are judged by their median strength."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic.locating.association.growing_columns import GrowingColumns
from dirmusic.locating.rules import AssignmentRules

FloatArray = NDArray[np.float64]


class LocalLevels:
    """The median level of the pulses of the same time and direction, for each pulse.

    Args:
        rules: How long a time, and how wide an arc.

    Attributes:
        n_settled: So many of the first pulses keep the local level that they were last given: their time has passed.
    """

    def __init__(self, rules: AssignmentRules) -> None:
        self._window_s, self._arc_rad = rules.level_window_s, rules.level_arc_rad
        self._groups = GrowingColumns([np.empty(0), np.empty(0), np.empty(0)])
        self._local_db = np.empty(0)
        self._is_known = True
        self._last_window = -np.inf
        self._first_of_last_window = 0
        self.n_settled = 0

    def extend(self, time_s: FloatArray, bearing_rad: FloatArray, level_db: FloatArray) -> None:
        """Add pulses: times, world bearings, and levels in dB over any reference, each of shape (n,)."""
        window = np.floor(time_s / self._window_s)
        sector = np.floor(np.mod(bearing_rad, 2 * np.pi) / self._arc_rad)
        for row in np.flatnonzero(np.diff(window, prepend=self._last_window)).tolist():
            is_later = window[row] > self._last_window
            self._first_of_last_window = self._groups.n_rows + row if is_later else 0
            self.n_settled = min(self.n_settled, self._first_of_last_window)
            self._last_window = max(self._last_window, float(window[row]))
        self._groups.extend([window, sector, level_db])
        self._is_known = False

    def local_db(self) -> FloatArray:
        """Local level of each pulse so far, shape (n_pulses,), dB over the reference of `add`."""
        if self._is_known:
            return self._local_db
        first, self.n_settled = self.n_settled, self._first_of_last_window
        window, sector, level_db = (column[first:] for column in self._groups.columns())
        order = np.lexsort((level_db, sector, window))
        is_new = np.diff(window[order], prepend=-np.inf) + np.abs(np.diff(sector[order], prepend=-1.0)) > 0
        starts = np.flatnonzero(is_new)
        counts = np.diff(np.append(starts, order.size))
        median_db = np.empty(order.size)
        median_db[order] = np.repeat(level_db[order[starts + counts // 2]], counts)
        self._local_db, self._is_known = np.concatenate([self._local_db[:first], median_db]), True
        return self._local_db
