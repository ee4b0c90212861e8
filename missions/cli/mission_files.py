"""Files of a mission: reading, writing, and printing their content."""

import os
import shlex
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import tomlkit

from pdpatrol.missions.atomic_file import write_text
from pdpatrol.missions.cli.terminal import err, note, out, print_written, say
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.inspection import inspect_sites
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.page import report_page
from pdpatrol.missions.report.records import Report, report_text
from pdpatrol.missions.report.tables import candidates_table, findings_table
from pdpatrol.missions.report.wording import summary_text
from pdpatrol.missions.runner import Stopwatch

CALIBRATION_HEADER = """\
# Errors of one array, estimated from pulses; `pdpatrol run --calibration` starts from them.
# By element: gain relative, offset in units of gain; covariance of all.
"""


def write_mission(log: MissionLog, wall_time_s: float, folder: Path) -> Report:
    """Write log, calibration, report and recording of a mission, complete or cut short.

    The calibration is written if the mission has estimated the array errors; the recording, if Rerun is installed.

    Args:
        log: The mission.
        wall_time_s: Time that the mission took.
        folder: Existing folder.

    Returns:
        The report.

    Raises:
        OSError: If a file cannot be written. Those that exist are complete.
    """
    log.meta["wall_time_s"] = wall_time_s
    log.save(folder)
    if "calibration" in log.meta:
        write_text(folder / "calibration.toml", CALIBRATION_HEADER + tomlkit.dumps(log.meta["calibration"]))
    report = write_report(log, folder)
    if find_spec("rerun") is None:
        note('no recording, as rerun is not installed; run: pip install "pdpatrol[viewer]"')
    else:
        from pdpatrol.missions.recording import write_recording  # Rerun is optional

        write_recording(log, folder / "mission.rrd")
    return report


def write_report(log: MissionLog, folder: Path) -> Report:
    """Write report.json and then report.html, which takes longer, and return the report."""
    report = make_report(log, log.meta.get("wall_time_s", 0.0), inspect_sites(log))
    write_text(folder / "report.json", report_text(report))
    write_text(folder / "report.html", report_page(log, report))
    return report


def print_findings(report: Report) -> None:
    """Print findings, or a summary without findings, and candidates."""
    if report.findings:
        out.print(findings_table(report))
    else:
        say(summary_text(report))
    if report.candidates:
        out.print(candidates_table(report))


def print_times(stopwatch: Stopwatch) -> None:
    """Print how long each part of the work took."""
    total_s = stopwatch.total_s
    parts = {**stopwatch.spent_s, "the rest": total_s - sum(stopwatch.spent_s.values())}
    text = ", ".join(f"{part} {spent_s:.1f} s" for part, spent_s in parts.items())
    say(f"Time: {total_s:.1f} s: {text}", err)


def print_outcome(report: Report, folder: Path, lines: Sequence[str], json_output: bool) -> None:
    """Print the report as JSON, or print findings, problems of the array, the given lines, and the files written."""
    if json_output:
        sys.stdout.write(report_text(report))
        return
    print_findings(report)
    contradictions = report.array.contradictions if report.array else ()
    parts = ("Receiver", report.channel_faults), ("Calibration", report.calibration), ("Array", contradictions)
    for heading, doubts in parts:
        for doubt in doubts:
            say(f"{heading}: {doubt}", style="yellow", hanging=2)
    for line in lines:
        say(line, hanging=2)
    print_written(folder, *sorted(path.name for path in folder.iterdir()))
    command = "uv run pdpatrol" if "UV_RUN_RECURSION_DEPTH" in os.environ else "pdpatrol"
    say(f"Look at it with: {command} replay {shlex.quote(str(folder))}")
