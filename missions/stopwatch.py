"""Where the time goes: wall time by what it was spent on. No result depends on it."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager


class Stopwatch:
    """Wall time by what it was spent on, from when it is made.

    Attributes:
        spent_s: By what, in the order in which each began.
    """

    def __init__(self) -> None:
        self._started_s = time.perf_counter()
        self.spent_s: dict[str, float] = {}

    @property
    def total_s(self) -> float:
        """Since it was made."""
        return time.perf_counter() - self._started_s

    @contextmanager
    def on(self, what: str) -> Iterator[None]:
        """Count the time within as spent on `what`, in addition to any before."""
        began_s = time.perf_counter()
        self.spent_s.setdefault(what, 0.0)
        try:
            yield
        finally:
            self.spent_s[what] += time.perf_counter() - began_s

    def split(self, what: str, parts_s: Mapping[str, float]) -> None:
        """Put parts of it, that were measured apart, in the place of `what`; what is left of it stays."""
        left_s = self.spent_s.pop(what) - sum(parts_s.values())
        self.spent_s |= {**parts_s, what: left_s}
