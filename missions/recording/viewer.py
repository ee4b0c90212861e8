"""Showing a recording: in the native viewer, in a browser on this machine, or while the mission runs.

Rerun listens on all interfaces by default; here it is bound to this machine alone.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from urllib.parse import quote

from missions.record.mission_log import MissionLog
from missions.recording import supervisor
from missions.recording.blueprint import blueprint
from missions.recording.identity import recording_stream, send_identity
from missions.recording.recorder import Recorder
from missions.recording.supervisor import LEAVE_OPEN

LOOPBACK = "127.0.0.1"
START_LIMIT_S = 30.0


def open_viewer(path: Path) -> None:
    """Show a recording in the native viewer and wait until it is closed; what ends the wait closes it."""
    _wait(_start(str(path)))


def serve(path: Path, announce: Callable[[str], None]) -> None:
    """Serve a recording to browsers on this machine until something ends the wait.

    Args:
        path: The recording.
        announce: Called with the address once it answers.
    """
    data_port, page_port = _free_port(), _free_port()
    process = _start(str(path), "--serve-web", "--port", str(data_port), "--web-viewer-port", str(page_port))
    source = quote(f"rerun+http://{LOOPBACK}:{data_port}/proxy", safe="")

    def announce_when_ready() -> None:
        if _answers(page_port, process):
            announce(f"http://{LOOPBACK}:{page_port}/?url={source}")

    _wait(process, announce_when_ready)


class LiveView:
    """The viewer on a mission that runs: call `update` as the log grows.

    It ends with this process, unless it is left open.

    Args:
        log: Of the mission.
    """

    def __init__(self, log: MissionLog) -> None:
        port = _free_port()
        self._process = _start("--port", str(port), "--expect-data-soon", "--hide-welcome-screen")
        _answers(port, self._process)
        self._log, self._stream = log, recording_stream(log)
        self._stream.connect_grpc(f"rerun+http://{LOOPBACK}:{port}/proxy", default_blueprint=blueprint(log.meta))
        self._recorder = Recorder(self._stream, log)

    def update(self) -> None:
        """Send the rows added since the last call; after the end, what the mission came to."""
        self._recorder.update()
        if "end" in self._log.column("event", "kind"):
            send_identity(self._stream, self._log)

    def leave_open(self) -> None:
        """Let the viewer stay when this process has ended."""
        with suppress(BrokenPipeError):
            assert self._process.stdin is not None
            self._process.stdin.write(LEAVE_OPEN)
            self._process.stdin.close()


def _start(*arguments: str) -> subprocess.Popen[bytes]:
    """Rerun, which ends with this process."""
    rerun = [sys.executable, "-m", "rerun", "--bind", LOOPBACK, *arguments]
    command = [sys.executable, str(Path(supervisor.__file__)), *rerun]
    return subprocess.Popen(command, start_new_session=True, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)


def _wait(process: subprocess.Popen[bytes], when_started: Callable[[], None] = lambda: None) -> None:
    """Wait for the viewer to end; an exception ends it."""
    try:
        when_started()
        process.wait()
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _answers(port: int, process: subprocess.Popen[bytes]) -> bool:
    """Whether something listens on a port of this machine before long."""
    deadline = time.monotonic() + START_LIMIT_S
    while time.monotonic() < deadline and process.poll() is None:
        with suppress(OSError), socket.create_connection((LOOPBACK, port), timeout=1.0):
            return True
        time.sleep(0.1)
    return False


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return probe.getsockname()[1]
