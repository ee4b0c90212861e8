"""All that radiates in a mission, and what stands about."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdpatrol.sensing.nature.discharges import Rhythm
from pdpatrol.sensing.nature.sources import Carrier, DischargeSource
from pdpatrol.sensing.radio.surroundings import Surroundings

FloatArray = NDArray[np.float64]


class Emissions(NamedTuple):
    """Pulses as they were radiated.

    Attributes:
        source: Number of the source, shape (n_pulses,).
        time_s: Shape (n_pulses,), ascending.
        peak_v: Peak 1 m away in a unit-gain channel, before the band-pass, with its sign, shape (n_pulses,).
    """

    source: NDArray[np.intp]
    time_s: FloatArray
    peak_v: FloatArray

    def take(self, chosen: NDArray[np.intp] | NDArray[np.bool_] | slice) -> Emissions:
        """Some of the pulses."""
        return Emissions(self.source[chosen], self.time_s[chosen], self.peak_v[chosen])

    def then(self, later: Emissions) -> Emissions:
        """These pulses and later ones."""
        return Emissions(
            np.concatenate([self.source, later.source]),
            np.concatenate([self.time_s, later.time_s]),
            np.concatenate([self.peak_v, later.peak_v]),
        )


class Scene:
    """Sources at their places, for one mission.

    Args:
        sources: All that radiates pulses or bursts.
        surroundings: What stands about.
        carriers: What radiates all the time.

    Attributes:
        surroundings: As given, or free space.
        positions_m: Places of the sources at time 0, shape (n_sources, 3), world frame.
        has_movers: Whether any source moves.
        burst_s: How long the emissions of each source last that are no pulses, 0 for pulses, shape (n_sources,).
        axes: Linear polarisations of the sources, unit vectors, shape (n_sources, 3).
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
        self.surroundings = surroundings or Surroundings.free_space()
        self.positions_m = positions_m
        self._movers = [k for k, source in enumerate(self.sources) if source.moves_to_m is not None]
        self.has_movers = bool(self._movers)
        self._amplitude_v = np.array([source.amplitude_v for source in self.sources])
        self._active_s = np.array([source.active_s for source in self.sources]).reshape(-1, 2)
        self._drift_db = np.array([source.drift_db_per_min for source in self.sources]) / 60.0
        self.burst_s = np.array([source.burst_s for source in self.sources])
        self.axes = np.array([source.axis for source in self.sources]).reshape(-1, 3)
        self._guns = [k for k, source in enumerate(self.sources) if source.rhythm is None]
        rhythms = [(k, source.rhythm) for k, source in enumerate(self.sources) if source.rhythm is not None]
        self._source_of_row = np.repeat([k for k, _ in rhythms], [r.rate_hz.size for _, r in rhythms]).astype(np.intp)
        columns = zip(*(rhythm for _, rhythm in rhythms), strict=True)
        self._rhythm = Rhythm(*(np.concatenate(column) for column in columns)) if rhythms else None

    def positions_at(self, time_s: float) -> FloatArray:
        """Places of the sources at a time, shape (n_sources, 3), world frame; to be read only."""
        if not self.has_movers:
            return self.positions_m
        positions_m = self.positions_m.copy()
        for k in self._movers:
            positions_m[k] = self.sources[k].position_at(time_s)
        return positions_m

    def draw(self, start_s: float, duration_s: float, rng: np.random.Generator) -> Emissions:
        """All pulses within `duration_s` from `start_s` on; intervals that join have none twice, and miss none."""
        source, time_s, relative = np.empty(0, dtype=np.intp), np.empty(0), np.empty(0)
        if self._rhythm is not None:
            row, time_s, relative = self._rhythm.emit(start_s, duration_s, rng)
            source = self._source_of_row[row]
        for k in self._guns:
            shot_s = self.sources[k].shots_s(start_s, duration_s)
            source = np.concatenate([source, np.full(shot_s.size, k)])
            time_s, relative = np.concatenate([time_s, shot_s]), np.concatenate([relative, np.ones(shot_s.size)])
        on = (time_s >= self._active_s[source, 0]) & (time_s < self._active_s[source, 1])
        order = np.flatnonzero(on)[np.argsort(time_s[on], kind="stable")]
        source, time_s = source[order], time_s[order]
        louder = 10 ** (self._drift_db[source] * time_s / 20)
        return Emissions(source, time_s, self._amplitude_v[source] * relative[order] * louder)
