"""Phase-resolved pattern: phase of the mains against level of each pulse of the findings."""

from __future__ import annotations

import numpy as np
import rerun as rr

from pdpatrol.missions.record.finding_pulses import phase_patterns
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.which_site import percent
from pdpatrol.missions.recording.bins import labels_2d, set_step

UNITS_PER_DB, SPAN_DB = 4.0, 30
"""Scale of the level axis, whose y points down, and its extent on each side of the middle; x is in degrees."""

COLOURS = (0xFFB228FF, 0x5AC8FFFF, 0x3CDC6EFF, 0xE66EDCFF, 0xF0E66EFF)
"""Colours of findings in order of their ids."""

MAX_PULSES = 2000
"""Pulses drawn for one finding."""


def draw_phase_patterns(stream: rr.RecordingStream, log: MissionLog) -> None:
    """Draw the pattern of each finding of a finished mission, each pulse at its time, and its kind at the end."""
    patterns = phase_patterns(log)
    if not patterns:
        return
    level_db = np.concatenate([pulses.level_db for pulses, _ in patterns.values()])
    middle_db = 10 * round(float(np.median(level_db)) / 10)
    _draw_axes(stream, middle_db)
    pulse_step = log.column("pulse", "step")
    for order, (number, (pulses, pattern)) in enumerate(sorted(patterns.items())):
        path, colour = f"phase_pattern/{number}", COLOURS[order % len(COLOURS)]
        rows = np.unique(np.linspace(0, pulses.phase_rad.size - 1, MAX_PULSES).astype(np.intp))
        phase_deg = np.mod(np.degrees(pulses.phase_rad[rows]), 360.0)
        place = np.column_stack([phase_deg, UNITS_PER_DB * (middle_db - pulses.level_db[rows])])
        step = pulse_step[pulses.pulse[rows]]
        for at in np.unique(step).tolist():
            set_step(stream, log, at)
            stream.log(path, rr.Points2D(place[step == at], colors=[colour], radii=[1.2]))
        row, column = divmod(order, 2)  # names stand in two columns above the frame
        x, y = 90.0 + 180.0 * column, -UNITS_PER_DB * SPAN_DB - 18.0 * (row + 1.5)
        text = f"finding {number}: {pattern.kind} {percent(pattern.confidence)}"
        set_step(stream, log, log.n_rows("step") - 1)
        stream.log(f"{path}/dot", rr.Points2D([[x - 84.0, y + 8.0]], colors=[colour], radii=[4.0]))
        stream.log(f"{path}/kind", labels_2d({text: [x, y]}))


def _draw_axes(stream: rr.RecordingStream, middle_db: int) -> None:
    """Draw the frame with phases and levels, and a sine of the mains."""
    reach, phase_deg = UNITS_PER_DB * SPAN_DB, np.arange(0.0, 361.0, 5.0)
    sine = np.column_stack([phase_deg, -0.8 * reach * np.sin(np.radians(phase_deg))])
    frame = [[0, -reach], [0, reach], [360, reach], [360, -reach], [0, -reach]]
    lines = rr.LineStrips2D([sine, [[0, 0], [360, 0]], frame], colors=[0x404648FF], radii=[0.6])
    stream.log("phase_pattern/axes/lines", lines, static=True)
    marks = {f"{x}°": [x, reach + 9.0] for x in range(0, 361, 90)}
    marks |= {f"{middle_db + db} dBV": [-22.0, -UNITS_PER_DB * db] for db in range(10 - SPAN_DB, SPAN_DB, 10)}
    stream.log("phase_pattern/axes/marks", labels_2d(marks), static=True)
