"""What all verbs share: the terminal, refusals, and what is told of a mission."""

from __future__ import annotations

import json
import sys
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from rich.console import Console

from missions.whole_file import write_whole

if TYPE_CHECKING:
    from envs.scenario import Scenario
    from missions.record.mission_log import MissionLog

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


def tell_notes(scenario: Scenario) -> None:
    """Say what in a scenario is hardly meant, one line each; it is used all the same."""
    from envs.plausibility import plausibility

    for note in plausibility(scenario):
        err.print(f"note: {note}", soft_wrap=True)


def write_mission(log: MissionLog, report: dict[str, Any], folder: Path) -> None:
    """Write log, report, recording, and the calibration of the array if the mission has learned any.

    Raises:
        OSError: If one cannot be written. What is there is whole, and `INCOMPLETE` beside it says what went wrong.
    """
    try:
        _write_files(log, report, folder)
    except OSError as error:
        with suppress(OSError):
            write_whole(folder / INCOMPLETE, f"Log, report and recording are not all here: {error}\n")
        raise


def _write_files(log: MissionLog, report: dict[str, Any], folder: Path) -> None:
    from envs.scenario.calibration import restore_calibration
    from missions.recording import write_recording

    log.save(folder)
    write_whole(folder / "report.json", json.dumps(report, indent=2) + "\n")
    if "calibration" in log.meta:
        when = datetime.now().astimezone().isoformat(timespec="seconds")
        text = restore_calibration(log.meta["calibration"]).as_toml()
        write_whole(folder / CALIBRATION, f"# Written {when}\n{text}")
    write_recording(log, folder / "mission.rrd")


def tell_where(folder: Path) -> None:
    """Say what was written and how to look at it."""
    files = ["log.npz", "report.json", "mission.rrd", *([CALIBRATION] if (folder / CALIBRATION).exists() else [])]
    out.print(f"Written to {folder}: {', '.join(files)}", soft_wrap=True)
    out.print(f"Look at it with: pdpatrol replay {folder}", soft_wrap=True)


def tell_findings(report: dict[str, Any]) -> None:
    """What was found, or why nothing was, and what was detected and not confirmed."""
    from missions.record.pulse_counts import in_words
    from missions.record.tables import candidates_table, findings_table

    found = findings_table(report) if report["findings"] else in_words(report["pulses"])
    out.print(found, soft_wrap=not report["findings"])
    if report["candidates"]:
        out.print(candidates_table(report))


def tell_channel_faults(report: dict[str, Any]) -> None:
    """Say which channels of the receiver were found at fault."""
    for text in report["channel_faults"]:
        out.print(f"Receiver: {text}", style="yellow")


def tell_calibration(report: dict[str, Any]) -> None:
    """Say whether the pulses contradict the calibration that was taken up."""
    for text in report["calibration"]:
        out.print(f"Calibration: {text}", style="yellow")
