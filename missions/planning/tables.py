"""A plan as a table for a terminal, as JSON, and as the `[route]` of a scenario file."""

from __future__ import annotations

from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.table import Table

from pdpatrol.missions.planning.hearing import MARGIN_DB
from pdpatrol.missions.planning.plan import Plan, PlannedSite

NOT_HEARD = "not heard from any reachable place"
RIGHT = ("z", "dB", "deg", "nearest", "ellipse", "height")
"""Height of the site; level over the trigger, aperture and distance along the tour; half the longer axis of the 95 %
ellipse, and deviation of the height, that are expected. Lengths in metres."""


def sites_table(plan: Plan) -> Table:
    """What the tour hears of each site, for a terminal."""
    title = (
        f"Heard along the tour of {plan.scenario.name}, lengths in metres: discharges of {plan.amplitude_v:g} V at 1 m"
    )
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("site", no_wrap=True)
    for heading in RIGHT:
        table.add_column(heading, justify="right")
    remarks = [_remark(plan, site) for site in plan.sites]
    if any(remarks):
        table.add_column("remark", overflow="fold")
    for site, remark in zip(plan.sites, remarks, strict=True):
        cells = ["-"] * 5
        if site.heard is not None:
            level_db, aperture_rad, nearest_m, expected = site.heard
            cells = [
                f"{level_db:.1f}",
                f"{np.degrees(aperture_rad):.0f}",
                f"{nearest_m:.1f}",
                f"{expected.semi_major_m:.2f}",
                f"+- {expected.height_m:.2f}",
            ]
        table.add_row(site.name, f"{site.position_m[2]:.2f}", *cells, *([remark] if any(remarks) else []))
    return table


def _remark(plan: Plan, site: PlannedSite) -> str:
    rules = plan.scenario.locating.rules()
    if site.heard is None:
        return NOT_HEARD
    remarks: list[str] = []
    if site.needed_rad < rules.planned_aperture_rad:
        remarks.append(f"from no more than {np.degrees(site.needed_rad):.0f} degrees of aperture")
    if site.heard.nearest_m > rules.confirm_range_m:
        remarks.append(f"from no nearer than {site.heard.nearest_m:.1f} m")
    return ", ".join(remarks)


def summary(plan: Plan) -> str:
    """The tour in a line or two."""
    n_heard, limit_s = len(plan.sites) - len(plan.blind), plan.scenario.task.time_limit_s
    parts = [
        f"{n_heard} of {len(plan.sites)} sites heard, {MARGIN_DB:g} dB above the trigger and in sight",
        f"{len(plan.stops_m)} stops",
        f"{plan.length_m:.0f} m",
        f"about {plan.driving_s:.0f} s of driving",
    ]
    if plan.driving_s > limit_s:
        parts.append(f"more than the time limit of {limit_s:.0f} s")
    return "; ".join(parts)


def as_json(plan: Plan) -> dict[str, Any]:
    """The plan as plain data; lengths in metres, angles in radians."""
    return {
        "scenario": plan.scenario.name,
        "amplitude_v": plan.amplitude_v,
        "margin_db": MARGIN_DB,
        "tour": {
            "dock_m": list(plan.scenario.route.dock_m),
            "waypoints_m": plan.stops_m.tolist(),
            "length_m": plan.length_m,
            "driving_s": plan.driving_s,
            "way_m": plan.way_m.tolist(),
        },
        "sites": [_site_as_json(site) for site in plan.sites],
        "blind": list(plan.blind),
    }


def _site_as_json(site: PlannedSite) -> dict[str, Any]:
    heard = site.heard
    return {
        "name": site.name,
        "position_m": site.position_m.tolist(),
        "needed_aperture_rad": site.needed_rad,
        "heard": None
        if heard is None
        else {
            "level_db": heard.level_db,
            "aperture_rad": heard.aperture_rad,
            "nearest_m": heard.nearest_m,
            "ellipse95_semi_major_m": heard.expected.semi_major_m,
            "height_std_m": heard.expected.height_m,
        },
    }


def as_toml(plan: Plan) -> str:
    """The table `[route]` of a scenario file."""
    route = plan.scenario.route
    lines = ["[route]", f"dock_m = {list(route.dock_m)}"]
    if route.dock_yaw_deg is not None:
        lines.append(f"dock_yaw_deg = {route.dock_yaw_deg}")
    stops = [f"  {stop}," for stop in plan.stops_m.tolist()]
    return "\n".join([*lines, "waypoints_m = [", *stops, "]", ""])
