"""Sources of discharges and interference, and the scene that combines them with their surroundings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from dirmusic.arrays import BoolArray, FloatArray, IntArray
from pdpatrol.sensing.nature.pulses import PulseTrain
from pdpatrol.sensing.radio.surroundings import Surroundings


@dataclass(frozen=True, kw_only=True)
class Carrier:
    """Distant narrowband transmitter that radiates all the time.

    Attributes:
        frequency_hz: Frequency of the tone.
        amplitude_v: Peak in a unit-gain channel at the array, before the band-pass filter.
        bearing_rad: Azimuth towards the transmitter, world frame.
    """

    frequency_hz: float
    amplitude_v: float
    bearing_rad: float


@dataclass(frozen=True, kw_only=True)
class DischargeSource:
    """Point source that radiates pulses equally in all directions.

    It fires at random times, as a Poisson process whose rate depends on the mains phase, or it fires a given number of
    regular shots.

    Attributes:
        name: Name in reports.
        position_m: Position, shape (3,), world frame.
        amplitude_v: Peak of a typical pulse in a unit-gain channel 1 m away, > 0.
        pulse_rate_hz: Mean number of pulses per second, >= 0.
        axis: Direction of the linear polarisation, a unit vector, shape (3,), world frame.
        train: Phases and amplitudes of the pulses, at a rate of one per second; None for equal pulses at any phase.
        active_s: Start and end of the activity.
        drift_db_per_min: Rate at which the amplitude grows.
        n_shots: Number of shots of a discharge gun, which fires regularly at the pulse rate; None for other sources.
        first_shot_s: Time of the first shot.
        burst_s: Duration of each carrier burst, for a source of bursts; 0 for pulses.
        moves_to_m: Far end of the line on which the source moves back and forth, shape (3,), world frame. It starts
            from `position_m` at time 0. None for a stationary source.
        speed_mps: Speed of a moving source, > 0.
    """

    name: str
    position_m: FloatArray
    amplitude_v: float
    pulse_rate_hz: float
    axis: FloatArray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    train: PulseTrain | None = None
    active_s: tuple[float, float] = (0.0, np.inf)
    drift_db_per_min: float = 0.0
    n_shots: int | None = None
    first_shot_s: float = 0.0
    burst_s: float = 0.0
    moves_to_m: FloatArray | None = None
    speed_mps: float = 0.0

    @property
    def clusters(self) -> PulseTrain:
        """Clusters of random pulses, at the pulse rate of the source; at rate 0 for a discharge gun."""
        return (self.train or PulseTrain.at_any_phase()).times(self.pulse_rate_hz if self.n_shots is None else 0.0)

    def position_at(self, time_s: float) -> FloatArray:
        """Return the position at a time, shape (3,), world frame."""
        if self.moves_to_m is None:
            return self.position_m
        line_m = self.moves_to_m - self.position_m
        length_m = float(np.linalg.norm(line_m))
        moved_m = self.speed_mps * time_s % (2 * length_m)
        return self.position_m + min(moved_m, 2 * length_m - moved_m) / length_m * line_m

    def shots_s(self, start_s: float, duration_s: float) -> FloatArray:
        """Return the times of the shots of a discharge gun within an interval, shape (n,).

        All times are rounded to nanoseconds, so that a shot on the boundary of two intervals falls into exactly one.
        """
        first, end = ((at_s - self.first_shot_s) * self.pulse_rate_hz for at_s in (start_s, start_s + duration_s))
        number = np.arange(max(int(first) - 1, 0), min(int(end) + 2, self.n_shots or 0))
        shot_s = np.round(self.first_shot_s + number / self.pulse_rate_hz, 9)
        return shot_s[(shot_s >= round(start_s, 9)) & (shot_s < round(start_s + duration_s, 9))]


class Emissions(NamedTuple):
    """Emissions of the sources of a scene.

    Attributes:
        source: Index of the source, shape (n,).
        time_s: Time, shape (n,).
        peak_v: Signed peak 1 m away, in a unit-gain channel before the band-pass filter, shape (n,).
    """

    source: IntArray
    time_s: FloatArray
    peak_v: FloatArray

    def take(self, chosen: IntArray | BoolArray | slice) -> Emissions:
        """Return some of the emissions."""
        return Emissions(self.source[chosen], self.time_s[chosen], self.peak_v[chosen])


class Scene:
    """Sources and surroundings of one mission.

    Args:
        sources: Sources of pulses or bursts.
        surroundings: Surroundings; None for free space.
        carriers: Transmitters that radiate all the time.

    Attributes:
        sources: Sources of pulses or bursts.
        carriers: Transmitters that radiate all the time.
        surroundings: Surroundings.
        positions_m: Positions of the sources at time 0, shape (n_sources, 3), world frame.
        axes: Linear polarisations, unit vectors, shape (n_sources, 3).
        burst_s: Durations of bursts, 0 for sources of pulses, shape (n_sources,).
        has_movers: True if any source moves.
    """

    def __init__(
        self,
        sources: Sequence[DischargeSource],
        surroundings: Surroundings | None = None,
        carriers: Sequence[Carrier] = (),
    ) -> None:
        self.sources, self.carriers = tuple(sources), tuple(carriers)
        self.surroundings = surroundings or Surroundings()
        self.positions_m = self.positions_at(0.0)
        self.axes = np.array([source.axis for source in sources]).reshape(-1, 3)
        self.burst_s = np.array([source.burst_s for source in sources])
        self.has_movers = any(source.moves_to_m is not None for source in sources)
        self._amplitude_v = np.array([source.amplitude_v for source in sources])
        self._active_s = np.array([source.active_s for source in sources]).reshape(-1, 2)
        self._drift_db_per_s = np.array([source.drift_db_per_min for source in sources]) / 60.0
        none = PulseTrain.at_any_phase().times(0.0)  # so that there is a cluster even without sources
        trains = [*(source.clusters for source in sources), none]
        self._source_of_cluster = np.repeat(np.arange(len(trains)), [train.rate_hz.size for train in trains])
        self._clusters = PulseTrain(*map(np.concatenate, zip(*trains, strict=True)))

    def positions_at(self, time_s: float) -> FloatArray:
        """Return the positions of the sources at a time, shape (n_sources, 3), world frame."""
        return np.array([source.position_at(time_s) for source in self.sources]).reshape(-1, 3)

    def draw(self, start_s: float, duration_s: float, rng: np.random.Generator) -> Emissions:
        """Draw all emissions in [start_s, start_s + duration_s), in any order.

        Adjacent intervals neither share nor miss any.
        """
        cluster, random_s, relative = self._clusters.draw(start_s, duration_s, rng)
        shots_s = [source.shots_s(start_s, duration_s) for source in self.sources]
        time_s = np.concatenate([random_s, *shots_s])
        source = np.concatenate(
            [self._source_of_cluster[cluster], *(np.full(s.size, k) for k, s in enumerate(shots_s))]
        )
        relative = np.pad(relative, (0, time_s.size - random_s.size), constant_values=1.0)
        gain = 10 ** (self._drift_db_per_s[source] * time_s / 20)
        is_active = (time_s >= self._active_s[source, 0]) & (time_s < self._active_s[source, 1])
        return Emissions(source, time_s, self._amplitude_v[source] * relative * gain).take(is_active)
