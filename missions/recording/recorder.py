"""Conversion of a mission log, growing or complete, to a Rerun recording."""

import hashlib
import json
import re
from pathlib import Path

import rerun as rr

from pdpatrol.missions.atomic_file import atomic_file
from pdpatrol.missions.record.log_contents import true_yard
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording.blueprint import blueprint
from pdpatrol.missions.recording.findings import draw_findings, draw_limit, draw_phase_patterns, draw_styles
from pdpatrol.missions.recording.motion import (
    LogBin,
    draw_bearing_plot,
    draw_motion,
    draw_paths,
    draw_pulses,
    set_step,
)
from pdpatrol.missions.recording.scene import draw_scene
from pdpatrol.missions.recording.story import draw_events, draw_outcome, draw_start, draw_story
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.wording import outcome_text, title_text

CHUNK_BINS = 60
"""Bins after which the data are written: 30 s of a mission. Each chunk of a file takes 2 kB, whatever it holds."""


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
            re.sub(r"[^A-Za-z0-9 _:-]", "-", f"pdpatrol {log.meta['name']}"),  # others make Rerun print a warning
            recording_id=f"{title} ({hashlib.sha256(facts.encode()).hexdigest()[:8]})",
            send_properties=False,
            batcher_config=rr.ChunkBatcherConfig.NEVER(),  # by time, the size of a file would depend on the machine
        )
        self.stream.set_log_time_enabled(False)  # wall-clock times of the writing of the file
        self._log, self._yard = log, true_yard(log)
        # steps drawn together: 0.5 s of a mission; field data make at most 2000 bins
        self._bin_steps = 5 if "truth" in log.meta else max(-(-log.n_rows("step") // 2000), 1)
        self._n_drawn: dict[str, int] = dict.fromkeys(("step", "pulse", "bearing", "finding", "likelihood", "event"), 0)
        self._styled: set[int] = set()  # numbers of the findings whose colours are set
        self._has_scene = False
        self.stream.send_recording_name(title)

    def update(self, *, is_over: bool) -> None:
        """Draw the complete bins; if the log no longer grows, the rest and the outcome as well.

        What does not change comes first, then motion, phases and plots, so that a browser shows yard, robot and the
        phases of the mission while the rest of a file arrives.
        """
        if not self._has_scene:  # not before, so that a blueprint can be sent first
            draw_scene(self.stream, self._log.meta)
            self._has_scene = True
        n_steps, n_drawn = self._log.n_rows("step"), self._n_drawn["step"]
        end = n_steps if is_over else n_steps - (n_steps - n_drawn) % self._bin_steps
        whole = self._rows_until(end)
        numbers = set(whole.tables["finding"]["id"].tolist())
        draw_styles(self.stream, sorted(numbers - self._styled))
        self._styled |= numbers
        report = make_report(self._log, 0.0) if is_over else None
        if report:
            draw_phase_patterns(self.stream, self._log, report)
            self.stream.send_recording_name(f"{title_text(self._log.meta)}: {outcome_text(report)}")
        if n_drawn == 0 < end:
            draw_start(self.stream, self._log)
        self.stream.flush()
        draw_motion(self.stream, whole, self._yard and self._yard.solids)
        draw_bearing_plot(self.stream, whole)
        for number, stop in enumerate(range(n_drawn + self._bin_steps, end + 1, self._bin_steps), start=1):
            self._draw_bin(stop)
            if number % CHUNK_BINS == 0:
                self.stream.flush()
        if report:
            self._draw_bin(max(n_steps, 1))  # without steps, events refer to step 0
            set_step(self.stream, self._log, self._log.last_step)
            draw_outcome(self.stream, report)
        self.stream.flush()

    def _rows_until(self, end: int) -> LogBin:
        """Return the rows that have not been drawn, up to step `end`."""
        stop = {name: self._log.rows_before(name, end) for name in self._n_drawn}
        tables = {name: self._log.table(name, start, stop[name]) for name, start in self._n_drawn.items()}
        return LogBin(self._log, self._n_drawn, tables)

    def _draw_bin(self, end: int) -> None:
        """Draw the rows up to step `end`."""
        part = self._rows_until(end)
        self._n_drawn = {name: self._log.rows_before(name, end) for name in self._n_drawn}
        draw_findings(self.stream, part)
        draw_events(self.stream, part)
        if part.end > part.first["step"]:
            set_step(self.stream, self._log, part.end - 1)
            draw_paths(self.stream, part)
            draw_pulses(self.stream, part)
            draw_limit(self.stream, part)
            draw_story(self.stream, part)


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
