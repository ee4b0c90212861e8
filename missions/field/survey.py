"""Array, receiver, poses and yard of a survey, as the options of `pdpatrol locate` state them."""

from dataclasses import dataclass, field
from datetime import date as calendar_date
from pathlib import Path
from typing import Annotated

import tyro
from pydantic import Field

from pdpatrol.envs.scenario.base import Day

Share = Annotated[float, Field(ge=0, le=1)]
Metres = Annotated[float, Field(ge=0, le=100)]
Degrees = Annotated[float, Field(ge=-720, le=720)]
Positive = Annotated[float, Field(ge=1e-12, le=1e6)]


@dataclass(frozen=True)
class SurveyOptions:
    """Array and receiver of the survey, its pose errors, yard and date.

    Attributes:
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
        yard_m: Length of the yard along x and y from its corner at 0 0; findings outside are marked.
        date: Date of the survey, which `pdpatrol trend` sorts by. Default: today.
    """

    pattern: Path | None = None
    boresights_deg: tuple[Degrees, ...] | None = None
    ring_radius_m: Metres = 0.12
    height_m: Metres = 0.6
    gain_error: Share = 0.05
    pointing_error_deg: Annotated[Degrees, Field(ge=0)] = 2.0
    gain_offset: Share = 0.0
    noise_v: Positive | None = None
    gate_ns: Positive = 4.5
    calibration: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    position_std_m: Metres = 0.05
    heading_std_deg: Annotated[Degrees, Field(ge=0)] = 0.5
    pose_correlation_s: Positive = 5.0
    yard_m: tuple[Positive, Positive] | None = None
    date: Annotated[Day, tyro.conf.arg(metavar="YYYY-MM-DD")] = field(
        default_factory=lambda: calendar_date.today().isoformat()
    )
