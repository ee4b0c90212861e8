"""Content of trend.json, each field with its unit and frame."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pdpatrol.missions.report.records import Count, Length, Number, Point, ReportPart


class TrendInterval(ReportPart):
    """Estimate with its 99 % confidence interval."""

    value: Number = Field(description="estimate")
    lower: Number = Field(description="lower end")
    upper: Number = Field(description="upper end")


class Observation(ReportPart):
    """Discharge in one inspection."""

    date: str = Field(description="date of the inspection, such as 2026-03-02")
    presence: Literal["found", "absent", "not inspected"] = Field(
        description="absent: not found, although it would have been with the level and rate of the nearest date"
    )
    finding_id: int | None = Field(description="number of the finding in log and report of the run; null without one")
    is_confirmed: bool = Field(description="whether that finding is confirmed; otherwise it is a candidate")
    level_db: TrendInterval | None = Field(
        description="strength of its pulses at 1 m, decibels over one volt, mean of the middle half; null if too few "
        "were received nearby in line of sight"
    )
    rate_hz: TrendInterval | None = Field(description="pulses per second; null for field data")
    n_pulses: Count = Field(description="number of pulses used for level and rate")


class LinearTrend(ReportPart):
    """Line through the values of several inspections."""

    per_week: TrendInterval = Field(description="slope")
    at_start: Number = Field(description="value on the date of the first inspection")
    scatter: Number = Field(description="standard deviation between inspections in addition to that of each value")


class TrackedDischarge(ReportPart):
    """One discharge over all inspections."""

    number: int = Field(description="number from 1, in the order of growth")
    site: str = Field(description="most probable site, in words; the position without a map")
    position_m: Point = Field(description="x, y, z, world frame, metres")
    semi_major_m: Length = Field(description="longer half-axis of its 95 % ellipse, metres")
    status: Literal["new", "standing", "gone"] = Field(
        description="new: absent before it was found; gone: absent when it was last inspected"
    )
    verdict: Literal["grown", "constant", "declined", "not clear", "too few dates"] = Field(
        description="change of the level, by the 99 % interval of its slope"
    )
    level: LinearTrend | None = Field(description="decibels over one volt at 1 m; null with fewer than three dates")
    rate: LinearTrend | None = Field(
        description="natural logarithm of pulses per second; null with fewer than three dates"
    )
    observations: tuple[Observation, ...] = Field(description="one for each inspection, by date")


class Trend(ReportPart):
    """Content of trend.json."""

    schema_number: Literal[2] = Field(default=2, alias="schema", description="number of this schema")
    scenario: str = Field(description="name of the yard")
    dates: tuple[str, ...] = Field(description="dates of the inspections, ascending")
    runs: tuple[str, ...] = Field(description="folders of the inspections, in the same order")
    discharges: tuple[TrackedDischarge, ...] = Field(description="all discharges that were confirmed at least once")
