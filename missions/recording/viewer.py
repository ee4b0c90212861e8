"""Rerun viewers: native, in a browser on this machine, live, and as a screenshot. They end with the command."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from rerun.experimental import ViewerClient

from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording.blueprint import blueprint
from pdpatrol.missions.recording.recorder import Recorder

LOOPBACK = "127.0.0.1"
"""Address to listen on; by default, Rerun listens on all interfaces."""

START_LIMIT_S = 60.0
"""Time after which a viewer is considered unable to start. Assumed; two seconds are usual."""


def _check_screen() -> None:
    """Check that there is a screen to open a window on.

    Raises:
        OSError: If no screen is available.
    """
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise OSError("no screen to open a viewer on; `pdpatrol replay --web` shows missions in a browser")


def open_viewer(recordings: Sequence[Path]) -> None:
    """Show recordings in the native viewer and wait until it is closed.

    Raises:
        OSError: If it cannot be opened.
    """
    _check_screen()
    with _rerun("--new", *(path.resolve() for path in recordings)) as viewer:
        _wait(viewer)


def serve(recordings: Sequence[Path], announce: Callable[[str], None], web_port: int | None = None) -> None:
    """Serve recordings to browsers on this machine until interrupted.

    Args:
        recordings: Recordings to serve.
        announce: Function called with the address when it can be opened.
        web_port: Port of the page, whose data come from the next one; None for two free ports.

    Raises:
        OSError: If they cannot be served.
    """
    if web_port is None:
        port, web_port = _free_port(), _free_port()
    else:
        port = web_port + 1
        _check_free(web_port, port)
    options = ("--serve-web", "--port", port, "--web-viewer-port", web_port)
    with _rerun(*options, *(path.resolve() for path in recordings)) as server:
        _retry(server, lambda: socket.create_connection((LOOPBACK, web_port), timeout=1.0).close())
        announce(f"http://{LOOPBACK}:{web_port}/?url=rerun%2Bhttp://{LOOPBACK}:{port}/proxy")
        _wait(server)


def take_screenshot(recording: Path, at_s: float) -> bytes:
    """Return a PNG of the viewer; no screen is needed.

    Args:
        recording: Recording to show.
        at_s: Simulated time to show.

    Raises:
        OSError: If the viewer cannot draw on this machine.
    """
    port = _free_port()
    with _rerun("--headless", "--window-size", "1600x1000", "--hide-welcome-screen", "--port", port) as viewer:
        client = _connect(viewer, port)
        started_s = time.monotonic()
        try:
            client.open(str(recording.resolve()))
            client.run_command("ui.toggle_top_panel")  # menus, and warnings about the machine
            client.set_time("sim_time", duration=at_s, play_state="paused")
            before, picture = b"", client.take_screenshot()
            # notifications cover the views for 7 s; after that, wait until nothing moves
            while (waited_s := time.monotonic() - started_s) < 7.0 or (picture != before and waited_s < START_LIMIT_S):
                time.sleep(0.5)
                before, picture = picture, client.take_screenshot()
        except (ConnectionError, RuntimeError) as error:
            raise OSError(f"the viewer cannot take a screenshot: {str(error).splitlines()[0]}") from None
    return picture


class LiveView:
    """Viewer of a running mission; it stays open after the mission, and if the user closes it, the mission continues.

    Raises:
        OSError: If it cannot be opened.
    """

    def __init__(self) -> None:
        _check_screen()
        self._port = _free_port()
        self._viewer = _start("--port", self._port, "--expect-data-soon", "--hide-welcome-screen")
        _connect(self._viewer, self._port)
        self._recorder: Recorder | None = None

    def update(self, log: MissionLog) -> None:
        """Draw the rows added to the log since the last call."""
        if self._viewer.poll() is not None:
            return
        if self._recorder is None:
            self._recorder = Recorder(log)
            layout = blueprint(log.meta, is_live=True)
            self._recorder.stream.connect_grpc(_address(self._port), default_blueprint=layout)
        self._recorder.update(is_over="end" in log.column("event", "kind"))


def _start(*arguments: object) -> subprocess.Popen[str]:
    """Start Rerun in its own process group, because it starts the viewer as a child."""
    return subprocess.Popen(
        [sys.executable, "-m", "rerun", "--bind", LOOPBACK, *map(str, arguments)],
        start_new_session=True,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env={**os.environ, "RUST_LOG": "error"},
        text=True,
    )


@contextmanager
def _rerun(*arguments: object) -> Iterator[subprocess.Popen[str]]:
    """Run Rerun until the end of the block."""
    process = _start(*arguments)
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def _wait(process: subprocess.Popen[str]) -> None:
    """Wait for the end of a process.

    Raises:
        OSError: If it failed; the message is its last error.
    """
    while True:
        try:  # in steps: a signal that arrives just before a blocking read does not interrupt it
            _, errors = process.communicate(timeout=1.0)
            break
        except subprocess.TimeoutExpired:
            continue
    if process.returncode:
        lines = [line.removeprefix("Error: ") for line in errors.splitlines() if line and not line.startswith("note:")]
        raise OSError(f"the viewer does not start: {lines[-1] if lines else 'no error message'}")


def _connect(viewer: subprocess.Popen[str], port: int) -> ViewerClient:
    client = _retry(viewer, lambda: ViewerClient.connect(_address(port)))
    _retry(viewer, client.get_state)
    return client


def _retry(process: subprocess.Popen[str], attempt: Callable[[], Any]) -> Any:  # noqa: ANN401 - of any attempt
    """Repeat an attempt until it succeeds, and return its result.

    Raises:
        OSError: If the process has ended, or the attempt does not succeed in time.
    """
    deadline_s = time.monotonic() + START_LIMIT_S
    while process.poll() is None and time.monotonic() < deadline_s:
        with suppress(OSError, RuntimeError):
            return attempt()
        time.sleep(0.1)
    if process.poll() is not None:
        _wait(process)
    raise OSError("the viewer does not start")


def _address(port: int) -> str:
    return f"rerun+http://{LOOPBACK}:{port}/proxy"


def _check_free(*ports: int) -> None:
    """Check that nothing listens on ports of this machine.

    Raises:
        OSError: If one is in use or reserved.
    """
    for port in ports:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # those of ended connections are free
            try:
                probe.bind((LOOPBACK, port))
            except OSError as error:
                raise OSError(
                    f"port {port} cannot be used ({error.strerror}); choose another one with --port"
                ) from None


def _free_port() -> int:
    """Return a port of this machine that is not in use."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return probe.getsockname()[1]
