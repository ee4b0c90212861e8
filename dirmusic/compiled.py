"""Inner loops that are compiled: over elements, paths and samples, where numpy would need a call for each line."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Self, TypeVar, cast

import numba
import numpy as np
from numba.core.types import StructRef
from numba.experimental import structref
from numpy.typing import NDArray

_Function = TypeVar("_Function", bound=Callable[..., object])


def compiled(function: _Function) -> _Function:
    """The same function as machine code, kept on disk after its first call.

    Rows of arrays are worked on one by one and in one order: the answer for a row does not depend, to the bit, on how
    many there are. Import modules with such functions where they are used: the compiler takes a second to load.
    """
    return cast("_Function", numba.njit(cache=True, error_model="numpy")(function))  # pyright: ignore


def elementwise(function: Callable[..., float]) -> Callable[..., NDArray[np.float64]]:
    """A function of numbers as a numpy ufunc, for arrays of any shapes that broadcast and for other compiled loops."""
    return cast("Callable[..., NDArray[np.float64]]", numba.vectorize(cache=True)(function))  # pyright: ignore


def plain(record: tuple[Any, ...]) -> tuple[Any, ...]:
    """A named tuple, and those within it, without names.

    Compiled functions that are called often take these: it is a matter of half a microsecond to look up the type of
    each named tuple. Inside they get their names back, at no cost.
    """
    return tuple(plain(cast("tuple[Any, ...]", entry)) if isinstance(entry, tuple) else entry for entry in record)


@structref.register  # pyright: ignore[reportUnknownMemberType]
class GeneratorType(StructRef):
    """Type of a `GeneratorHandle`, for the compiler."""


class GeneratorHandle(structref.StructRefProxy):
    """Holds a generator for compiled functions; both draw from the same state.

    A bare generator costs them 7 us at each call, a tenth of what it takes to hear a pulse: the compiler asks it anew
    where its functions and its state are.
    """

    rng: np.random.Generator
    """As compiled functions take it."""
    _generator: np.random.Generator

    def __new__(cls, rng: np.random.Generator) -> Self:  # noqa: D102 - as the compiler wants it
        handle = structref.StructRefProxy.__new__(cls, rng)  # pyright: ignore
        handle._generator = rng
        return cast("Self", handle)

    def __reduce__(self) -> tuple[type[Self], tuple[np.random.Generator]]:
        """A copy holds the copy of the generator."""
        return type(self), (self._generator,)


structref.define_proxy(GeneratorHandle, GeneratorType, ["rng"])  # pyright: ignore[reportUnknownMemberType]
