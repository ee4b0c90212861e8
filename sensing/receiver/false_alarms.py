"""False alarms: when noise alone triggers."""

from __future__ import annotations

import numpy as np


class FalseAlarms:
    """When noise alone triggers: a Poisson process for each of several robots.

    Args:
        rate_hz: Mean number of false alarms per second, of one robot.
        n_robots: How many robots.
    """

    def __init__(self, rate_hz: float, n_robots: int) -> None:
        self._mean_s = 1.0 / rate_hz
        self._next_s: list[float | None] = [None] * n_robots

    def restart(self, robot: int) -> None:
        """Let the time of one robot start anew."""
        self._next_s[robot] = None

    def times_s(self, robot: int, start_s: float, duration_s: float, rng: np.random.Generator) -> list[float]:
        """Times of one robot's false alarms within an interval; the intervals are to follow one another."""
        next_s, end_s = self._next_s[robot], start_s + duration_s
        times_s: list[float] = []
        if next_s is None:
            next_s = start_s + rng.exponential(self._mean_s)
        while next_s < end_s:
            times_s.append(next_s)
            next_s += rng.exponential(self._mean_s)
        self._next_s[robot] = next_s
        return times_s
