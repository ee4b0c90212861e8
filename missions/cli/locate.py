"""`pdpatrol locate`: findings from field data."""

from pathlib import Path
from typing import Annotated

import tyro

from pdpatrol.missions.cli.arguments import JsonOutput, OutFolder
from pdpatrol.missions.cli.mission_files import print_outcome, print_times, write_mission
from pdpatrol.missions.cli.terminal import err, note, output_folder, progress_bar
from pdpatrol.missions.field.field_data import read_field_data
from pdpatrol.missions.field.locate_field_data import locate_field_data
from pdpatrol.missions.field.survey import SurveyOptions
from pdpatrol.missions.runner import Stopwatch


def locate(
    table: Annotated[Path, tyro.conf.arg(metavar="FILE.csv")],
    /,
    *,
    survey: Annotated[SurveyOptions, tyro.conf.arg(name="")],
    out_dir: OutFolder = None,
    json_output: JsonOutput = False,
    timing: bool = False,
) -> None:
    """Locate discharges in field data, and write the log, report and recording as for a mission.

    The table has the columns time_s, x_m, y_m, yaw_deg (counter-clockwise from x) and, one pulse per row, strength_1 to
    strength_n in volts, with std_1 to std_n where known; or waveform, the name of a file next to the table, or
    waveform_1 to waveform_n, one for each channel: CSV or a binary file of an oscilloscope, .npz, TDMS, MATLAB, HDF5 or
    SigMF. All pulses of a file are found. With a column mains_phase_deg, the kind of discharge is classified.

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
        with progress_bar() as progress, stopwatch.on("locating"):
            bar = progress.add_task(f"{data.step.size} pulses", total=1.0)
            log = locate_field_data(data, survey, lambda share: progress.advance(bar, share))
        with err.status("Writing log, report and recording"), stopwatch.on("log, report and recording"):
            report = write_mission(log, stopwatch.total_s, folder)
    if timing:
        print_times(stopwatch)
    note(*report.notes)
    counts = f"{data.time_s.size} poses, {data.step.size} pulses, {report.n_bearings} bearings"
    print_outcome(report, folder, [counts], json_output)
