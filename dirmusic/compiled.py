"""Compilation of inner loops with Numba, and the folder in which the machine code is kept.

Kernels loop over elements, paths and samples one by one and in one order, so that the result of a row does not depend,
to the bit, on the number of rows.
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
from numpy.typing import NDArray

_Function = TypeVar("_Function", bound=Callable[..., object])
_Value = TypeVar("_Value")

KERNEL_PACKAGES = ("dirmusic", "pdpatrol/sensing", "pdpatrol/envs", "pdpatrol/robot_models")
"""Packages with compiled functions, relative to the folder that holds this one."""

KEPT_VERSIONS = 4
"""Versions of the source whose machine code is kept, 20 MB each. Assumed; more only avoid compiling old ones again."""

COMPLETE = "complete"
"""Name of the file that marks a cache folder in which all functions of a mission are kept."""


def source_digest() -> str:
    """Return 16 hexadecimal digits that change with any source file of the packages that have compiled functions.

    Code with bounds checks (`NUMBA_BOUNDSCHECK=1`) has another digest.
    """
    root = Path(__file__).parents[1]
    digest = hashlib.sha256(f"{numba.config.BOUNDSCHECK}".encode())  # pyright: ignore
    for package in KERNEL_PACKAGES:
        for file in sorted((root / package).rglob("*.py")):
            digest.update(f"{file.relative_to(root).as_posix()}\0{file.stat().st_size}\0".encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


@cache
def cache_folder() -> Path | None:
    """Return the folder for machine code, or None with a warning where none can be written.

    If the user has set `NUMBA_CACHE_DIR`, that folder is used. Otherwise the folder lies in the user's cache directory,
    or else in a private folder of the directory for temporary files, and is named by the digest of the source: Numba
    notices a change in the file of a function, but not in the functions and constants of other files that it uses.
    """
    if numba.config.CACHE_DIR:  # pyright: ignore
        return Path(numba.config.CACHE_DIR)  # pyright: ignore
    home, digest = Path.home() / ("Library/Caches" if sys.platform == "darwin" else ".cache"), source_digest()
    usual = Path(os.environ.get("XDG_CACHE_HOME") or home) / "pdpatrol"
    for base in (usual, Path(tempfile.gettempdir()) / f"pdpatrol-{os.getuid()}"):
        with suppress(OSError):
            base.mkdir(mode=0o700, parents=True, exist_ok=True)
            if base.lstat().st_uid != os.getuid():  # in the directory for temporary files, anybody may have made it
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
    """Remove the machine code of all but the most recently used versions of the source."""
    with suppress(OSError):  # another process may remove the same
        folders = sorted(base.iterdir(), key=lambda folder: folder.stat().st_mtime)
        for folder in folders[:-KEPT_VERSIONS]:
            shutil.rmtree(folder, ignore_errors=True)


def is_cache_complete() -> bool:
    """Return True if nothing remains to be compiled: after `mark_cache_complete`, or with `NUMBA_DISABLE_JIT=1`."""
    if numba.config.DISABLE_JIT:  # pyright: ignore
        return True
    folder = cache_folder()
    return folder is not None and (folder / COMPLETE).exists()


def mark_cache_complete() -> None:
    """Note in the cache folder that all functions of a mission have been compiled and kept."""
    if folder := cache_folder():
        (folder / COMPLETE).touch()


@contextmanager
def _own_cache() -> Generator[bool]:
    """Let Numba use `cache_folder` for functions decorated in the block; other functions are not affected."""
    folder, before = cache_folder(), numba.config.CACHE_DIR  # pyright: ignore
    numba.config.CACHE_DIR = str(folder or "")  # pyright: ignore
    try:
        yield folder is not None
    finally:
        numba.config.CACHE_DIR = before  # pyright: ignore


def compiled(function: _Function, **options: bool) -> _Function:
    """Compile a function at its first call and keep the machine code on disk."""
    with _own_cache() as keep:
        compile_it: Any = numba.njit(cache=keep, nogil=True, error_model="numpy", **options)  # pyright: ignore
        return cast("_Function", compile_it(function))


def compiled_inner(function: _Function) -> _Function:
    """Compile a function that only compiled functions call: without an entry from Python, in a sixth less time."""
    return compiled(function, no_cpython_wrapper=True)


def elementwise(function: Callable[..., float]) -> Callable[..., NDArray[np.float64]]:
    """Compile a function of numbers to a NumPy ufunc, which other compiled functions may call as well."""
    if numba.config.DISABLE_JIT:  # pyright: ignore
        return np.vectorize(function, otypes=[np.float64])
    with _own_cache() as keep:
        return cast("Callable[..., NDArray[np.float64]]", numba.vectorize(cache=keep)(function))  # pyright: ignore


@structref.register  # pyright: ignore[reportUnknownMemberType]
class _HeldType(types.StructRef):
    """Numba type of `Held`."""

    def preprocess_fields(self, fields: Any) -> Any:  # noqa: ANN401
        """Drop literal types, so that one specialisation serves all values."""
        return tuple((name, types.unliteral(of)) for name, of in fields)  # pyright: ignore


class Held(structref.StructRefProxy, Generic[_Value]):
    """A record that compiled functions take by reference.

    Numba unpacks a plain named tuple at each call: 0.1 us for each array, 7 us for a random generator. Without this
    class, an environment step of one robot in `one_source` takes 2.7 times as long (median of five runs in turns).

    Attributes:
        value: The named tuple or generator, in Python and in compiled functions.
    """

    value: _Value

    def __new__(cls, value: _Value) -> Self:
        """Hold a value; without compilation in a plain object."""
        held = object.__new__(cls) if numba.config.DISABLE_JIT else _hold(value)  # pyright: ignore
        held.value = value
        return held

    def __reduce__(self) -> tuple[type[Held[_Value]], tuple[_Value]]:
        return Held, (self.value,)


structref.define_boxing(_HeldType, Held)  # pyright: ignore[reportUnknownMemberType]
structref.define_constructor(Held, _HeldType, ["value"])  # pyright: ignore[reportUnknownMemberType]


@compiled
def _hold(value: Any) -> Any:  # noqa: ANN401
    """Construct a `Held` value in compiled code, where the constructor is kept on disk."""
    return Held(value)
