"""Figures of a report: site plan, phase-resolved pattern, and the places from which a finding was detected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.text import Annotation
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray
from scipy.cluster.hierarchy import fclusterdata

from dirmusic.locating.finding import outline95
from pdpatrol.missions.record.finding_pulses import FindingPulses
from pdpatrol.missions.record.log_contents import known_yard
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.records import DischargeKind, FindingRecord, Report
from pdpatrol.robot_models.equipment import colour_of
from pdpatrol.robot_models.yard.yard import Yard

FloatArray = NDArray[np.float64]

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

ROUTE, BEARING, NAME = "#2471a3", "#5dade2", "#333d47"
STATES = {
    "confirmed": ("#b3261e", "finding"),
    "candidate": ("#b9770e", "not confirmed"),
    "outside": ("#7d6608", "beyond the fence"),
}
"""Colour and legend of findings by state."""

SITE_MARKS = {
    "inspected": ("o", "#1e8449", "site, inspected"),
    "partly_inspected": ("^", "#d68910", "site, from too few directions"),
    "not_inspected": ("X", "#6c3483", "site, not inspected"),
}
"""Marker, colour and legend of sites by state of inspection."""

MARGIN_M = 1.0
"""Ground shown around the bounds of a mission and around the poses of a finding."""

MAX_BEARINGS = 60
"""Bearings drawn for a finding; more could not be distinguished."""


def draw_site_plan(log: MissionLog, report: Report) -> Figure:
    """Draw yard, path, sites and findings; field data have no yard."""
    low_m, high_m = np.array(log.meta["bounds_m"]) + np.array([[-MARGIN_M], [MARGIN_M]])
    width_m, height_m = high_m - low_m
    with rc_context(STYLE):
        figure = Figure(figsize=(7.1, min(6.4 * height_m / width_m + 1.0, 7.4)), layout="constrained")
        axes = figure.subplots()
        draw_ground(axes, low_m, high_m)
        if (yard := known_yard(log)) is not None:
            draw_yard(axes, yard)
            for site in report.inspection.sites if report.inspection else ():
                marker, colour, label = SITE_MARKS[site.state]
                x, y, _ = yard.site_position(site.name)
                axes.plot(x, y, marker, color=colour, markersize=5.5, markeredgecolor="white", label=label, zorder=6)
        _draw_path(axes, log)
        beyond: list[FindingRecord] = []
        for finding in (*report.candidates, *report.findings):
            place_m = np.array(finding.position_m[:2])
            if ((place_m < low_m) | (place_m > high_m)).any():
                beyond.append(finding)
            else:
                draw_finding(axes, finding.id, finding.state, finding.position_m, finding.covariance_m2)
        if beyond:
            _mark_beyond(axes, beyond, low_m, high_m)
        handles = dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
        figure.legend(handles.values(), handles, loc="outside lower center", ncols=3, fontsize=7.5, frameon=False)
    return figure


def draw_phase_pattern(discharge: DischargeKind) -> Figure:
    """Draw the number of pulses by phase and level, with a sine of the mains."""
    pattern = discharge.pattern
    counts = np.array(pattern.counts, dtype=np.float64)
    phase_deg = pattern.phase_step_deg * np.arange(counts.shape[1] + 1)
    level_db = pattern.lowest_db + pattern.level_step_db * np.arange(counts.shape[0] + 1)
    with rc_context(STYLE):
        figure = Figure(figsize=(3.5, 3.2), layout="constrained")
        axes = figure.subplots()
        shown = np.ma.masked_equal(counts, 0.0)
        mesh = axes.pcolormesh(phase_deg, level_db, shown, cmap="viridis_r", vmin=0, edgecolors="white", linewidth=0.2)
        figure.colorbar(mesh, label="pulses per cell", aspect=30)
        middle_db, half_db = 0.5 * (level_db[0] + level_db[-1]), 0.45 * (level_db[-1] - level_db[0])
        sine_deg = np.linspace(0.0, 360.0, 91)
        axes.axhline(middle_db, color="#aab4bd", linewidth=0.6)
        axes.plot(sine_deg, middle_db + half_db * np.sin(np.radians(sine_deg)), color="#7b8a97", linewidth=1.0)
        axes.set(xlim=(0, 360), ylim=(level_db[0], level_db[-1]), xticks=range(0, 361, 90))
        axes.yaxis.set_major_locator(MaxNLocator(8, integer=True, steps=[1, 2, 5, 10]))
        axes.set(xlabel="phase of the receiver's mains (degrees)", ylabel="level at 1 m (dBV)")
    return figure


def draw_detected_from(log: MissionLog, finding: FindingRecord, pulses: FindingPulses | None) -> Figure:
    """Draw the poses from which a finding was detected and the bearings taken there, 8 to 26 m across."""
    place_m, pose_m, lines_m = np.array(finding.position_m[:2]), np.empty((0, 2)), np.empty((0, 2, 2))
    if pulses is not None and pulses.time_s.size:
        rows = np.unique(np.linspace(0, pulses.time_s.size - 1, MAX_BEARINGS).astype(np.intp))
        pose_m, bearing_rad = pulses.pose[rows, :2], pulses.bearing_rad[rows]
        ahead_m = pulses.range_m[rows] * np.array([np.cos(bearing_rad), np.sin(bearing_rad)])
        lines_m = np.stack([pose_m, pose_m + ahead_m.T], axis=1)
    half_m = float(np.clip(np.abs(pose_m - place_m).max(initial=0.0) + MARGIN_M, 4.0, 13.0))
    with rc_context(STYLE):
        figure = Figure(figsize=(3.5, 3.2), layout="constrained")
        axes = figure.subplots()
        draw_ground(axes, place_m - half_m, place_m + half_m)
        if (yard := known_yard(log)) is not None:
            draw_yard(axes, yard)
        axes.plot(*log.column("step", "pose")[:, :2].T, color="#b8c4cf", linewidth=0.9, zorder=2)
        lines = LineCollection(list(lines_m), colors=BEARING, linewidths=0.5, alpha=0.7, label="bearing", zorder=3)
        axes.add_collection(lines)
        poses = axes.plot(*pose_m.T, "o", color=ROUTE, markersize=2.4, label="pose", zorder=4)
        draw_finding(axes, finding.id, finding.state, finding.position_m, finding.covariance_m2)
        axes.legend(handles=[*poses, lines], fontsize=7, loc="lower left", framealpha=0.9, handlelength=1.2)
    return figure


def draw_ground(axes: Axes, low_m: ArrayLike, high_m: ArrayLike) -> None:
    """Draw axes in metres with equal scales, a light grid and a north arrow."""
    (left, bottom), (right, top) = np.asarray(low_m), np.asarray(high_m)
    axes.set(xlim=(left, right), ylim=(bottom, top), xlabel="x, east (m)", ylabel="y, north (m)", aspect="equal")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(8, integer=True, steps=[1, 2, 5, 10]))
    axes.grid(color="#e3e8ec", linewidth=0.5)
    axes.set_axisbelow(True)
    axes.annotate(
        "N",
        xy=(0.95, 0.99),
        xytext=(0.95, 0.9),
        xycoords="axes fraction",
        ha="center",
        va="top",
        fontsize=8,
        fontweight="bold",
        color=NAME,
        arrowprops={"arrowstyle": "-|>", "color": NAME, "shrinkA": 0, "shrinkB": 0},
        zorder=9,
    )


def draw_yard(axes: Axes, yard: Yard) -> None:
    """Draw fence and equipment with its names from above, lower parts first."""
    parts = [(item, k, part) for item in yard.equipment for k, part in enumerate(item.assembly.parts)]
    for item, k, part in sorted(parts, key=lambda entry: float(entry[0].solids.top_m[entry[1]])):
        solids, rgba = item.solids, np.array(colour_of(item.kind, part))
        style: Any = {"facecolor": 0.5 + 0.5 * rgba[:3], "edgecolor": "#5f6b76", "linewidth": 0.4, "zorder": 1}
        centre_m, half_m, radius_m = solids.centre_m[k], solids.half_size_m[k], float(solids.radius_m[k])
        if radius_m > 0.0:
            axes.add_patch(Circle(tuple(centre_m), radius_m, **style))
        else:
            yaw_deg = float(np.degrees(solids.yaw_rad[k]))
            corner_m, size_m = centre_m - half_m, 2.0 * half_m
            axes.add_patch(Rectangle(tuple(corner_m), *size_m, angle=yaw_deg, rotation_point="center", **style))
    axes.add_patch(Rectangle((0, 0), *yard.size_m, fill=False, edgecolor="#7b8a97", linewidth=1.4, zorder=2))
    for item in yard.equipment:
        low_m, high_m = item.solids.extent_m
        is_large = (high_m - low_m).min() > 2.5  # the name fits inside
        x, y = 0.5 * (low_m[0] + high_m[0]), 0.5 * (low_m[1] + high_m[1]) if is_large else low_m[1]
        axes.text(
            x,
            y,
            item.name,
            ha="center",
            va="center" if is_large else "top",
            fontsize=7.0 if len(yard.equipment) <= 14 else 5.5,
            color=NAME,
            clip_on=True,
            path_effects=[withStroke(linewidth=2.2, foreground="white")],
            zorder=6,
        )


def draw_finding(axes: Axes, number: int, state: str, position_m: ArrayLike, covariance_m2: ArrayLike) -> list[Artist]:
    """Draw position, 95 % ellipse and id of a finding; an ellipse larger than the figure is omitted."""
    colour, label = STATES[state]
    style: dict[str, Any] = {"color": colour, "zorder": 7}
    place_m = np.asarray(position_m)[:2]
    artists: list[Artist] = [draw_label(axes, str(number), place_m, (10.0, 10.0), colour)]
    artists += axes.plot(*place_m, "+", markersize=7, label=f"{label} with its id, 95 % ellipse", **style)
    outline_m = outline95(place_m, np.asarray(covariance_m2)[:2, :2], 60)
    if np.ptp(outline_m, axis=0).max() < np.ptp(axes.get_xlim()):
        artists += axes.plot(*outline_m.T, linewidth=1.3, **style)
    return artists


def draw_label(
    axes: Axes, text: str, place_m: ArrayLike, offset_pt: ArrayLike, colour: str, side: str = "center"
) -> Annotation:
    """Draw a number in a box of a colour, at an offset from its place."""
    return axes.annotate(
        text,
        np.asarray(place_m).tolist(),
        np.asarray(offset_pt).tolist(),
        textcoords="offset points",
        ha=side,
        va="center",
        fontsize=8.5,
        fontweight="bold",
        color="white",
        bbox={"boxstyle": "round,pad=0.25", "facecolor": colour, "edgecolor": "white"},
        zorder=8,
    )


def _draw_path(axes: Axes, log: MissionLog) -> None:
    """Draw the path of the estimated poses with dock and waypoints; for field data, the poses alone."""
    pose_m = log.column("step", "pose")[:, :2]
    if "field_data" in log.meta:
        axes.plot(*pose_m.T, "o", color=ROUTE, markersize=4, label="pose of the array", zorder=4)
        return
    axes.plot(*pose_m.T, color=ROUTE, linewidth=1.1, label="path driven", zorder=4)
    if "route" in log.meta:
        draw_waypoints(axes, log.meta["route"])


def draw_waypoints(axes: Axes, route: Mapping[str, Any]) -> None:
    """Draw dock and numbered waypoints."""
    axes.plot(*route["dock_m"], "s", color=ROUTE, markersize=7, label="dock", zorder=5)
    for number, (x, y) in enumerate(route["waypoints_m"], start=1):
        axes.plot(x, y, "o", color="white", markeredgecolor=ROUTE, markersize=9.5, label="waypoint, in order", zorder=5)
        axes.text(x, y, str(number), fontsize=6, ha="center", va="center_baseline", color=ROUTE, zorder=5.5)


def _mark_beyond(axes: Axes, findings: Sequence[FindingRecord], low_m: FloatArray, high_m: FloatArray) -> None:
    """Mark findings outside the figure at its edge; neighbours share one label."""
    edge_m = np.clip([finding.position_m[:2] for finding in findings], low_m, high_m)
    label_m = 0.08 * float((high_m - low_m).max())
    groups = fclusterdata(edge_m, label_m, "distance", method="single") if len(findings) > 1 else np.ones(1)
    for group in np.unique(groups):
        members = [finding for finding, own in zip(findings, groups, strict=True) if own == group]
        place_m, (colour, _) = edge_m[groups == group].mean(axis=0), STATES[members[0].state]
        axes.plot(*edge_m[groups == group].T, "D", color=colour, label="farther out, its id", zorder=7)
        inward = (place_m <= low_m).astype(int) - (place_m >= high_m)
        side = {1: "left", 0: "center", -1: "right"}[int(inward[0])]
        draw_label(axes, ", ".join(str(finding.id) for finding in members), place_m, 12.0 * inward, colour, side)
