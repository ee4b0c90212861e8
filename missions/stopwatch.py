"""Wall time by activity; no result depends on it."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager


class Stopwatch:
    """Measures wall time by activity, from its construction on.

    Attributes:
        spent_s: Seconds by activity, in the order in which each began.
    """

    def __init__(self) -> None:
        self._started_s = time.perf_counter()
        self.spent_s: dict[str, float] = {}

    @property
    def total_s(self) -> float:
        """Seconds since construction."""
        return time.perf_counter() - self._started_s

    @contextmanager
    def on(self, activity: str) -> Iterator[None]:
        """Add the time within the block to an activity."""
        began_s = time.perf_counter()
        self.spent_s.setdefault(activity, 0.0)
        try:
            yield
        finally:
            self.spent_s[activity] += time.perf_counter() - began_s

    def split(self, activity: str, parts_s: Mapping[str, float]) -> None:
        """Replace part of an activity's time by parts that were measured separately."""
        rest_s = self.spent_s.pop(activity) - sum(parts_s.values())
        self.spent_s |= {**parts_s, activity: rest_s}
