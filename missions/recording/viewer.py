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

import rerun as rr

from missions.record.mission_log import MissionLog
from missions.recording.blueprint import blueprint
from missions.recording.recorder import Recorder

LOOPBACK = "127.0.0.1"
START_LIMIT_S = 30.0
TERMINATE_LIMIT_S = 5.0


def open_viewer(path: Path) -> None:
    """Show a recording in the native viewer and wait until it is closed; Ctrl-C closes it."""
    _wait(_start(str(path)))


def serve(path: Path, announce: Callable[[str], None]) -> None:
    """Serve a recording to browsers on this machine until Ctrl-C.

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


def live_stream(log: MissionLog) -> Recorder:
    """Open the viewer on a mission that runs; call `update` on what comes back as the log grows.

    The viewer stays open when the mission is over.
    """
    port = _free_port()
    process = _start("--port", str(port), "--expect-data-soon", "--hide-welcome-screen")
    _answers(port, process)
    stream = rr.RecordingStream("pdpatrol")
    stream.connect_grpc(f"rerun+http://{LOOPBACK}:{port}/proxy", default_blueprint=blueprint(log.meta))
    return Recorder(stream, log)


def _start(*arguments: str) -> subprocess.Popen[bytes]:
    """Rerun in a process group of its own: its launcher starts the viewer as a child, and both must go together."""
    command = [sys.executable, "-m", "rerun", "--bind", LOOPBACK, *arguments]
    return subprocess.Popen(command, start_new_session=True, stdout=subprocess.DEVNULL)


def _wait(process: subprocess.Popen[bytes], when_started: Callable[[], None] = lambda: None) -> None:
    """Wait for the viewer to end, and end it on Ctrl-C or a request to terminate."""
    previous = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with suppress(KeyboardInterrupt):
            when_started()
            process.wait()
    finally:
        signal.signal(signal.SIGTERM, previous)
        _end(process)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End the viewer and what it started: terminate first, kill where that does not end it."""
    for request in (signal.SIGTERM, signal.SIGKILL):
        with suppress(ProcessLookupError):
            os.killpg(process.pid, request)
        with suppress(subprocess.TimeoutExpired):
            process.wait(TERMINATE_LIMIT_S)
            return


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
