"""Records of report.json, each field with its unit and frame, and the JSON Schema generated from them.

World frame: x east, y north, z up, metres, origin at the south-west corner of the yard; for field data, the frame of
their table. Numbers are exact in memory and have six significant digits in the file.
"""

from __future__ import annotations

import json
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, PlainSerializer

from dirmusic.locating.finding import square_within


def _rounded(value: float) -> float:
    """Round to six significant digits; minus zero becomes zero."""
    return float(f"{value:.6g}") + 0.0


Number = Annotated[float, Field(allow_inf_nan=False), PlainSerializer(_rounded, return_type=float, when_used="json")]
Length = Annotated[Number, Field(ge=0.0)]
Probability = Annotated[Number, Field(ge=0.0, le=1.0)]
Count = Annotated[int, Field(ge=0)]
Point = tuple[Number, Number, Number]


class ReportPart(BaseModel):
    """Part of the report; the docstrings of its fields are their descriptions in the JSON Schema."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class Waypoints(ReportPart):
    """Waypoints by number, from 1."""

    visited: tuple[Count, ...]
    """Waypoints that the robot reached, ascending."""
    missed: tuple[Count, ...]
    """The other waypoints, ascending."""
    unreachable: tuple[Count, ...]
    """Missed waypoints to which the robot found no path."""


class Charge(ReportPart):
    """One charge of the battery at the dock; times in seconds from the start, null if the mission ended before."""

    returned_s: Length
    """Time at which the robot turned back to charge."""
    arrived_s: Length | None
    """Time at which it began to charge."""
    battery_left: Probability | None
    """State of charge at that time."""
    continued_s: Length | None
    """Time at which it went on."""


class PulseCounts(ReportPart):
    """Classification of the pulses; the last two are null if the mission was killed."""

    detected: Count
    """Pulses that triggered the receiver; the sum of the other fields."""
    rejected: Count
    """Clipped, or without a usable direction; not used."""
    of_findings: Count | None
    """Associated with findings and candidates."""
    unexplained: Count | None
    """Used, but of no finding: other multipath, interference, simultaneous waves, or a source that was not located."""


class Ellipse95(ReportPart):
    """95 % ellipse of a position in the horizontal plane."""

    semi_major_m: Length
    """Longer half-axis, metres."""
    semi_minor_m: Length
    """Shorter half-axis, metres."""
    angle_rad: Number
    """Direction of the longer half-axis, world frame, counter-clockwise from east."""


class Site(ReportPart):
    """Possible place of a finding."""

    name: str
    """`equipment/site`; only `equipment` for another place on it; or `elsewhere`."""
    probability: Probability
    """Probability that the finding is there."""


class DischargeKind(ReportPart):
    """Kind of discharge, and the phase-resolved pattern by which it was classified."""

    kind: Literal["corona", "void", "surface", "floating", "unknown"]
    """`unknown` if the pattern resembles none of the kinds or has too few pulses."""
    confidence: Probability
    """Probability of `kind`; 1 for unknown with too few pulses."""
    shift_deg: Number
    """Phase by which the pattern leads that of its kind, relative to the receiver's mains phase, degrees."""
    phase_step_deg: Number
    """Width of a column of `counts`, degrees of the receiver's mains phase; the first begins at 0."""
    lowest_db: Number
    """Lower edge of the first row of `counts`, decibels relative to one volt at 1 m."""
    level_step_db: Number
    """Height of a row of `counts`, decibels; the outer rows include levels beyond them."""
    counts: tuple[tuple[Count, ...], ...]
    """Pulses of known phase, one row for each level, lowest first."""


class Strength(ReportPart):
    """Level and rate of the pulses of a finding, corrected for range and array gain, and where they were detected."""

    level_db: Number | None
    """Median level of the pulses in line of sight, decibels relative to one volt at 1 m, as estimated with the position
    and corrected for attenuation on the map; null if never in sight."""
    low_db: Number
    """10 % quantile of the levels of all pulses, not corrected for attenuation, in the same unit."""
    high_db: Number
    """90 % quantile of these levels, decibels relative to one volt at 1 m."""
    n_pulses: Count
    """Pulses associated with the finding, in line of sight or not."""
    duration_s: Length
    """Total length of the time steps in which pulses were detected, seconds."""
    rate_per_s: Length | None
    """Pulses per second of `duration_s`; null for field data."""
    nearest_m: Length
    """Smallest horizontal distance at which they were detected, metres."""
    farthest_m: Length
    """Largest horizontal distance at which they were detected, metres."""
    aperture_deg: Number
    """Horizontal angle that the lines of sight span, seen from the finding."""


