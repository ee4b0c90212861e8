"""Deep calls at their full speed.

Python's call stack grows by 16 kB at a time, and each piece goes back to the system as soon as the call that needed it
returns. A compiler that calls itself to any depth crosses such a border hundreds of thousands of times: an eighth of
the time that a first command takes.
"""

from __future__ import annotations

from collections.abc import Callable

_WORDS = 70_000
"""Python takes the next power of two bytes, here 1 MB, in one piece: what the frame leaves is for those that follow."""


def call_with_room(function: Callable[[], None]) -> None:
    """Call a function in a part of the call stack that has room for half a megabyte of frames."""
    function()


call_with_room.__code__ = call_with_room.__code__.replace(co_stacksize=_WORDS)
