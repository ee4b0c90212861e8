"""Pictures of one finding: the phase-resolved pattern, and from where it was detected."""

from __future__ import annotations

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from pdpatrol.missions.record.finding_pulses import FindingPulses
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.yard_of_log import known_yard
from pdpatrol.missions.report.page import SVG_STYLE
from pdpatrol.missions.report.pictures.site_plan import way_of
from pdpatrol.missions.report.pictures.yard_drawing import COLOURS, draw_finding, draw_frame, draw_yard
from pdpatrol.missions.report.records import Discharge, FindingRecord

FloatArray = NDArray[np.float64]

SIZE_IN = (3.5, 3.2)

MOST_BEARINGS = 60
"""Drawn of a finding: more cannot be told apart."""

LEAST_SIDE_M, MOST_SIDE_M = 8.0, 26.0
"""Of the ground round a finding that is shown."""

AROUND_M = 1.0


def draw_phase_pattern(discharge: Discharge) -> Figure:
    """Phase against level, how many pulses of each by colour, and the sine of the mains."""
    pattern = discharge.pattern
    counts = np.array(pattern.counts, dtype=np.float64)
    phase_deg = pattern.phase_step_deg * np.arange(counts.shape[1] + 1)
    level_db = pattern.lowest_db + pattern.level_step_db * np.arange(counts.shape[0] + 1)
    with rc_context(SVG_STYLE):
        figure = Figure(figsize=SIZE_IN)
        axes = figure.add_axes((0.17, 0.16, 0.58, 0.79))
        shown = np.ma.masked_equal(counts, 0.0)
        mesh = axes.pcolormesh(phase_deg, level_db, shown, cmap="viridis_r", vmin=0, edgecolors="white", linewidth=0.2)
        colour_bar = figure.colorbar(mesh, cax=figure.add_axes((0.78, 0.16, 0.03, 0.79)))
        colour_bar.set_label("pulses per cell")
        middle, half = 0.5 * (level_db[0] + level_db[-1]), 0.45 * (level_db[-1] - level_db[0])
        phase = np.linspace(0.0, 360.0, 91)
        axes.axhline(middle, color="#aab4bd", linewidth=0.6)
        axes.plot(phase, middle + half * np.sin(np.radians(phase)), color="#7b8a97", linewidth=1.0)
        axes.set(xlim=(0, 360), ylim=(level_db[0], level_db[-1]), xticks=range(0, 361, 90))
        axes.yaxis.set_major_locator(MaxNLocator(8, integer=True, steps=[1, 2, 5, 10]))
        axes.set(xlabel="phase of the receiver's mains (degrees)", ylabel="level at 1 m (dBV)")
    return figure


def draw_detected_from(log: MissionLog, finding: FindingRecord, pulses: FindingPulses | None) -> Figure:
    """Poses from which a finding was detected, and the bearings taken there."""
    place_m = np.array(finding.position_m[:2])
    seen_m = np.empty((0, 2)) if pulses is None else pulses.pose[:, :2]
    off_m = np.abs(seen_m - place_m).max(axis=0, initial=0.0).max() + AROUND_M
    half_m = float(np.clip(off_m, 0.5 * LEAST_SIDE_M, 0.5 * MOST_SIDE_M))
    with rc_context(SVG_STYLE):
        figure = Figure(figsize=SIZE_IN)
        axes = figure.add_axes((0.15, 0.16, 0.83, 0.79))
        draw_frame(axes, place_m - half_m, place_m + half_m)
        yard = known_yard(log)
        if yard is not None:
            draw_yard(axes, yard, with_names=True)
        axes.plot(*way_of(log).T, color="#b8c4cf", linewidth=0.9, zorder=2)
        if pulses is not None and len(seen_m):
            some = np.unique(np.linspace(0, len(seen_m) - 1, MOST_BEARINGS).astype(np.intp))
            for x, y, bearing_rad, range_m in zip(
                *seen_m[some].T, pulses.bearing_rad[some], pulses.range_m[some], strict=True
            ):
                ends = np.array([[x, y], [x + range_m * np.cos(bearing_rad), y + range_m * np.sin(bearing_rad)]])
                axes.plot(*ends.T, color=COLOURS["bearing"], linewidth=0.5, alpha=0.7, zorder=3)
            axes.plot(*seen_m[some].T, "o", color=COLOURS["route"], markersize=2.4, zorder=4)
        draw_finding(axes, finding)
        marks = [
            Line2D([], [], color=COLOURS["route"], marker="o", markersize=3, linestyle="", label="pose"),
            Line2D([], [], color=COLOURS["bearing"], linewidth=1, label="bearing"),
        ]
        axes.legend(handles=marks, fontsize=7, loc="lower left", framealpha=0.9, handlelength=1.2)
    return figure
