"""Files from outside: what can be wrong with any of them, and text files."""

from __future__ import annotations

import stat
import warnings
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO

MOST_BYTES = 256 * 10**6
"""Largest text file that is read (assumed): a table of three million pulses."""

FOREIGN = {
    b"PK\x03\x04": "a ZIP archive or a workbook",
    b"\x1f\x8b": "a compressed file",
    b"\xff\xfe": "UTF-16, no UTF-8",
    b"\xfe\xff": "UTF-16, no UTF-8",
    b"\xd0\xcf\x11\xe0": "a workbook",
    b"\x93NUMPY": "an array of NumPy",
}
"""First bytes of files that are taken for text files."""


class InputFileError(ValueError):
    """A file that cannot be used; one line per fault, each with file, place, what came and what is allowed."""

    def __init__(self, faults: Sequence[str]) -> None:
        super().__init__("\n".join(faults))
        self.faults = tuple(faults)


class InputFileWarning(UserWarning):
    """Something unusual about a file, which could be read all the same."""


def read_text(path: Path) -> str:
    """UTF-8 text of a file, without a byte-order mark.

    Raises:
        InputFileError: If it cannot be read, is too large, or is no such text.
    """
    data = read_whole(path, MOST_BYTES)
    kind = next((kind for begin, kind in FOREIGN.items() if data.startswith(begin)), None)
    if kind is not None:
        raise InputFileError([f"{path}: is {kind}; allowed is a UTF-8 text file"])
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputFileError([f"{path}: byte {error.start} is no UTF-8; allowed is a UTF-8 text file"]) from None
    if "\0" in text:
        raise InputFileError([f"{path}: holds zero bytes; allowed is a UTF-8 text file"])
    if data.startswith(b"\xef\xbb\xbf"):
        warnings.warn(f"{path}: begins with a byte-order mark, which is skipped", InputFileWarning, stacklevel=3)
    return text


@contextmanager
def opened(path: Path, most_bytes: int) -> Generator[IO[bytes]]:
    """A file that is no larger than so many bytes, for reading.

    Raises:
        InputFileError: If it cannot be read, is no file but a folder, a device or a pipe, or is too large.
    """
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode):
            kind = "a folder" if stat.S_ISDIR(found.st_mode) else "a device or a pipe"
            raise InputFileError([f"{path}: cannot be read (is {kind}); allowed is a file"])
        if found.st_size > most_bytes:
            came, most = found.st_size / 1e6, most_bytes / 1e6
            raise InputFileError([f"{path}: has {came:.1f} MB; allowed are up to {most:.0f} MB"])
        file = path.open("rb")
    except (OSError, ValueError) as error:  # a path with a zero byte is a ValueError
        if isinstance(error, InputFileError):
            raise
        why = error.strerror if isinstance(error, OSError) else "it is no path"
        raise InputFileError([f"{path}: cannot be read ({why})"]) from None
    with file:
        yield file


def read_whole(path: Path, most_bytes: int) -> bytes:
    """Content of a file that is no larger than so many bytes.

    Raises:
        InputFileError: As of `opened`.
    """
    with opened(path, most_bytes) as file:
        try:
            return file.read()
        except OSError as error:
            raise InputFileError([f"{path}: cannot be read ({error.strerror})"]) from None
