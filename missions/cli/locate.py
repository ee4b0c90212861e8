"""`pdpatrol locate`: findings from field data."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import tyro
from pydantic import Field

from pdpatrol.missions.cli.arguments import Flag, JsonOutput, OutFolder, optional
from pdpatrol.missions.cli.follow_survey import follow_survey, title_of
from pdpatrol.missions.cli.mission_files import print_outcome, print_times, write_mission
from pdpatrol.missions.cli.terminal import continued_folder, err, note, out, output_folder, progress_bar, refuse
from pdpatrol.missions.field.field_data import FieldData, read_field_data
from pdpatrol.missions.field.follow import RECEIVED
from pdpatrol.missions.field.locate_field_data import locate_field_data
from pdpatrol.missions.field.survey import SurveyOptions
from pdpatrol.missions.record.words import counted
from pdpatrol.missions.runner import Stopwatch


def locate(
    table: Annotated[Path, tyro.conf.arg(metavar="FILE.csv")],
    /,
    *,
    survey: Annotated[SurveyOptions, tyro.conf.arg(name="")],
    follow: Flag = False,
    idle_s: Annotated[float | None, optional("SECONDS"), Field(gt=0, allow_inf_nan=False)] = None,
    live: Flag = False,
    out_dir: OutFolder = None,
    json_output: JsonOutput = False,
    timing: Flag = False,
) -> None:
    """Locate discharges in field data, and write the log, report and recording as for a mission.

    The table has the columns time_s, x_m, y_m, yaw_deg (see --heading) and, one pulse per row, strength_1 to
    strength_n in volts, with std_1 to std_n where known; or waveform, the name of a file next to the table, or
    waveform_1 to waveform_n, one for each channel: CSV or a binary file of an oscilloscope, .npz, TDMS, MATLAB, HDF5 or
    SigMF. All pulses of a file are found. With a column mains_phase_deg, the kind of discharge is classified.

    Instead of a table, an MCAP file or a rosbag2 folder holds poses and pulses, as `pdpatrol export` writes them.

    Args:
        table: CSV table, MCAP file or rosbag2 folder of the survey. With --follow also a folder of tables, which are
            read in the order of their names; - for standard input; or 127.0.0.1:PORT, to which one program after
            another may connect and send.
        survey: Array, receiver, poses, yard and date.
        follow: Locate while the survey is recorded: print findings as they change, until Ctrl-C, the end of standard
            input, or --idle-s. Records are rows of a CSV table with strengths, or JSON objects with the same names, one
            a line. They are stored in received.csv in the output folder, and located as a finished file at the end. A
            folder with that file is continued.
        idle_s: With --follow, end when nothing has arrived for so long.
        live: With --follow, show the survey in the Rerun viewer.
        out_dir: Folder to write to; new or empty. Default: runs/NAME, then -2, -3 and so on.
        json_output: Print the report as JSON instead of a table.
        timing: Print how long each part took.
    """
    if not follow and (live or idle_s is not None):
        refuse("--live and --idle-s need --follow")
    stopwatch, title = Stopwatch(), title_of(table) if follow else table
    reserved = continued_folder(out_dir, title.stem, RECEIVED) if follow else output_folder(out_dir, title.stem)
    with reserved as folder:
        if follow:
            with stopwatch.on("following"):
                table = follow_survey(table, survey, folder, idle_s, live, err if json_output else out).path
        with err.status(f"Reading {table.name}"), stopwatch.on("reading"):
            data = replace(read_survey(table, survey), path=title)
        with progress_bar() as progress, stopwatch.on("locating"):
            bar = progress.add_task(counted(data.step.size, "pulse"), total=1.0)
            log = locate_field_data(data, survey, lambda share: progress.advance(bar, share))
        with err.status("Writing log, report and recording"), stopwatch.on("log, report and recording"):
            report = write_mission(log, stopwatch.total_s, folder)
    if timing:
        print_times(stopwatch)
    note(*report.notes)
    counts = (data.time_s.size, "pose"), (data.step.size, "pulse"), (report.n_bearings, "bearing")
    print_outcome(report, folder, [", ".join(counted(n, noun) for n, noun in counts)], json_output)


def read_survey(path: Path, survey: SurveyOptions) -> FieldData:
    """Read a table, or a recording of ROS 2."""
    if path.suffix.lower() in (".mcap", ".db3") or path.is_dir():
        from pdpatrol.missions.field.ros2_bag import read_bag  # rosbags is optional

        return read_bag(path, survey)
    return read_field_data(path, noise_v=survey.noise_v, gate_s=survey.gate_ns * 1e-9, heading=survey.heading)
