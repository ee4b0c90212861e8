"""Inner loops that are compiled: over robots, where numpy would need a call for each line."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

import numba

_Function = TypeVar("_Function", bound=Callable[..., object])


def compiled(function: _Function) -> _Function:
    """The same function as machine code, kept on disk after its first call.

    It is found there again while its file has not changed: use nothing in it that is defined in another one.
    """
    return cast("_Function", numba.njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)(function))  # pyright: ignore
