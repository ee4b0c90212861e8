"""Inner loops that are compiled: over elements, paths and samples, where numpy would need a call for each line."""

from __future__ import annotations

import gc
import os
import tempfile
import time
import warnings
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager
from functools import update_wrapper
from pathlib import Path
from types import FunctionType
from typing import Any, Generic, Self, TypeVar, cast

import numba
import numpy as np
from numba.core import config, event, types
from numba.core.types import StructRef
from numba.experimental import structref
from numba.typed import List
from numpy.typing import NDArray

from dirmusic.compile_cache import KeptByContent
from dirmusic.compiler import Callee, CompilerForOthers

_Function = TypeVar("_Function", bound=Callable[..., object])
_Value = TypeVar("_Value")


class CacheWarning(UserWarning):
    """Compiled functions are not kept where they should be."""


def _can_write(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _finds_cache() -> bool:
    """Whether compiled functions can be kept: where the compiler does, or else in the folder for temporary files."""
    usual = Path(__file__).parent / "__pycache__", Path("~/.cache/numba").expanduser()
    if os.environ.get("NUMBA_CACHE_DIR") or any(_can_write(folder) for folder in usual):
        return True
    try:
        elsewhere = Path(tempfile.gettempdir()) / f"pdpatrol-compiled-{os.getuid()}"
        is_found = _can_write(elsewhere)
    except OSError:  # no place for temporary files either
        elsewhere, is_found = usual[0], False
    told = f"they are kept in {elsewhere}" if is_found else "each command compiles them anew, for half a minute or so"
    warnings.warn(f"compiled functions cannot be kept in {usual[0]} or {usual[1]}: {told}", CacheWarning, stacklevel=2)
    if is_found:
        os.environ["NUMBA_CACHE_DIR"] = str(elsewhere)
        config.reload_config()  # pyright: ignore
    return is_found


_CACHE = _finds_cache()
_OPTIONS = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


class _Compiled:
    """A function as machine code: for Python, and for other compiled functions, each from its first call on.

    Most functions are called by compiled ones alone, for whom much of the compiler's work is not needed: no way in from
    Python, no machine code before it is theirs.
    """

    def __init__(self, function: FunctionType) -> None:
        update_wrapper(self, function)
        self._name = function.__qualname__
        inner = FunctionType(function.__code__, function.__globals__, function.__name__, function.__defaults__)
        inner.__module__, inner.__qualname__ = function.__module__, f"{function.__qualname__}.inner"  # kept under this
        njit = cast("Any", numba.njit)  # pyright: ignore
        self._for_python = njit(**_OPTIONS)(function)
        self._for_compiled = njit(**_OPTIONS, no_cpython_wrapper=True, pipeline_class=CompilerForOthers)(inner)
        if _CACHE:
            for dispatcher in (self._for_python, self._for_compiled):
                dispatcher._cache = KeptByContent(dispatcher.py_func)

    def __call__(self, *values: object) -> object:
        return self._for_python(*values)

    def __reduce__(self) -> str:
        """A copy is the same function."""
        return self._name

    def compile_as_called(self, *values: object) -> None:
        """See the function of this name."""
        self._for_compiled.compile(tuple(numba.typeof(value) for value in values))  # pyright: ignore

    @property
    def _numba_type_(self) -> types.Type:  # by which the compiler knows what it may call
        return Callee(self._for_compiled)


def compiled(function: _Function) -> _Function:
    """The same function as machine code, kept on disk after its first call.

    Rows of arrays are worked on one by one and in one order: the answer for a row does not depend, to the bit, on how
    many there are. Import modules with such functions where they are used: the compiler takes a second to load.
    """
    return cast("_Function", _Compiled(cast("FunctionType", function)))


def compile_as_called(function: Callable[..., object], *values: object) -> None:
    """Compile a function that is `compiled` as compiled functions call it, with values of these types.

    It is not called, and there is no way into it from Python: what a caller takes in is kept on disk.
    """
    cast("_Compiled", function).compile_as_called(*values)


def elementwise(function: Callable[..., float]) -> Callable[..., NDArray[np.float64]]:
    """A function of numbers as a numpy ufunc, for arrays of any shapes that broadcast and for other compiled loops."""
    return cast("Callable[..., NDArray[np.float64]]", numba.vectorize(cache=_CACHE)(function))  # pyright: ignore


@structref.register  # pyright: ignore[reportUnknownMemberType]
class HeldType(StructRef):
    """Type of what is `Held`, for the compiler."""

    def preprocess_fields(self, fields: Any) -> Any:  # noqa: ANN401, D102 - the compiler's own
        return tuple((name, types.unliteral(of)) for name, of in fields)  # pyright: ignore


class Held(structref.StructRefProxy, Generic[_Value]):
    """Holds a record for compiled functions, which see the same arrays, and what becomes of them.

    A bare one costs them at each call: the compiler unpacks it anew, a tenth of a microsecond for every array, and
    seven for a random generator, of which it asks where its functions and its state are.

    Args:
        value: A named tuple, nested ones included, or a generator.
    """

    value: _Value
    """As compiled functions take it."""
    given: _Value
    """As others take it."""

    def __new__(cls, value: _Value) -> Self:  # noqa: D102 - as the compiler wants it
        held = _hold(value)
        held.given = value
        return held

    def __reduce__(self) -> tuple[type[Held[_Value]], tuple[_Value]]:
        """A copy holds a copy."""
        return Held, (self.given,)


def held_list(records: Iterable[Held[_Value]]) -> Any:  # noqa: ANN401 - the compiler's own list
    """Records of one type as compiled functions take many at once; `replace_in` puts another one in."""
    first, *others = records
    listed = _listed(first)
    for record in others:
        _append(listed, record)
    return listed


structref.define_boxing(HeldType, Held)  # pyright: ignore[reportUnknownMemberType]
structref.define_constructor(Held, HeldType, ["value"])  # pyright: ignore[reportUnknownMemberType]


@compiled
def _hold(value: Any) -> Any:  # noqa: ANN401 - of any type
    return Held(value)


# What the compiler's own lists do for Python is compiled anew in each process, a second long; these are kept on disk.


@compiled
def _listed(first: Any) -> Any:  # noqa: ANN401 - of any type
    listed = List()  # pyright: ignore
    listed.append(first)  # pyright: ignore
    return listed  # pyright: ignore


@compiled
def _append(listed: Any, record: Any) -> None:  # noqa: ANN401
    listed.append(record)


@compiled
def replace_in(listed: Any, index: int, record: Any) -> None:  # noqa: ANN401
    """Put another record of the same type into a `held_list`."""
    listed[index] = record


@compiled
def _smallest() -> None:
    """Of all functions."""


def try_compiler() -> None:
    """Have a function compiled, or read from disk: those who watch learn at once if nothing has been compiled yet."""
    _smallest()


class Compiling:
    """What was compiled so far.

    Attributes:
        n_functions: How many functions, the one at hand included.
        n_kept: How many of them are kept on disk, and compiled once on a machine.
        spent_s: How long it took.
    """

    def __init__(self) -> None:
        self.n_functions = 0
        self.n_kept = 0
        self.spent_s = 0.0


@contextmanager
def watch_compiler(tell: Callable[[Compiling], None]) -> Generator[Compiling]:
    """Follow the compiler in the block; `tell` is called before each function that it compiles.

    Meanwhile no garbage is collected: the compiler leaves little, and has Python look for it an eighth of the time.
    """
    compiling, began_s, collects = Compiling(), list[float](), gc.isenabled()

    class Follower(event.Listener):
        """A function may be compiled while another one is, which calls it."""

        def on_start(self, event: event.Event) -> None:
            gc.disable()
            compiling.n_functions += 1
            compiling.n_kept += event.data["dispatcher"].stats.cache_path is not None  # pyright: ignore
            tell(compiling)
            began_s.append(time.perf_counter())

        def on_end(self, event: event.Event) -> None:
            spent_s = time.perf_counter() - began_s.pop()
            if not began_s:
                compiling.spent_s += spent_s
                if collects:
                    gc.enable()

    with event.install_listener("numba:compile", Follower()):  # pyright: ignore[reportUnknownMemberType]
        yield compiling
