"""Figures of a report: site plan and phase-resolved pattern."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.text import Annotation
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from dirmusic.locating.finding import outline95
from pdpatrol.missions.record.log_contents import known_yard
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.records import DischargeKind, Report
from pdpatrol.robot_models.equipment.catalogue import colour_of
from pdpatrol.robot_models.yard.yard import Yard

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

ROUTE, BEARING = "#2471a3", "#5dade2"
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


def draw_site_plan(log: MissionLog, report: Report) -> Figure:
    """Draw yard, path, sites and findings; field data have no yard. Findings farther out are drawn at the edge."""
    low_m, high_m = np.array(log.meta["bounds_m"]) + np.array([[-1.0], [1.0]])
    width_m, height_m = high_m - low_m
    pose_m, is_field = log.column("step", "pose")[:, :2], "field_data" in log.meta
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
        if is_field:
            axes.plot(*pose_m.T, "o", color=ROUTE, markersize=4, label="pose of the array", zorder=4)
        else:
            axes.plot(*pose_m.T, color=ROUTE, linewidth=1.1, label="path driven", zorder=4)
        if "route" in log.meta:
            draw_waypoints(axes, log.meta["route"])
        for finding in (*report.candidates, *report.findings):
            draw_finding(axes, finding.id, finding.state, finding.position_m, finding.covariance_m2)
        handles = dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
        figure.legend(handles.values(), handles, loc="outside lower center", ncols=3, fontsize=7.5, frameon=False)
    return figure


def draw_phase_pattern(discharge: DischargeKind) -> Figure:
    """Draw the number of pulses by phase and level, with a sine of the mains."""
    counts = np.array(discharge.counts)
    phase_deg = discharge.phase_step_deg * np.arange(counts.shape[1] + 1)
    level_db = discharge.lowest_db + discharge.level_step_db * np.arange(counts.shape[0] + 1)
    with rc_context(STYLE):
        figure = Figure(figsize=(3.5, 3.2), layout="constrained")
        axes = figure.subplots()
        shown = np.ma.masked_equal(counts, 0)
        mesh = axes.pcolormesh(phase_deg, level_db, shown, cmap="viridis_r", vmin=0, edgecolors="white", linewidth=0.2)
        figure.colorbar(mesh, label="pulses per cell", aspect=30)
        sine_deg, sine = np.linspace(0.0, 360.0, 91), axes.twinx()
        sine.plot(sine_deg, np.sin(np.radians(sine_deg)), color="#7b8a97", linewidth=1.0)
        sine.set(ylim=(-1.1, 1.1), yticks=[])
        axes.set(xlim=(0, 360), xticks=range(0, 361, 90))
        axes.set(xlabel="phase of the receiver's mains (degrees)", ylabel="level at 1 m (dBV)")
    return figure


def draw_ground(axes: Axes, low_m: ArrayLike, high_m: ArrayLike) -> None:
    """Draw axes in metres with equal scales, a light grid and a north arrow."""
    (left, bottom), (right, top) = np.asarray(low_m), np.asarray(high_m)
    axes.set(xlim=(left, right), ylim=(bottom, top), xlabel="x, east (m)", ylabel="y, north (m)", aspect="equal")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(8, integer=True, steps=[1, 2, 5, 10]))
    axes.grid(color="#e3e8ec", linewidth=0.5)
    axes.set_axisbelow(True)
    axes.text(1.0, 1.0, "N \N{UPWARDS ARROW}", transform=axes.transAxes, ha="right", va="bottom", weight="bold")


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
    style = {"fontsize": 7.0 if len(yard.equipment) <= 14 else 5.5, "color": "#333d47", "clip_on": True, "zorder": 6}
    for item in yard.equipment:
        low_m, high_m = item.solids.extent_m
        name = axes.text(0.5 * (low_m[0] + high_m[0]), low_m[1], item.name, ha="center", va="top", **style)
        name.set_path_effects([withStroke(linewidth=2.2, foreground="white")])


def draw_finding(axes: Axes, number: int, state: str, position_m: ArrayLike, covariance_m2: ArrayLike) -> list[Artist]:
    """Draw position, 95 % ellipse and id of a finding; an ellipse larger than the figure is omitted.

    A finding beyond the axes is drawn as a diamond at their edge.
    """
    colour, label = STATES[state]
    style: dict[str, Any] = {"color": colour, "zorder": 7}
    place_m, limits_m = np.asarray(position_m)[:2], np.transpose([axes.get_xlim(), axes.get_ylim()])
    edge_m = np.clip(place_m, *limits_m)
    inward = np.where(edge_m < limits_m.mean(axis=0), 10.0, -10.0)
    if (edge_m != place_m).any():
        edge = axes.plot(*edge_m, "D", label="farther out, its id", **style)
        return [*edge, draw_label(axes, str(number), edge_m, inward, colour)]
    artists: list[Artist] = [draw_label(axes, str(number), place_m, (10.0, 10.0), colour)]
    artists += axes.plot(*place_m, "+", markersize=7, label=f"{label} with its id, 95 % ellipse", **style)
    outline_m = outline95(place_m, np.asarray(covariance_m2)[:2, :2], 60)
    if np.ptp(outline_m, axis=0).max() < np.ptp(limits_m[:, 0]):
        artists += axes.plot(*outline_m.T, linewidth=1.3, **style)
    return artists


def draw_label(axes: Axes, text: str, place_m: ArrayLike, offset_pt: ArrayLike, colour: str) -> Annotation:
    """Draw a number in a box of a colour, at an offset from its place."""
    return axes.annotate(
        text,
        np.asarray(place_m).tolist(),
        np.asarray(offset_pt).tolist(),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=8.5,
        fontweight="bold",
        color="white",
        bbox={"boxstyle": "round,pad=0.25", "facecolor": colour, "edgecolor": "white"},
        zorder=8,
    )


def draw_waypoints(axes: Axes, route: Mapping[str, Any]) -> None:
    """Draw dock and numbered waypoints."""
    axes.plot(*route["dock_m"], "s", color=ROUTE, markersize=7, label="dock", zorder=5)
    for number, (x, y) in enumerate(route["waypoints_m"], start=1):
        axes.plot(x, y, "o", color="white", markeredgecolor=ROUTE, markersize=9.5, label="waypoint, in order", zorder=5)
        axes.text(x, y, str(number), fontsize=6, ha="center", va="center_baseline", color=ROUTE, zorder=5.5)
