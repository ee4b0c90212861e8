"""Conversion of a mission log, growing or complete, to a Rerun recording."""

import hashlib
import json
from pathlib import Path

import rerun as rr

from pdpatrol.missions.atomic_file import atomic_file
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording.blueprint import blueprint
from pdpatrol.missions.recording.findings import (
    draw_events,
    draw_findings,
    draw_outcome,
    draw_phase_patterns,
    draw_status,
)
from pdpatrol.missions.recording.scene import LogBin, draw_motion, draw_pulses, draw_scene, set_step
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.wording import outcome_text, title_text


class Recorder:
    """Draws the rows added to a log since the last call.

    Recordings of one scenario share an application id, and with it a blueprint; recordings of one mission of the same
    length share their recording id, so that a viewer shows them once.

    Args:
        log: Log of a mission, growing or complete.

    Attributes:
        stream: Recording that is drawn on.
    """

    def __init__(self, log: MissionLog) -> None:
        title, facts = title_text(log.meta), f"{json.dumps(log.meta, sort_keys=True)} {log.n_rows('step')}"
        self.stream = rr.RecordingStream(
            f"pdpatrol {log.meta['name']}",
            recording_id=f"{title} ({hashlib.sha256(facts.encode()).hexdigest()[:8]})",
            send_properties=False,
        )
        self._log = log
        # steps drawn together: 0.5 s of a mission; field data make at most 2000 bins
        self._bin_steps = 5 if "truth" in log.meta else max(-(-log.n_rows("step") // 2000), 1)
        self._n_drawn: dict[str, int] = dict.fromkeys(("step", "pulse", "bearing", "finding", "likelihood", "event"), 0)
        self.stream.send_recording_name(title)
        draw_scene(self.stream, log.meta)

    def update(self, *, is_over: bool) -> None:
        """Draw the complete bins; if the log no longer grows, the rest and the outcome as well."""
        n_steps = self._log.n_rows("step")
        for end in range(self._n_drawn["step"] + self._bin_steps, n_steps + 1, self._bin_steps):
            self._draw_bin(end)
        if is_over:
            self._draw_bin(max(n_steps, 1))  # without steps, events refer to step 0
            set_step(self.stream, self._log, self._log.last_step)
            report = make_report(self._log, 0.0)
            draw_phase_patterns(self.stream, self._log, report)
            draw_outcome(self.stream, report)
            self.stream.send_recording_name(f"{title_text(self._log.meta)}: {outcome_text(report)}")

    def _draw_bin(self, end: int) -> None:
        """Draw the rows up to step `end`."""
        stop = {name: self._log.rows_before(name, end) for name in self._n_drawn}
        tables = {name: self._log.table(name, start, stop[name]) for name, start in self._n_drawn.items()}
        part = LogBin(self._log, self._n_drawn, tables)
        self._n_drawn = stop
        draw_findings(self.stream, part)
        draw_events(self.stream, part)
        if part.end > part.first["step"]:
            set_step(self.stream, self._log, part.end - 1)
            draw_motion(self.stream, part)
            draw_pulses(self.stream, part)
            draw_status(self.stream, part)


def write_recording(log: MissionLog, path: Path, *, lists_recordings: bool = False) -> None:
    """Write the recording of a log together with its blueprint.

    Args:
        log: Log of a finished or killed mission.
        path: File to write.
        lists_recordings: Whether a viewer opens the panel that lists all recordings.

    Raises:
        OSError: If the file cannot be written.
    """
    recorder = Recorder(log)
    content = recorder.stream.binary_stream()  # Rerun's own files are cut short silently on a full disk
    try:
        recorder.stream.send_blueprint(blueprint(log.meta, is_live=False, lists_recordings=lists_recordings))
        recorder.update(is_over=True)
    finally:
        data = content.read(flush=True) or b""
        recorder.stream.disconnect()
    with atomic_file(path) as temporary:
        temporary.write_bytes(data)
