"""What all verbs share: the terminal, refusals, and what is told of a mission."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from rich.console import Console

from pdpatrol.missions.atomic_file import write_text

if TYPE_CHECKING:
    from pdpatrol.envs.scenario import Scenario
    from pdpatrol.missions.record.mission_log import MissionLog
    from pdpatrol.missions.report.records import Report
    from pdpatrol.missions.stopwatch import Stopwatch

FAILED = 1
USAGE_ERROR = 2

CALIBRATION, INCOMPLETE = "calibration.toml", "INCOMPLETE.txt"

out, err = (Console(stderr=to_stderr, markup=False, highlight=False, emoji=False) for to_stderr in (False, True))
"""What is printed may come from a user's file: brackets, colons and numbers in it stay as they are."""


def in_one_line(text: str) -> str:
    """A text with line breaks and other control characters as escapes, for a terminal must not obey them."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def refuse(*faults: str) -> NoReturn:
    """Print one line per fault and leave with exit status 2."""
    for fault in faults:
        err.print(in_one_line(fault), soft_wrap=True)
    sys.exit(USAGE_ERROR)


def fail(fault: str) -> NoReturn:
    """Print one line on what this machine denies and leave with exit status 1."""
    err.print(in_one_line(fault), soft_wrap=True)
    sys.exit(FAILED)


def tell_notes(scenario: Scenario) -> None:
    """Say what in a scenario is hardly meant, one line each; it is used all the same."""
    from pdpatrol.envs.plausibility import plausibility

    for note in plausibility(scenario):
        err.print(f"note: {note}", soft_wrap=True)


def write_mission(log: MissionLog, wall_time_s: float, folder: Path) -> Report:
    """Write log, report, recording, page, and the calibration of the array if the mission has learned any.

    Args:
        log: The mission, whole or cut short.
        wall_time_s: How long it took.
        folder: Where to.

    Returns:
        The report.

    Raises:
        OSError: If one cannot be written. What is there is whole, and `INCOMPLETE` beside it says what went wrong.
    """
    try:
        return _write_files(log, wall_time_s, folder)
    except OSError as error:
        with suppress(OSError):
            write_text(folder / INCOMPLETE, f"Log, report and recording are not all here: {error}\n")
        raise


def _write_files(log: MissionLog, wall_time_s: float, folder: Path) -> Report:
    from pdpatrol.envs.scenario.array import restore_calibration
    from pdpatrol.missions.recording import write_recording

    log.save(folder)
    if "calibration" in log.meta:
        when = datetime.now().astimezone().isoformat(timespec="seconds")
        text = restore_calibration(log.meta["calibration"]).as_toml()
        write_text(folder / CALIBRATION, f"# Written {when}\n{text}")
    return write_report(log, wall_time_s, folder, lambda: write_recording(log, folder / "mission.rrd"))


def write_report(
    log: MissionLog, wall_time_s: float, folder: Path, between: Callable[[], None] = lambda: None
) -> Report:
    """Write report.json and, what takes longer, report.html; see `write_mission`.

    Args:
        log: The mission, whole or cut short.
        wall_time_s: How long it took.
        folder: Where to.
        between: Done between the two.
    """
    from pdpatrol.missions.report.inspection import inspected_sites
    from pdpatrol.missions.report.make_report import make_report
    from pdpatrol.missions.report.report_file import report_text
    from pdpatrol.missions.report.report_page import report_page

    inspected = inspected_sites(log)
    report = make_report(log, wall_time_s, inspected)
    write_text(folder / "report.json", report_text(report))
    between()
    write_text(folder / "report.html", report_page(log, report, inspected))
    return report


def load_what_writes() -> None:
    """Load the libraries that `write_mission` needs, before a mission: one that is interrupted has two seconds."""
    import pdpatrol.missions.recording
    import pdpatrol.missions.report.report_page  # noqa: F401


def tell_time(stopwatch: Stopwatch) -> None:
    """Say where the time went, in a line."""
    total_s = stopwatch.total_s
    parts = {**stopwatch.spent_s, "the rest": total_s - sum(stopwatch.spent_s.values())}
    told = ", ".join(f"{what} {spent_s:.1f} s" for what, spent_s in parts.items())
    err.print(f"Time: {total_s:.1f} s: {told}", soft_wrap=True)


def tell_where(folder: Path) -> None:
    """Say what was written and how to look at it."""
    files = ["log.npz", "report.json", "report.html", "mission.rrd", CALIBRATION]
    out.print(f"Written to {folder}: {', '.join(name for name in files if (folder / name).exists())}", soft_wrap=True)
    out.print(f"Look at it with: {as_typed(f'replay {shlex.quote(str(folder))}')}", soft_wrap=True)


def as_typed(words: str) -> str:
    """A command of pdpatrol as it works where the user is: through uv, if this one came so."""
    return f"uv run pdpatrol {words}" if "UV_RUN_RECURSION_DEPTH" in os.environ else f"pdpatrol {words}"


def tell_json(report: Report) -> None:
    """Print report.json."""
    from pdpatrol.missions.report.report_file import report_text

    out.print(report_text(report), end="", soft_wrap=True)


def tell_findings(report: Report) -> None:
    """What was found, or why nothing was, and what was detected and not confirmed."""
    from pdpatrol.missions.report.pulse_counts import in_words
    from pdpatrol.missions.report.tables import candidates_table, findings_table

    found = findings_table(report) if report.findings else in_words(report.pulses)
    out.print(found, soft_wrap=not report.findings)
    if report.candidates:
        out.print(candidates_table(report))


def tell_channel_faults(report: Report) -> None:
    """Say which channels of the receiver were found at fault."""
    for text in report.channel_faults:
        out.print(f"Receiver: {text}", style="yellow")


def tell_calibration(report: Report) -> None:
    """Say whether the pulses contradict the calibration that was taken up."""
    for text in report.calibration:
        out.print(f"Calibration: {text}", style="yellow")
