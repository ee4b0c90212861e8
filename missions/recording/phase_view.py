"""Pulse phase against level, as discharges are usually shown: a cloud of points over one cycle of the mains."""

from __future__ import annotations

import numpy as np
import rerun as rr

from missions.record.mission_log import MissionLog
from missions.record.phase_patterns import phase_patterns
from missions.recording import blueprint as paths
from missions.recording.scene import COLOURS

PIXELS_PER_DB = 4.0
"""Vertical scale beside one pixel per degree; levels are drawn about the median, larger upwards."""

TINTS = ((255, 178, 40), (90, 200, 255), (60, 220, 110), (230, 110, 220), (240, 230, 110))
MOST_DRAWN = 2000


def draw_phase_patterns(stream: rr.RecordingStream, log: MissionLog) -> None:
    """Draw the pattern of every finding of a finished mission; they do not move with time."""
    patterns = phase_patterns(log)
    if not patterns:
        return
    phase_deg = np.arange(0.0, 361.0, 5.0)
    wave = np.column_stack([phase_deg, -80.0 * np.sin(np.radians(phase_deg))])
    axis = np.array([[0.0, 0.0], [360.0, 0.0]])
    lines = rr.LineStrips2D([wave, axis], colors=[COLOURS["route"]], radii=[0.5])
    stream.log(f"{paths.PHASES}/mains", lines, static=True)
    marks = rr.Points2D(
        [[x, 96.0] for x in (0, 90, 180, 270, 360)],
        labels=[f"{x} deg" for x in (0, 90, 180, 270, 360)],
        radii=[0.1],
        colors=[COLOURS["route"]],
        show_labels=True,
    )
    stream.log(f"{paths.PHASES}/marks", marks, static=True)
    for order, (number, resolved) in enumerate(sorted(patterns.items())):
        some = np.unique(np.linspace(0, resolved.phase_rad.size - 1, MOST_DRAWN).astype(np.intp))
        above = resolved.level_db[some] - np.median(resolved.level_db)
        place = np.column_stack([np.mod(np.degrees(resolved.phase_rad[some]), 360.0), -PIXELS_PER_DB * above])
        tint = TINTS[order % len(TINTS)]
        stream.log(f"{paths.PHASES}/{number}", rr.Points2D(place, colors=[tint], radii=[1.2]), static=True)
        text = f"finding {number}: {resolved.pattern.kind}, {100 * resolved.pattern.confidence:.0f} %"
        label = rr.Points2D(
            [[180.0, -100.0 + 14.0 * order]], labels=[text], colors=[tint], radii=[0.1], show_labels=True
        )
        stream.log(f"{paths.PHASES}/{number}/kind", label, static=True)
