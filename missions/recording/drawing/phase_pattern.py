"""Pulse phase against level, as discharges are usually shown: a cloud of points over one cycle of the mains."""

from __future__ import annotations

import numpy as np
import rerun as rr

from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.phase_patterns import phase_patterns
from pdpatrol.missions.record.which_site import percent
from pdpatrol.missions.recording import paths
from pdpatrol.missions.recording.drawing import palette
from pdpatrol.missions.recording.drawing.canvas import Canvas

UNITS_PER_DB, UNITS_PER_DEG = 4.0, 1.0
"""Scale of the picture, whose y goes down."""

SPAN_DB = 30
"""Up and down from the middle of the level axis."""

MARK_DB = 10
NAME_COLUMNS, NAME_HALF, NAME_HEIGHT = 2, 84.0, 18.0
"""Of the names of findings: how many side by side, and half the width and the height of one, in units."""

MOST_DRAWN = 2000
"""Pulses of one finding."""


def draw_phase_patterns(canvas: Canvas, log: MissionLog) -> None:
    """Draw the pattern of every finding of a finished mission, each pulse when it came."""
    patterns = phase_patterns(log)
    if not patterns:
        return
    level_db = np.concatenate([resolved.level_db for resolved in patterns.values()])
    middle_db = MARK_DB * round(float(np.median(level_db)) / MARK_DB)
    _draw_axes(canvas, middle_db)
    pulse_step = log.column("pulse", "step")
    for order, (number, resolved) in enumerate(sorted(patterns.items())):
        some = np.unique(np.linspace(0, resolved.phase_rad.size - 1, MOST_DRAWN).astype(np.intp))
        phase_deg = np.mod(np.degrees(resolved.phase_rad[some]), 360.0)
        place = np.column_stack([phase_deg * UNITS_PER_DEG, UNITS_PER_DB * (middle_db - resolved.level_db[some])])
        colour = palette.FINDINGS[order % len(palette.FINDINGS)]
        path = f"{paths.PHASE_PATTERN}/{number}"
        canvas.still(path, rr.Points2D.from_fields(colors=[colour], radii=[1.2]))
        steps, counts = np.unique(pulse_step[resolved.pulse[some]], return_counts=True)
        in_time = np.argsort(pulse_step[resolved.pulse[some]], kind="stable")
        points = rr.Points2D.columns(positions=place[in_time].astype(np.float32)).partition(counts)
        canvas.columns(path, steps, points)
        text = f"finding {number}: {resolved.pattern.kind} {percent(resolved.pattern.confidence)}"
        at, (x, y) = np.array([log.n_rows("step") - 1]), _name_at(order)
        canvas.still(f"{path}/kind", rr.Points2D.from_fields(colors=[palette.NAME], radii=[0.1], show_labels=True))
        canvas.columns(f"{path}/kind", at, rr.Points2D.columns(positions=[[x, y]], labels=[text]))
        dot = rr.Points2D.columns(positions=[[x - NAME_HALF, y + 8.0]], colors=[colour], radii=[4.0])
        canvas.columns(f"{path}/dot", at, dot)


def _name_at(order: int) -> tuple[float, float]:
    """Where the name of a finding stands: above the frame, in columns, the first lowest."""
    row, column = divmod(order, NAME_COLUMNS)
    return 360.0 * UNITS_PER_DEG * (column + 0.5) / NAME_COLUMNS, -UNITS_PER_DB * SPAN_DB - NAME_HEIGHT * (row + 1.5)


def _draw_axes(canvas: Canvas, middle_db: int) -> None:
    """Phase in degrees, level in decibels over 1 V at 1 m, and the voltage of the mains."""
    phase_deg = np.arange(0.0, 361.0, 5.0)
    reach = UNITS_PER_DB * SPAN_DB
    wave = np.column_stack([UNITS_PER_DEG * phase_deg, -0.8 * reach * np.sin(np.radians(phase_deg))])
    frame = [[0.0, -reach], [0.0, reach], [360.0, reach], [360.0, -reach], [0.0, -reach]]
    lines = rr.LineStrips2D([wave, [[0.0, 0.0], [360.0, 0.0]], frame], colors=[palette.GROUND], radii=[0.6])
    canvas.still(f"{paths.PHASE_PATTERN}/axes/lines", lines)
    levels = range(-SPAN_DB + MARK_DB, SPAN_DB, MARK_DB)
    marks = [[float(x), reach + 9.0] for x in (0, 90, 180, 270, 360)] + [[-22.0, -UNITS_PER_DB * db] for db in levels]
    labels = [f"{x}°" for x in (0, 90, 180, 270, 360)] + [f"{middle_db + db} dBV" for db in levels]
    points = rr.Points2D(marks, labels=labels, radii=[0.1], colors=[palette.NAME], show_labels=True)
    canvas.still(f"{paths.PHASE_PATTERN}/axes/marks", points)
