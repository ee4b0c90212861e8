"""Figures of a report: site plan and phase-resolved pattern."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from numpy.typing import ArrayLike

from dirmusic.locating.finding import outline95
from pdpatrol.missions.record.log_contents import known_yard, zones_of
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.records import ArrayCheck, DischargeKind, Report
from pdpatrol.missions.yard_plan import ROUTE, draw_ground, draw_legend, draw_waypoints, draw_yard, draw_zones

STYLE: Any = {
    "svg.hashsalt": "pdpatrol",  # the same figure gives the same bytes
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#5f6b76",
    "axes.labelcolor": "#1c2833",
    "xtick.color": "#45525e",
    "ytick.color": "#45525e",
}
"""Matplotlib settings for all figures of a page."""

BEARING = "#5dade2"
STATES = {
    "confirmed": ("#b3261e", "finding"),
    "candidate": ("#b9770e", "not confirmed"),
    "outside": ("#7d6608", "beyond the fence"),
}
"""Colour and legend of findings by state."""

LABEL_PLACES_PT = ((-10, 10), (10, -10), (-10, -10), (0, 17), (20, 0), (-20, 0), (0, -17), (0, 27), (0, -27))
"""Offsets of a label from its place, of which the first free one is used."""

LABEL_PAD_PX = 4.0
"""Width of the box around the text of a label, at 100 pixels per inch."""

SITE_MARKS = {
    "inspected": ("o", "#1e8449", "site, inspected"),
    "finding": ("s", "#b3261e", "site, finding near"),
    "unexplained": ("^", "#d68910", "site, unexplained pulses"),
    "not_inspected": ("X", "#6c3483", "site, not inspected"),
}
"""Marker, colour and legend of sites by state of inspection."""


@rc_context(STYLE)
def draw_site_plan(log: MissionLog, report: Report) -> Figure:
    """Draw yard, path, sites and findings; field data have no yard. Findings farther out are drawn at the edge."""
    width_m, height_m = np.ptp(log.meta["bounds_m"], axis=0)
    figure = Figure(figsize=(7.1, min(6.4 * height_m / width_m + 1.0, 7.4)), layout="constrained")
    axes = figure.subplots()
    draw_ground(axes, log.meta["bounds_m"])
    draw_zones(axes, zones_of(log))
    if yard := known_yard(log):
        draw_yard(axes, yard)
        for site in report.inspection.sites if report.inspection else ():
            marker, colour, label = SITE_MARKS[site.state]
            place_m = yard.site_position(site.name)[:2]
            axes.plot(*place_m, marker, color=colour, markersize=5.5, markeredgecolor="white", label=label, zorder=6)
    style, label = ("o", "pose of the array") if "field_data" in log.meta else ("-", "path driven")
    pose_m = log.column("step", "pose")[:, :2]
    axes.plot(*pose_m.T, style, color=ROUTE, markersize=4, linewidth=1.1, label=label, zorder=4)
    if "route" in log.meta:
        draw_waypoints(axes, log.meta["route"])
    for finding in (*report.candidates, *report.findings):
        draw_finding(axes, finding.id, finding.state, finding.position_m, finding.covariance_m2)
    draw_legend(axes)
    move_labels_apart(figure)
    return figure


@rc_context(STYLE)
def draw_phase_pattern(discharge: DischargeKind) -> Figure:
    """Draw the number of pulses by phase and level, with a sine of the mains."""
    counts = np.ma.masked_equal(discharge.counts, 0)
    phase_deg = discharge.phase_step_deg * np.arange(counts.shape[1] + 1)
    level_db = discharge.lowest_db + discharge.level_step_db * np.arange(counts.shape[0] + 1)
    figure = Figure(figsize=(3.5, 3.2), layout="constrained")
    axes = figure.subplots()
    mesh = axes.pcolormesh(phase_deg, level_db, counts, cmap="viridis_r", vmin=0, edgecolors="white", linewidth=0.2)
    figure.colorbar(mesh, label="pulses per cell", aspect=30)
    sine_deg, sine = np.linspace(0.0, 360.0, 91), axes.twinx()
    sine.plot(sine_deg, np.sin(np.radians(sine_deg)), color="#7b8a97", linewidth=1.0)
    sine.set(ylim=(-1.1, 1.1), yticks=[])
    axes.set(xlim=(0, 360), xticks=range(0, 361, 90))
    axes.set(xlabel="phase of the receiver's mains (degrees)", ylabel="level at 1 m (dBV)")
    return figure


@rc_context(STYLE)
def draw_gains(check: ArrayCheck) -> Figure:
    """Draw the gain by the angle off boresight, in the mission and by the data sheet."""
    figure = Figure(figsize=(4.4, 2.9), layout="constrained")
    axes = figure.subplots()
    off_deg = [gain.off_boresight_deg for gain in check.by_angle]
    axes.plot(off_deg, [gain.data_sheet_db for gain in check.by_angle], color="#7b8a97", label="data sheet")
    axes.plot(off_deg, [gain.measured_db for gain in check.by_angle], "o", color=ROUTE, markersize=4, label="measured")
    axes.grid(color="#e3e8ec", linewidth=0.5)
    axes.set(xlim=(-180, 180), xticks=range(-180, 181, 60))
    axes.set(xlabel="angle off boresight (degrees, counter-clockwise)", ylabel="gain (dB)")
    axes.legend(frameon=False)
    return figure


def draw_finding(axes: Axes, number: int, state: str, position_m: ArrayLike, covariance_m2: ArrayLike) -> list[Artist]:
    """Draw position, 95 % ellipse and id of a finding; an ellipse larger than the figure is omitted.

    A finding beyond the axes is drawn as a diamond at their edge.
    """
    colour, label = STATES[state]
    place_m, limits_m = np.asarray(position_m)[:2], np.transpose([axes.get_xlim(), axes.get_ylim()])
    edge_m = np.clip(place_m, *limits_m)
    marker, label, offset_pt = "+", f"{label} with its number, 95 % ellipse", (10.0, 10.0)
    if (edge_m != place_m).any():
        inward_pt = np.where(edge_m < limits_m.mean(axis=0), 10.0, -10.0)
        marker, label, offset_pt = "D", "farther out, its id", tuple(inward_pt)
    artists: list[Artist] = [draw_label(axes, str(number), tuple(edge_m), offset_pt, colour)]
    artists += axes.plot(*edge_m, marker, color=colour, markersize=7, label=label, zorder=7)
    outline_m = outline95(place_m, np.asarray(covariance_m2)[:2, :2], 60)
    if np.ptp(outline_m, axis=0).max() < np.ptp(limits_m[:, 0]):
        artists += axes.plot(*outline_m.T, color=colour, linewidth=1.3, zorder=7)
    return artists


def draw_label(
    axes: Axes, text: str, place_m: tuple[float, float], offset_pt: tuple[float, float], colour: str
) -> Annotation:
    """Draw a number in a box of a colour, at an offset from its place."""
    return axes.annotate(
        text,
        place_m,
        offset_pt,
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=8.5,
        fontweight="bold",
        color="white",
        bbox={"boxstyle": "round,pad=0.25", "facecolor": colour, "edgecolor": "white"},
        zorder=8,
    )


def move_labels_apart(figure: Figure) -> None:
    """Move labels of `draw_label` off other texts and off each other; one for which no place is free stays.

    Names of equipment keep off these labels by themselves.
    """
    figure.draw_without_rendering()
    axes = figure.axes[0]
    taken = [text.get_window_extent() for text in axes.texts if not isinstance(text, Annotation)]
    for label in axes.texts:
        if not isinstance(label, Annotation):
            continue
        own = label.xyann
        for place in (own, *LABEL_PLACES_PT, own):
            label.xyann = place
            box = label.get_window_extent().padded(LABEL_PAD_PX)
            if not any(box.overlaps(other) for other in taken):
                break
        taken.append(label.get_window_extent().padded(LABEL_PAD_PX))
