"""`pdpatrol locate`: findings from field data."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Annotated

import tyro
from pydantic import Field

from dirmusic import ElementSpread, PoseError, read_pattern
from dirmusic.array.element_errors import UNEXPLAINED
from pdpatrol.envs.scenario.array import read_calibration
from pdpatrol.envs.scenario.base import Day
from pdpatrol.missions.cli.arguments import JsonOutput, OutFolder
from pdpatrol.missions.cli.mission_files import print_outcome, print_times, write_mission
from pdpatrol.missions.cli.terminal import err, note, output_folder, progress_bar
from pdpatrol.missions.field.field_data import read_field_data
from pdpatrol.missions.field.locate_field_data import array_model, calibrated, locate_field_data
from pdpatrol.missions.runner import Stopwatch

Share = Annotated[float, Field(ge=0, le=1)]
Metres = Annotated[float, Field(ge=0, le=100)]
Degrees = Annotated[float, Field(ge=-720, le=720)]
Positive = Annotated[float, Field(ge=1e-12, le=1e6)]


@dataclass(frozen=True)
class SurveyOptions:
    """Array and receiver of the survey, its pose errors, yard and date.

    Attributes:
        pattern: Measured pattern of one element: .csv with angle_deg and gain or gain_db, .msi or .pln. Default: eq.
            (1) of the Dir-MUSIC paper.
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
    date: Annotated[Day | None, tyro.conf.arg(metavar="YYYY-MM-DD")] = None


def locate(
    table: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FILE.csv")],
    *,
    survey: Annotated[SurveyOptions, tyro.conf.arg(name="")] = SurveyOptions(),
    out_dir: OutFolder = None,
    json_output: JsonOutput = False,
    timing: bool = False,
) -> None:
    """Locate discharges in field data, and write the log, report and recording as for a mission.

    The table has the columns time_s, x_m, y_m, yaw_deg (counter-clockwise from x) and, one pulse per row, strength_1 to
    strength_n in volts, with std_1 to std_n where known; or waveform, the name of a file next to the table: .npz with
    waveforms (channels, samples) or (pulses, channels, samples), sample_rate_hz and, for counts, volts_per_count; or
    .csv with time_s and channel_1 to channel_n. With a column mains_phase_deg, the kind of discharge is classified.

    Args:
        table: CSV table of the survey.
        survey: Array, receiver, poses, yard and date.
        out_dir: Folder to write to; new or empty. Default: runs/NAME, then -2, -3 and so on.
        json_output: Print the report as JSON instead of a table.
        timing: Print how long each part took.
    """
    stopwatch = Stopwatch()
    with output_folder(out_dir, table.stem) as folder:
        with err.status(f"Reading {table.name}"), stopwatch.on("reading"):
            data = read_field_data(table, noise_v=survey.noise_v, gate_s=survey.gate_ns * 1e-9)
        spread = ElementSpread(
            gain=survey.gain_error,
            pointing_rad=math.radians(survey.pointing_error_deg),
            offset=survey.gain_offset / math.sqrt(3),
            unexplained=UNEXPLAINED,
        )
        pattern = survey.pattern and read_pattern(survey.pattern)
        model = array_model(data, spread, pattern, survey.boresights_deg, survey.ring_radius_m, survey.height_m)
        calibration = survey.calibration and read_calibration(survey.calibration)
        if calibration is not None:
            model = calibrated(model, calibration)
        with progress_bar() as progress, stopwatch.on("locating"):
            bar = progress.add_task(f"{data.step.size} pulses", total=1.0)
            log = locate_field_data(
                data,
                model,
                PoseError(
                    position_m=survey.position_std_m,
                    heading_rad=math.radians(survey.heading_std_deg),
                    correlation_s=survey.pose_correlation_s,
                ),
                fence_m=survey.yard_m,
                date=survey.date or datetime.now().astimezone().date().isoformat(),
                calibration=calibration,
                progress=lambda share: progress.advance(bar, share),
            )
        with err.status("Writing log, report and recording"), stopwatch.on("log, report and recording"):
            report = write_mission(log, stopwatch.total_s, folder)
    if timing:
        print_times(stopwatch)
    for text in report.notes:
        note(text)
    counts = f"{data.time_s.size} poses, {data.step.size} pulses, {report.n_bearings} bearings"
    print_outcome(report, folder, [counts], json_output)
