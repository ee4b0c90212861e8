"""Array, receiver, poses and yard of a survey, as the options of `pdpatrol locate` state them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import tyro
from pydantic import Field

from dirmusic.arrays import FloatArray
from pdpatrol.envs.scenario.base import Day

Share = Annotated[float, Field(ge=0, le=1)]
Metres = Annotated[float, Field(ge=0, le=100)]
Degrees = Annotated[float, Field(ge=-720, le=720)]
Positive = Annotated[float, Field(ge=1e-12, le=1e6)]
Georeference = tuple[
    Annotated[float, Field(ge=-85, le=85)],
    Annotated[float, Field(ge=-180, le=180)],
    Annotated[float, Field(ge=-360, le=360)],
]
"""Values of `GeoreferenceConfig`, in order."""

Heading = Literal["counterclockwise", "compass", "clockwise"]


class HeadingConvention(NamedTuple):
    """Convention of the angles in the column yaw_deg.

    Attributes:
        sign: 1 if they increase counter-clockwise, seen from above; -1 if clockwise.
        zero_deg: Direction of zero, counter-clockwise from the x axis.
        text: Description.
    """

    sign: float
    zero_deg: float
    text: str

    def yaw_deg(self, angle_deg: FloatArray) -> FloatArray:
        """Convert angles as written to angles counter-clockwise from the x axis; the conversion is its own inverse."""
        return self.zero_deg + self.sign * angle_deg


HEADINGS: dict[Heading, HeadingConvention] = {
    "counterclockwise": HeadingConvention(1.0, 0.0, "angles counter-clockwise from the x axis"),
    "compass": HeadingConvention(-1.0, 90.0, "compass headings, clockwise from the y axis (north)"),
    "clockwise": HeadingConvention(-1.0, 0.0, "angles clockwise from the x axis"),
}


@dataclass(frozen=True)
class SurveyOptions:
    """Array and receiver of the survey, its pose errors, yard and date.

    Attributes:
        heading: What yaw_deg holds: angles counter-clockwise or clockwise from the x axis, or compass headings,
            clockwise from the y axis, which then points north.
        pattern: Measured pattern of one element: a CSV table with angle_deg and gain or gain_db, over frequency_hz if
            need be; an MSI Planet file; or a far field of NEC, FEKO, CST, HFSS or TICRA. Default: eq. (1) of the
            Dir-MUSIC paper.
        boresights_deg: Azimuth of each channel's element, counter-clockwise from straight ahead. Default: a ring of
            six, 90 30 -30 -90 -150 150, or its first four; for other numbers of channels, an evenly spaced ring,
            clockwise from 90.
        ring_radius_m: Radius of the ring of elements.
        height_m: Height of the elements above the ground.
        gain_error: Relative standard deviation of the gains from the data sheet.
        pointing_error_deg: Standard deviation of the boresights.
        gain_offset: Half-width of a uniform error that is added to each gain.
        noise_v: Standard deviation of a strength, if the table has no std_1 ..., or of a noise sample of a waveform, if
            no noise was recorded outside the pulse.
        gate_ns: Length of the gate that is cut out of a waveform.
        calibration: calibration.toml written from earlier data of the same array. The array errors that it contains are
            used until the pulses contradict them, and a new file is written.
        position_std_m: Standard deviation of the poses' x and y.
        heading_std_deg: Standard deviation of their heading.
        pose_correlation_s: Correlation time of the errors of the poses.
        yard: Scenario file of the yard whose frame the poses are in: its equipment is the map, by which sites are named
            and sight is known; `[map]`, `[receiver]` and `[inspection]` state which discharges are excluded, and
            where; `[survey]` has site and conditions for the report.
        yard_m: Length of the yard along x and y from its corner at 0 0, without --yard; findings outside are marked.
        georeference: Latitude and longitude of the origin, degrees on WGS 84, north and east positive, and direction
            of the y axis, degrees clockwise from true north, for maps that `pdpatrol export` writes.
        pose_topic: Topic of the poses in a recording of ROS 2.
        pulse_topic: Topic of the pulses in it.
        date: Date of the survey, which `pdpatrol trend` sorts by.
    """

    heading: Heading = "counterclockwise"
    pattern: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    boresights_deg: Annotated[
        tuple[Degrees, ...] | None, tyro.conf.arg(metavar="DEGREES [DEGREES ...]", help_behavior_hint="")
    ] = None
    ring_radius_m: Metres = 0.12
    height_m: Metres = 0.6
    gain_error: Share = 0.05
    pointing_error_deg: Annotated[Degrees, Field(ge=0)] = 2.0
    gain_offset: Share = 0.0
    noise_v: Annotated[Positive | None, tyro.conf.arg(metavar="VOLTS", help_behavior_hint="")] = None
    gate_ns: Positive = 4.5
    calibration: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    position_std_m: Metres = 0.05
    heading_std_deg: Annotated[Degrees, Field(ge=0)] = 0.5
    pose_correlation_s: Positive = 5.0
    yard: Annotated[Path | None, tyro.conf.arg(metavar="FILE.toml", help_behavior_hint="")] = None
    yard_m: Annotated[tuple[Positive, Positive] | None, tyro.conf.arg(metavar="X Y", help_behavior_hint="")] = None
    georeference: Annotated[Georeference | None, tyro.conf.arg(metavar="LAT LON HEADING", help_behavior_hint="")] = None
    pose_topic: Annotated[str, tyro.conf.arg(metavar="TOPIC")] = "/pose"
    pulse_topic: Annotated[str, tyro.conf.arg(metavar="TOPIC")] = "/pulses"
    date: Annotated[Day | None, tyro.conf.arg(metavar="YYYY-MM-DD", help_behavior_hint="")] = None
