"""A plan as a table for a terminal, as JSON, as the `[route]` of a scenario file, and as a picture."""

from __future__ import annotations

import textwrap
from dataclasses import asdict
from typing import Any

import numpy as np
import tomlkit
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from pdpatrol.missions.driving.site_map import CELL_M
from pdpatrol.missions.fitted_table import FittedTable
from pdpatrol.missions.plan_labels import labels_of
from pdpatrol.missions.planning.confirmation_probability import CERTAIN
from pdpatrol.missions.planning.detectability import MARGIN_DB
from pdpatrol.missions.planning.plan import Plan
from pdpatrol.missions.planning.shift import shift_text
from pdpatrol.missions.yard_plan import SIDES, draw_ground, draw_legend, draw_waypoints, draw_yard, draw_zones

MOST_INCHES = 20.0
"""Longest side of a yard in a picture."""

MOST_ROWS = 100
"""Largest number of sites of which a table shows all; of more sites, it shows those that need attention."""

SITE_HEADINGS = (
    "height\n(m)",
    "level over\ntrigger (dB)",
    "aperture\n(deg)",
    "nearest\nplace (m)",
    "confirmed\n(%)",
)
"""Headings of the table of sites, after the name."""

BLIND_COLOUR = "#d50000"


def sites_table(plan: Plan) -> FittedTable:
    """Return a table that shows how the tour detects each site, or of many sites, those that may not be confirmed.

    The columns are the height of the site, the highest level over the trigger, aperture and smallest distance along the
    tour, and the probability that the discharge of `[inspection]` would be confirmed. A dash means not detectable.
    """
    sites, is_long = plan.detectability, len(plan.confirmed) > MOST_ROWS
    which = f"Sites confirmed with less than {100 * CERTAIN:.0f} %" if is_long else "Sites"
    tour = f"along the tour of {plan.scenario.name}"
    title = f"{which} {tour}: discharges of {plan.amplitude_v:g} V at 1 m"
    table = FittedTable(title, {"site": "left", **dict.fromkeys(SITE_HEADINGS, "right")})
    rows = zip(sites.names, sites.positions_m, plan.detections(), plan.confirmed, strict=True)
    for name, position_m, detection, confirmed in rows:
        cells = ["-"] * 3
        if is_long and (detection is None or confirmed >= CERTAIN):
            continue
        if detection is not None:
            level_db, aperture_rad, nearest_m = detection
            cells = [f"{level_db:.1f}", f"{np.degrees(aperture_rad):.0f}", f"{nearest_m:.1f}"]
        table.add_row(name, f"{position_m[2]:.2f}", *cells, f"{100 * confirmed:.0f}")
    return table


def summary(plan: Plan) -> str:
    """Describe the tour in a few lines."""
    n_sites, limit_s = len(plan.detectability.names), plan.scenario.task.time_limit_s
    parts = [
        f"{n_sites - len(plan.blind)} of {n_sites} sites detectable in sight, {MARGIN_DB:g} dB above the trigger",
        f"{len(plan.stops_m)} stops",
        f"{plan.tour.length_m:.0f} m",
        f"at most {100 * plan.gap:.1f} % longer than the shortest past these stops, which may detect fewer sites",
        f"about {plan.driving_s:.0f} s of driving",
    ]
    stated, n_certain = plan.scenario.inspection, int((plan.confirmed >= CERTAIN).sum())
    parts.append(
        f"with {plan.dwell_s:g} s at each stop, {n_certain} sites at which {stated.level_dbv:g} dBV at 1 m and "
        f"{stated.rate_hz:g}/s would be confirmed with {100 * CERTAIN:.0f} %"
    )
    parts.append(shift_text(plan.shift))
    if plan.shift.duration_s > limit_s:
        parts.append(f"more than the time limit of {limit_s:.0f} s")
    return "; ".join(parts)


def blind_sites(plan: Plan) -> str:
    """Name the sites that no reachable place detects, by equipment."""
    by_equipment = dict[str, list[str]]()
    for name in plan.blind:
        equipment, _, site = name.partition("/")
        by_equipment.setdefault(equipment, []).append(site)
    return "; ".join(f"{equipment}/{', '.join(sites)}" for equipment, sites in by_equipment.items())


