"""Folders for output: each is claimed by one process before anything slow, and never written twice."""

from __future__ import annotations

import fcntl
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import NoReturn

from pdpatrol.missions.cli.endings.interrupts import clean_up_by
from pdpatrol.missions.cli.output.terminal import refuse

CLAIM = ".claim"
"""File by which a process claims a folder; locked for as long as it lives."""


@contextmanager
def output_folder(given: Path | None, name: str, option: str = "--out") -> Iterator[Path]:
    """A folder that holds nothing yet, for this process alone: the one given, or the next free one under runs/.

    What was not there before is removed again if nothing was written to it.

    Args:
        given: By the user, if any.
        name: Of the folder under runs/, where none is given.
        option: By which it is given, for refusals.
    """
    folder, made = _next_free(name, option) if given is None else (given, _make(given, option))

    def release() -> None:
        (folder / CLAIM).unlink(missing_ok=True)
        with suppress(OSError):
            for each in made:
                each.rmdir()

    claim = _claim(folder, option, release)
    clean_up_by(release)
    try:
        _refuse_what_is_not_empty(folder, option)
        yield folder
    finally:
        release()
        os.close(claim)


def _next_free(name: str, option: str) -> tuple[Path, list[Path]]:
    folder, count = Path("runs") / name, 1
    while not (made := _make(folder, option)):
        count += 1
        folder = Path("runs") / f"{name}-{count}"
    return folder, made


def _make(folder: Path, option: str) -> list[Path]:
    """Make a folder; it and those above it that were not there before, the innermost first."""
    try:
        made = [each for each in (folder, *folder.parents) if not each.exists()]
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir()
    except FileExistsError:
        if not folder.is_dir():
            refuse(f"{option}: {folder} is a file, or in one; allowed is a new or an empty folder")
        return []
    except (OSError, ValueError) as error:
        _refuse_what_cannot_be_written(folder, option, error)
    return made


def _claim(folder: Path, option: str, release: Callable[[], None]) -> int:
    """File descriptor of the claim on a folder, which is held as long as that is open; released where it fails."""
    try:
        claim = os.open(folder / CLAIM, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o644)
        fcntl.flock(claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
        now = datetime.now().astimezone().isoformat(timespec="seconds")
        os.write(claim, f"process {os.getpid()}, since {now}: {' '.join(sys.argv[1:])}\n".encode(errors="replace"))
    except FileExistsError:
        _refuse_what_is_claimed(folder, option)
    except OSError as error:
        release()
        _refuse_what_cannot_be_written(folder, option, error)
    return claim


def _refuse_what_is_claimed(folder: Path, option: str) -> NoReturn:
    who, is_alive = "", True
    with suppress(OSError), (folder / CLAIM).open("rb") as file:
        who = file.readline(200).decode(errors="replace").strip()
        with suppress(BlockingIOError):
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
            is_alive = False
    by = f" ({who})" if who else ""
    if is_alive:
        refuse(f"{option}: {folder} is being written to{by}; allowed is a new or an empty folder")
    refuse(f"{option}: {folder} was left by a command that was cut off{by}; allowed is a new or an empty folder")


def _refuse_what_is_not_empty(folder: Path, option: str) -> None:
    if any(entry.name != CLAIM for entry in folder.iterdir()):
        refuse(f"{option}: {folder} is not empty; allowed is a new or an empty folder")


def _refuse_what_cannot_be_written(folder: Path, option: str, error: Exception) -> NoReturn:
    why = getattr(error, "strerror", None) or str(error)
    refuse(f"{option}: {folder} cannot be written to ({why}); allowed is a folder that can")
