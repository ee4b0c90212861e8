"""Terminal output, error exits and output folders of all commands."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from itertools import count
from pathlib import Path
from typing import NoReturn

from filelock import FileLock, Timeout
from rich.console import Console
from rich.progress import Progress

from pdpatrol.missions.cli.process import FAILED, USAGE_ERROR, one_line, print_error, wrapped

CLAIM, LOCK = ".claim", ".lock"
"""Files that reserve an output folder for one process; the lock ends with the process."""

out, err = (Console(stderr=to_stderr, markup=False, highlight=False, emoji=False) for to_stderr in (False, True))
"""Consoles without markup: text from a user's file is printed as it is."""


def refuse(*errors: str) -> NoReturn:
    """Print one line per input error and exit with status 2."""
    for error in errors:
        print_error(error)
    sys.exit(USAGE_ERROR)


def fail(error: str) -> NoReturn:
    """Print one line that says what this machine cannot do, and exit with status 1."""
    print_error(error)
    sys.exit(FAILED)


def say(line: str, console: Console = out, *, style: str = "", hanging: int = 0) -> None:
    """Print a line of text; a terminal shows it wrapped at spaces.

    Args:
        line: The text.
        console: Console to print to.
        style: Style of rich.
        hanging: Number of spaces before the second and later lines on a terminal.
    """
    console.print(wrapped(line, hanging) if console.is_terminal else line, style=style, soft_wrap=True)


def note(*texts: str) -> None:
    """Print notes on something unusual, one line each, on the standard error output."""
    for text in texts:
        say(f"note: {one_line(text)}", err, hanging=2)


def progress_bar() -> Progress:
    """Return a progress bar on the standard error output, which is shown on terminals only."""
    return Progress(console=err, transient=True, disable=not err.is_terminal)


def print_written(folder: Path, *names: str) -> None:
    """Print which files were written."""
    say(f"Written to {one_line(str(folder))}: {', '.join(names)}", hanging=2)


@contextmanager
def output_folder(given: Path | None, name: str, option: str = "--out") -> Iterator[Path]:
    """Reserve a new or empty folder for this process; remove it again if nothing is written to it.

    Args:
        given: Folder given by the user, if any.
        name: Name of the folder under runs/ otherwise; -2, -3 and so on are appended until it is new.
        option: Option that gives the folder, for error messages.
    """
    try:
        folder = given or _new_folder(name)
        is_new = given is None or not given.exists()
        folder.mkdir(parents=True, exist_ok=True)
        (folder / CLAIM).touch(exist_ok=False)
    except FileExistsError:
        refuse(f"{option}: {given} must be a new or empty folder, which no other command writes to")
    except (OSError, ValueError) as error:
        refuse(f"{option}: {given or 'runs'} cannot be written to ({getattr(error, 'strerror', error)})")
    try:
        if any(entry.name != CLAIM for entry in folder.iterdir()):
            refuse(f"{option}: {folder} must be a new or empty folder")
        yield folder
    finally:
        (folder / CLAIM).unlink(missing_ok=True)
        with suppress(OSError):
            if is_new:
                folder.rmdir()
            if given is None:
                folder.parent.rmdir()


@contextmanager
def continued_folder(given: Path | None, name: str, content: str) -> Iterator[Path]:
    """Reserve a folder as `output_folder` does, or one in which an earlier process has left a file to be continued.

    Args:
        given: Folder given by the user, if any.
        name: Name of the folder under runs/ otherwise.
        content: Name of the file that is continued.
    """
    is_continued = given is not None and (given / content).is_file()
    with nullcontext(given) if is_continued else output_folder(given, name) as folder:
        assert folder is not None
        lock = FileLock(folder / LOCK, timeout=0)
        try:
            lock.acquire()
        except Timeout:
            refuse(f"--out: {given} must be a folder to which no other command writes")
        try:
            yield folder
        finally:
            for name in (CLAIM, LOCK):  # the claim is that of a killed process, if the folder is continued
                (folder / name).unlink(missing_ok=True)
            lock.release()


def _new_folder(name: str) -> Path:
    """Make the next free folder under runs/."""
    for number in count(1):
        folder = Path("runs", name if number == 1 else f"{name}-{number}")
        with suppress(FileExistsError):
            folder.mkdir(parents=True)
            return folder
    raise AssertionError
