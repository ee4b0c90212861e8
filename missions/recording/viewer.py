"""Showing a recording: in the native viewer, in a browser on this machine, or while the mission runs."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from urllib.parse import quote

import rerun as rr

from missions.log import MissionLog
from missions.recording.blueprint import blueprint
from missions.recording.recorder import Recorder

LOOPBACK = "127.0.0.1"


def open_viewer(path: Path) -> None:
    """Show a recording in the native viewer and wait until it is closed; Ctrl-C closes it."""
    with _viewer_process(str(path)) as process:
        process.wait()


@contextmanager
def serve(path: Path) -> Iterator[str]:
    """Serve a recording to browsers on this machine while the context lasts; gives the address to open."""
    data_port, page_port = _free_port(), _free_port()
    options = ("--serve-web", "--port", str(data_port), "--web-viewer-port", str(page_port))
    with _viewer_process(str(path), *options):
        source = quote(f"rerun+http://{LOOPBACK}:{data_port}/proxy", safe="")
        yield f"http://{LOOPBACK}:{page_port}/?url={source}"


def live_stream(log: MissionLog) -> Recorder:
    """Open the viewer on a mission that runs; call `update` on what comes back as the log grows."""
    stream = rr.RecordingStream("pdpatrol")
    stream.spawn(default_blueprint=blueprint(log.meta), hide_welcome_screen=True)
    return Recorder(stream, log)


@contextmanager
def _viewer_process(*arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """Rerun in a process group of its own: its launcher starts the viewer as a child, and both must go together."""
    command = [sys.executable, "-m", "rerun", "--bind", LOOPBACK, *arguments]
    process = subprocess.Popen(command, start_new_session=True, stdout=subprocess.DEVNULL)
    try:
        with suppress(KeyboardInterrupt):
            yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)
        process.wait()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return probe.getsockname()[1]
