"""Recordings on disk: whether a file is one that this Rerun wrote; where it is not, it is made anew from the log."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from pathlib import Path

import rerun as rr
from rerun.chunk import RrdReader

from dirmusic import InputFileError
from dirmusic.input_file import opened
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording.recorder import write_recording

RECORDING = "mission.rrd"
"""In the folder of a mission."""

MOST_BYTES = 16 * 10**9
"""Largest recording that is shown (assumed)."""

MAGIC, END = b"RRF2", b"RRF2FOOT"
"""First bytes of a recording, and those four bytes before its end."""

OWN_VERSION = tuple(int(number) for number in rr.__version__.split("+")[0].split("-")[0].split("."))
"""Of the Rerun that is installed; in a recording one byte each, after its first four."""


def ready_recording(folder: Path, tell: Callable[[str], None]) -> Path:
    """The recording of a mission, made from its log where there is none, a damaged one, or one of another Rerun.

    Args:
        folder: Of the mission.
        tell: Called with the reason, in one line, where a recording that is there is made anew.

    Raises:
        InputFileError: If neither the recording nor the log can be made use of.
        FileNotFoundError: If the folder holds neither.
        OSError: If the recording cannot be written.
    """
    path = folder / RECORDING
    fault = None
    if path.exists():
        try:
            check_recording(path)
        except InputFileError as error:
            (fault,) = error.faults
        else:
            return path
    try:
        log = MissionLog.load(folder)
    except FileNotFoundError:
        if fault is None:
            raise
        raise InputFileError([f"{fault}; there is no log beside it to make it anew from"]) from None
    except ValueError as error:
        raise InputFileError([str(error)]) from None
    if fault is not None:
        tell(f"{fault}; it is made anew from the log")
    try:
        write_recording(log, path)
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError):
        fault = f"{folder}: the facts in its log are damaged; give the folder that `pdpatrol run` wrote"
        raise InputFileError([fault]) from None
    return path


def check_recording(path: Path) -> None:
    """Read a recording through.

    Raises:
        InputFileError: If it cannot be read, is no recording, is damaged or cut short, or of another Rerun.
    """
    with opened(path, MOST_BYTES) as file:
        begin, written_by = file.read(len(MAGIC)), tuple(file.read(3))
        file.seek(0, os.SEEK_END)
        file.seek(max(file.tell() - len(END) - 4, 0))
        end = file.read(len(END))
    if begin != MAGIC:
        raise InputFileError([f"{path}: is {'no recording' if begin else 'empty'}"])
    if len(written_by) == len(OWN_VERSION) and written_by != OWN_VERSION:
        raise InputFileError(
            [f"{path}: was written by Rerun {'.'.join(map(str, written_by))}, and this is Rerun {rr.__version__}"]
        )
    if end != END:
        raise InputFileError([f"{path}: is cut short"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # of a file without its end
        try:
            for _ in RrdReader(path).stream():
                pass
        except (RuntimeError, ValueError, OSError, Warning):
            raise InputFileError([f"{path}: is damaged"]) from None
