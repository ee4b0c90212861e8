"""Records of report.json, each field with its unit and frame, and the JSON Schema generated from them.

World frame: x east, y north, z up, metres, origin at the south-west corner of the yard; for field data, the frame of
their table. Numbers are exact in memory and rounded in the file.
"""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, PlainSerializer

SCHEMA = 5


def significant(value: float) -> float:
    """Round to four significant digits; minus zero becomes zero."""
    return float(f"{value:.4g}") + 0.0


def _decimals(n: int) -> PlainSerializer:
    """Round to n decimals in JSON; minus zero becomes zero."""
    return PlainSerializer(lambda value: round(value, n) + 0.0, return_type=float, when_used="json")


_finite: Any = Field(allow_inf_nan=False)
_positive: Any = Field(ge=0.0, allow_inf_nan=False)

Metre = Annotated[float, _finite, _decimals(3)]
Length = Annotated[float, _positive, _decimals(3)]
Number = Annotated[float, _finite, PlainSerializer(significant, return_type=float, when_used="json")]
Second = Annotated[float, _positive, _decimals(2)]
Time = Annotated[float, _finite, _decimals(2)]
Probability = Annotated[float, Field(ge=0.0, le=1.0), _decimals(3)]
Radian = Annotated[float, _finite, _decimals(4)]
Degree = Annotated[float, _finite, _decimals(1)]
Decibel = Annotated[float, _finite, _decimals(1)]
Rate = Annotated[float, _positive, _decimals(2)]
Count = Annotated[int, Field(ge=0)]
Point = tuple[Metre, Metre, Metre]

Kind = Literal["corona", "void", "surface", "floating", "unknown"]
InspectionState = Literal["inspected", "partly_inspected", "not_inspected"]


class ReportPart(BaseModel, frozen=True, extra="forbid"):
    """Part of the report."""


class Waypoints(ReportPart, frozen=True):
    """Waypoints by number, from 1."""

    visited: tuple[Count, ...] = Field(description="waypoints that the robot reached, ascending")
    missed: tuple[Count, ...] = Field(description="the other waypoints, ascending")
    unreachable: tuple[Count, ...] = Field(description="missed waypoints to which the robot found no path")


class PulseCounts(ReportPart, frozen=True):
    """Classification of the pulses; all but the first two are null if the mission was killed."""

    detected: Count = Field(description="pulses that triggered the receiver; the sum of the other fields")
    not_credible: Count = Field(description="not consistent with one plane wave, or too weak for a bearing")
    of_findings: Count | None = Field(description="associated with findings and candidates")
    unassigned: Count | None = Field(description="consistent with no finding")
    ambiguous: Count | None = Field(description="consistent with several findings")
    biased: Count | None = Field(description="from a finding, but with a bearing biased by reflections")
    diffracted: Count | None = Field(description="from a finding, diffracted around an edge")
    echo: Count | None = Field(description="multipath of a finding")


class Ellipse95(ReportPart, frozen=True):
    """95 % ellipse of a position on plan."""

    semi_major_m: Length = Field(description="longer half-axis, metres")
    semi_minor_m: Length = Field(description="shorter half-axis, metres")
    angle_rad: Radian = Field(description="direction of the longer half-axis, world frame, counter-clockwise from east")


class Site(ReportPart, frozen=True):
    """Possible place of a finding."""

    name: str = Field(description="equipment/site; the equipment alone for another place on it; or elsewhere")
    probability: Probability = Field(description="probability that the finding is there")


class PhaseHistogram(ReportPart, frozen=True):
    """Phase-resolved pattern: number of pulses by phase and level."""

    phase_step_deg: Degree = Field(
        description="width of a column, degrees of the receiver's mains phase; the first begins at 0"
    )
    lowest_db: Decibel = Field(description="lower edge of the first row, decibels over one volt at 1 m")
    level_step_db: Decibel = Field(description="height of a row, decibels; the outer rows include levels beyond them")
    counts: tuple[tuple[Count, ...], ...] = Field(description="pulses, one row for each level, lowest first")


