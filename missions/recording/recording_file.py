"""Recordings from disk: whether a file is one, before a viewer or a server is started on it."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

from rerun.chunk import RrdReader

from dirmusic import InputFileError
from dirmusic.input_file import opened

MOST_BYTES = 16 * 10**9
"""Largest recording that is shown (assumed)."""

MAGIC, END = b"RRF2", b"RRF2FOOT"
"""First bytes of a recording, and those four bytes before its end."""


def check_recording(path: Path) -> None:
    """Read a recording through.

    Raises:
        InputFileError: If it cannot be read, is no recording, or is damaged or cut short.
    """
    with opened(path, MOST_BYTES) as file:
        begin = file.read(len(MAGIC))
        file.seek(0, os.SEEK_END)
        file.seek(max(file.tell() - len(END) - 4, 0))
        end = file.read(len(END))
    if begin != MAGIC:
        raise InputFileError([f"{path}: is {'no recording' if begin else 'empty'}; {MEND}"])
    if end != END:
        raise InputFileError([f"{path}: is cut short; {MEND}"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # of a file without its end
        try:
            for _ in RrdReader(path).stream():
                pass
        except (RuntimeError, ValueError, OSError, Warning):
            raise InputFileError([f"{path}: is damaged; {MEND}"]) from None


MEND = "remove it, and replay makes it again from the log"
