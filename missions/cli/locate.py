"""`pdpatrol locate`: findings from field data."""

from __future__ import annotations

import math
import warnings
from datetime import datetime
from pathlib import Path
from typing import Annotated, NamedTuple

import tyro

from pdpatrol.missions.cli.output.folders import output_folder
from pdpatrol.missions.cli.output.terminal import (
    err,
    out,
    refuse,
    tell_calibration,
    tell_channel_faults,
    tell_findings,
    tell_json,
    tell_time,
    tell_where,
    write_mission,
)


class Limits(NamedTuple):
    """What an option may be: from the least to the most; where the least is above zero, the words say so."""

    least: float
    most: float
    unit: str = ""

    def holds(self, value: float) -> bool:
        """Whether a value lies within."""
        return self.least <= value <= self.most

    def __str__(self) -> str:
        """In words."""
        words = "0 or more, up to" if self.least == 0 else f"above 0, {self.least:g} to" if self.least > 0 else None
        words = words or f"{self.least:g} to"
        return f"{words} {self.most:g}{self.unit}"


LIMITS = {
    "--boresights-deg": Limits(-720, 720, " degrees"),
    "--ring-radius-m": Limits(0, 10, " m"),
    "--height-m": Limits(0, 100, " m"),
    "--gain-error": Limits(0, 1),
    "--pointing-error-deg": Limits(0, 90, " degrees"),
    "--gain-offset": Limits(0, 1),
    "--position-std-m": Limits(0, 100, " m"),
    "--heading-std-deg": Limits(0, 180, " degrees"),
    "--pose-correlation-s": Limits(1e-3, 1e6, " s"),
    "--noise-v": Limits(1e-12, 1e6, " V"),
    "--gate-ns": Limits(1e-3, 1e6, " ns"),
    "--yard-m": Limits(0.1, 1e5, " m"),
}
"""Of every number (assumed): beyond them are no arrays, receivers and sites that are built."""