class Asset(ReportPart):
    """Piece of equipment on the map."""

    name: str
    """Name in the scenario."""
    kind: str
    """Kind of equipment."""
    asset_id: str | None
    """Number in the register of its owner; null if not stated."""
    kv: Number | None
    """Nominal voltage, kV; null if not stated."""
    phase: str | None
    """Phase or phases of the mains, such as L1; null if not stated."""


class Assessment(ReportPart):
    """Severity of a finding, and action, by the table of severity of the survey."""

    severity: str
    """Class of severity."""
    within_days: Count
    """Days from the survey until the action is due."""
    due: str | None
    """Date on which the action is due, such as 2026-03-02; null if the survey has no date."""
    meaning: str
    """Usual cause of such a discharge."""
    action: str
    """Recommended action on site."""
    rule: str
    """Table and row that led to the class."""


class FindingRecord(ReportPart):
    """Located discharge as estimated at the end of the mission."""

    id: int
    """Number of the finding, the same in log, recording, terminal and pages; candidates are numbered as well."""
    state: Literal["confirmed", "candidate", "outside"]
    """`outside` is beyond the fence."""
    position_m: Point
    """x, y, z, world frame, metres."""
    position_std_m: tuple[Length, Length, Length]
    """Standard deviations of x, y, z, metres."""
    covariance_m2: tuple[Point, Point, Point]
    """Covariance of x, y, z, world frame, square metres, including the errors of the array and of the localisation
    against the map. The position has Student's t distribution with 8 degrees of freedom and this covariance."""
    existence: Probability
    """Probability that a source exists there."""
    possibly_two: bool
    """True if two sources close to each other explain its pulses better than one; the covariance includes their
    distance."""
    ellipse95: Ellipse95
    """95 % ellipse in the horizontal plane."""
    sites: tuple[Site, ...]
    """Possible places, the most probable first, down to 1 %; empty without a map and beyond the fence."""
    asset: Asset | None
    """Piece of equipment of the most probable place; null if that is elsewhere, without a map, and beyond the fence."""
    assessment: Assessment | None
    """Severity, action and due date; null for findings that are not confirmed."""
    discharge: DischargeKind | None
    """Kind; null if the phase of the mains is not known."""
    strength: Strength | None
    """Strength and rate of its pulses; null if the mission was killed."""
    n_bearings: Count
    """Pulses used to estimate the position."""
    first_detected_s: Number
    """Time of the first pulse, seconds from the start of the mission."""
    confirmed_s: Number | None
    """Time of the first confirmation, seconds from the start; null if never."""


class SiteInspection(ReportPart):
    """Inspection of one site of the map."""

    name: str
    """`equipment/site`."""
    state: Literal["inspected", "finding", "unexplained", "not_inspected"]
    """`inspected` if a discharge of `level_db` and `rate_hz` is excluded; `finding` if one was located, or may be,
    within 2 m or with the site in its ellipse; `unexplained` if pulses from there, or most from anywhere, belong to no
    finding; `not_inspected` if too few pulses would have been detected, or from too few directions."""
    probability: Probability
    """Probability that such a discharge would have been confirmed or remained a candidate, and left more traces."""
    min_level_db: Number | None
    """Weakest level excluded at `rate_hz`, decibels relative to one volt at 1 m, in steps of 3; null if none."""
    min_rate_hz: Number | None
    """Lowest rate excluded at `level_db`, pulses per second, in steps of about two; null if none."""
    nearest_m: Length | None
    """Smallest horizontal distance in line of sight, metres; null if never in sight within 20 m."""


class SiteInspections(ReportPart):
    """Inspection of the sites of the map from the robot's poses, with the channels that were not found faulty."""

    level_db: Number
    """Level of the discharge that is excluded, decibels relative to one volt at 1 m."""
    rate_hz: Number
    """Its pulses per second."""
    sites: tuple[SiteInspection, ...]
    """Every site, in the order of the map."""

    def names(self, state: str) -> list[str]:
        """Return the names of the sites in a state."""
        return [site.name for site in self.sites if site.state == state]


