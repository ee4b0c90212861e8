"""`pdpatrol locate`: findings from field data."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Annotated

import tyro
from rich.progress import Progress

from dirmusic import ElementSpread, InputFileError, PoseError, read_pattern
from dirmusic.array.element_errors import UNEXPLAINED
from pdpatrol.envs.scenario.array import read_calibration
from pdpatrol.envs.scenario.base import is_day
from pdpatrol.missions.cli.mission_files import (
    print_doubts,
    print_files,
    print_findings,
    print_json,
    print_times,
    write_mission,
)
from pdpatrol.missions.cli.terminal import err, note, out, output_folder, refuse
from pdpatrol.missions.field.field_data import read_field_data
from pdpatrol.missions.field.locate_field_data import array_model, calibrated, locate_field_data, rejections
from pdpatrol.missions.runner import Stopwatch

LIMITS = {
    "boresights_deg": (-720, 720, " degrees"),
    "ring_radius_m": (0, 10, " m"),
    "height_m": (0, 100, " m"),
    "gain_error": (0, 1, ""),
    "pointing_error_deg": (0, 90, " degrees"),
    "gain_offset": (0, 1, ""),
    "position_std_m": (0, 100, " m"),
    "heading_std_deg": (0, 180, " degrees"),
    "pose_correlation_s": (1e-3, 1e6, " s"),
    "noise_v": (1e-12, 1e6, " V"),
    "gate_ns": (1e-3, 1e6, " ns"),
    "yard_m": (0.1, 1e5, " m"),
}
"""Least and largest value of each number, and its unit. Assumed; no array, receiver or site lies beyond them."""


@dataclass(frozen=True)
class ArrayOptions:
    """Array and receiver that took the data.

    Attributes:
        pattern: Measured pattern of one element: .csv with angle_deg and gain or gain_db, .msi or .pln. Default: eq.
            (1) of the Dir-MUSIC paper.
        boresights_deg: Azimuth of each channel's element, counter-clockwise from straight ahead. Default: a ring of
            six, 90 30 -30 -90 -150 150, or its first four; for other numbers an even ring from 90 on, clockwise.
        ring_radius_m: Radius of the ring of elements.
        height_m: Height of the elements above the ground.
        gain_error: Relative standard deviation of the gains from the data sheet.
        pointing_error_deg: Standard deviation of the boresights.
        gain_offset: Half width of uniform additions to the gains.
        noise_v: Standard deviation of a strength, if the table has no std_1 ..., or of a noise sample of a waveform, if
            no noise was recorded outside the pulse.
        gate_ns: Length of the gate that is cut out of a waveform.
        calibration: calibration.toml written from earlier data of this very array. The errors of the array that it
            holds are used until the pulses contradict them, and a new file is written.
    """

    pattern: Path | None = None
    boresights_deg: tuple[float, ...] | None = None
    ring_radius_m: float = 0.12
    height_m: float = 0.6
    gain_error: float = 0.05
    pointing_error_deg: float = 2.0
    gain_offset: float = 0.0
    noise_v: float | None = None
    gate_ns: float = 4.5
    calibration: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None

    @property
    def spread(self) -> ElementSpread:
        """Deviations of such arrays from their data sheet."""
        return ElementSpread(
            gain=self.gain_error,
            pointing_rad=math.radians(self.pointing_error_deg),
            offset=self.gain_offset / math.sqrt(3),
            unexplained=UNEXPLAINED,
        )


@dataclass(frozen=True)
class SurveyOptions:
    """Poses, yard and date of the survey.

    Attributes:
        position_std_m: Standard deviation of the poses' x and y.
        heading_std_deg: Standard deviation of their heading.
        pose_correlation_s: Correlation time of the errors of the poses.
        yard_m: Length of the yard along x and y from its corner at 0 0; findings outside are marked.
        date: Date of the survey, by which `pdpatrol trend` sorts. Default: today.
    """

    position_std_m: float = 0.05
    heading_std_deg: float = 0.5
    pose_correlation_s: float = 5.0
    yard_m: tuple[float, float] | None = None
    date: Annotated[str | None, tyro.conf.arg(metavar="YYYY-MM-DD")] = None

    @property
    def pose_error(self) -> PoseError:
        """Errors of the poses."""
        return PoseError(
            position_m=self.position_std_m,
            heading_rad=math.radians(self.heading_std_deg),
            correlation_s=self.pose_correlation_s,
        )


def locate(
    table: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FILE.csv")],
    *,
    array: Annotated[ArrayOptions, tyro.conf.arg(name="")] = ArrayOptions(),
    survey: Annotated[SurveyOptions, tyro.conf.arg(name="")] = SurveyOptions(),
    out_dir: Annotated[Path | None, tyro.conf.arg(name="out", metavar="DIR")] = None,
    json_output: Annotated[bool, tyro.conf.arg(name="json")] = False,
    timing: bool = False,
) -> None:
    """Locate discharges in field data; write log, report and recording as those of a mission.

    The table has the columns time_s, x_m, y_m, yaw_deg (counter-clockwise from x) and, one pulse per row, strength_1 to
    strength_n in volts, with std_1 to std_n where known; or waveform, the name of a file next to the table: .npz with
    waveforms (channels, samples) or (pulses, channels, samples), sample_rate_hz and, for counts, volts_per_count; or
    .csv with time_s and channel_1 to channel_n. With a column mains_phase_deg the kind of discharge is classified.

    Args:
        table: The table.
        array: Array and receiver.
        survey: Poses, yard and date.
        out_dir: Folder to write to; new or empty. Default: runs/NAME, then -2, -3 and so on.
        json_output: Print the report as JSON instead of a table.
        timing: Print how long each part took.
    """
    day = survey.date or datetime.now().astimezone().date().isoformat()
    errors = _errors(array) + _errors(survey)
    if not is_day(day):
        errors.append(f"--date must be a day of this century such as 2026-03-02, got {day}")
    if errors:
        refuse(*errors)
    stopwatch = Stopwatch()
    with output_folder(out_dir, table.stem) as folder:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                with err.status(f"Reading {table.name}"), stopwatch.on("reading"):
                    data = read_field_data(table, noise_v=array.noise_v, gate_s=array.gate_ns * 1e-9)
                model = array_model(
                    data,
                    array.spread,
                    read_pattern(array.pattern) if array.pattern else None,
                    array.boresights_deg,
                    array.ring_radius_m,
                    array.height_m,
                )
                calibration = None if array.calibration is None else read_calibration(array.calibration)
                if calibration is not None:
                    model = calibrated(model, calibration)
            except InputFileError as error:
                refuse(*error.faults)
        notes = tuple(str(warning.message) for warning in caught)
        for text in (*notes, *data.notes):
            note(text)
        n_pulses = data.strengths_v.shape[0]
        with Progress(console=err, transient=True) as progress, stopwatch.on("locating"):
            bar = progress.add_task(f"{n_pulses} pulses", total=1.0)
            log = locate_field_data(
                data,
                model,
                survey.pose_error,
                fence_m=survey.yard_m,
                date=day,
                calibration=calibration,
                notes=notes,
                progress=lambda share: progress.advance(bar, share),
            )
        with err.status("Writing log, report and recording"), stopwatch.on("log, report and recording"):
            report = write_mission(log, stopwatch.total_s, folder)
    if timing:
        print_times(stopwatch)
    if json_output:
        print_json(report)
        return
    print_findings(report)
    for text in rejections(log):
        note(text)
    print_doubts(report)
    out.print(f"{data.time_s.size} poses, {n_pulses} pulses, {report.n_bearings} bearings")
    print_files(folder)


def _errors(options: ArrayOptions | SurveyOptions) -> list[str]:
    """Return one line for each number that is out of its limits."""
    errors: list[str] = []
    for name, value in vars(options).items():
        if name not in LIMITS or value is None:
            continue
        low, high, unit = LIMITS[name]
        for number in value if isinstance(value, tuple) else (value,):
            if not low <= number <= high:
                option = f"--{name.replace('_', '-')}"
                errors.append(f"{option} must be from {low:g} to {high:g}{unit}, got {number:g}")
    return errors