class DischargeKind(ReportPart, frozen=True):
    """Kind of discharge, classified by the phase-resolved pattern."""

    kind: Kind = Field(description="unknown if the pattern resembles none of the kinds or has too few pulses")
    confidence: Probability = Field(description="probability of `kind`; 1 for unknown with too few pulses")
    shift_deg: Degree = Field(description="lead of the pattern over that of its kind at the receiver's mains phase")
    pattern: PhaseHistogram = Field(description="phase against level of all pulses of known phase")


class Strength(ReportPart, frozen=True):
    """Level and rate of the pulses of a finding, corrected for range and array gain."""

    level_db: Decibel = Field(description="upper quartile of the levels, decibels over one volt at 1 m")
    low_db: Decibel = Field(description="10 % quantile of the levels, decibels over one volt at 1 m")
    high_db: Decibel = Field(description="90 % quantile of the levels, decibels over one volt at 1 m")
    n_pulses: Count = Field(description="pulses associated with the finding, in line of sight or not")
    rate_per_s: Rate | None = Field(
        description="pulses per second, over the seconds in which any were detected; null for field data"
    )


class DetectedFrom(ReportPart, frozen=True):
    """Places from which a finding was detected."""

    nearest_m: Length = Field(description="smallest distance on plan, metres")
    farthest_m: Length = Field(description="largest distance on plan, metres")
    aperture_deg: Degree = Field(description="angle on plan that the lines of sight span, seen from the finding")
    duration_s: Second = Field(description="seconds in which any of its pulses were detected")


class FindingRecord(ReportPart, frozen=True):
    """Located discharge as estimated at the end of the mission."""

    id: int = Field(description="the same in log, recording, terminal and pages; candidates are numbered as well")
    state: Literal["confirmed", "candidate", "outside"] = Field(description="outside: beyond the fence")
    position_m: Point = Field(description="x, y, z, world frame, metres")
    position_std_m: tuple[Length, Length, Length] = Field(description="standard deviations of x, y, z, metres")
    covariance_m2: tuple[tuple[Number, Number, Number], ...] = Field(
        description="of x, y, z, world frame, square metres, including the errors of the array",
        min_length=3,
        max_length=3,
    )
    ellipse95: Ellipse95 = Field(description="95 % ellipse on plan")
    sites: tuple[Site, ...] = Field(
        description="possible places, the most probable first, down to 1 %; empty without a map and beyond the fence"
    )
    discharge: DischargeKind | None = Field(description="kind; null if the phase of the mains is not known")
    strength: Strength | None = Field(description="null if the mission was killed")
    detected_from: DetectedFrom | None = Field(description="null if the mission was killed")
    n_bearings: Count = Field(description="pulses used to estimate the position")
    first_detected_s: Time = Field(description="time of the first pulse, seconds from the start of the mission")
    confirmed_s: Time | None = Field(
        description="time of the first confirmation, seconds from the start; null if never"
    )


class SiteInspection(ReportPart, frozen=True):
    """How well one site of the map was inspected."""

    name: str = Field(description="equipment/site")
    state: InspectionState = Field(
        description="inspected: a discharge of `level_db` would have been detected from within `range_m` over "
        "`aperture_deg`; partly_inspected: from fewer directions; not_inspected: from nowhere"
    )
    nearest_m: Length | None = Field(description="smallest distance on plan in line of sight; null if beyond `range_m`")
    aperture_deg: Degree = Field(description="angle, seen from the site, over which it would have been detected")
    min_level_db: Decibel | None = Field(
        description="weakest detectable discharge, decibels over one volt at 1 m; null if never in sight within "
        "`range_m`"
    )


class SiteInspections(ReportPart, frozen=True):
    """Inspection of the sites of the map from the poses driven; assumes a receiver and an array without faults."""

    range_m: Length = Field(description="distance on plan within which findings can be confirmed, metres")
    aperture_deg: Degree = Field(description="aperture needed to confirm a finding")
    level_db: Decibel = Field(description="peak of the discharge assumed, decibels over one volt at 1 m")
    sites: tuple[SiteInspection, ...] = Field(description="every site, in the order of the map")

    def names(self, state: InspectionState) -> list[str]:
        """Return the names of the sites in a state."""
        return [site.name for site in self.sites if site.state == state]


