"""Lines of text as they arrive: from a growing file, a folder, standard input, or a socket of this machine.

Each source is a generator that yields the complete lines that arrived, at least every `POLL_S`, or an empty list.
It ends when the source cannot give more.
"""

import os
import re
import select
import socket
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO

from dirmusic import InputFileError

POLL_S = 0.1
"""Time between two looks at a source without new lines. Assumed; a tenth of the longest delay that is accepted."""

PIECE_BYTES = 2**16
"""Largest number of bytes that are read at a time: about 500 records of six channels."""

MAX_LINE_BYTES = 2**16
"""Length from which on a line without an end is left out. Assumed; 32 channels take 1 kB."""

SUFFIXES = (".csv", ".txt", ".json", ".jsonl")
"""Suffixes of files of a folder that hold records."""

LOOPBACK = "127.0.0.1"
"""Only address at which records are received."""

Report = Callable[[str], None]
"""Function that is given one line on something unusual."""

IsOver = Callable[[], bool]
"""Function that returns true when no more data are waited for."""


class LineBuffer:
    """Splits bytes into lines, whatever the sizes of the pieces.

    Args:
        report: Called with a line on anything that is left out.
    """

    def __init__(self, report: Report) -> None:
        self._report = report
        self._rest = b""

    def add(self, data: bytes) -> list[str]:
        """Return the lines that are complete with the next bytes."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > MAX_LINE_BYTES:
            self._report(f"a line of more than {MAX_LINE_BYTES} bytes: left out")
            self._rest = b""
        return [line.decode("utf-8-sig", errors="replace") for line in lines]

    def end(self) -> list[str]:
        """Return the last line if it is a complete JSON object; report any other without an end, and leave it out."""
        last, self._rest = self._rest.decode("utf-8", errors="replace").strip(), b""
        if last.startswith("{") and last.endswith("}"):
            return [last]
        if last:
            self._report(f"last line has no end and may be torn: left out: {last:.60}")
        return []


def open_source(text: str, report: Report, is_over: IsOver) -> Iterator[list[str]]:
    """Return the lines of a source.

    Args:
        text: A file or folder; `-` for standard input; 127.0.0.1:PORT to receive from a socket.
        report: Called with a line on anything that is unusual.
        is_over: Called while no data arrive; the source ends when it returns true.

    Raises:
        InputFileError: If it cannot be opened.
        OSError: If the port is in use.
    """
    if text == "-":
        return _pieces(sys.stdin.fileno(), report, is_over)
    path = Path(text)
    if not path.exists() and (address := re.fullmatch(r"([^/]*):(\d+)", text)):
        host, port = address[1], int(address[2])
        if host != LOOPBACK or not 0 < port < 65536:
            raise InputFileError([f"{text}: a socket must be {LOOPBACK}:PORT, with a port from 1 to 65535"])
        return _senders(socket.create_server((LOOPBACK, port)), report, is_over)
    if path.is_dir():
        return _folder(path, report, is_over)
    if not path.exists() and not path.parent.is_dir():
        raise InputFileError([f"{text}: cannot be read: no such file or folder"])
    return _file(path, report, is_over)


def _file(path: Path, report: Report, is_over: IsOver) -> Iterator[list[str]]:
    """Follow a file; if it is replaced or cut, start again."""
    file: IO[bytes] | None = None
    buffer = LineBuffer(report)
    if not path.exists():
        report(f"{path}: does not exist yet: waiting for it")
    try:
        while True:
            may_end = is_over()  # before the read, so that all is read that was written until then
            if file is not None and _is_other(file, path):
                report(f"{path}: was replaced or cut: read from its start")
                buffer.end()
                file.close()
                file = None
            if file is None and path.exists():
                file = path.open("rb")
            if data := file.read(PIECE_BYTES) if file is not None else b"":
                yield buffer.add(data)
            elif may_end:
                yield buffer.end()
                return
            else:
                time.sleep(POLL_S)
                yield []
    finally:
        buffer.end()
        if file is not None:
            file.close()


def _is_other(file: IO[bytes], path: Path) -> bool:
    """Test whether a path has become another file, or the file is shorter than the part read so far."""
    try:
        now, opened = path.stat(), os.fstat(file.fileno())
    except FileNotFoundError:
        return False  # it is being replaced
    return (now.st_ino, now.st_dev) != (opened.st_ino, opened.st_dev) or now.st_size < file.tell()


def _folder(path: Path, report: Report, is_over: IsOver) -> Iterator[list[str]]:
    """Follow the files of a folder in the order of their names; a file ends when a later one exists."""
    read = ""

    def has_later() -> bool:
        return any(name > read for name in _file_names(path))

    while not is_over() or has_later():
        if later := sorted(name for name in _file_names(path) if name > read):
            read = later[0]
            yield from _file(path / read, report, lambda: is_over() or has_later())
        else:
            time.sleep(POLL_S)
            yield []


def _file_names(folder: Path) -> list[str]:
    """Return the names of the files with records, which are not hidden."""
    return [each.name for each in folder.glob("[!.]*") if each.suffix.lower() in SUFFIXES and each.is_file()]


def _senders(server: socket.socket, report: Report, is_over: IsOver) -> Iterator[list[str]]:
    """Receive from one sender after another."""
    with server:
        while True:
            if select.select([server], [], [], POLL_S)[0]:
                sender, _ = server.accept()
                with sender:
                    yield from _pieces(sender.fileno(), report, is_over)
            elif is_over():
                return
            else:
                yield []


def _pieces(file: int, report: Report, is_over: IsOver) -> Iterator[list[str]]:
    """Read a pipe or a connection up to its end."""
    buffer = LineBuffer(report)
    try:
        while True:
            if select.select([file], [], [], POLL_S)[0]:
                if not (data := _read(file)):
                    break
                yield buffer.add(data)
            elif is_over():
                break
            else:
                yield []
        yield buffer.end()
    finally:
        buffer.end()


def _read(file: int) -> bytes:
    """Return the next bytes; none at the end, or if the sender was killed."""
    try:
        return os.read(file, PIECE_BYTES)
    except ConnectionError:
        return b""
