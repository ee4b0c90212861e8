"""What radiates: discharges, and impulsive interferers from elsewhere."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pdpatrol.sensing.nature.discharges import PulseTrain, Rhythm

FloatArray = NDArray[np.float64]


def in_nanoseconds(time_s: float) -> float:
    """A time >= 0 to the nanosecond: a shot on the edge of two intervals is fired once, however their ends round."""
    return int(time_s * 1e9 + 0.5) / 1e9


@dataclass(frozen=True, kw_only=True)
class Carrier:
    """A narrowband transmitter far away, that radiates all the time.

    Attributes:
        frequency_hz: Frequency of the tone.
        amplitude_v: Peak in a unit-gain channel at the array, before the band-pass.
        bearing_rad: Direction it comes from, world frame, level.
    """

    frequency_hz: float
    amplitude_v: float
    bearing_rad: float


@dataclass(frozen=True, kw_only=True)
class DischargeSource:
    """A point that radiates pulses equally in all directions.

    It fires at random times (a Poisson process), over the phase of the mains as its kind does, or a few shots.

    Attributes:
        name: Name in reports.
        position_m: Shape (3,), world frame.
        amplitude_v: Peak that a typical pulse would have in a unit-gain channel 1 m away, > 0.
        pulse_rate_hz: Mean number of pulses per second, >= 0.
        axis: Of its linear polarisation, a unit vector, shape (3,), world frame.
        train: How its pulses lie in the cycle of the mains, and how their amplitudes spread; None for any phase.
        active_s: From when to when it discharges, seconds.
        drift_db_per_min: By how much it grows louder.
        n_shots: How many pulses a discharge gun fires, evenly at the pulse rate; None for a source that goes on.
        first_shot_s: When it fires the first.
        burst_s: How long each emission lasts, where it is a burst of a carrier and no pulse; 0 for a pulse.
        moves_to_m: Where it turns back if it moves, shape (3,), world frame, other than `position_m`: it travels to
            and fro between the two on the straight line, from `position_m` at time 0. None for one that stands.
        speed_mps: How fast it moves, > 0 where it does.
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
    def rhythm(self) -> Rhythm | None:
        """When it fires, if at random; None for a few shots."""
        if self.n_shots is not None:
            return None
        return self.train.rhythm(self.pulse_rate_hz) if self.train else Rhythm.at_any_phase(self.pulse_rate_hz)

    def position_at(self, time_s: float) -> FloatArray:
        """Where it is at a time, shape (3,), world frame."""
        if self.moves_to_m is None:
            return self.position_m
        way_m = self.moves_to_m - self.position_m
        length_m = float(np.linalg.norm(way_m))
        gone_m = self.speed_mps * time_s % (2 * length_m)
        return self.position_m + min(gone_m, 2 * length_m - gone_m) / length_m * way_m

    def shots_s(self, start_s: float, duration_s: float) -> FloatArray:
        """Times of the shots within an interval, seconds, shape (n,)."""
        first, end = ((at_s - self.first_shot_s) * self.pulse_rate_hz for at_s in (start_s, start_s + duration_s))
        number = np.arange(max(int(first) - 1, 0), min(int(end) + 2, self.n_shots or 0))
        shot_s = np.round(self.first_shot_s + number / self.pulse_rate_hz, 9)
        return shot_s[(shot_s >= in_nanoseconds(start_s)) & (shot_s < in_nanoseconds(start_s + duration_s))]
