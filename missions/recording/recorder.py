"""Conversion of a mission log, growing or complete, to a Rerun recording."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from warnings import catch_warnings

import numpy as np
import rerun as rr
from rerun.chunk import RrdReader

from pdpatrol.missions.atomic_file import atomic_file
from pdpatrol.missions.record.log_contents import described_manifold
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording.bins import LogBin
from pdpatrol.missions.recording.blueprint import blueprint
from pdpatrol.missions.recording.findings import draw_findings
from pdpatrol.missions.recording.phase_pattern import draw_phase_patterns
from pdpatrol.missions.recording.pulses import draw_pulses
from pdpatrol.missions.recording.scene import draw_motion, draw_scene
from pdpatrol.missions.recording.spectra import N_AZIMUTHS, draw_spectra, draw_spectra_axes
from pdpatrol.missions.recording.status import draw_outcome, draw_status
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.wording import outcome_text, title_text

BIN_STEPS = 5
"""Steps of a mission, 0.1 s each, that are drawn together."""

MAX_BINS = 2000
"""Bins of field data, which may have any number of poses."""


class Recorder:
    """Draws the rows added to a log since the last call.

    Args:
        stream: Recording to draw on.
        log: Log of a mission, growing or complete.
        end_s: Latest time of the end of the mission; None for its time limit.
    """

    def __init__(self, stream: rr.RecordingStream, log: MissionLog, end_s: float | None = None) -> None:
        self._stream, self._log = stream, log
        self._end_s = log.meta["scenario"]["task"]["time_limit_s"] if end_s is None else end_s
        self._bin_steps = steps_per_bin(log)
        self._n_drawn = dict.fromkeys(("step", "pulse", "bearing", "finding", "likelihood", "event"), 0)
        gain = described_manifold(log.meta["array"]).gain(np.radians(np.arange(0.0, 360.0, 360.0 / N_AZIMUTHS)))
        self._unit_gain = gain / np.linalg.norm(gain, axis=0)
        stream.send_recording_name(title_text(log.meta))
        draw_scene(stream, log.meta)
        draw_spectra_axes(stream, self._end_s)

    def update(self) -> None:
        """Draw the complete bins; if the mission has ended, the rest as well."""
        if "end" in self._log.column("event", "kind", self._n_drawn["event"]):
            self.finish()
        while self._log.n_rows("step") >= self._n_drawn["step"] + self._bin_steps:
            self._draw_bin(self._n_drawn["step"] + self._bin_steps)

    def finish(self) -> None:
        """Draw the rest of a log that will not grow any more."""
        n_steps = self._log.n_rows("step")
        for end in range(self._n_drawn["step"] + self._bin_steps, n_steps, self._bin_steps):
            self._draw_bin(end)
        self._draw_bin(n_steps, is_last=True)
        if self._log.n_rows("association") and n_steps:
            draw_phase_patterns(self._stream, self._log)
        report = make_report(self._log, 0.0)
        draw_outcome(self._stream, self._log, report)
        self._stream.send_recording_name(f"{title_text(self._log.meta)}: {outcome_text(report)}")

    def _draw_bin(self, end: int, *, is_last: bool = False) -> None:
        stop = {name: self._log.n_rows(name) if is_last else self._log.rows_before(name, end) for name in self._n_drawn}
        tables = {name: self._log.table(name, start, stop[name]) for name, start in self._n_drawn.items()}
        part = LogBin(self._log, self._n_drawn["step"], self._n_drawn["pulse"], tables, not end % self._bin_steps)
        self._n_drawn = stop
        draw_motion(self._stream, part)
        draw_pulses(self._stream, part, self._unit_gain)
        draw_spectra(self._stream, part, self._unit_gain, self._bin_steps, self._end_s, is_last=is_last)
        draw_findings(self._stream, part)
        draw_status(self._stream, part)


def steps_per_bin(log: MissionLog) -> int:
    """Return how many steps are drawn together."""
    return BIN_STEPS if "scenario" in log.meta else max(-(-log.n_rows("step") // MAX_BINS), 1)


def recording_stream(log: MissionLog) -> rr.RecordingStream:
    """Return a stream for a mission.

    Recordings of one scenario share an application id, and with it a blueprint; recordings of one mission of the same
    length share their recording id, so that a viewer shows them once.
    """
    facts = f"{json.dumps(log.meta, sort_keys=True)} {log.n_rows('step')}"
    digest = hashlib.sha256(facts.encode()).hexdigest()[:8]
    name = f"pdpatrol {log.meta.get('name', 'mission')}"
    return rr.RecordingStream(name, recording_id=f"{title_text(log.meta)} ({digest})", send_properties=False)


def write_recording(log: MissionLog, path: Path, *, lists_recordings: bool = False) -> None:
    """Write the recording of a log together with its blueprint.

    Args:
        log: Log of a finished or killed mission.
        path: File to write.
        lists_recordings: Whether a viewer opens the panel that lists all recordings.

    Raises:
        OSError: If the file cannot be written.
    """
    stream = recording_stream(log)
    content = stream.binary_stream()  # Rerun's own files are cut short silently on a full disk
    time_s = log.column("step", "time_s")
    end_s = max(float(time_s.max(initial=0.0)), 0.1)
    bin_s = max(steps_per_bin(log) * end_s / max(time_s.size, 1), 0.05)
    try:
        stream.send_blueprint(blueprint(log.meta, bin_s, is_live=False, lists_recordings=lists_recordings))
        Recorder(stream, log, end_s).finish()
    finally:
        data = content.read(flush=True) or b""
        stream.disconnect()
    with atomic_file(path) as temporary:
        temporary.write_bytes(data)


def update_recording(folder: Path, *, lists_recordings: bool = False) -> Path:
    """Write `mission.rrd` of a mission from its log; without a log, keep the recording as it is.

    Returns:
        The path of the recording.

    Raises:
        FileNotFoundError: If the folder has neither log nor recording.
        ValueError: If the log, or without a log the recording, is damaged.
        OSError: If the recording cannot be written.
    """
    path = folder / "mission.rrd"
    try:
        log = MissionLog.load(folder)
    except FileNotFoundError:
        if not path.exists():
            raise
        try:
            with catch_warnings(action="error"):  # a file without its end causes a warning
                for _ in RrdReader(path).stream():
                    pass
        except (RuntimeError, ValueError, OSError, Warning) as error:
            raise ValueError(f"{path}: not a readable recording ({str(error).splitlines()[0]})") from None
        return path
    try:
        write_recording(log, path, lists_recordings=lists_recordings)
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        reason = " ".join(str(error).splitlines()[:3])
        raise ValueError(f"{folder}: log with metadata that are damaged or of another version ({reason})") from None
    return path
