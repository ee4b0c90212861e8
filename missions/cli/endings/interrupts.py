"""SIGINT, SIGTERM and SIGHUP: a command ends within two seconds, whatever it is doing, and leaves whole files.

The first of them raises `Interrupted` in the main thread, unless a mission has put it off to the end of its step. If
that does not come to it in time, in compiled code or while it writes, and at a second signal, a thread of its own ends
the process; no compiled loop holds the interpreter's lock, so that it always can.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import NoReturn

GRACE_S = 1.7
"""From a signal to the end by force: what is left of two seconds to wake up and to clean up (assumed)."""

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))

BY_KEYBOARD = 128 + signal.SIGINT
"""Exit status after Ctrl-C."""

_received: int | None = None
_is_put_off = False
_cleanups: list[Callable[[], None]] = []


class Interrupted(KeyboardInterrupt):
    """A signal asked the command to end."""


def watch() -> None:
    """Take over the signals of this process; those that whoever started it wants ignored stay so, as under nohup."""
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _receive)
    sys.unraisablehook = _report_unraisable
    threading.Thread(target=_end_in_time, args=(reader,), daemon=True).start()


def status() -> int | None:
    """Exit status by the signal that was received, 128 and its number as shells have it; None if there was none."""
    return None if _received is None else 128 + _received


@contextmanager
def put_off() -> Iterator[Callable[[], bool]]:
    """In the block a signal raises nothing: what comes back tells whether one was received."""
    global _is_put_off
    _is_put_off = True
    try:
        yield lambda: _received is not None
    finally:
        _is_put_off = False


def clean_up_by(cleanup: Callable[[], None]) -> None:
    """Have something done should the process be ended by force; it must be quick, and may be called in any thread."""
    _cleanups.append(cleanup)


def _receive(number: int, _frame: object) -> None:
    global _received
    if _received is None:
        _received = number
        if not _is_put_off:
            raise Interrupted


def _report_unraisable(error: sys.UnraisableHookArgs) -> None:
    """Nothing of a signal that came while foreign code, such as a compiler, called back: the thread sees to it."""
    if not isinstance(error.exc_value, Interrupted):
        sys.__unraisablehook__(error)


def _end_in_time(reader: int) -> None:
    first = _next_signal(reader, None)
    _next_signal(reader, GRACE_S)
    _end(first)


def _next_signal(reader: int, timeout_s: float | None) -> int:
    """The next of the signals; 0 if none comes in time."""
    while select.select([reader], [], [], timeout_s)[0]:
        for number in os.read(reader, 64):
            if number in SIGNALS:
                return number
    return 0


def _end(number: int) -> NoReturn:
    kill_children()
    for cleanup in _cleanups:
        with suppress(Exception):
            cleanup()
    with suppress(OSError):
        os.write(sys.stderr.fileno(), b"\nInterrupted\n")
    os._exit(128 + number)


def kill_children() -> None:
    """Processes that this one has started, and those of theirs: one that is just starting would not notice the end."""
    import psutil  # here, so that signals are taken over sooner

    for child in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):
            if not any("resource_tracker" in word for word in child.cmdline()):  # it tidies up, and then ends itself
                child.kill()
