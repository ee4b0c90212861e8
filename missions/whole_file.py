"""Files that are there whole or not at all, whatever ends the process that writes them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_unfinished: set[Path] = set()


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A new file beside `path`, to be written and closed in the block, which takes its name when that ends well.

    It is on the disk before it takes the name, so that a loss of power leaves what was there before, or all of it.
    After an error it is removed.

    Args:
        path: Of the file that is to be; replaced where it exists.

    Raises:
        OSError: If it cannot be written; it names `path`.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    _unfinished.add(temporary)
    try:
        yield temporary
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        if error.filename == str(temporary):
            error.filename = str(path)  # the name that whoever reads the message knows
        raise
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        _unfinished.discard(temporary)


def write_whole(path: Path, text: str) -> None:
    """Write a text, as UTF-8, whole or not at all.

    Raises:
        OSError: If it cannot be written.
    """
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def remove_unfinished() -> None:
    """Remove what is being written: for a process that must end at once, with its other threads still at work."""
    for path in tuple(_unfinished):
        with suppress(OSError):
            path.unlink(missing_ok=True)
