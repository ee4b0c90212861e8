"""What radiates, as a scenario file says it: discharges and how they age, impulsive interferers, carriers."""

from __future__ import annotations

from math import dist, hypot
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from dirmusic.pulses.phase_resolved import KindName
from pdpatrol.envs.scenario.base import Config, Day, SiteChoice, weeks_between
from pdpatrol.robot_models.yard.quantities import MOST_PIECES, MOST_SITES, Coordinate, Height, Name
from pdpatrol.sensing.quantities import PLAIN_ZERO, Degree, Hertz, MissionSecond, PeakVolt, Volt

LEAST_WAY_M = 1e-3
"""Places nearer to each other than this are the same (assumed)."""

LEAST_LENGTH = 1e-3
"""Of a vector that is a direction (assumed)."""

SLOWEST_GUN_HZ = 1e-4
"""A gun that fires more seldom fires once in the longest mission (assumed)."""


def _points_somewhere(direction: tuple[float, float, float]) -> tuple[float, float, float]:
    if hypot(*direction) < LEAST_LENGTH:
        raise ValueError(f"got {direction}; allowed is a vector that is not 0")
    return direction


Component = Annotated[float, Field(ge=-1000.0, le=1000.0), PLAIN_ZERO]
Direction = Annotated[tuple[Component, Component, Component], AfterValidator(_points_somewhere)]
"""x, y, z of any length but 0, world frame."""

FarCoordinate = Annotated[float, Field(ge=-10_000.0, le=10_000.0), PLAIN_ZERO]
"""Of what is heard from beyond the fence: from 10 km a pulse has 80 dB less than from 1 m."""

FarHeight = Annotated[float, Field(ge=0.01, le=1000.0), PLAIN_ZERO]

PulseRate = Annotated[float, Field(ge=0.0, le=1e4), PLAIN_ZERO]
RangeDecibel = Annotated[float, Field(ge=0.0, le=60.0), PLAIN_ZERO]
DriftDecibel = Annotated[float, Field(ge=-60.0, le=60.0), PLAIN_ZERO]
"""A minute, or a week, in which a discharge changes by more than a factor of 1000 is none that one could follow."""

RateGrowth = Annotated[float, Field(ge=-0.9, le=9.0), PLAIN_ZERO]
"""A week, as a share of the rate: from a tenth to ten times as many pulses."""


class CampaignConfig(Config, frozen=True):
    """When an inspection takes place, and whether others met the same discharges.

    A mission has its date from here and never from the clock, so that the same seed gives the same mission.
    """

    number: int | None = Field(default=None, ge=0, le=2**63 - 1)
    """Which discharges the yard has: one number is the same sites, amplitudes, polarisations and phase patterns,
    whatever else a mission draws. Left out, each mission has others."""
    begins: Day = "2026-01-05"
    """When sources are as loud and as frequent as they are stated; from here on they grow. The default is assumed."""
    date: Day | None = None
    """Of this inspection; left out, it takes place when the campaign begins."""

    @property
    def day(self) -> str:
        """Of this inspection."""
        return self.date or self.begins

    @property
    def weeks(self) -> float:
        """Since the campaign began."""
        return weeks_between(self.begins, self.day)

    def faults(self) -> list[str]:
        """Whether the inspection comes before all of it."""
        if self.weeks < 0.0:
            return [f"campaign.date: got {self.day}, before campaign.begins; allowed is {self.begins} or later"]
        return []