class GainInMission(ReportPart):
    """Gain of the antennas in a range of angles off their boresights, mean over the channels."""

    off_boresight_deg: Number
    """Middle of the range, degrees counter-clockwise."""
    measured_db: Number
    """Gain that the pulses show, decibels; its scale is such that it agrees with the data sheet on the whole."""
    data_sheet_db: Number
    """Gain of the data sheet towards the same directions, decibels."""


class MisfitInMission(ReportPart):
    """Misfit of the data sheet in a range of distances."""

    from_m: Length
    """Shortest horizontal distance from the finding, metres; the next entry begins where this one ends."""
    n_pulses: Count
    """Number of pulses."""
    misfit: Length
    """Median of the misfit of a pulse: norm of the deviations of its strengths, relative to the norm of the
    strengths."""


class ArrayCheck(ReportPart):
    """Comparison of the pulses of confirmed findings with the data sheet of the array."""

    beam_width: Number
    """Width of the beam relative to that of the data sheet, estimated with the findings."""
    beam_width_std: Length
    """Its standard deviation."""
    yaw_deg: Number
    """Yaw of the array relative to the robot, degrees counter-clockwise, estimated with the findings."""
    yaw_std_deg: Length
    """Its standard deviation, degrees."""
    pattern_error: Length
    """Standard deviation of the gain pattern from that of the data sheet, relative to the largest gain."""
    contradictions: tuple[str, ...]
    """How the array differs from its data sheet, one sentence each; empty if it hardly does."""
    by_channel_db: dict[int, Number]
    """Gain of each sound channel relative to the data sheet, decibels, by its number; only differences matter."""
    by_angle: tuple[GainInMission, ...]
    """Gains by the angle off the boresight, ascending."""
    by_range: tuple[MisfitInMission, ...]
    """Misfits by distance, ascending."""


class SourceMatch(ReportPart):
    """Comparison of a finding with the source it is paired with."""

    finding_id: int
    """Id of the finding."""
    error_m: Length
    """Horizontal distance between finding and source, metres."""
    height_error_m: Number
    """Height of the finding above the source, metres."""
    mahalanobis2_2d: Length
    """Squared horizontal Mahalanobis distance of the source from the finding: its quantiles are those of
    `finding.square_within` if the statement is right."""
    mahalanobis2_3d: Length
    """The same in three dimensions."""
    log_score: Number
    """Minus the logarithm of the stated density of the position at the source, per cubic metre; lower is better."""
    right_site: bool
    """Whether the most probable place of the finding is `true_site`."""
    site_log_score: Length
    """Minus the logarithm of the stated probability of `true_site`, which counts as one in a million if it is lower."""

    def is_inside(self, share: float) -> tuple[bool, bool]:
        """Return whether the source lies in the ellipse, and in the ellipsoid, that are stated to hold a share."""
        return self.mahalanobis2_2d <= square_within(share, 2), self.mahalanobis2_3d <= square_within(share, 3)


class ScoredSource(ReportPart):
    """True source, and the confirmed finding within 2 m horizontally that it is paired with."""

    name: str
    """Name in the scenario."""
    true_position_m: Point
    """x, y, z, world frame, metres."""
    true_site: str
    """Its place as in `Site.name`; `elsewhere` as well for a piece of equipment that the map lacks."""
    found: bool
    """Whether a finding is paired with the source."""
    confirmed_s: Length | None
    """Time at which a confirmed finding was first within 1 m horizontally and nearer to this source than to any other,
    seconds from the start; null if never."""
    match: SourceMatch | None
    """Comparison with the paired finding; null if the source was not found."""


class Encounter(ReportPart):
    """Encounters of the robot with a person or vehicle that moved through the yard."""

    name: str
    """Name in the scenario."""
    kind: Literal["person", "vehicle"]
    """What it was."""
    closest_m: Number | None
    """Smallest distance from the circular outline of the robot, metres; null for a mission without steps."""
    contacts: Count
    """Number of contacts with the robot."""
    ran_into_robot: Count
    """Those in which the robot stood still."""


