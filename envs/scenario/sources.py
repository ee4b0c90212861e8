"""Scenario tables for radiating sources: discharges and their growth, impulsive interferers, and carriers."""

from itertools import pairwise
from math import dist, hypot
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from dirmusic.pulses.phase_resolved import KindName
from pdpatrol.envs.scenario.base import Day, Number, SiteChoice, weeks_between
from pdpatrol.robot_models.yard.quantities import MOST_PIECES, MOST_SITES, Coordinate, Height, Name
from pdpatrol.sensing.quantities import Config, Degree, Hertz, MissionSecond, PeakVolt, Volt


def _check_direction(direction: tuple[float, float, float]) -> tuple[float, float, float]:
    if hypot(*direction) < 1e-3:
        raise ValueError(f"must not be the zero vector, got {direction}")
    return direction


Direction = Annotated[tuple[Number, Number, Number], AfterValidator(_check_direction)]
"""Direction x, y, z in the world frame; its length must not be zero and has no effect."""

FarCoordinate = Annotated[float, Field(ge=-10_000.0, le=10_000.0)]
"""Coordinate of an interferer, metres. A pulse loses 80 dB over 10 km compared with 1 m."""

FarHeight = Annotated[float, Field(ge=0.01, le=1000.0)]
FarPosition = tuple[FarCoordinate, FarCoordinate, FarHeight]
PulseRate = Annotated[float, Field(ge=0.0, le=1e4)]
RangeDecibel = Annotated[float, Field(ge=0.0, le=60.0)]
DriftDecibel = Annotated[float, Field(ge=-60.0, le=60.0)]
"""Change of level per minute or per week, at most a factor of 1000."""

DutySecond = Annotated[float, Field(ge=0.1, le=86_400.0)]
"""Mean duration of activity or of a pause, not shorter than a control step."""

RateGrowth = Annotated[float, Field(ge=-0.9, le=9.0)]
"""Relative change of the pulse rate per week: from a tenth to ten times as many pulses."""


class CampaignConfig(Config):
    """Date of the inspection, and seed of discharges that several inspections share.

    The date of a mission is set here and is never taken from the clock, so that the same seed gives the same mission.
    """

    number: int | None = Field(default=None, ge=0, le=2**63 - 1)
    """Seed of the discharges of the yard. Missions with the same number meet the same sites, amplitudes, polarisations
    and phase patterns, whatever their own seed. By default each mission draws its own discharges."""
    begins: Day = "2026-01-05"
    """Day on which sources have their stated amplitude and rate; growth starts on this day."""
    date: Day | None = None
    """Day of this inspection; by default the day on which the campaign begins."""

    @property
    def day(self) -> str:
        """Day of this inspection."""
        return self.date or self.begins

    @property
    def weeks(self) -> float:
        """Weeks from the beginning of the campaign to this inspection."""
        return weeks_between(self.begins, self.day)

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if self.weeks < 0.0:
            raise ValueError(f"date: must not be before begins, {self.begins}, got {self.day}")
        return self


class ChangeConfig(Config):
    """Change of a source at some time of the mission; keys that are absent keep their value."""

    at_s: MissionSecond
    """Time of the change."""
    amplitude_db: Annotated[float, Field(ge=-60.0, le=60.0)] | None = None
    """Level from then on, relative to the amplitude at the start."""
    pulse_rate_hz: PulseRate | None = None
    """Mean number of pulses per second from then on."""
    kind: KindName | None = None
    """Kind of discharge from then on."""


class EmitterConfig(Config):
    """Source of pulses: what discharges and interferers have in common."""

    name: Name
    """Name of the source, used once among sources and interferers."""
    amplitude_range_db: RangeDecibel = 6.0
    """Width of the range around `amplitude_v` from which the amplitude is drawn per mission."""
    pulse_rate_hz: PulseRate = 20.0
    """Mean number of pulses per second while the source is active."""
    polarisation: Direction | None = None
    """Direction of the linear polarisation; by default drawn per mission."""
    kind: KindName | None = None
    """Kind of discharge, which determines the phases and levels of the pulses; by default pulses come at any phase."""
    conductor_deg: Degree | None = None
    """Phase of the conductor relative to the receiver's mains supply; by default 0, 120 or 240 is drawn per mission."""
    active_s: tuple[MissionSecond, MissionSecond] | None = None
    """Start and end of the activity; by default the duration of the mission."""
    duty_s: tuple[DutySecond, DutySecond] | None = None
    """Mean durations of activity and of the pauses between, in turns, both exponentially distributed; by default
    without pauses."""

    @model_validator(mode="after")
    def _check_activity(self) -> Self:
        if self.active_s is not None and self.active_s[0] >= self.active_s[1]:
            raise ValueError(f"active_s: must start before it ends, got {self.active_s}")
        return self


