"""Rerun as a process: bound to this machine, silent, and gone when the command that started it is."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO

from rerun.experimental import ViewerClient

from pdpatrol.missions.recording.viewer import supervisor
from pdpatrol.missions.recording.viewer.supervisor import LEAVE_OPEN

LOOPBACK = "127.0.0.1"
"""Rerun listens on all interfaces by default."""

START_LIMIT_S = 60.0
"""After which a viewer that does not answer counts as one that cannot start (assumed; two seconds are usual)."""

QUIET = {"RUST_LOG": "error"}
"""Rerun tells of every address and every file otherwise."""


class ViewerError(OSError):
    """The machine cannot show a recording; one line says why."""


class RerunProcess:
    """Rerun, which ends with this process unless it is left open; as a context, it ends with the block.

    Args:
        arguments: Of the `rerun` command, after the address that it is bound to.
    """

    def __init__(self, *arguments: str) -> None:
        rerun = [sys.executable, "-m", "rerun", "--bind", LOOPBACK, *arguments]
        self._told: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - it is read when the process has ended
        self._process = subprocess.Popen(
            [sys.executable, str(Path(supervisor.__file__)), *rerun],
            start_new_session=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=self._told,
            env={**os.environ, **QUIET},
        )

    def __enter__(self) -> RerunProcess:
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self._told.close()

    @property
    def has_ended(self) -> bool:
        """Whether it is no more, such as when its window was closed."""
        return self._process.poll() is not None

    def wait(self) -> None:
        """Wait for it to end.

        Raises:
            ViewerError: If it could not do what it was started for.
        """
        if self._process.wait() != 0:
            raise ViewerError(self._fault())

    def client(self, port: int) -> ViewerClient:
        """A connection to the viewer, once it has come up.

        Raises:
            ViewerError: If it does not.
        """
        deadline = time.monotonic() + START_LIMIT_S
        while self._is_starting(deadline):
            with suppress(ConnectionError, RuntimeError):
                client = ViewerClient.connect(address(port))
                client.get_state()
                return client
        raise ViewerError(self._fault())

    def wait_for(self, port: int) -> None:
        """Wait until something listens on a port of this machine.

        Raises:
            ViewerError: If nothing does.
        """
        deadline = time.monotonic() + START_LIMIT_S
        while self._is_starting(deadline):
            with suppress(OSError), socket.create_connection((LOOPBACK, port), timeout=1.0):
                return
        raise ViewerError(self._fault())

    def leave_open(self) -> None:
        """Let it stay when this process has ended."""
        with suppress(BrokenPipeError):
            assert self._process.stdin is not None
            self._process.stdin.write(LEAVE_OPEN)
            self._process.stdin.close()

    def _is_starting(self, deadline: float) -> bool:
        time.sleep(0.1)
        return time.monotonic() < deadline and not self.has_ended

    def _fault(self) -> str:
        """Why it has not started, in one line."""
        self._told.seek(0)
        lines = [line.strip() for line in self._told.read().decode(errors="replace").splitlines() if line.strip()]
        told = [line for line in lines if not line.startswith("note:")]
        why = next(
            (line for line in reversed(told) if line.startswith("Error:")), told[-1] if told else "it says nothing"
        )
        return f"the viewer does not start: {why.removeprefix('Error: ')}"


def address(port: int) -> str:
    """Where a viewer takes data and orders."""
    return f"rerun+http://{LOOPBACK}:{port}/proxy"


def free_port() -> int:
    """A port of this machine that nothing listens on."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return probe.getsockname()[1]


def check_screen(environment: Mapping[str, str] = os.environ) -> None:
    """Whether there is a screen to open a window on.

    Raises:
        ViewerError: If there is none.
    """
    if sys.platform == "linux" and not (environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY")):
        raise ViewerError("there is no screen to open a viewer on (neither DISPLAY nor WAYLAND_DISPLAY is set)")