class SourceConfig(Config, frozen=True):
    """A discharge on a site drawn from `sites` (`equipment/site`, or `equipment/*` for all of it), or at a position."""

    name: Name
    sites: tuple[SiteChoice, ...] = Field(default=(), max_length=MOST_PIECES * MOST_SITES)
    position_m: tuple[Coordinate, Coordinate, Coordinate] | None = None
    anywhere_at_m: Height | None = None
    """It hangs at this height over some free ground, which is drawn per mission."""
    amplitude_v: PeakVolt = 0.27
    """Peak of a pulse in a unit-gain channel 1 m away. The default puts the bearing bound of one pulse at 0.44 degrees
    from 5 m and 1.3 degrees from 15 m, with the default receiver."""
    amplitude_range_db: RangeDecibel = 6.0
    """Width of the range, centred on `amplitude_v`, from which the amplitude is drawn per mission."""
    pulse_rate_hz: PulseRate = 20.0
    polarisation: Direction | None = None
    """Direction of its linear polarisation; left out, any is drawn per mission."""
    kind: KindName | None = None
    """How its pulses lie over the phase of the mains; left out, they come at any phase."""
    conductor_deg: Degree | None = None
    """Phase of its conductor against the receiver's mains; left out, 0, 120 or 240 is drawn per mission."""
    active_s: tuple[MissionSecond, MissionSecond] | None = None
    """From when to when it discharges; left out, always."""
    drift_db_per_min: DriftDecibel = 0.0
    growth_db_per_week: DriftDecibel = 0.0
    """By how much its pulses grow from week to week of the campaign."""
    rate_growth_per_week: RateGrowth = 0.0
    """By what share of them its pulses become more from week to week: 0.2 is a fifth, and 44 % in two weeks."""
    n_shots: int | None = Field(default=None, ge=1, le=1_000_000)
    """A discharge gun: this many pulses, evenly at the pulse rate from `first_shot_s` on, and then no more."""
    first_shot_s: MissionSecond = 0.0

    def after(self, weeks: float) -> Self:
        """The source as it is so many weeks after the campaign began, >= 0; within the limits of `growth_faults`."""
        louder, more = 10 ** (self.growth_db_per_week * weeks / 20), (1.0 + self.rate_growth_per_week) ** weeks
        return self.model_copy(
            update={"amplitude_v": self.amplitude_v * louder, "pulse_rate_hz": self.pulse_rate_hz * more}
        )

    @model_validator(mode="after")
    def _stops_after_it_starts(self) -> Self:
        if self.active_s is not None and self.active_s[0] >= self.active_s[1]:
            raise ValueError(f"active_s: got {self.active_s}; allowed is a start before the end")
        if self.kind is not None and self.n_shots is not None:
            raise ValueError("kind, n_shots: both given; allowed is one: a gun fires at no phase of the mains")
        return self

    @model_validator(mode="after")
    def _fires_at_some_rate(self) -> Self:
        if self.n_shots is not None and self.pulse_rate_hz < SLOWEST_GUN_HZ:
            raise ValueError(
                f"pulse_rate_hz: got {self.pulse_rate_hz:g}; allowed is above 0, {SLOWEST_GUN_HZ:g} or more, or the "
                "shots never come"
            )
        return self

    @model_validator(mode="after")
    def _is_somewhere(self) -> Self:
        given = [key for key in ("sites", "position_m", "anywhere_at_m") if getattr(self, key) not in (None, ())]
        if len(given) != 1:
            came = " and ".join(given) or "none of them"
            raise ValueError(f"sites, position_m, anywhere_at_m: {came} given; allowed is one of them")
        return self


class InterfererConfig(Config, frozen=True):
    """Something impulsive beyond the fence that is heard like a discharge and must not become a finding."""

    name: Name
    position_m: tuple[FarCoordinate, FarCoordinate, FarHeight]
    amplitude_v: PeakVolt
    amplitude_range_db: RangeDecibel = 6.0
    pulse_rate_hz: PulseRate = 20.0
    polarisation: Direction | None = None
    """Direction of its linear polarisation; left out, any is drawn per mission."""
    burst_s: Annotated[float, Field(ge=0.0, le=1e-3), PLAIN_ZERO] = 0.0
    """Length of each burst of a carrier in the band, as from a switch or a radar; 0 for impulses like discharges."""
    moves_to_m: tuple[FarCoordinate, FarCoordinate, FarHeight] | None = None
    """Where it turns back, if it moves, as traffic outside: it travels to and fro between `position_m`, where it is
    when the mission begins, and this point, on the straight line."""
    speed_mps: Annotated[float, Field(ge=1e-3, le=1000.0)] | None = None

    @model_validator(mode="after")
    def _moves_or_stands(self) -> Self:
        if (self.moves_to_m is None) != (self.speed_mps is None):
            given = "speed_mps" if self.moves_to_m is None else "moves_to_m"
            raise ValueError(f"moves_to_m, speed_mps: only {given} given; allowed is both or neither")
        if self.moves_to_m is not None and dist(self.position_m, self.moves_to_m) < LEAST_WAY_M:
            raise ValueError(f"moves_to_m: got {self.moves_to_m}, which is position_m; allowed is another place")
        return self


class CarrierConfig(Config, frozen=True):
    """A narrowband transmitter far away, such as the 948 MHz that the Dir-MUSIC paper met; on all the time."""

    name: Name
    frequency_hz: Hertz = 948e6
    amplitude_v: Volt
    """Peak in a unit-gain channel at the array, before the band-pass."""
    bearing_deg: Degree
    """Direction it comes from, counter-clockwise from x (east)."""
