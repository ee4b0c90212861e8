"""A plan as a picture: how many sites each place hears, the tour, and the sites that no place hears."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon
from matplotlib.ticker import MaxNLocator

from pdpatrol.missions.driving.site_map import CELL_M
from pdpatrol.missions.planning.plan import Plan

INCHES_PER_M = 0.27
TOUR_COLOUR, DOCK_COLOUR, BLIND_COLOUR = "#c2185b", "#1a237e", "#d50000"
GROUND_COLOUR, EQUIPMENT_COLOUR = "#f2f2f2", "#37474f"


def draw_plan(plan: Plan, path: Path) -> None:
    """Draw the plan to a PNG file."""
    size_x, size_y = plan.site_map.yard.size_m
    figure = Figure(figsize=(INCHES_PER_M * size_x + 2.2, INCHES_PER_M * size_y + 1.6), layout="constrained")
    axes = figure.subplots()
    axes.set_facecolor(GROUND_COLOUR)
    _draw_audibility(figure, axes, plan)
    _draw_equipment(axes, plan)
    _draw_tour(axes, plan)
    _draw_sites(figure, axes, plan)
    axes.set(xlim=(-0.3, size_x + 0.3), ylim=(-0.3, size_y + 0.3), xlabel="east (m)", ylabel="north (m)")
    axes.set_aspect("equal")
    n_heard = len(plan.sites) - len(plan.blind)
    axes.set_title(
        f"{plan.scenario.name}: {n_heard} of {len(plan.sites)} sites heard at {plan.amplitude_v:g} V; "
        f"{len(plan.stops_m)} stops, {plan.length_m:.0f} m, about {plan.driving_s:.0f} s",
        fontsize=11,
    )
    figure.savefig(path, dpi=110, format="png")


def _draw_audibility(figure: Figure, axes: Axes, plan: Plan) -> None:
    """Colour each place that the robot can reach by how many sites it hears; what is left plain is out of reach."""
    shape = tuple(round(size / CELL_M) for size in plan.site_map.yard.size_m)
    n_heard = np.full(shape[0] * shape[1], np.nan)
    n_heard[plan.hearing.cells] = plan.hearing.is_heard.sum(axis=0)
    most = int(np.nanmax(n_heard, initial=1.0))
    edges = np.unique(np.round(np.linspace(0, most + 1, min(most + 2, 13)))) - 0.5
    west, north = CELL_M * shape[0], CELL_M * shape[1]
    image = axes.imshow(
        n_heard.reshape(shape).T,
        origin="lower",
        extent=(0.0, west, 0.0, north),
        cmap="YlGnBu",
        norm=BoundaryNorm(edges.tolist(), 256),
        alpha=0.85,
        zorder=0,
    )
    range_m = plan.scenario.locating.rules().confirm_range_m
    bar = figure.colorbar(image, ax=axes, shrink=0.8, pad=0.015, ticks=MaxNLocator(8, integer=True))
    bar.set_label(f"sites heard in sight from within {range_m:g} m")


def _draw_equipment(axes: Axes, plan: Plan) -> None:
    solids = plan.site_map.yard.solids
    for centre_m, yaw_rad, half_m, radius_m in zip(
        solids.centre_m, solids.yaw_rad, solids.half_size_m, solids.radius_m, strict=True
    ):
        style = {"facecolor": (*[0.55] * 3, 0.35), "edgecolor": EQUIPMENT_COLOUR, "linewidth": 0.8, "zorder": 1}
        if radius_m > 0.0:
            axes.add_patch(Circle((centre_m[0], centre_m[1]), radius_m, **style))
            continue
        cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half_m
        axes.add_patch(Polygon(centre_m + corners @ np.array([[cos, sin], [-sin, cos]]), closed=True, **style))


def _draw_tour(axes: Axes, plan: Plan) -> None:
    axes.plot(*plan.way_m.T, color=TOUR_COLOUR, linewidth=2.0, zorder=3)
    for number, (x, y) in enumerate(plan.stops_m, start=1):
        axes.plot(x, y, "o", color="white", markeredgecolor=TOUR_COLOUR, markeredgewidth=1.6, markersize=14, zorder=4)
        axes.text(x, y, str(number), fontsize=8, ha="center", va="center_baseline", color=TOUR_COLOUR, zorder=5)
    x, y = plan.scenario.route.dock_m
    axes.plot(x, y, "s", color=DOCK_COLOUR, markeredgecolor="white", markersize=11, zorder=5)


def _draw_sites(figure: Figure, axes: Axes, plan: Plan) -> None:
    """Every site, and by name those that are not heard; under the picture what the marks mean."""
    for site in plan.sites:
        x, y = site.position_m[:2]
        if site.heard is not None:
            axes.plot(x, y, ".", color="black", markersize=4, zorder=6)
            continue
        axes.plot(x, y, "X", color=BLIND_COLOUR, markeredgecolor="white", markersize=12, zorder=7)
        axes.annotate(site.name, (x, y), (6, 6), textcoords="offset points", fontsize=8, color=BLIND_COLOUR, zorder=7)
    marks: list[Patch | Line2D] = [
        Line2D([], [], color=TOUR_COLOUR, marker="o", markerfacecolor="white", label="tour, stops in order"),
        Line2D([], [], color=DOCK_COLOUR, marker="s", linestyle="", label="dock"),
        Line2D([], [], color="black", marker=".", linestyle="", label="site"),
        Patch(facecolor=GROUND_COLOUR, edgecolor="grey", label="out of reach"),
    ]
    if plan.blind:
        label = "site that no reachable place hears"
        marks.append(Line2D([], [], color=BLIND_COLOUR, marker="X", linestyle="", label=label))
    figure.legend(handles=marks, loc="outside lower center", ncols=len(marks), fontsize=8)
