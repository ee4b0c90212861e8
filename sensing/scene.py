"""What there is to be heard: all that radiates, and what stands about."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensing.discharges import Rhythm
from sensing.propagation import Mirrors, Paths, Surroundings
from sensing.sources import Carrier, DischargeSource

FloatArray = NDArray[np.float64]


class Emissions(NamedTuple):
    """Pulses as they were radiated, source by source.

    Attributes:
        source: Number of the source, shape (n_pulses,), ascending.
        time_s: Shape (n_pulses,).
        peak_v: Peak 1 m away in a unit-gain channel, before the band-pass, with its sign, shape (n_pulses,).
    """

    source: NDArray[np.intp]
    time_s: FloatArray
    peak_v: FloatArray


class Scene:
    """Sources at their places, for one mission.

    Args:
        sources: All that radiates pulses or bursts.
        surroundings: What stands about.
        carriers: What radiates all the time.

    Attributes:
        burst_s: How long the emissions of each source last that are no pulses, 0 for pulses, shape (n_sources,).
    """

    def __init__(
        self,
        sources: Sequence[DischargeSource],
        surroundings: Surroundings | None = None,
        carriers: Sequence[Carrier] = (),
    ) -> None:
        self.sources = tuple(sources)
        self.carriers = tuple(carriers)
        positions_m = np.array([source.position_m for source in self.sources]).reshape(-1, 3)
        self._mirrors = Mirrors(surroundings or Surroundings.free_space(), positions_m)
        self._amplitude_v = np.array([source.amplitude_v for source in self.sources])
        self._active_s = np.array([source.active_s for source in self.sources]).reshape(-1, 2)
        self._drift_db = np.array([source.drift_db_per_min for source in self.sources]) / 60.0
        self.burst_s = np.array([source.burst_s for source in self.sources])
        self._guns = [k for k, source in enumerate(self.sources) if source.rhythm is None]
        rhythms = [(k, source.rhythm) for k, source in enumerate(self.sources) if source.rhythm is not None]
        self._source_of_row = np.repeat([k for k, _ in rhythms], [r.rate_hz.size for _, r in rhythms]).astype(np.intp)
        columns = zip(*(rhythm for _, rhythm in rhythms), strict=True)
        self._rhythm = Rhythm(*(np.concatenate(column) for column in columns)) if rhythms else None

    def emissions(self, start_s: float, duration_s: float, rng: np.random.Generator) -> Emissions:
        """All pulses within `duration_s` from `start_s` on."""
        source, time_s, relative = np.empty(0, dtype=np.intp), np.empty(0), np.empty(0)
        if self._rhythm is not None:
            row, time_s, relative = self._rhythm.emit(start_s, duration_s, rng)
            source = self._source_of_row[row]
        for k in self._guns:
            shot_s = self.sources[k].shots_s(start_s, duration_s)
            source = np.concatenate([source, np.full(shot_s.size, k)])
            time_s, relative = np.concatenate([time_s, shot_s]), np.concatenate([relative, np.ones(shot_s.size)])
        if source.size == 0:
            return Emissions(source, time_s, relative)
        if self._guns:
            order = np.argsort(source, kind="stable")
            source, time_s, relative = source[order], time_s[order], relative[order]
        on = (time_s >= self._active_s[source, 0]) & (time_s < self._active_s[source, 1])
        if not on.all():
            source, time_s, relative = source[on], time_s[on], relative[on]
        louder = 10 ** (self._drift_db[source] * time_s / 20)
        return Emissions(source, time_s, self._amplitude_v[source] * relative * louder)

    def trace(
        self, sources: NDArray[np.intp], elements_m: FloatArray, world_from_array: FloatArray, longer_m: float
    ) -> Paths:
        """Paths from some sources to elements; see `Mirrors.trace`."""
        return self._mirrors.trace(sources, elements_m, world_from_array, longer_m)
