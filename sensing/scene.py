"""What there is to be heard: all that radiates, and what stands about."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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

    def emissions(self, start_s: float, duration_s: float, rng: np.random.Generator) -> Emissions:
        """All pulses within `duration_s` from `start_s` on."""
        drawn = [source.emissions(start_s, duration_s, rng) for source in self.sources]
        counts = [time_s.size for time_s, _ in drawn]
        return Emissions(
            np.repeat(np.arange(len(drawn)), counts),
            np.concatenate([np.empty(0), *(time_s for time_s, _ in drawn)]),
            np.concatenate([np.empty(0), *(peak_v for _, peak_v in drawn)]),
        )

    def trace(self, sources: NDArray[np.intp], elements_m: FloatArray, world_from_array: FloatArray) -> Paths:
        """Paths from some sources to elements; see `Mirrors.trace`."""
        return self._mirrors.trace(sources, elements_m, world_from_array)