def locate(
    table: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FILE.csv")],
    *,
    pattern: Path | None = None,
    boresights_deg: tuple[float, ...] | None = None,
    ring_radius_m: float = 0.12,
    height_m: float = 0.6,
    gain_error: float = 0.05,
    pointing_error_deg: float = 2.0,
    gain_offset: float = 0.0,
    position_std_m: float = 0.05,
    heading_std_deg: float = 0.5,
    pose_correlation_s: float = 5.0,
    noise_v: float | None = None,
    gate_ns: float = 4.5,
    calibration: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None,
    yard_m: tuple[float, float] | None = None,
    date: Annotated[str | None, tyro.conf.arg(metavar="YYYY-MM-DD")] = None,
    out_dir: Annotated[Path | None, tyro.conf.arg(name="out", metavar="DIR")] = None,
    json_output: Annotated[bool, tyro.conf.arg(name="json")] = False,
    timing: bool = False,
) -> None:
    """Locate discharges in data from the field; writes log, report and recording like a mission.

    The table has the columns time_s, x_m, y_m, yaw_deg (counter-clockwise from x) and, one pulse a row, strength_1 to
    strength_n in volts, with std_1 to std_n where known; or waveform, the name of a file beside the table: .npz with
    waveforms (channels, samples) or (pulses, channels, samples), sample_rate_hz and, for counts, volts_per_count; or
    .csv with time_s and channel_1 to channel_n. With a column mains_phase_deg the kind of discharge is told too.

    Args:
        table: The table.
        pattern: Measured pattern of one element: .csv with angle_deg and gain or gain_db, .msi or .pln. Default: eq.
            (1) of the Dir-MUSIC paper.
        boresights_deg: Where each channel's element looks, counter-clockwise from straight ahead. Default: a ring of
            six, 90 30 -30 -90 -150 150, or its first four; for other numbers an even ring from 90 on, clockwise.
        ring_radius_m: Radius of the ring of elements.
        height_m: Height of the elements above the ground.
        gain_error: How far gains spread about the data sheet, relative standard deviation.
        pointing_error_deg: How far boresights do, standard deviation.
        gain_offset: Half width of uniform additions to the gains.
        position_std_m: Standard deviation of the poses' x and y.
        heading_std_deg: Standard deviation of their heading.
        pose_correlation_s: How long an error of the pose stays the same.
        noise_v: Deviation of a strength, where the table has no std_1 ..., or of a noise sample of a waveform, where
            no noise was recorded apart from the pulse.
        gate_ns: Length of the gate that is cut out of a waveform.
        calibration: calibration.toml that was written of earlier data of this very array: what they have shown of the
            errors of the array is made use of, and one more is written. It counts until the pulses contradict it.
        yard_m: Length of the yard along x and y from its corner at 0 0; what lies outside is told apart.
        date: When the data were taken, which `pdpatrol trend` goes by. Default: today.
        out_dir: Folder to write to; new or empty. Default: runs/NAME, then -2, -3 and so on.
        json_output: Print the report as JSON instead of a table.
        timing: Say in a line where the time went.
    """
    options = {
        "--boresights-deg": boresights_deg or (),
        "--ring-radius-m": (ring_radius_m,),
        "--height-m": (height_m,),
        "--gain-error": (gain_error,),
        "--pointing-error-deg": (pointing_error_deg,),
        "--gain-offset": (gain_offset,),
        "--position-std-m": (position_std_m,),
        "--heading-std-deg": (heading_std_deg,),
        "--pose-correlation-s": (pose_correlation_s,),
        "--noise-v": () if noise_v is None else (noise_v,),
        "--gate-ns": (gate_ns,),
        "--yard-m": yard_m or (),
    }
    faults = [
        f"{option}: got {value}; allowed is {LIMITS[option]}"
        for option, values in options.items()
        for value in values
        if not LIMITS[option].holds(value)
    ]
    day = date or datetime.now().astimezone().date().isoformat()
    from pdpatrol.envs.scenario.base import is_day

    if not is_day(day):
        faults.append(f"--date: got {day}; allowed is a day of this century as 2026-03-02")
    if faults:
        refuse(*faults)
    from rich.progress import Progress

    from dirmusic import ElementSpread, InputFileError, PoseError, read_pattern
    from dirmusic.array.element_errors import UNEXPLAINED
    from pdpatrol.envs.scenario.array import read_calibration
    from pdpatrol.missions.field.field_data import read_field_data
    from pdpatrol.missions.field.locate_field_data import array_model, calibrated, locate_field_data, rejections
    from pdpatrol.missions.stopwatch import Stopwatch

    stopwatch = Stopwatch()
    with output_folder(out_dir, table.stem) as folder:
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            try:
                with err.status(f"Reads {table.name}"), stopwatch.on("reading"):
                    data = read_field_data(table, noise_v=noise_v, gate_s=gate_ns * 1e-9)
                array = array_model(
                    data,
                    ElementSpread(
                        gain=gain_error,
                        pointing_rad=math.radians(pointing_error_deg),
                        offset=gain_offset / math.sqrt(3),
                        unexplained=UNEXPLAINED,
                    ),
                    read_pattern(pattern) if pattern else None,
                    boresights_deg,
                    ring_radius_m,
                    height_m,
                )
                before = None if calibration is None else read_calibration(calibration)
                if before is not None:
                    array = calibrated(array, before)
            except InputFileError as error:
                refuse(*error.faults)
        notes = tuple(str(warning.message) for warning in told)
        for note in (*notes, *data.notes):
            err.print(f"note: {note}", soft_wrap=True)

        pose_error = PoseError(
            position_m=position_std_m, heading_rad=math.radians(heading_std_deg), correlation_s=pose_correlation_s
        )
        with Progress(console=err, transient=True) as progress, stopwatch.on("locating"):
            bar = progress.add_task(f"{data.strengths_v.shape[0]} pulses", total=1.0)
            log = locate_field_data(
                data,
                array,
                pose_error,
                fence_m=yard_m,
                date=day,
                calibration=before,
                notes=notes,
                progress=lambda share: progress.advance(bar, share),
            )
        with err.status("Writes log, report and recording"), stopwatch.on("log, report and recording"):
            report = write_mission(log, stopwatch.total_s, folder)
    if timing:
        tell_time(stopwatch)
    if json_output:
        tell_json(report)
        return
    tell_findings(report)
    for text in rejections(log):
        err.print(f"note: {text}", soft_wrap=True)
    tell_channel_faults(report)
    tell_calibration(report)
    out.print(
        f"{data.time_s.size} poses, {data.strengths_v.shape[0]} pulses, {report.n_bearings} bearings",
    )
    tell_where(folder)
