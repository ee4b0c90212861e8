"""Columns that grow by rows, as a mission goes on, without being copied each time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Column = NDArray[Any]

FIRST_ROOM = 256


class GrowingColumns:
    """Arrays with as many rows each; their room doubles whenever it is used up.

    Args:
        columns: Arrays with the dtype and the shape of rows of the columns; their rows are the first.
    """

    def __init__(self, columns: Sequence[Column]) -> None:
        self.n_rows = 0
        self._room = [np.empty((FIRST_ROOM, *column.shape[1:]), dtype=column.dtype) for column in columns]
        self.extend(columns)

    def extend(self, columns: Sequence[Column]) -> None:
        """Add the rows of as many columns."""
        before, self.n_rows = self.n_rows, self.n_rows + len(columns[0])
        for k, column in enumerate(columns):
            while len(self._room[k]) < self.n_rows:
                self._room[k] = np.concatenate([self._room[k], np.empty_like(self._room[k])])
            self._room[k][before : self.n_rows] = column

    def columns(self) -> list[Column]:
        """All rows so far of each column; views, which later rows do not change."""
        return [column[: self.n_rows] for column in self._room]
