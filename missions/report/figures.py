"""Figures of a report: site plan and phase-resolved pattern."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.text import Annotation
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import offset_copy
from numpy.typing import ArrayLike

from dirmusic.locating.finding import outline95
from pdpatrol.envs.scenario.zone import ZoneConfig
from pdpatrol.missions.record.log_contents import known_yard, zones_of
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.records import ArrayCheck, DischargeKind, Report
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

NAME_BELOW_PT = 3.0
"""Distance of the name of equipment from its lower side, so that a site there does not cover it."""

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


def draw_ground(axes: Axes, bounds_m: ArrayLike) -> None:
    """Draw axes in metres with equal scales, a light grid and a north arrow.

    Args:
        axes: Axes to draw on.
        bounds_m: South-west and north-east corner of the ground, shape (2, 2); the axes extend 1 m beyond.
    """
    (left, bottom), (right, top) = np.array(bounds_m) + np.array([[-1.0], [1.0]])
    axes.set(xlim=(left, right), ylim=(bottom, top), xlabel="x, east (m)", ylabel="y, north (m)", aspect="equal")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(8, integer=True, steps=[1, 2, 5, 10]))
    axes.grid(color="#e3e8ec", linewidth=0.5)
    axes.set_axisbelow(True)
    axes.text(1.0, 1.0, "N \N{UPWARDS ARROW}", transform=axes.transAxes, ha="right", va="bottom", weight="bold")


def draw_yard(axes: Axes, yard: Yard) -> None:
    """Draw fence and equipment with its names from above, lower parts first."""
    solids, parts = yard.solids, [(item.kind, part) for item in yard.equipment for part in item.assembly.parts]
    for k in np.argsort(solids.top_m, kind="stable").tolist():
        rgb = np.array(colour_of(*parts[k]))[:3]
        style: Any = {"facecolor": 0.5 + 0.5 * rgb, "edgecolor": "#5f6b76", "linewidth": 0.4, "zorder": 1}
        centre_m, half_m, radius_m = solids.centre_m[k], solids.half_size_m[k], float(solids.radius_m[k])
        if radius_m > 0.0:
            axes.add_patch(Circle(tuple(centre_m), radius_m, **style))
        else:
            style |= {"angle": np.degrees(solids.yaw_rad[k]), "rotation_point": "center"}
            axes.add_patch(Rectangle(tuple(centre_m - half_m), *(2.0 * half_m), **style))
    axes.add_patch(Polygon(yard.fence.corners_m, fill=False, edgecolor="#7b8a97", linewidth=1.4, zorder=2))
    size_pt, outline = 7.0 if len(yard.equipment) <= 14 else 5.5, [withStroke(linewidth=2.2, foreground="white")]
    style = {"fontsize": size_pt, "color": "#333d47", "path_effects": outline, "clip_on": True, "zorder": 6}
    style["transform"] = offset_copy(axes.transData, axes.get_figure(root=True), y=-NAME_BELOW_PT, units="points")
    for item in yard.equipment:
        low_m, high_m = item.solids.extent_m
        axes.text(0.5 * (low_m[0] + high_m[0]), low_m[1], item.name, ha="center", va="top", **style)


def draw_zones(axes: Axes, zones: Sequence[ZoneConfig]) -> None:
    """Draw zones with their speed limits."""
    for zone in zones:
        axes.add_patch(Polygon(zone.polygon_m, facecolor="#f9a825", alpha=0.18, linewidth=0.0, zorder=0.5))
        axes.add_patch(Polygon(zone.polygon_m, fill=False, edgecolor="#f9a825", linestyle="--", zorder=0.6))
        x, y = np.mean(zone.polygon_m, axis=0)
        label = f"{zone.name}, {zone.limit_mps:g} m/s"
        axes.text(x, y, label, ha="center", va="center", fontsize=6.5, color="#8d5a00", clip_on=True, zorder=6)


def draw_finding(axes: Axes, number: int, state: str, position_m: ArrayLike, covariance_m2: ArrayLike) -> list[Artist]:
    """Draw position, 95 % ellipse and id of a finding; an ellipse larger than the figure is omitted.

    A finding beyond the axes is drawn as a diamond at their edge.
    """
    colour, label = STATES[state]
    place_m, limits_m = np.asarray(position_m)[:2], np.transpose([axes.get_xlim(), axes.get_ylim()])
    edge_m = np.clip(place_m, *limits_m)
    marker, label, offset_pt = "+", f"{label} with its id, 95 % ellipse", (10.0, 10.0)
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
    """Move labels of `draw_label` off names and off each other; one for which no place is free stays."""
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


def draw_legend(axes: Axes) -> None:
    """Explain each label once, below the axes."""
    handles = dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
    axes.figure.legend(handles.values(), handles, loc="outside lower center", ncols=3, fontsize=7.5, frameon=False)


def draw_waypoints(axes: Axes, route: Mapping[str, Any], size_pt: float = 6.0) -> None:
    """Draw dock and waypoints, with numbers of a font size."""
    axes.plot(*route["dock_m"], "s", color=ROUTE, markersize=7, label="dock", zorder=5)
    for number, (x, y) in enumerate(route["waypoints_m"], start=1):
        axes.plot(
            x,
            y,
            "o",
            color="white",
            markeredgecolor=ROUTE,
            markersize=1.6 * size_pt,
            label="waypoint, in order",
            zorder=5,
        )
        axes.text(x, y, str(number), fontsize=size_pt, ha="center", va="center_baseline", color=ROUTE, zorder=5.5)