class SourceConfig(EmitterConfig):
    """Discharge on a site drawn from `sites`, at a given position, or above free ground."""

    sites: tuple[SiteChoice, ...] = Field(default=(), max_length=MOST_PIECES * MOST_SITES)
    """Sites, of which one is drawn per mission: `equipment/site`, or `equipment/*` for all sites of a piece. Give
    one of `sites`, `position_m` and `anywhere_at_m`."""
    position_m: tuple[Coordinate, Coordinate, Coordinate] | None = None
    """Fixed position, world frame, z from the ground."""
    anywhere_at_m: Height | None = None
    """Height above the ground, over a place on free ground that is drawn per mission."""
    amplitude_v: PeakVolt = 0.27
    """Peak of a pulse in a unit-gain channel 1 m away. With the default receiver, the Cramer-Rao bound for the bearing
    of one pulse of the default amplitude is 0.44 degrees at 5 m and 1.3 degrees at 15 m."""
    changes: Annotated[tuple[ChangeConfig, ...], Field(min_length=1, max_length=100)] | None = None
    """Changes of level, rate and kind in the course of the mission, in order of time."""
    drift_db_per_min: DriftDecibel = 0.0
    """Change of the amplitude in the course of the mission."""
    growth_db_per_week: DriftDecibel = 0.0
    """Growth of the amplitude over the weeks of the campaign."""
    rate_growth_per_week: RateGrowth = 0.0
    """Relative growth of the pulse rate per week: 0.2 is 20 % in one week and 44 % in two weeks."""
    n_shots: int | None = Field(default=None, ge=1, le=1_000_000)
    """Makes the source a discharge gun, with this many pulses at the pulse rate from `first_shot_s` on."""
    first_shot_s: MissionSecond = 0.0
    """Time of the first pulse of a discharge gun."""

    @property
    def max_pulse_rate_hz(self) -> float:
        """Largest pulse rate of the mission."""
        return max([self.pulse_rate_hz, *(change.pulse_rate_hz or 0.0 for change in self.changes or ())])

    @property
    def max_amplitude_v(self) -> float:
        """Largest amplitude that may be drawn, after all changes but the drift."""
        changes_db = max([0.0, *(change.amplitude_db or 0.0 for change in self.changes or ())])
        return self.amplitude_v * 10 ** (self.amplitude_range_db / 40) * 10 ** (changes_db / 20)

    def after(self, weeks: float) -> Self:
        """Return the source as it is a number of weeks after the campaign began."""
        gain, more = 10 ** (self.growth_db_per_week * weeks / 20), (1.0 + self.rate_growth_per_week) ** weeks
        grown = {"amplitude_v": self.amplitude_v * gain, "pulse_rate_hz": self.pulse_rate_hz * more}
        if self.changes is not None:
            grown["changes"] = tuple(
                change
                if change.pulse_rate_hz is None
                else change.model_copy(update={"pulse_rate_hz": change.pulse_rate_hz * more})
                for change in self.changes
            )
        return self.model_copy(update=grown)

    @model_validator(mode="after")
    def _check_keys(self) -> Self:
        places = [key for key in ("sites", "position_m", "anywhere_at_m") if getattr(self, key) not in (None, ())]
        if len(places) != 1:
            given = " and ".join(places) or "none"
            raise ValueError(f"sites, position_m, anywhere_at_m: exactly one must be given, got {given}")
        if self.n_shots is not None and self.kind is not None:
            raise ValueError("kind, n_shots: must not be given together; a gun ignores the phase of the mains")
        if self.n_shots is not None and self.changes is not None:
            raise ValueError("changes, n_shots: must not be given together; a gun does not change")
        if self.n_shots is not None and self.pulse_rate_hz < 1e-4:
            raise ValueError(f"pulse_rate_hz: must be at least 0.0001 for a gun, got {self.pulse_rate_hz:g}")
        for before, change in pairwise(self.changes or ()):
            if before.at_s >= change.at_s:
                raise ValueError(f"changes: at_s must increase, {before.at_s:g} is followed by {change.at_s:g}")
        return self


class InterfererConfig(EmitterConfig):
    """Source of impulses that is not a discharge, beyond the fence or within it.

    It must not be reported as a finding: a confirmed finding on it counts as false, wherever it is.
    """

    position_m: FarPosition
    """Position, world frame, z from the ground; of a moving interferer, that at the start."""
    amplitude_v: PeakVolt
    """Peak of a pulse in a unit-gain channel 1 m away."""
    burst_s: Annotated[float, Field(ge=0.0, le=1e-3)] = 0.0
    """Length of each burst of an in-band carrier, as from a switch or a radar; 0 for impulses like those of a
    discharge."""
    path_m: Annotated[tuple[FarPosition, ...], Field(min_length=1, max_length=100)] | None = None
    """Further points of the path of a moving interferer, such as traffic. It starts at `position_m`, moves along
    straight lines to the last point, and back and forth from then on."""
    speed_mps: Annotated[float, Field(ge=1e-3, le=1000.0)] | None = None
    """Speed along `path_m`; required with it."""

    @property
    def max_pulse_rate_hz(self) -> float:
        """Pulse rate."""
        return self.pulse_rate_hz

    @property
    def max_amplitude_v(self) -> float:
        """Largest amplitude that may be drawn."""
        return self.amplitude_v * 10 ** (self.amplitude_range_db / 40)

    @model_validator(mode="after")
    def _check_path(self) -> Self:
        if (self.path_m is None) != (self.speed_mps is None):
            raise ValueError("path_m, speed_mps: must be given together")
        for before_m, point_m in pairwise([self.position_m, *(self.path_m or ())]):
            if dist(before_m, point_m) < 1e-3:
                raise ValueError(f"path_m: each point must differ from the one before, got {point_m} twice")
        return self


class CarrierConfig(Config):
    """Distant narrowband transmitter that is always on, such as the one at 948 MHz in the Dir-MUSIC paper."""

    name: Name
    """Name of the transmitter."""
    frequency_hz: Hertz = 948e6
    """Frequency, below half the sampling rate."""
    amplitude_v: Volt
    """Peak in a unit-gain channel at the array, before the band-pass filter."""
    bearing_deg: Degree
    """Direction towards the transmitter, counter-clockwise from x (east)."""
