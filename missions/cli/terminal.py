"""What all verbs share: the terminal, refusals, and folders that are never written twice."""

from __future__ import annotations

import json
import sys
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from rich.console import Console

if TYPE_CHECKING:
    from envs.scenario import Scenario
    from missions.record.mission_log import MissionLog

FAILED = 1
USAGE_ERROR = 2
INTERRUPTED = 130

CALIBRATION = "calibration.toml"

out, err = Console(), Console(stderr=True)


def refuse(*faults: str) -> NoReturn:
    """Print one line per fault and leave with exit status 2."""
    for fault in faults:
        err.print(fault, highlight=False, markup=False, soft_wrap=True)
    sys.exit(USAGE_ERROR)


def tell_notes(scenario: Scenario) -> None:
    """Say what in a scenario is hardly meant, one line each; it is used all the same."""
    from envs.plausibility import plausibility

    for note in plausibility(scenario):
        err.print(f"note: {note}", highlight=False, markup=False, soft_wrap=True)


def new_folder(given: Path | None, name: str, option: str = "--out") -> Path:
    """A folder that holds nothing yet: the one given by an option, or the next free one under runs/."""
    if given is not None:
        if given.exists() and not given.is_dir():
            refuse(f"{option}: {given} is a file; allowed is a new or an empty folder")
        if given.is_dir() and any(given.iterdir()):
            refuse(f"{option}: {given} is not empty; allowed is a new or an empty folder")
        return given
    folder, count = Path("runs") / name, 1
    while folder.exists():
        count += 1
        folder = Path("runs") / f"{name}-{count}"
    return folder


def make_folder(folder: Path, option: str = "--out") -> Path:
    """The folder, made where it is not there yet."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        refuse(f"{option}: {folder} cannot be made ({error.strerror}); allowed is a folder that can be written to")
    return folder


def write_mission(log: MissionLog, report: dict[str, Any], folder: Path) -> None:
    """Write log, report, recording, and the calibration of the array if the mission has learned any."""
    from envs.scenario.calibration import restore_calibration
    from missions.recording import write_recording

    log.save(folder)
    write_text(folder / "report.json", json.dumps(report, indent=2) + "\n")
    if "calibration" in log.meta:
        when = datetime.now().astimezone().isoformat(timespec="seconds")
        text = restore_calibration(log.meta["calibration"]).as_toml()
        write_text(folder / CALIBRATION, f"# Written {when}\n{text}")
    write_recording(log, folder / "mission.rrd")


def tell_where(folder: Path) -> None:
    """Say what was written and how to look at it."""
    files = ["log.npz", "report.json", "mission.rrd", *([CALIBRATION] if (folder / CALIBRATION).exists() else [])]
    out.print(f"Written to {folder}: {', '.join(files)}", highlight=False, soft_wrap=True)
    out.print(f"Look at it with: pdpatrol replay {folder}", highlight=False, soft_wrap=True)


def write_text(path: Path, text: str) -> None:
    """Write a text whole, or not at all."""
    temporary = path.with_name(path.name + ".tmp")
    temporary.write_text(text, encoding="utf-8")
    temporary.replace(path)


def tell_findings(report: dict[str, Any]) -> None:
    """What was found, or why nothing was, and what was detected and not confirmed."""
    from missions.record.pulse_counts import in_words
    from missions.record.tables import candidates_table, findings_table

    found = findings_table(report) if report["findings"] else in_words(report["pulses"])
    out.print(found, highlight=False, soft_wrap=not report["findings"])
    if report["candidates"]:
        out.print(candidates_table(report), highlight=False)


def tell_channel_faults(report: dict[str, Any]) -> None:
    """Say which channels of the receiver were found at fault."""
    for text in report["channel_faults"]:
        out.print(f"Receiver: {text}", highlight=False, style="yellow")


def tell_calibration(report: dict[str, Any]) -> None:
    """Say whether the pulses contradict the calibration that was taken up."""
    for text in report["calibration"]:
        out.print(f"Calibration: {text}", highlight=False, style="yellow")
