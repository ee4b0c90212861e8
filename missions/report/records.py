"""What report.json is made of, each field with its unit and frame; its JSON Schema is made from here.

World frame: x east, y north, z up, metres, origin at the south-west corner of the yard; of field data, the frame of
their table.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field

from pdpatrol.missions.report.quantities import (
    Count,
    Decibel,
    Degree,
    Length,
    Metre,
    Point,
    Probability,
    Radian,
    Rate,
    Second,
    SquareMetre,
    Time,
)

SCHEMA = 5

Kind = Literal["corona", "void", "surface", "floating", "unknown"]


class Record(BaseModel, frozen=True, extra="forbid"):
    """A part of the report."""


class Waypoints(Record, frozen=True):
    """Waypoints by their number, from 1 on."""

    visited: tuple[Count, ...] = Field(description="those that the robot came to, ascending")
    missed: tuple[Count, ...] = Field(description="the others, ascending")
    unreachable: tuple[Count, ...] = Field(description="those of the missed ones to which it found no way")


class PulseCounts(Record, frozen=True):
    """What became of the pulses; all but the first two are null if the mission was cut off without warning."""

    detected: Count = Field(description="all that triggered the receiver; the sum of the other fields")
    not_credible: Count = Field(description="no plane wave, or too weak to tell a direction")
    of_findings: Count | None = Field(description="of findings and candidates")
    unassigned: Count | None = Field(description="from nowhere in particular")
    ambiguous: Count | None = Field(description="from where several findings may be")
    biased: Count | None = Field(description="of a finding, their bearing biased by reflections")
    diffracted: Count | None = Field(description="round an edge")
    echo: Count | None = Field(description="echoes of a finding")


class Ellipse(Record, frozen=True):
    """The 95 % ellipse of a position on plan."""

    semi_major_m: Length = Field(description="longer half-axis, metres")
    semi_minor_m: Length = Field(description="shorter half-axis, metres")
    angle_rad: Radian = Field(description="direction of the longer half-axis, world frame, counter-clockwise from east")


class Site(Record, frozen=True):
    """A place where a finding may be."""

    name: str = Field(description="equipment/site; equipment alone for another place on it; or elsewhere")
    probability: Probability = Field(description="that the finding is there")


class PhaseHistogram(Record, frozen=True):
    """Phase-resolved pattern: how many pulses came at which phase and level."""

    phase_step_deg: Degree = Field(
        description="width of a column, degrees of the receiver's mains; the first from 0 on"
    )
    lowest_db: Decibel = Field(description="lower edge of the first row, decibels over one volt at 1 m")
    level_step_db: Decibel = Field(description="height of a row, decibels; the outer rows hold what lies beyond them")
    counts: tuple[tuple[Count, ...], ...] = Field(description="pulses, one row for each level from the lowest up")


class Discharge(Record, frozen=True):
    """What the phases of the mains at the pulses say of the kind of discharge."""

    kind: Kind = Field(description="unknown where the pattern is like none of the others, or has too few pulses")
    confidence: Probability = Field(description="probability of `kind`; of unknown, 1 where there are too few pulses")
    shift_deg: Degree = Field(description="by how much the pattern leads that of its kind over the receiver's mains")
    pattern: PhaseHistogram = Field(description="phase against level of all pulses of known phase")


class Strength(Record, frozen=True):
    """How strong and how frequent the pulses of a finding are, with range and gain of the array taken out."""

    level_db: Decibel = Field(description="upper quartile of the levels, decibels over one volt at 1 m")
    low_db: Decibel = Field(description="10 % quantile of the levels, decibels over one volt at 1 m")
    high_db: Decibel = Field(description="90 % quantile of the levels, decibels over one volt at 1 m")
    n_pulses: Count = Field(description="pulses that belong to it, in sight or not")
    rate_per_s: Rate | None = Field(
        description="pulses per second, over the seconds in which any were detected; null for field data"
    )


class DetectedFrom(Record, frozen=True):
    """From where a finding was detected."""

    nearest_m: Length = Field(description="least distance on plan, metres")
    farthest_m: Length = Field(description="largest distance on plan, metres")
    aperture_deg: Degree = Field(
        description="angle on plan over which the lines of sight spread, seen from the finding"
    )
    duration_s: Second = Field(description="seconds in which any of its pulses were detected")


class FindingRecord(Record, frozen=True):
    """A discharge as located by the end."""

    id: int = Field(description="the same in log, recording, terminal and pages; candidates take numbers too")
    state: Literal["confirmed", "candidate", "outside"] = Field(description="outside: beyond the fence")
    position_m: Point = Field(description="x, y, z, world frame, metres")
    position_std_m: tuple[Length, Length, Length] = Field(description="standard deviations of x, y, z, metres")
    covariance_m2: tuple[tuple[SquareMetre, SquareMetre, SquareMetre], ...] = Field(
        description="of x, y, z, world frame, square metres, the array's common error included",
        min_length=3,
        max_length=3,
    )
    ellipse95: Ellipse = Field(description="95 % ellipse on plan")
    sites: tuple[Site, ...] = Field(
        description="where it may be, the likeliest first, from 1 % on; empty without a map and beyond the fence"
    )
    discharge: Discharge | None = Field(description="kind; null where the phase of the mains is not known")
    strength: Strength | None = Field(description="null if the mission was cut off without warning")
    detected_from: DetectedFrom | None = Field(description="null if the mission was cut off without warning")
    n_bearings: Count = Field(description="pulses that its position rests on")
    first_detected_s: Time = Field(description="when its first pulse came, seconds of the mission")
    confirmed_s: Time | None = Field(description="when it was first confirmed, seconds of the mission; null if never")


class Inspection(Record, frozen=True):
    """Which sites of the map were listened to, over the poses driven; sound channels and an undamaged array assumed."""

    useful_range_m: Length = Field(description="distance on plan from within which findings are confirmed, metres")
    level_db: Decibel = Field(description="peak of the discharge that is asked for, decibels over one volt at 1 m")
    inspected: tuple[str, ...] = Field(description="sites where such a discharge would have been heard and located")
    heard_narrowly: tuple[str, ...] = Field(description="sites where it would have been heard from too few sides")
    not_inspected: tuple[str, ...] = Field(description="sites never in sight from near enough to hear it")


class Match(Record, frozen=True):
    """How well a finding fits the source that it is paired with."""

    finding_id: int = Field(description="id of the finding")
    error_m: Length = Field(description="distance of the finding from the source on plan, metres")
    height_error_m: Metre = Field(description="height of the finding above the source, metres")
    inside_ellipse95: bool = Field(description="whether the source lies in the finding's 95 % ellipse")
    right_site: bool = Field(description="whether no site is nearer to the finding than the source is")


class ScoredSource(Record, frozen=True):
    """A true source, and the confirmed finding within 2 m on plan that it is paired with, if any."""

    name: str = Field(description="as of the scenario")
    true_position_m: Point = Field(description="x, y, z, world frame, metres")
    found: bool = Field(description="whether there is such a finding")
    match: Match | None = Field(description="how well it fits; null if there is none")


class Evaluation(Record, frozen=True):
    """The findings against the truth, which a simulator alone knows."""

    sources: tuple[ScoredSource, ...] = Field(description="every source inside the fence")
    false_findings: Count = Field(description="confirmed findings without a source")
    ospa_m: Length = Field(description="OSPA distance of findings and sources, order 1, cut-off 2 m, metres")

    @property
    def matches(self) -> tuple[Match, ...]:
        """Of the sources that were found."""
        return tuple(source.match for source in self.sources if source.match is not None)


class Report(Record, frozen=True):
    """What a mission found, how sure that is, and what it did not look at."""

    schema_number: Literal[5] = Field(alias="schema", description="number of this schema")
    scenario: str = Field(description="name of the scenario, or of the table of field data")
    seed: int | None = Field(description="of the mission; null for field data")
    policy: str | None = Field(description="who drove; null for field data")
    date: str | None = Field(description="of the inspection, as 2026-03-02; null if nobody has said")
    versions: dict[str, str] = Field(description="of the software that made the log, by name")
    ending: str | None = Field(description="how the mission ended; null if it was cut off without warning")
    sim_time_s: Second = Field(description="duration of the mission, seconds; of field data, time of the last pose")
    wall_time_s: Second = Field(description="that it took to compute, seconds; differs between runs of one seed")
    distance_m: Length = Field(description="length of the way, metres")
    battery_left: Probability | None = Field(description="share of the battery that is left; null for field data")
    collisions: Count = Field(description="times that the robot touched something")
    waypoints: Waypoints = Field(description="of the route")
    n_bearings: Count = Field(description="credible pulses, each with a bearing")
    pulses: PulseCounts = Field(description="what became of all pulses")
    channel_faults: tuple[str, ...] = Field(description="channels of the receiver that were left out, and why")
    calibration: tuple[str, ...] = Field(description="that the pulses contradict the calibration taken up, if they do")
    notes: tuple[str, ...] = Field(description="what was unusual about the data")
    findings: tuple[FindingRecord, ...] = Field(description="confirmed findings, by id")
    candidates: tuple[FindingRecord, ...] = Field(description="detected, and not confirmed or beyond the fence, by id")
    inspection: Inspection | None = Field(description="what was looked at; null without a map with sites")
    evaluation: Evaluation | None = Field(description="findings against the truth; null where it is not known")

    @property
    def scores(self) -> Evaluation:
        """The evaluation of a mission whose truth is known.

        Raises:
            ValueError: If it is not.
        """
        if self.evaluation is None:
            raise ValueError(f"{self.scenario}: the truth is not known")
        return self.evaluation
