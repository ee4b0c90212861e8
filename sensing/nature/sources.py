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


class Telegraph:
    """Signal that is on and off in turns, each time for an exponentially distributed duration; on or off at time 0.

    Args:
        on_s: Mean duration of the on state.
        off_s: Mean duration of the off state.
        rng: Generator of the durations, used by nothing else.
    """

    def __init__(self, on_s: float, off_s: float, rng: np.random.Generator) -> None:
        self._rng, self._mean_s = rng, (on_s, off_s)
        self._starts_off = rng.random() >= on_s / (on_s + off_s)
        self._ends_s = [rng.exponential(self._mean_s[self._starts_off])]

    def is_on(self, time_s: FloatArray) -> BoolArray:
        """Return whether the signal is on at times from 0 on, any shape; calls may be in any order of time."""
        while self._ends_s[-1] <= time_s.max(initial=0.0):
            state = (len(self._ends_s) + self._starts_off) % 2
            self._ends_s.append(self._ends_s[-1] + self._rng.exponential(self._mean_s[state]))
        return (np.searchsorted(self._ends_s, time_s, side="right") + self._starts_off) % 2 == 0


class SourceChange(NamedTuple):
    """Properties of a source from some time on.

    Attributes:
        at_s: Time of the change.
        gain: Factor of the source's amplitude.
        pulse_rate_hz: Mean number of pulses per second.
        train: Phases and amplitudes of the pulses, as in `DischargeSource`.
    """

    at_s: float
    gain: float
    pulse_rate_hz: float
    train: PulseTrain | None


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
        duty: Signal that interrupts the activity; None without interruptions.
        changes: Later changes of level, rate and phases, in order of time.
        drift_db_per_min: Rate at which the amplitude grows.
        n_shots: Number of shots of a discharge gun, which fires regularly at the pulse rate; None for other sources.
        first_shot_s: Time of the first shot.
        burst_s: Duration of each carrier burst, for a source of bursts; 0 for pulses.
        path_m: Further points of the path on which the source moves back and forth, shape (n_points, 3), world frame.
            It starts from `position_m` at time 0. None for a stationary source.
        speed_mps: Speed of a moving source, > 0.
    """

    name: str
    position_m: FloatArray
    amplitude_v: float
    pulse_rate_hz: float
    axis: FloatArray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    train: PulseTrain | None = None
    active_s: tuple[float, float] = (0.0, np.inf)
    duty: Telegraph | None = None
    changes: tuple[SourceChange, ...] = ()
    drift_db_per_min: float = 0.0
    n_shots: int | None = None
    first_shot_s: float = 0.0
    burst_s: float = 0.0
    path_m: FloatArray | None = None
    speed_mps: float = 0.0

    @property
    def stages(self) -> list[tuple[PulseTrain, float, tuple[float, float]]]:
        """Clusters of random pulses, their gain, and start and end, for each stage of the activity between changes.

        Clusters have the pulse rate of the source, 0 for a discharge gun.
        """
        (start_s, end_s), rate_hz = self.active_s, self.pulse_rate_hz if self.n_shots is None else 0.0
        stages = [SourceChange(start_s, 1.0, rate_hz, self.train), *self.changes]
        ends_s = [*(change.at_s for change in self.changes), end_s]
        return [
            (
                (stage.train or PulseTrain.at_any_phase()).times(stage.pulse_rate_hz),
                stage.gain,
                (max(stage.at_s, start_s), min(stage_end_s, end_s)),
            )
            for stage, stage_end_s in zip(stages, ends_s, strict=True)
        ]

    def position_at(self, time_s: float) -> FloatArray:
        """Return the position at a time, shape (3,), world frame."""
        if self.path_m is None:
            return self.position_m
        points_m = np.vstack([self.position_m, self.path_m])
        legs_m = np.diff(points_m, axis=0)
        lengths_m = [float(np.linalg.norm(leg)) for leg in legs_m]
        length_m = sum(lengths_m)
        moved_m = self.speed_mps * time_s % (2 * length_m)
        along_m, leg = min(moved_m, 2 * length_m - moved_m), 0
        while leg < len(lengths_m) - 1 and along_m > lengths_m[leg]:
            along_m -= lengths_m[leg]
            leg += 1
        return points_m[leg] + along_m / lengths_m[leg] * legs_m[leg]

    def shots_s(self, start_s: float, duration_s: float) -> FloatArray:
        """Return the times of the shots of a discharge gun within an interval, shape (n,).

        All times are rounded to nanoseconds, so that a shot on the boundary of two intervals falls into exactly one.
        """
        first, end = ((at_s - self.first_shot_s) * self.pulse_rate_hz for at_s in (start_s, start_s + duration_s))
        number = np.arange(max(int(first) - 1, 0), min(int(end) + 2, self.n_shots or 0))
        shot_s = np.round(self.first_shot_s + number / self.pulse_rate_hz, 9)
        first_s, end_s = max(round(start_s, 9), self.active_s[0]), min(round(start_s + duration_s, 9), self.active_s[1])
        return shot_s[(shot_s >= first_s) & (shot_s < end_s)]


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
        self.has_movers = any(source.path_m is not None for source in sources)
        self._amplitude_v = np.array([source.amplitude_v for source in sources])
        self._drift_db_per_s = np.array([source.drift_db_per_min for source in sources]) / 60.0
        none = PulseTrain.at_any_phase().times(0.0)  # so that there is a cluster even without sources
        stages = [(k, *stage) for k, source in enumerate(sources) for stage in source.stages]
        source, trains, gain, active_s = zip(*stages, (0, none, 1.0, (0.0, np.inf)), strict=True)
        n_clusters = [train.rate_hz.size for train in trains]
        self._source_of_cluster, self._gain_of_cluster = np.repeat(source, n_clusters), np.repeat(gain, n_clusters)
        self._active_s = np.repeat(active_s, n_clusters, axis=0)
        self._clusters = PulseTrain(*map(np.concatenate, zip(*trains, strict=True)))

    def positions_at(self, time_s: float) -> FloatArray:
        """Return the positions of the sources at a time, shape (n_sources, 3), world frame."""
        return np.array([source.position_at(time_s) for source in self.sources]).reshape(-1, 3)

    def draw(self, start_s: float, duration_s: float, rng: np.random.Generator) -> Emissions:
        """Draw all emissions in [start_s, start_s + duration_s), in any order.

        Adjacent intervals neither share nor miss any.
        """
        cluster, random_s, relative = self._clusters.draw(start_s, duration_s, rng)
        is_active = (random_s >= self._active_s[cluster, 0]) & (random_s < self._active_s[cluster, 1])
        cluster, random_s = cluster[is_active], random_s[is_active]
        relative = relative[is_active] * self._gain_of_cluster[cluster]
        shots_s = [source.shots_s(start_s, duration_s) for source in self.sources]
        time_s = np.concatenate([random_s, *shots_s])
        source = np.concatenate(
            [self._source_of_cluster[cluster], *(np.full(s.size, k) for k, s in enumerate(shots_s))]
        )
        relative = np.pad(relative, (0, time_s.size - random_s.size), constant_values=1.0)
        gain = 10 ** (self._drift_db_per_s[source] * time_s / 20)
        is_on = np.ones(time_s.size, np.bool_)
        for k, each in enumerate(self.sources):
            if each.duty is not None:
                is_on[source == k] = each.duty.is_on(time_s[source == k])
        return Emissions(source, time_s, self._amplitude_v[source] * relative * gain).take(is_on)