def as_json(plan: Plan) -> dict[str, Any]:
    """Return the plan as plain data; lengths in metres, angles in radians."""
    sites = plan.detectability
    return {
        "scenario": plan.scenario.name,
        "amplitude_v": plan.amplitude_v,
        "margin_db": MARGIN_DB,
        "inspection": plan.scenario.inspection.model_dump(),
        "tour": {
            "dock_m": list(plan.scenario.route.dock_m),
            "waypoints_m": plan.stops_m.tolist(),
            "length_m": plan.tour.length_m,
            "bound_m": plan.bound_m,
            "dwell_s": plan.dwell_s,
            "driving_s": plan.driving_s,
            "path_m": plan.path_m.tolist(),
        },
        "sites": [
            {
                "name": name,
                "position_m": sites.positions_m[k].tolist(),
                "needed_aperture_rad": float(plan.required[k, 0]),
                "confirmed": confirmed,
                "detection": None if detection is None else detection._asdict(),
            }
            for k, (name, detection, confirmed) in enumerate(
                zip(sites.names, plan.detections(), plan.confirmed.tolist(), strict=True)
            )
        ],
        "blind": list(plan.blind),
        "shift": {
            **asdict(plan.shift),
            "charges": [{**asdict(charge), "place_m": list(charge.place_m)} for charge in plan.shift.charges],
        },
    }


def as_toml(plan: Plan) -> str:
    """Return the table `[route]` of a scenario file, with the time to dwell."""
    route = plan.scenario.route.model_dump(mode="json", exclude_none=True)
    return tomlkit.dumps({"route": {**route, "waypoints_m": plan.stops_m.tolist(), "dwell_s": plan.dwell_s}})


def draw_plan(plan: Plan) -> Figure:
    """Draw the number of sites detectable from each place, the tour, and undetectable sites."""
    size_m, where = np.array(plan.site_map.yard.size_m), plan.detectability
    scale = min(0.27, MOST_INCHES / size_m.max())
    width_in, title = scale * size_m[0] + 2.7, f"{plan.scenario.name}, {plan.amplitude_v:g} V: {summary(plan)}"
    lines = textwrap.wrap(title, int(11.0 * width_in))
    height_in = scale * size_m[1] + 2.2 + 0.17 * len(lines)
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    axes = figure.subplots()
    axes.set_facecolor("#f2f2f2")
    n_sites = np.full(plan.site_map.is_free.shape, np.nan)
    n_sites[where.cells] = np.bincount(where.column, minlength=where.cells.size)
    shape = tuple(round(size / CELL_M) for size in size_m)
    extent = (0.0, CELL_M * shape[0], 0.0, CELL_M * shape[1])
    cells = axes.imshow(
        n_sites.reshape(shape).T, cmap="YlGnBu", alpha=0.85, origin="lower", extent=extent, zorder=0, aspect="equal"
    )
    bar = figure.colorbar(cells, ax=axes, shrink=0.8, pad=0.015, ticks=MaxNLocator(8, integer=True))
    bar.set_label(f"sites in sight within {plan.scenario.locating.rules().confirm_range_m:g} m; grey: out of reach")
    draw_ground(axes, [np.zeros(2), size_m])
    draw_yard(axes, plan.site_map.yard)
    draw_zones(axes, plan.scenario.zones)
    axes.plot(*plan.path_m.T, color="#c2185b", linewidth=2.0, zorder=3, label="tour")
    draw_waypoints(axes, {"dock_m": plan.scenario.route.dock_m, "waypoints_m": plan.stops_m})
    axes.plot(*where.positions_m[:, :2].T, ".", color="black", markersize=4, zorder=6, label="site")
    blind_m = where.positions_m[where.is_blind, :2]
    label = "site that no reachable place detects" if plan.blind else ""
    axes.plot(*blind_m.T, "X", color=BLIND_COLOUR, markersize=min(12.0, 45.0 * scale), zorder=7, label=label)
    equipment = {name.partition("/")[0]: position_m for name, position_m in zip(plan.blind, blind_m, strict=True)}
    for name, position_m in equipment.items():
        labels_of(axes).add(name, (position_m, position_m), SIDES, margin_pt=6.0, fontsize=8, color=BLIND_COLOUR)
    figure.suptitle("\n".join(lines), fontsize=10)
    draw_legend(axes)
    return figure
