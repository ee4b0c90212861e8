"""The native viewer, on recordings that are whole, and on a mission that runs."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import rerun as rr

from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording.blueprint import blueprint
from pdpatrol.missions.recording.identity import recording_stream, send_identity
from pdpatrol.missions.recording.recorder import Recorder
from pdpatrol.missions.recording.viewer.rerun_process import RerunProcess, address, check_screen, free_port


def open_viewer(recordings: Sequence[Path]) -> None:
    """Show recordings in the native viewer and wait until it is closed; what ends the wait closes it.

    Raises:
        ViewerError: If it cannot be opened.
    """
    check_screen()
    port = free_port()
    with RerunProcess("--port", str(port), *(str(path.resolve()) for path in recordings)) as viewer:
        if len(recordings) > 1:
            _list_recordings(viewer, port)
        viewer.wait()


def _list_recordings(viewer: RerunProcess, port: int) -> None:
    """Open the panel that lists the recordings, once the blueprint, which hides it, has been read."""
    client = viewer.client(port)
    with suppress(ConnectionError, RuntimeError):  # closed meanwhile
        while not client.get_state().views:
            time.sleep(0.1)
        client.run_command("ui.expand_blueprint_panel")


class LiveView:
    """The viewer on a mission that runs: call `update` as its log grows.

    It ends with this process, unless it is left open; where the user closes it, the mission goes on unseen.

    Raises:
        ViewerError: If it cannot be opened.
    """

    def __init__(self) -> None:
        check_screen()
        self._port = free_port()
        self._viewer = RerunProcess("--port", str(self._port), "--expect-data-soon", "--hide-welcome-screen")
        self._viewer.client(self._port)
        self._shown: tuple[rr.RecordingStream, Recorder] | None = None

    def update(self, log: MissionLog) -> None:
        """Send the rows added to the log since the last call; after the end, what the mission came to."""
        if self._viewer.has_ended:
            return
        self._shown = self._shown or self._show(log)
        stream, recorder = self._shown
        recorder.update()
        if "end" in log.column("event", "kind"):
            send_identity(stream, log)

    def leave_open(self) -> None:
        """Let the viewer stay when this process has ended."""
        self._viewer.leave_open()

    def _show(self, log: MissionLog) -> tuple[rr.RecordingStream, Recorder]:
        stream = recording_stream(log)
        stream.connect_grpc(address(self._port), default_blueprint=blueprint(log.meta))
        return stream, Recorder(stream, log)
