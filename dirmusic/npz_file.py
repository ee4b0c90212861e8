"""Arrays from .npz archives that others wrote: every array is judged by its header before it takes any memory."""

from __future__ import annotations

import math
import tokenize
import warnings
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any
from zipfile import ZIP_DEFLATED, ZIP_STORED, BadZipFile, ZipFile, ZipInfo

from numpy.lib import format as npy
from numpy.typing import NDArray

from dirmusic.input_file import opened

MOST_ARRAYS = 1000
"""Of one archive (assumed)."""

IS_ENCRYPTED = 0x1
"""Bit of a member's flags."""

ALLOWED = "allowed is an .npz archive, whole and not encrypted"

DAMAGE = (
    ArithmeticError,
    AttributeError,
    BadZipFile,
    EOFError,
    LookupError,
    MemoryError,
    NotImplementedError,
    OSError,
    RuntimeError,
    SyntaxError,
    TypeError,
    ValueError,
    Warning,
    tokenize.TokenError,
    zlib.error,
)
"""What the readers of archives and of headers raise, each for other wrong bytes."""


class NpzError(ValueError):
    """An archive that cannot be used; one line, without the name of the file."""


def read_npz(
    path: Path, needed: Sequence[str], more: Sequence[str] = (), *, most_bytes: int
) -> dict[str, NDArray[Any]]:
    """Arrays of an archive, by name.

    Args:
        path: The archive.
        needed: Names of arrays that have to be there.
        more: Names of arrays that may be there.
        most_bytes: Memory that these arrays may take together, and the file for itself.

    Raises:
        NpzError: If it is no such archive, is damaged, encrypted or too large, or lacks an array.
        InputFileError: If it cannot be read.
    """
    if not path.exists():
        raise NpzError("no such file")
    with opened(path, most_bytes) as file:
        begin = file.read(len(npy.MAGIC_PREFIX))
        if not begin.startswith(b"PK"):
            kind = "a single array" if begin == npy.MAGIC_PREFIX else "empty" if not begin else "no archive"
            raise NpzError(f"is {kind}; {ALLOWED}")
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # headers of old versions
            try:
                return _read(file, needed, more, most_bytes)
            except NpzError:
                raise
            except DAMAGE:
                raise NpzError(f"cannot be read (damaged or cut short); {ALLOWED}") from None


def _read(file: IO[bytes], needed: Sequence[str], more: Sequence[str], most_bytes: int) -> dict[str, NDArray[Any]]:
    with ZipFile(file) as archive:
        members = {member.filename.removesuffix(".npy"): member for member in archive.infolist()}
        if len(members) > MOST_ARRAYS:
            raise NpzError(f"holds {len(members)} arrays; allowed are up to {MOST_ARRAYS}")
        missing = [name for name in needed if name not in members]
        if missing:
            held = ", ".join(members) or "nothing"
            raise NpzError(f"no array {', '.join(missing)}; it holds {held:.200}")
        arrays: dict[str, NDArray[Any]] = {}
        for name in (*needed, *(name for name in more if name in members)):
            arrays[name] = _read_array(archive, members[name], name, most_bytes)
            most_bytes -= arrays[name].nbytes
        return arrays


def _read_array(archive: ZipFile, member: ZipInfo, name: str, most_bytes: int) -> NDArray[Any]:
    """One array; what its header and the archive say of its size has to agree before it is read."""
    if member.flag_bits & IS_ENCRYPTED:
        raise NpzError(f"{name}: is encrypted; {ALLOWED}")
    if member.compress_type not in (ZIP_STORED, ZIP_DEFLATED):
        raise NpzError(f"{name}: is compressed in another way than NumPy does; {ALLOWED}")
    with archive.open(member) as file:
        version = npy.read_magic(file)
        if version not in ((1, 0), (2, 0)):
            raise NpzError(
                f"{name}: is of another format of arrays, {version[0]}.{version[1]}; allowed are 1.0 and 2.0"
            )
        read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, _, dtype = read_header(file)
        if dtype.hasobject:
            raise NpzError(f"{name}: holds a pickle, which is not read; allowed are plain numbers")
        n_bytes = math.prod(shape) * dtype.itemsize
        if n_bytes > most_bytes:
            raise NpzError(
                f"{name}: shape {_shown(shape)} of {dtype} takes {n_bytes / 1e6:.6g} MB; allowed are up to "
                f"{most_bytes / 1e6:.0f} MB"
            )
        if min(shape, default=0) < 0 or member.file_size != file.tell() + n_bytes:
            raise NpzError(
                f"{name}: shape {_shown(shape)} of {dtype} does not fit the {member.file_size} bytes that are there"
            )
    with archive.open(member) as file:
        return npy.read_array(file, allow_pickle=False)


def _shown(shape: tuple[int, ...]) -> str:
    text = str(tuple(shape))
    return text if len(text) <= 60 else text[:57] + "..."
