"""Content of trend.json, each field with its unit and frame."""

from typing import Literal

from pydantic import Field

from pdpatrol.missions.report.records import Count, Length, Number, Point, ReportPart

Verdict = Literal["grown", "constant", "declined", "not known", "too few dates"]


class TrendInterval(ReportPart):
    """Estimate with the lower and upper end of its 99 % confidence interval."""

    value: Number
    lower: Number
    upper: Number


class Observation(ReportPart):
    """Discharge in one inspection."""

    date: str
    """Date of the inspection, such as 2026-03-02."""
    presence: Literal["found", "absent", "not inspected"]
    """Absent: not found, although it would have been found at the level and rate of the nearest date."""
    finding_id: int | None
    """Id of the finding in the log and report of the run; null without a finding."""
    is_confirmed: bool
    """True if the finding is confirmed, false if it is a candidate or no finding exists."""
    level_db: TrendInterval | None
    """Strength of its pulses at 1 m, decibels relative to one volt, interquartile mean; null if too few pulses were
    received nearby in line of sight."""
    rate_hz: TrendInterval | None
    """Pulses per second; null for field data."""
    n_pulses: Count
    """Number of pulses used for level and rate."""


class LinearTrend(ReportPart):
    """Line through the values of several inspections."""

    per_week: TrendInterval
    """Slope."""
    at_start: Number
    """Value on the date of the first inspection."""
    scatter: Number
    """Standard deviation between inspections in addition to that of each value."""


class TrackedDischarge(ReportPart):
    """One discharge over all inspections."""

    number: int
    """Number from 1, in the order of growth."""
    site: str
    """Most probable site in words; without a map, the position."""
    position_m: Point
    """x, y, z, world frame, metres."""
    semi_major_m: Length
    """Longer half-axis of its 95 % ellipse, metres."""
    status: Literal["new", "standing", "gone"]
    """New: absent before it was found. Gone: absent when it was last inspected."""
    verdict: Verdict
    """Change of the level, judged by the 99 % interval of its slope. Constant: the interval includes zero and excludes
    growth and decline by `relevant_db_per_week`."""
    level: LinearTrend | None
    """Line through the levels at 1 m, decibels relative to one volt; null with fewer than three dates."""
    rate: LinearTrend | None
    """Line through the natural logarithms of the pulses per second; null with fewer than three dates."""
    observations: tuple[Observation, ...]
    """One for each inspection, in order of date."""


class Trend(ReportPart):
    """Content of trend.json."""

    schema_number: Literal[3] = Field(default=3, alias="schema")
    """Number of this schema."""
    scenario: str
    """Name of the yard."""
    dates: tuple[str, ...]
    """Dates of the inspections, ascending."""
    runs: tuple[str, ...]
    """Folders of the inspections, in the same order."""
    relevant_db_per_week: Number
    """Growth of the level that matters, decibels per week."""
    discharges: tuple[TrackedDischarge, ...]
    """All discharges that were confirmed at least once."""