class SourceMatch(ReportPart, frozen=True):
    """Comparison of a finding with the source it is paired with."""

    finding_id: int = Field(description="id of the finding")
    error_m: Length = Field(description="distance between finding and source on plan, metres")
    height_error_m: Metre = Field(description="height of the finding above the source, metres")
    inside_ellipse95: bool = Field(description="whether the source lies inside the 95 % ellipse of the finding")
    right_site: bool = Field(description="whether the finding is nearer to the source than to any site")


class ScoredSource(ReportPart, frozen=True):
    """True source and the confirmed finding within 2 m on plan that it is paired with."""

    name: str = Field(description="name in the scenario")
    true_position_m: Point = Field(description="x, y, z, world frame, metres")
    found: bool = Field(description="whether a finding is paired with it")
    match: SourceMatch | None = Field(description="comparison with that finding; null if there is none")


class Scores(ReportPart, frozen=True):
    """Findings compared with the truth, which is known only for simulated missions."""

    sources: tuple[ScoredSource, ...] = Field(description="every source inside the fence")
    false_findings: Count = Field(description="confirmed findings without a source")
    ospa_m: Length = Field(description="OSPA distance of findings and sources, order 1, cut-off 2 m, metres")

    @property
    def matches(self) -> tuple[SourceMatch, ...]:
        """Matches of the sources that were found."""
        return tuple(source.match for source in self.sources if source.match is not None)


class Report(ReportPart, frozen=True):
    """Findings of a mission, their uncertainty, and the inspection of the sites."""

    schema_number: Literal[5] = Field(alias="schema", description="number of this schema")
    scenario: str = Field(description="name of the scenario, or of the table of field data")
    seed: int | None = Field(description="seed of the mission; null for field data")
    policy: str | None = Field(description="driving policy; null for field data")
    date: str | None = Field(description="date of the inspection, as 2026-03-02; null if not given")
    versions: dict[str, str] = Field(description="versions of the software that made the log, by name")
    ending: str | None = Field(description="why the mission ended; null if it was killed")
    sim_time_s: Second = Field(
        description="duration of the mission, seconds; for field data, from the first to the last pose"
    )
    wall_time_s: Second = Field(description="computing time, seconds; differs between runs of the same seed")
    distance_m: Length = Field(description="length of the path of the estimated poses, metres")
    battery_left: Probability | None = Field(description="remaining share of the battery; null for field data")
    collisions: Count = Field(description="number of contacts of the robot")
    waypoints: Waypoints = Field(description="waypoints of the route")
    n_bearings: Count = Field(description="number of bearings")
    pulses: PulseCounts = Field(description="classification of all pulses")
    channel_faults: tuple[str, ...] = Field(description="channels of the receiver that were excluded, and why")
    calibration: tuple[str, ...] = Field(description="contradictions between the pulses and the calibration used")
    notes: tuple[str, ...] = Field(description="unusual properties of the data, and errors")
    findings: tuple[FindingRecord, ...] = Field(description="confirmed findings, by id")
    candidates: tuple[FindingRecord, ...] = Field(description="sources not confirmed or beyond the fence, by id")
    inspection: SiteInspections | None = Field(description="inspected sites; null without a map with sites")
    evaluation: Scores | None = Field(description="findings compared with the truth; null if it is not known")

    @property
    def scores(self) -> Scores:
        """Scores of a mission whose truth is known.

        Raises:
            ValueError: If the truth is not known.
        """
        if self.evaluation is None:
            raise ValueError(f"{self.scenario}: the truth is not known")
        return self.evaluation


def report_text(report: ReportPart) -> str:
    """Return the text of report.json or trend.json."""
    return report.model_dump_json(indent=1, by_alias=True) + "\n"


def read_report(text: str) -> Report:
    """Parse the text of report.json.

    Raises:
        ValueError: If it is not a report, or of another schema.
    """
    return Report.model_validate_json(text)


def schema_text() -> str:
    """Return the text of docs/schemas/report.schema.json, the JSON Schema of report.json, draft 2020-12."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **Report.model_json_schema(by_alias=True)}
    return json.dumps(schema, indent=2) + "\n"
