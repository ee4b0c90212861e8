"""How a command ends when something outside ends it: one line, and the exit status that shells expect."""

from __future__ import annotations

import gc
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import NoReturn, TextIO

from pdpatrol.missions.cli.endings import interrupts


@contextmanager
def command_line() -> Iterator[None]:
    """Run a command in the block, with its signals taken over.

    Interrupted, it leaves with 128 and the number of the signal. What the machine denies, such as space on the disk or
    memory, is told in one line, with exit status 1; so are warnings, as notes.
    """
    interrupts.watch()
    warnings.showwarning = _note
    try:
        yield
        for stream in _streams():
            stream.flush()
    except KeyboardInterrupt:
        interrupts.kill_children()
        _tell("Interrupted")
        sys.exit(interrupts.status() or interrupts.BY_KEYBOARD)
    except BrokenPipeError:
        _leave_unheard()
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        _tell(f"{where}{error.strerror or error}")
        _leave_unheard()
    except MemoryError as error:
        _tell(f"Out of memory{f' ({error})' if str(error) else ''}")
        sys.exit(1)
    except Exception:
        status = interrupts.status()
        if status is None:
            raise
        interrupts.kill_children()
        _tell("Interrupted")  # foreign code has made an error of its own of it
        sys.exit(status)
    finally:
        gc.freeze()  # or the interpreter would look for cycles in all that was loaded and compiled, for half a second


def _streams() -> list[TextIO]:
    """Those of standard output and error that are not closed."""
    return [stream for stream in (sys.stdout, sys.stderr) if stream]


def _note(message: Warning | str, *_: object) -> None:
    _tell(f"note: {message}")


def _tell(line: str) -> None:
    with suppress(OSError):
        from pdpatrol.missions.cli.output.terminal import err, in_one_line

        err.print(in_one_line(line), soft_wrap=True)


def _leave_unheard() -> NoReturn:
    """Exit status 1, where what is still to be printed would fail as well."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in _streams():
        try:
            stream.flush()
        except OSError:
            os.dup2(nowhere, stream.fileno())
    sys.exit(1)
