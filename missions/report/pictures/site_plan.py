"""The plan of a report: yard, way driven, findings, and how well each site was listened to."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.yard_of_log import known_yard
from pdpatrol.missions.report.inspection import Inspected
from pdpatrol.missions.report.page import SVG_STYLE
from pdpatrol.missions.report.pictures.yard_drawing import (
    COLOURS,
    draw_beyond,
    draw_finding,
    draw_frame,
    draw_yard,
    is_beyond,
)
from pdpatrol.missions.report.records import Report

FloatArray = NDArray[np.float64]

WIDTH_IN, MOST_HEIGHT_IN = 7.1, 7.4
LEFT_IN, BOTTOM_IN, TOP_IN, RIGHT_IN = 0.5, 0.95, 0.1, 0.1
"""Room for axes and legend."""

AROUND_M = 1.0
"""Ground shown beyond the bounds."""

MOST_POINTS = 400
"""Of the way driven: more cannot be told apart."""

MARKS = {
    "inspected": ("o", "site, inspected"),
    "heard_narrowly": ("^", "site, heard from too few sides"),
    "not_inspected": ("X", "site, not inspected"),
}


def draw_site_plan(log: MissionLog, report: Report, inspected: Inspected | None) -> Figure:
    """The plan; of field data without the yard, of which no map is known."""
    low_m, high_m = (np.array(corner) for corner in log.meta["bounds_m"])
    low_m, high_m = low_m - AROUND_M, high_m + AROUND_M
    width_m, height_m = high_m - low_m
    inch_per_m = min(
        (WIDTH_IN - LEFT_IN - RIGHT_IN) / width_m,
        (MOST_HEIGHT_IN - BOTTOM_IN - TOP_IN) / height_m,
    )
    across_in, up_in = inch_per_m * width_m, inch_per_m * height_m
    height_in = up_in + BOTTOM_IN + TOP_IN
    with rc_context(SVG_STYLE):
        figure = Figure(figsize=(WIDTH_IN, height_in))
        left_in = 0.5 * (WIDTH_IN - across_in - LEFT_IN - RIGHT_IN) + LEFT_IN
        box = (left_in / WIDTH_IN, BOTTOM_IN / height_in, across_in / WIDTH_IN, up_in / height_in)
        axes = figure.add_axes(box)
        draw_frame(axes, low_m, high_m)
        yard = known_yard(log)
        if yard is not None:
            draw_yard(axes, yard, with_names=True)
        marks = [*_draw_way(axes, log), *_draw_sites(axes, inspected)]
        located = (*report.candidates, *report.findings)
        beyond = [finding for finding in located if is_beyond(axes, finding)]
        draw_beyond(axes, beyond)
        for finding in located:
            if finding not in beyond:
                draw_finding(axes, finding)
        states = {"confirmed": "finding", "candidate": "not confirmed", "outside": "beyond the fence"}
        shown = {finding.state for finding in located}
        marks += [
            Line2D([], [], color=COLOURS[state], marker="+", markersize=7, label=f"{label} with its id, 95 % ellipse")
            for state, label in states.items()
            if state in shown
        ]
        if beyond:
            marks.append(
                Line2D([], [], color=COLOURS["outside"], marker="D", linestyle="", label="further out, its id")
            )
        figure.legend(handles=marks, loc="lower center", ncols=3, fontsize=7.5, frameon=False, columnspacing=1.5)
    return figure


def way_of(log: MissionLog) -> FloatArray:
    """The way driven as the robot believed it, thinned out, shape (n, 2), world frame."""
    pose = log.column("step", "pose")[:, :2]
    return pose[np.unique(np.linspace(0, max(len(pose) - 1, 0), MOST_POINTS).astype(np.intp))] if len(pose) else pose


def _draw_way(axes: Axes, log: MissionLog) -> list[Line2D]:
    colour, is_field = COLOURS["route"], "field_data" in log.meta
    if is_field:
        axes.plot(*way_of(log).T, "o", color=colour, markersize=4, zorder=4)
        return [Line2D([], [], color=colour, marker="o", linestyle="", label="pose of the array")]
    axes.plot(*way_of(log).T, color=colour, linewidth=1.1, zorder=4)
    marks = [Line2D([], [], color=colour, label="way driven")]
    route = log.meta.get("route", {})
    if route:
        axes.plot(*route["dock_m"], "s", color=colour, markersize=7, zorder=5)
        marks.append(Line2D([], [], color=colour, marker="s", linestyle="", label="dock"))
    for number, (x, y) in enumerate(route.get("waypoints_m", ()), start=1):
        axes.plot(x, y, "o", color="white", markeredgecolor=colour, markersize=9.5, zorder=5)
        axes.text(x, y, str(number), fontsize=6, ha="center", va="center_baseline", color=colour, zorder=5.5)
    if route.get("waypoints_m"):
        marks.append(
            Line2D([], [], color="white", marker="o", markeredgecolor=colour, linestyle="", label="waypoint, in order")
        )
    return marks


def _draw_sites(axes: Axes, inspected: Inspected | None) -> list[Line2D]:
    marks: list[Line2D] = []
    for state, (marker, label) in MARKS.items():
        sites = [site.position_m[:2] for site in (inspected.sites if inspected else ()) if site.state == state]
        if sites:
            style: Any = {"marker": marker, "linestyle": "", "color": COLOURS[state], "markeredgecolor": "white"}
            size = 3.5 if state == "inspected" else 6.5
            axes.plot(*np.array(sites).T, markersize=size, markeredgewidth=0.5, zorder=6, **style)
            marks.append(Line2D([], [], markersize=6, label=label, **style))
    return marks
