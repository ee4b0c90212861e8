"""What trend.json is made of, each field with its unit and frame."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, Field, PlainSerializer

from pdpatrol.missions.report.records import Count, Length, Point, significant

SCHEMA = 1

Presence = Literal["found", "absent", "not inspected"]
Verdict = Literal["grown", "constant", "declined", "not clear", "too few dates"]
Status = Literal["new", "standing", "gone"]

Number = Annotated[float, Field(allow_inf_nan=False), PlainSerializer(significant, return_type=float, when_used="json")]
"""In the file with as many digits as mean something."""


class Record(BaseModel, frozen=True, extra="forbid"):
    """A part of a trend."""


class Interval(Record, frozen=True):
    """An estimate with the ends of its 99 % interval."""

    value: Number = Field(description="the estimate")
    lower: Number = Field(description="lower end")
    upper: Number = Field(description="upper end")


class Observation(Record, frozen=True):
    """A discharge in one inspection."""

    run: str = Field(description="folder of the mission, as it was given")
    date: str = Field(description="of the inspection, as 2026-03-02")
    week: Number = Field(description="weeks since the first inspection")
    presence: Presence = Field(description="absent: it would have been found if it were as it was on the nearest date")
    finding_id: int | None = Field(description="of the finding in log and report of the run; null where it is none")
    is_confirmed: bool = Field(description="whether that finding is confirmed; else it is a candidate")
    level_db: Interval | None = Field(
        description="strength of its pulses 1 m away, decibels over one volt, mean of the middle half of them; null "
        "where too few came from near and in sight"
    )
    rate_hz: Interval | None = Field(
        description="pulses a second that were told to be its own; null for data from the field"
    )
    n_pulses: Count = Field(description="pulses that tell level and rate")
    n_looks: Count = Field(description="squares of the ground, 1 m wide, from which they came")


class Line(Record, frozen=True):
    """A line over the weeks."""

    per_week: Interval = Field(description="slope")
    at_start: Number = Field(description="value on the day of the first inspection")
    scatter: Number = Field(description="standard deviation between inspections beyond what each states")


class Discharge(Record, frozen=True):
    """One discharge over all inspections."""

    number: int = Field(description="from 1 on, those that grow most first")
    site: str = Field(description="likeliest place, in words; empty without a map")
    position_m: Point = Field(description="x, y, z, world frame, metres")
    semi_major_m: Length = Field(description="longer half-axis of its 95 % ellipse, metres")
    status: Status = Field(description="new: absent before it was found; gone: absent when it was last inspected")
    verdict: Verdict = Field(description="of the level, by the 99 % interval of its slope")
    level: Line | None = Field(description="decibels over one volt at 1 m; null with fewer than three dates")
    rate: Line | None = Field(description="natural logarithm of pulses a second; null with fewer than three dates")
    observations: tuple[Observation, ...] = Field(description="one for each inspection, by date")


class Trend(Record, frozen=True):
    """The content of trend.json."""

    schema_number: Literal[1] = Field(alias="schema", description="number of this schema")
    scenario: str = Field(description="name of the yard")
    dates: tuple[str, ...] = Field(description="of the inspections, ascending")
    runs: tuple[str, ...] = Field(description="their folders, in the same order")
    discharges: tuple[Discharge, ...] = Field(description="all that were confirmed at least once")
