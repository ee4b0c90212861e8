"""Exit of a command after signals, operating-system errors, and missing libraries.

This module imports nothing that loads slowly, so that signals are handled from the start.
"""

import os
import shutil
import signal
import sys
import textwrap
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, NoReturn, TextIO

FAILED, USAGE_ERROR = 1, 2
"""Exit statuses; after a signal, the status is 128 plus the number of the signal."""

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

EXTRAS = {
    "rerun": "viewer",
    "mcap": "ros",
    "mcap_ros2": "ros",
    "rosbags": "instruments",
    "imageio": "video",
    "ray": "ray",
    "ezdxf": "dxf",
    "RigolWFM": "instruments",
    "nptdms": "instruments",
    "h5py": "instruments",
    "sigmf": "instruments",
}
"""Extra of the package that installs each optional library; `missions` installs all others."""


@contextmanager
def command_process() -> Iterator[None]:
    """Handle the signals, errors and warnings of a command that runs in the block.

    SIGINT, SIGTERM and SIGHUP raise KeyboardInterrupt; those that the parent process ignores, as under nohup, stay
    ignored. Operating-system errors and missing libraries print one line and exit with status 1. Warnings print one
    line.
    """
    received: list[int] = []

    def interrupt(number: int, _frame: object) -> NoReturn:
        received.append(number)
        raise KeyboardInterrupt

    _handle_signals(interrupt)
    warnings.showwarning = lambda message, *_, **__: print_error(f"note: {message}")
    try:
        yield
        for stream in _streams():
            stream.flush()
    except ModuleNotFoundError as error:
        library = (error.name or "").partition(".")[0]
        if library in ("", "dirmusic", "pdpatrol"):
            raise
        extra = EXTRAS.get(library, "missions")
        print_error(f'pdpatrol: {library} is not installed; run: pip install "pdpatrol[{extra}]"')
        sys.exit(FAILED)
    except BrokenPipeError:
        _exit_without_output()
    except OSError as error:
        print_error(f"{error.filename}: {error.strerror}" if error.filename else str(error.strerror or error))
        _exit_without_output()
    except MemoryError as error:
        print_error(f"out of memory: {error}")
        sys.exit(FAILED)
    except (KeyboardInterrupt, Exception) as error:
        if not received and not isinstance(error, KeyboardInterrupt):
            raise  # otherwise, other code has replaced the interrupt with its own error
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)
        kill_children()
        print_error("Interrupted")
        sys.exit(128 + (received[0] if received else signal.SIGINT))


@contextmanager
def deferred_signals() -> Iterator[list[int]]:
    """Collect the signals received in the block; only the second one interrupts it."""
    received: list[int] = []

    def defer(number: int, frame: FrameType | None) -> None:
        received.append(number)
        if len(received) > 1:
            handlers[received[0]](received[0], frame)

    handlers = _handle_signals(defer)
    try:
        yield received
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


def _handle_signals(handler: Callable[[int, FrameType | None], object]) -> dict[int, Any]:
    """Handle the signals that the parent process does not ignore; return their former handlers."""
    handled = [number for number in SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]
    return {number: signal.signal(number, handler) for number in handled}


def kill_children() -> None:
    """Kill all child processes of this process and their descendants."""
    import psutil  # only needed when a command is interrupted

    for child in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):
            if not any("resource_tracker" in word for word in child.cmdline()):  # it cleans up and ends by itself
                child.kill()


def print_error(line: str) -> None:
    """Print a line to the standard error output, with control characters escaped; a terminal shows it wrapped."""
    with suppress(OSError, AttributeError):  # it may be closed
        text = one_line(line)
        sys.stderr.write((wrapped(text, hanging=2) if sys.stderr.isatty() else text) + "\n")


def wrapped(line: str, hanging: int = 0) -> str:
    """Wrap a line at spaces to the width of the terminal; words longer than that are kept in one piece.

    Args:
        line: Line of text; its leading spaces are kept.
        hanging: Number of spaces before the second and later lines.
    """
    width = max(shutil.get_terminal_size().columns, 2 * hanging)
    lines = textwrap.wrap(line, width, subsequent_indent=" " * hanging, break_long_words=False, break_on_hyphens=False)
    return "\n".join(lines)


def one_line(text: str) -> str:
    """Escape line breaks and other control characters, which a terminal would interpret."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def _streams() -> list[TextIO]:
    """Return the output streams that are not closed."""
    return [stream for stream in (sys.stdout, sys.stderr) if stream]


def _exit_without_output() -> NoReturn:
    """Exit with status 1, and discard buffered output that cannot be written."""
    devnull = os.open(os.devnull, os.O_WRONLY)
    for stream in _streams():
        try:
            stream.flush()
        except OSError:
            os.dup2(devnull, stream.fileno())
    sys.exit(FAILED)
