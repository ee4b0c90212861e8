"""What may trigger one robot's receiver: pulses of the sources, and noise alone; drawn ahead."""

from __future__ import annotations

import numpy as np

from pdpatrol.sensing.nature.scene import Emissions, Scene
from pdpatrol.sensing.nature.sources import in_nanoseconds

AHEAD_S = 10.0
"""How far ahead is drawn at once: a draw costs the same for many."""

NOISE = -1
"""The source of what noise alone triggers."""


class Schedule:
    """What may trigger, for intervals that follow one another; an earlier one is drawn anew.

    Args:
        scene: All that radiates.
        false_alarm_rate_hz: How often noise alone triggers, on average: a Poisson process.
        nature_rng: When sources discharge, and how strongly.
        receiver_rng: When noise alone triggers.
    """

    def __init__(
        self,
        scene: Scene,
        false_alarm_rate_hz: float,
        nature_rng: np.random.Generator,
        receiver_rng: np.random.Generator,
    ) -> None:
        self._scene, self._false_alarm_rate_hz = scene, false_alarm_rate_hz
        self._nature_rng, self._receiver_rng = nature_rng, receiver_rng
        self._first_s = self._last_s = 0.0
        self.ahead = Emissions(np.empty(0, dtype=np.intp), np.empty(0), np.empty(0))

    def reaches(self, start_s: float, end_s: float) -> bool:
        """Whether an interval lies within what is drawn already."""
        return self._first_s <= start_s and end_s <= self._last_s

    def draw(self, start_s: float, end_s: float) -> None:
        """Let `ahead` hold all from the start of an interval to its end, and beyond, by time."""
        if not self._first_s <= start_s <= self._last_s:
            self.ahead, self._last_s = self.ahead.take(slice(0)), start_s
        further_s = max(AHEAD_S, end_s - self._last_s)
        false_s = self._last_s + further_s * self._receiver_rng.random(
            self._receiver_rng.poisson(self._false_alarm_rate_hz * further_s)
        )
        drawn = self._scene.draw(self._last_s, further_s, self._nature_rng).then(
            Emissions(np.full(false_s.size, NOISE), false_s, np.zeros(false_s.size))
        )
        drawn = self.ahead.take(self.ahead.time_s >= start_s).then(drawn.take(np.argsort(drawn.time_s, kind="stable")))
        self._first_s, self._last_s, self.ahead = start_s, in_nanoseconds(self._last_s + further_s), drawn

    def between(self, start_s: float, duration_s: float) -> Emissions:
        """All that may trigger within an interval."""
        start_s, end_s = in_nanoseconds(start_s), in_nanoseconds(start_s + duration_s)
        if not self.reaches(start_s, end_s):
            self.draw(start_s, end_s)
        first, last = np.searchsorted(self.ahead.time_s, (start_s, end_s)).tolist()
        return self.ahead.take(slice(first, last))
