"""What compiled functions are kept under on disk: all that their machine code is made of.

The compiler itself looks at the file of a function alone. After a change in another file, of a function that it calls
or of a constant, it would run what it has kept, without a word.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from functools import cache
from types import CodeType, FunctionType, ModuleType
from typing import Any, cast

import numpy as np
from numba.core import sigutils, types
from numba.core.caching import FunctionCache
from numba.core.types import StructRef


class KeptByContent(FunctionCache):  # pyright: ignore[reportUntypedBaseClass]
    """Finds a function again only if nothing that it is made of has changed, wherever that is written."""

    def __init__(self, function: FunctionType) -> None:
        super().__init__(function)  # pyright: ignore[reportUnknownMemberType]
        self._function = function

    def _index_key(self, sig: Any, codegen: Any) -> Any:  # noqa: ANN401 - the compiler's own
        arguments, _ = cast("Any", sigutils.normalize_signature(sig))  # pyright: ignore
        key = cast("Any", super())._index_key(sig, codegen)
        return (*key, _digest((*content(self._function), *_fields(arguments))))


@cache
def content(function: FunctionType) -> tuple[str, ...]:
    """What a compiled function is made of: its code, that of all it calls, and the constants that they name."""
    digests: dict[FunctionType, str] = {}
    waiting = [function]
    while waiting:
        at = waiting.pop()
        if at not in digests:
            digests[at], callees = _own(at)
            waiting += callees
    return tuple(sorted(f"{at.__module__}.{at.__qualname__} {digest}" for at, digest in digests.items()))


@cache
def _own(function: FunctionType) -> tuple[str, tuple[FunctionType, ...]]:
    """Digest of a function without those that it calls, and these."""
    known = function.__globals__ | {
        name: cell.cell_contents
        for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    }
    callees: list[FunctionType] = []
    parts = [*_code(function.__code__), *_described(function.__defaults__, callees)]
    names = _names(function.__code__)
    for name in sorted(names & known.keys()):
        value = known[name]
        parts.append(name)
        if isinstance(value, ModuleType):  # no more than the constants that may be meant
            inside = {of: vars(value)[of] for of in sorted(names & vars(value).keys())}
            value = {of: value for of, value in inside.items() if not isinstance(value, FunctionType)}
        parts += _described(value, callees)
    return _digest(parts), tuple(callees)


def _names(code: CodeType) -> set[str]:
    """What a code may look up, in it and in those that it defines."""
    inner = [const for const in code.co_consts if isinstance(const, CodeType)]
    return {*code.co_names, *code.co_freevars}.union(*map(_names, inner))


def _code(code: CodeType) -> Iterator[str]:
    yield code.co_code.hex()
    yield " ".join((*code.co_names, "|", *code.co_varnames))
    for const in code.co_consts:
        yield from _code(const) if isinstance(const, CodeType) else _described(const, [])


def _described(value: Any, callees: list[FunctionType]) -> Iterator[str]:  # noqa: ANN401 - of any type
    """The same for equal values in all processes; functions are added to `callees`."""
    function = getattr(value, "__wrapped__", value)  # what the compiler has made of it
    if isinstance(function, FunctionType):
        callees.append(function)
        yield f"{function.__module__}.{function.__qualname__}"
    elif isinstance(value, dict):
        for name, of in cast("dict[Any, Any]", value).items():
            yield str(name)
            yield from _described(of, callees)
    elif isinstance(value, tuple | list):
        yield "("
        for of in cast("Iterable[Any]", value):
            yield from _described(of, callees)
        yield ")"
    elif isinstance(value, set | frozenset):
        yield " ".join(sorted(map(repr, cast("Iterable[Any]", value))))
    elif isinstance(value, np.ndarray | np.generic):
        yield f"{cast('Any', value).dtype} {cast('Any', value).shape} {value.tobytes().hex()}"
    elif isinstance(value, type):
        yield f"{value.__module__}.{value.__qualname__} {getattr(value, '_fields', '')}"
    elif value is None or isinstance(value, bool | int | float | complex | str | bytes | slice | np.dtype):
        yield repr(cast("object", value))
    else:
        yield type(value).__qualname__


def _fields(of: Iterable[Any]) -> Iterator[str]:
    """Names of the fields of records, in order: types are compared without them."""
    for kind in of:
        if isinstance(kind, types.BaseNamedTuple):
            yield " ".join(kind.fields)  # pyright: ignore
        if isinstance(kind, types.BaseTuple):
            yield from _fields(kind.types)  # pyright: ignore
        elif isinstance(kind, StructRef):
            yield from _fields(kind.field_dict.values())  # pyright: ignore
        elif isinstance(kind, types.ListType):
            yield from _fields([kind.dtype])  # pyright: ignore


def _digest(parts: Iterable[str]) -> str:
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()
