"""Compilation of inner loops with Numba, and the folder in which machine code is cached.

Compiled functions loop over elements, paths and samples one by one and in a fixed order, so that the result of a row is
bit-identical for any number of rows.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import tempfile
import warnings
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, Generic, Self, TypeVar, cast

import numba
import numpy as np
from numba import types
from numba.experimental import structref

from dirmusic.arrays import FloatArray

_Function = TypeVar("_Function", bound=Callable[..., object])
_Value = TypeVar("_Value")

KERNEL_PACKAGES = (
    "dirmusic",
    "pdpatrol/sensing",
    "pdpatrol/envs",
    "pdpatrol/robot_models",
    "pdpatrol/missions/driving",
    "pdpatrol/missions/planning",
)
"""Packages with compiled functions, relative to the parent folder of this package."""

KEPT_VERSIONS = 4
"""Number of source versions whose machine code is cached, 20 MB each. Assumed; a larger number only avoids recompiling
old versions."""

COMPLETE = "complete"
"""Name of the file that marks a cache folder as holding all functions that a mission needs."""


def source_digest() -> str:
    """Hash all source files of the packages with compiled functions, as 16 hexadecimal digits.

    It covers paths and times of modification too, because Numba compiles a file anew when they differ, as in another
    checkout. With bounds checks (`NUMBA_BOUNDSCHECK=1`), the digest is different.
    """
    root = Path(__file__).parents[1]
    digest = hashlib.sha256(f"{numba.config.BOUNDSCHECK}".encode())  # pyright: ignore
    for package in KERNEL_PACKAGES:
        for file in sorted((root / package).rglob("*.py")):
            digest.update(f"{file}\0{file.stat().st_size}\0{file.stat().st_mtime_ns}\0".encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


@cache
def cache_folder() -> Path | None:
    """Return the folder for cached machine code, or warn and return None if no folder is writable.

    If the user has set `NUMBA_CACHE_DIR`, that folder is used. Otherwise the folder is in the user's cache directory
    or, if that is not writable, in a private folder of the temporary directory. It is named after the digest of the
    source, because Numba detects a change in the file of a function, but not in functions and constants that it uses
    from other files.
    """
    if numba.config.CACHE_DIR:  # pyright: ignore
        return Path(numba.config.CACHE_DIR)  # pyright: ignore
    home, digest = Path.home() / ("Library/Caches" if sys.platform == "darwin" else ".cache"), source_digest()
    usual = Path(os.environ.get("XDG_CACHE_HOME") or home) / "pdpatrol"
    for base in (usual, Path(tempfile.gettempdir()) / f"pdpatrol-{os.getuid()}"):
        with suppress(OSError):
            base.mkdir(mode=0o700, parents=True, exist_ok=True)
            if base.lstat().st_uid != os.getuid():  # in the temporary directory, any user may have created it
                continue
            folder = base / digest
            folder.mkdir(exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                os.utime(folder)
            _remove_old(base)
            return folder
    warnings.warn(
        f"compiled functions cannot be kept in {usual}: each process compiles them anew, for about a minute",
        RuntimeWarning,
        stacklevel=2,
    )
    return None


def _remove_old(base: Path) -> None:
    """Remove the machine code of all but the most recently used source versions."""
    with suppress(OSError):  # another process may remove the same folder
        folders = sorted(base.iterdir(), key=lambda folder: folder.stat().st_mtime)
        for folder in folders[:-KEPT_VERSIONS]:
            shutil.rmtree(folder, ignore_errors=True)


def is_cache_complete() -> bool:
    """Return whether nothing remains to be compiled: after `mark_cache_complete`, or with `NUMBA_DISABLE_JIT=1`."""
    if numba.config.DISABLE_JIT:  # pyright: ignore
        return True
    folder = cache_folder()
    return folder is not None and (folder / COMPLETE).exists()


def mark_cache_complete() -> None:
    """Mark the cache folder as holding all functions that a mission needs."""
    if folder := cache_folder():
        (folder / COMPLETE).touch()


@contextmanager
def _own_cache() -> Generator[bool]:
    """Make Numba use `cache_folder` for functions that are decorated within the `with` block, and for no others."""
    folder, before = cache_folder(), numba.config.CACHE_DIR  # pyright: ignore
    numba.config.CACHE_DIR = str(folder or "")  # pyright: ignore
    try:
        yield folder is not None
    finally:
        numba.config.CACHE_DIR = before  # pyright: ignore


def compiled(function: _Function, **options: bool) -> _Function:
    """Compile a function at its first call and cache the machine code on disk."""
    with _own_cache() as keep:
        compile_it: Any = numba.njit(cache=keep, nogil=True, error_model="numpy", **options)  # pyright: ignore
        return cast("_Function", compile_it(function))


def compiled_inner(function: _Function) -> _Function:
    """Compile a function that only compiled functions call.

    Without a wrapper for calls from Python, compilation takes a sixth less time.
    """
    return compiled(function, no_cpython_wrapper=True)


def elementwise(function: Callable[..., float]) -> Callable[..., FloatArray]:
    """Compile a function of scalars to a NumPy ufunc, which other compiled functions can call too."""
    if numba.config.DISABLE_JIT:  # pyright: ignore
        return np.vectorize(function, otypes=[np.float64])
    with _own_cache() as keep:
        return cast("Callable[..., FloatArray]", numba.vectorize(cache=keep)(function))  # pyright: ignore


@structref.register  # pyright: ignore[reportUnknownMemberType]
class _HeldType(types.StructRef):
    """Numba type of `Held`."""

    def preprocess_fields(self, fields: Any) -> Any:  # noqa: ANN401
        """Replace literal types by their general types, so that one specialisation serves all values."""
        return tuple((name, types.unliteral(of)) for name, of in fields)  # pyright: ignore


class Held(structref.StructRefProxy, Generic[_Value]):
    """Wrapper that lets compiled functions take a record by reference.

    Numba unpacks a plain named tuple at each call, which takes 0.1 us per array and 7 us per random generator. Without
    this class, an environment step of one robot in `one_source` takes 2.7 times as long (median of five alternating
    runs).

    Attributes:
        value: The wrapped named tuple or generator, accessible in Python and in compiled functions.
    """

    value: _Value

    def __new__(cls, value: _Value) -> Self:
        """Wrap a value; if compilation is disabled, in a plain object."""
        held = object.__new__(cls) if numba.config.DISABLE_JIT else _hold(value)  # pyright: ignore
        held.value = value
        return held

    def __reduce__(self) -> tuple[type[Held[_Value]], tuple[_Value]]:
        return Held, (self.value,)


structref.define_boxing(_HeldType, Held)  # pyright: ignore[reportUnknownMemberType]
structref.define_constructor(Held, _HeldType, ["value"])  # pyright: ignore[reportUnknownMemberType]


@compiled
def _hold(value: Any) -> Any:  # noqa: ANN401
    """Construct a `Held` in compiled code, so that its constructor is cached on disk."""
    return Held(value)
