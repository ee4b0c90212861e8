"""A plan as a table for a terminal, as JSON, as the `[route]` of a scenario file, and as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from rich.box import SIMPLE_HEAD
from rich.table import Table

from pdpatrol.missions.driving.site_map import CELL_M
from pdpatrol.missions.planning.detectability import MARGIN_DB
from pdpatrol.missions.planning.plan import Plan, PlannedSite
from pdpatrol.missions.report.figures import draw_ground, draw_waypoints, draw_yard

BLIND_COLOUR = "#d50000"


def sites_table(plan: Plan) -> Table:
    """Return a table of how the tour detects each site.

    The columns are the height of the site, the highest level over the trigger, aperture and smallest distance along the
    tour, and the expected semi-major axis of the 95 % ellipse and standard deviation of the height.
    """
    title = (
        f"Sites along the tour of {plan.scenario.name}, lengths in metres: discharges of {plan.amplitude_v:g} V at 1 m"
    )
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("site", no_wrap=True)
    for heading in ("z", "dB", "deg", "nearest", "ellipse", "height"):
        table.add_column(heading, justify="right")
    remarks = [_remark(plan, site) for site in plan.sites]
    if any(remarks):
        table.add_column("remark", overflow="fold")
    for site, remark in zip(plan.sites, remarks, strict=True):
        cells, detection = ["-"] * 5, site.detection
        if detection is not None:
            cells = [
                f"{detection.level_db:.1f}",
                f"{np.degrees(detection.aperture_rad):.0f}",
                f"{detection.nearest_m:.1f}",
                f"{detection.ellipse95_semi_major_m:.2f}",
                f"+- {detection.height_std_m:.2f}",
            ]
        table.add_row(site.name, f"{site.position_m[2]:.2f}", *cells, *([remark] if any(remarks) else []))
    return table


def _remark(plan: Plan, site: PlannedSite) -> str:
    rules = plan.scenario.locating.rules()
    if site.detection is None:
        return "not detectable from any reachable place"
    remarks: list[str] = []
    if site.needed_rad < rules.planned_aperture_rad:
        remarks.append(f"aperture of at most {np.degrees(site.needed_rad):.0f} degrees")
    if site.detection.nearest_m > rules.confirm_range_m:
        remarks.append(f"no nearer than {site.detection.nearest_m:.1f} m")
    return ", ".join(remarks)


def summary(plan: Plan) -> str:
    """Describe the tour in one or two lines."""
    n_detectable, limit_s = len(plan.sites) - len(plan.blind), plan.scenario.task.time_limit_s
    parts = [
        f"{n_detectable} of {len(plan.sites)} sites detectable in sight, {MARGIN_DB:g} dB above the trigger",
        f"{len(plan.stops_m)} stops",
        f"{plan.length_m:.0f} m",
        f"about {plan.driving_s:.0f} s of driving",
    ]
    if plan.driving_s > limit_s:
        parts.append(f"more than the time limit of {limit_s:.0f} s")
    return "; ".join(parts)


def as_json(plan: Plan) -> dict[str, Any]:
    """Return the plan as plain data; lengths in metres, angles in radians."""
    return {
        "scenario": plan.scenario.name,
        "amplitude_v": plan.amplitude_v,
        "margin_db": MARGIN_DB,
        "tour": {
            "dock_m": list(plan.scenario.route.dock_m),
            "waypoints_m": plan.stops_m.tolist(),
            "length_m": plan.length_m,
            "driving_s": plan.driving_s,
            "path_m": plan.path_m.tolist(),
        },
        "sites": [
            {
                "name": site.name,
                "position_m": site.position_m.tolist(),
                "needed_aperture_rad": site.needed_rad,
                "detection": None if site.detection is None else site.detection._asdict(),
            }
            for site in plan.sites
        ],
        "blind": list(plan.blind),
    }


def as_toml(plan: Plan) -> str:
    """Return the table `[route]` of a scenario file."""
    route = plan.scenario.route
    lines = ["[route]", f"dock_m = {list(route.dock_m)}"]
    if route.dock_yaw_deg is not None:
        lines.append(f"dock_yaw_deg = {route.dock_yaw_deg}")
    stops = [f"  {stop}," for stop in plan.stops_m.tolist()]
    return "\n".join([*lines, "waypoints_m = [", *stops, "]", ""])


def draw_plan(plan: Plan, path: Path) -> None:
    """Draw how many sites each place detects, the tour, and sites that no place detects, to a PNG file."""
    size_m, route = np.array(plan.site_map.yard.size_m), plan.scenario.route
    figure = Figure(figsize=(0.27 * size_m[0] + 2.2, 0.27 * size_m[1] + 1.6), layout="constrained")  # inches
    axes = figure.subplots()
    axes.set_facecolor("#f2f2f2")
    _draw_detectability(figure, axes, plan)
    draw_ground(axes, (-0.3, -0.3), size_m + 0.3)
    draw_yard(axes, plan.site_map.yard)
    axes.plot(*plan.path_m.T, color="#c2185b", linewidth=2.0, zorder=3, label="tour")
    draw_waypoints(axes, {"dock_m": route.dock_m, "waypoints_m": plan.stops_m})
    _draw_sites(axes, plan)
    axes.set_title(f"{plan.scenario.name}, {plan.amplitude_v:g} V: {summary(plan)}", fontsize=11, wrap=True)
    handles = dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
    figure.legend(handles.values(), handles, loc="outside lower center", ncols=4, fontsize=8)
    figure.savefig(path, dpi=110, format="png")


def _draw_detectability(figure: Figure, axes: Axes, plan: Plan) -> None:
    """Colour each reachable place by the number of sites that it detects."""
    shape = tuple(round(size / CELL_M) for size in plan.site_map.yard.size_m)
    n_sites = np.full(shape[0] * shape[1], np.nan)
    n_sites[plan.detectability.cells] = plan.detectability.is_detectable.sum(axis=0)
    extent = (0.0, CELL_M * shape[0], 0.0, CELL_M * shape[1])
    image = axes.imshow(n_sites.reshape(shape).T, origin="lower", extent=extent, cmap="YlGnBu", alpha=0.85, zorder=0)
    bar = figure.colorbar(image, ax=axes, shrink=0.8, pad=0.015, ticks=MaxNLocator(8, integer=True))
    bar.set_label(f"sites in sight within {plan.scenario.locating.rules().confirm_range_m:g} m; grey: out of reach")


def _draw_sites(axes: Axes, plan: Plan) -> None:
    """Draw all sites, with the names of those that are not detectable."""
    sites_m = np.array([site.position_m for site in plan.sites]).reshape(-1, 3)
    is_blind = plan.detectability.is_blind
    axes.plot(*sites_m[~is_blind, :2].T, ".", color="black", markersize=4, zorder=6, label="site")
    if is_blind.any():
        label = "site that no reachable place detects"
        axes.plot(*sites_m[is_blind, :2].T, "X", color=BLIND_COLOUR, markersize=12, zorder=7, label=label)
    for name, position_m in zip(plan.blind, sites_m[is_blind], strict=True):
        axes.annotate(name, position_m[:2], (6, 6), textcoords="offset points", fontsize=8, color=BLIND_COLOUR)