class Scores(ReportPart):
    """Findings compared with the truth, which is known only for simulated missions."""

    sources: tuple[ScoredSource, ...]
    """Every source inside the fence."""
    false_findings: Count
    """Confirmed findings without a source."""
    ospa_m: Length
    """OSPA distance of findings and sources, order 1, cut-off 2 m, metres."""
    confirmations: Count
    """Findings that were confirmed at any time of the mission."""
    wrong_confirmations: Count
    """Those that were shown as confirmed for more than 2 s in total while more than 1 m horizontally from every source
    that had been active until then."""
    wrong_s: Length
    """Total time for which findings were shown so, seconds."""
    false_all_clears: tuple[str, ...] | None
    """Inspected sites with a source of at least the stated level and rate, without a confirmed finding within 1 m of
    it; null if the inspection is not known."""
    moving: tuple[Encounter, ...]
    """Encounters with people and vehicles, which the robot did not know."""

    @property
    def matches(self) -> tuple[SourceMatch, ...]:
        """Matches of the sources that were found."""
        return tuple(source.match for source in self.sources if source.match is not None)


class Survey(ReportPart):
    """Statements on the survey from the table `[survey]` of the scenario; null where nothing is stated."""

    site: str | None
    """Name of the substation."""
    owner: str | None
    """Owner of the equipment."""
    voltage: str | None
    """Nominal voltages of the site."""
    report_number: str | None
    """Number of the report."""
    revision: str | None
    """Revision of the report."""
    inspector: str | None
    """Who made the survey."""
    weather: str | None
    """Weather."""
    load: str | None
    """Load and operating state of the equipment."""
    background_noise: str | None
    """Radio background as observed on site."""
    previous_survey: str | None
    """Date of the previous survey, or path of its report or its folder."""
    next_survey: str | None
    """Date planned for the next survey."""
    trend: str | None
    """Path of a trend page or its folder."""
    serial_number: int | None
    """Serial number of the array."""
    array_calibrated: str | None
    """Date of the last calibration of the array in a laboratory."""
    array_state: str
    """Errors of the array that the survey started from, in words."""


class Report(ReportPart):
    """Findings of a mission, their uncertainty, and the inspection of the sites."""

    schema_number: Literal[9] = Field(alias="schema")
    """Number of this schema."""
    scenario: str
    """Name of the scenario, or of the table of field data."""
    seed: int | None
    """Seed of the mission; null for field data."""
    policy: str | None
    """Driving policy; null for field data."""
    date: str | None
    """Date of the inspection, such as 2026-03-02; null if not given."""
    survey: Survey
    """Site, people, conditions, other surveys, and the array."""
    versions: dict[str, str]
    """Versions of the software that made the log, by name."""
    ending: str | None
    """Why the mission ended; null if it was killed."""
    sim_time_s: Length
    """Duration of the mission, seconds; for field data, from the first to the last pose."""
    wall_time_s: Length
    """Computing time, seconds; differs between runs of the same seed."""
    distance_m: Length
    """Length of the path of the estimated poses, metres."""
    battery_left: Probability | None
    """Remaining fraction of the battery's energy; null for field data."""
    charges: tuple[Charge, ...]
    """Charges of the battery, in order."""
    collisions: Count
    """Number of contacts of the robot."""
    waypoints: Waypoints
    """Waypoints of the route."""
    n_bearings: Count
    """Number of bearings."""
    pulses: PulseCounts
    """Classification of all pulses."""
    channel_faults: tuple[str, ...]
    """Channels of the receiver that were excluded, and why."""
    calibration: tuple[str, ...]
    """Contradictions between the pulses and the calibration that was used."""
    array: ArrayCheck | None
    """Comparison of the pulses with the data sheet of the array; null without a confirmed finding."""
    notes: tuple[str, ...]
    """Unusual properties of the data, deviations from the map, and errors."""
    findings: tuple[FindingRecord, ...]
    """Confirmed findings, sorted by id."""
    candidates: tuple[FindingRecord, ...]
    """Findings that are not confirmed or lie beyond the fence, sorted by id."""
    inspection: SiteInspections | None
    """Inspected sites; null without a map with sites."""
    evaluation: Scores | None
    """Findings compared with the truth; null if it is not known."""

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


def schema_text() -> str:
    """Return the text of docs/schemas/report.schema.json, the JSON Schema of report.json, draft 2020-12."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **Report.model_json_schema(by_alias=True)}
    return json.dumps(schema, indent=2) + "\n"
