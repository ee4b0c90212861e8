"""What a running sweep has come to so far, and what it takes."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

from pdpatrol.missions.sweep.engines.worker import peak_memory_mb
from pdpatrol.missions.sweep.mission_row import MissionRow


class Tally:
    """Counts the missions that one run of a sweep finishes.

    Args:
        before: Rows that are there already: they count in what was found, not in what it took.
    """

    def __init__(self, before: Sequence[Mapping[str, Any]] = ()) -> None:
        self._start_s = time.perf_counter()
        self._n_missions = 0
        self._n_sources, self._n_found = (sum(row[name] for row in before) for name in ("n_sources", "n_found"))
        self._sim_time_s = self._worker_mb = 0.0

    def add(self, row: MissionRow) -> None:
        """Count one more."""
        self._n_missions += 1
        self._n_sources += row.n_sources
        self._n_found += row.n_found
        self._sim_time_s += row.sim_time_s or 0.0
        self._worker_mb = max(self._worker_mb, row.peak_memory_mb or 0.0)

    def found(self) -> str:
        """How much was found."""
        return f"{self._n_found} of {self._n_sources} sources found"

    def cost(self) -> str:
        """How fast missions were, and how much memory they took; start and compilation included."""
        elapsed_s = time.perf_counter() - self._start_s
        return (
            f"{self._n_missions} missions in {elapsed_s:.0f} s: {3600 * self._n_missions / elapsed_s:.0f} an hour, "
            f"{self._sim_time_s / elapsed_s:.0f} simulated seconds a second; "
            f"{self._worker_mb:.0f} MB a worker at most, {peak_memory_mb():.0f} MB here"
        )
