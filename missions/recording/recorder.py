"""Slices of a growing MissionLog to Rerun: the live view and the file are made by the same code."""

from __future__ import annotations

from pathlib import Path

import rerun as rr

from pdpatrol.missions.atomic_file import atomic_file
from pdpatrol.missions.record.array_description import described_manifold
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording.blueprint import blueprint
from pdpatrol.missions.recording.drawing.canvas import BIN_S, Canvas, Slices, bin_steps
from pdpatrol.missions.recording.drawing.findings import Findings
from pdpatrol.missions.recording.drawing.motion import Motion
from pdpatrol.missions.recording.drawing.phase_pattern import draw_phase_patterns
from pdpatrol.missions.recording.drawing.pulses import Pulses
from pdpatrol.missions.recording.drawing.scene import draw_scene
from pdpatrol.missions.recording.drawing.spectra import SpectraOverTime
from pdpatrol.missions.recording.drawing.status import Status
from pdpatrol.missions.recording.identity import recording_stream

LEAST_BIN_S = 0.05
"""Of data from the field whose rows all came at once."""


def write_recording(log: MissionLog, path: Path) -> None:
    """Write a whole recording, blueprint inside.

    Raises:
        OSError: If it cannot be written; a file that Rerun itself writes ends silently where the disk is full.
    """
    stream = recording_stream(log)
    content = stream.binary_stream()
    try:
        time_s = log.column("step", "time_s")
        end_s = float(time_s[-1]) if time_s.size else 0.0
        bin_s = BIN_S if "scenario" in log.meta else max(end_s * bin_steps(log) / max(time_s.size, 1), LEAST_BIN_S)
        stream.send_blueprint(blueprint(log.meta, end_s, bin_s))
        Recorder(stream, log, end_s, bin_s).finish()
    finally:
        recording = content.read(flush=True) or b""  # after an error too: Rerun warns of what nobody has read
        stream.disconnect()
    with atomic_file(path) as temporary:
        temporary.write_bytes(recording)


class Recorder:
    """Draws what was added to a log since the last call.

    Args:
        stream: Where to.
        log: A mission's log, growing or whole.
        end_s: When it ends; None where nobody knows: at its time limit at the latest.
        bin_s: How long a bin lasts.
    """

    def __init__(
        self, stream: rr.RecordingStream, log: MissionLog, end_s: float | None = None, bin_s: float = BIN_S
    ) -> None:
        if end_s is None:
            end_s = float(log.meta["scenario"]["task"]["time_limit_s"])
        self._log = log
        self._canvas = canvas = Canvas(stream, log)
        self._slices = Slices(log)
        self._motion = Motion(canvas)
        self._pulses = Pulses(canvas, described_manifold(log.meta["array"]))
        self._spectra = SpectraOverTime(canvas, end_s, bin_s)
        self._findings = Findings(canvas, log.meta)
        self._status = Status(canvas, log.meta)
        draw_scene(canvas, log.meta)

    def update(self) -> None:
        """Draw the bins that are complete; all that is left where the mission is over."""
        events = self._log.column("event", "kind")
        self._draw(is_whole=events.size > 0 and events[-1] == "end")

    def finish(self) -> None:
        """Draw all that is left of a log to which nothing will be added."""
        self._draw(is_whole=True)

    def _draw(self, *, is_whole: bool) -> None:
        while (part := self._slices.take(is_whole=is_whole)) is not None:
            self._motion.draw(part)
            spectra = self._pulses.spectra(part)
            self._pulses.draw(part, spectra)
            self._spectra.draw(part, spectra)
            self._findings.draw(part)
            self._status.draw(part)
            for kind, reason in zip(part.event["kind"], part.event["subject"], strict=True):
                if kind == "end":
                    draw_phase_patterns(self._canvas, self._log)
                    self._status.draw_end(self._log, str(reason))
        if is_whole:
            self._spectra.finish()
