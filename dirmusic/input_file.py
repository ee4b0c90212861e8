"""Reading of input files, and the errors that it raises."""

import stat
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO


class InputFileError(ValueError):
    """Error for a file that cannot be used.

    Attributes:
        faults: One line for each error in the file: file, location, requirement and value found.
    """

    def __init__(self, faults: Sequence[str]) -> None:
        super().__init__("\n".join(faults))
        self.faults = tuple(faults)


class InputFileWarning(UserWarning):
    """Warning about an unusual file that can still be read."""


@contextmanager
def opened(path: Path, max_bytes: int) -> Generator[IO[bytes]]:
    """Open a regular file for reading.

    Raises:
        InputFileError: If the path is not a readable regular file, or the file is larger than `max_bytes`.
    """
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise InputFileError([f"{path}: cannot be read: must be a file, not a folder, device or pipe"])
        if status.st_size > max_bytes:
            size_mb = status.st_size / 1e6
            raise InputFileError([f"{path}: must have at most {max_bytes / 1e6:.0f} MB, has {size_mb:.1f} MB"])
        file = path.open("rb")
    except (OSError, ValueError) as error:  # a path with a zero byte raises ValueError
        if isinstance(error, InputFileError):
            raise
        reason = error.strerror if isinstance(error, OSError) else "invalid path"
        raise InputFileError([f"{path}: cannot be read: {reason}"]) from None
    with file:
        yield file


def read_whole(path: Path, max_bytes: int) -> bytes:
    """Read all bytes of a file.

    Raises:
        InputFileError: If the path is not a readable regular file, or the file is larger than `max_bytes`.
    """
    with opened(path, max_bytes) as file:
        try:
            return file.read()
        except OSError as error:
            raise InputFileError([f"{path}: cannot be read: {error.strerror}"]) from None


def read_lines(path: Path, max_bytes: int, errors: str = "strict") -> list[tuple[int, str]]:
    """Read the lines of a UTF-8 file that are neither empty nor comments, with their line numbers, from 1.

    Args:
        path: The file.
        max_bytes: Largest size of the file.
        errors: How bytes that are not UTF-8 are handled, as in `bytes.decode`.

    Raises:
        InputFileError: As `read_whole`, and if the file is not UTF-8 text.
    """
    try:
        text = read_whole(path, max_bytes).decode("utf-8-sig", errors)
    except UnicodeDecodeError as error:
        raise InputFileError([f"{path}: must be UTF-8 text, byte {error.start} is not"]) from None
    lines = enumerate(text.splitlines(), start=1)
    return [(number, line) for number, line in lines if line.strip(" ,;\t") and not line.lstrip().startswith("#")]


def delimiter_of(header: str) -> str:
    """Return the delimiter of a CSV table: a semicolon or a tab if the header has one, else a comma."""
    return next((mark for mark in ";\t" if mark in header), ",")
