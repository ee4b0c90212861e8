"""Picture of a scenario from above: the true yard with its sources, and errors in the map of the robot."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle, pairwise
from pathlib import Path
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from dirmusic.arrays import FloatArray
from pdpatrol.envs.scenario import Scenario
from pdpatrol.envs.scenario.scenario import PLANNED
from pdpatrol.envs.substation.drawing import ROAD_M
from pdpatrol.envs.substation.substation import Point
from pdpatrol.missions.atomic_file import atomic_file
from pdpatrol.missions.driving.local_paths import LocalPaths
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.plan_labels import labels_of
from pdpatrol.missions.yard_plan import (
    FENCE,
    ROUTE,
    SIDES,
    draw_ground,
    draw_legend,
    draw_waypoints,
    draw_yard,
    draw_zones,
    outline,
)

INCHES_PER_M, LEAST_INCHES, MOST_INCHES = 0.3, 8.0, 17.0
"""Scale of a small yard, and limits of the longer side of a yard."""

DPI = 110

SOURCE, MAP, MOVING, INTERFERER = "#c62828", "#1565c0", "#c05a00", "#6a1b9a"
"""Colours of sources, of what the robot's map shows, of moving bodies, and of interferers."""

AROUND = ("above right", "above left", "below right", "below left", *SIDES)
"""Places of the names of points."""


def write_picture(scenario: Scenario, path: Path, roads_m: Sequence[tuple[Point, Point]] = ()) -> None:
    """Draw a scenario to a PNG file; see `draw_scenario`."""
    figure = draw_scenario(scenario, roads_m)
    with atomic_file(path) as temporary:
        figure.savefig(temporary, dpi=DPI, format="png")


def draw_scenario(scenario: Scenario, roads_m: Sequence[tuple[Point, Point]] = ()) -> Figure:
    """Draw a scenario from above.

    Args:
        scenario: The scenario.
        roads_m: Start and end of each road, where known.
    """
    size_m = np.array(scenario.yard.size_m)
    scale = np.clip(INCHES_PER_M, LEAST_INCHES / size_m.max(), MOST_INCHES / size_m.max())
    width_in, height_in = scale * (size_m + 2.0)
    lines = [line for text in _captions(scenario) for line in textwrap.wrap(text, max(int(13.0 * width_in), 60))]
    figure = Figure(figsize=(width_in + 0.8, height_in + 1.5 + 0.17 * len(lines)), layout="constrained")
    axes = figure.subplots()
    north_deg = scenario.georeference.heading_deg if scenario.georeference else 0.0
    draw_ground(axes, [np.zeros(2), size_m], north_deg)
    _draw_scale(axes)
    _draw_roads(axes, roads_m)
    draw_yard(axes, scenario.yard)
    axes.plot([], [], color=FENCE, linewidth=1.4, label="fence")
    sites_m = np.array([scenario.yard.site_position(name)[:2] for name in scenario.yard.site_names()]).reshape(-1, 2)
    axes.plot(*sites_m.T, ".", color="black", markersize=2.5, zorder=3, label="discharge site")
    draw_zones(axes, scenario.zones)
    _draw_route(axes, scenario)
    _draw_map_errors(axes, scenario)
    _draw_moving(axes, scenario)
    _draw_sources(axes, scenario)
    figure.suptitle("\n".join(lines), fontsize=9.5, parse_math=False)
    draw_legend(axes)
    return figure


def _captions(scenario: Scenario) -> Iterator[str]:
    """Describe the yard, and what cannot be drawn on its plan."""
    x_m, y_m = scenario.yard.size_m
    n_pieces, n_sites = len(scenario.yard.equipment), len(scenario.yard.site_names())
    yield f"{scenario.name}: {x_m:g} x {y_m:g} m, {n_pieces} pieces of equipment, {n_sites} discharge sites"
    if scenario.route.waypoints_m == PLANNED:
        yield "The route is planned when a mission starts."
    for source in scenario.sources:
        if source.anywhere_at_m is not None:
            yield f"Source {source.name}: anywhere in the yard, {source.anywhere_at_m:g} m above the ground"
    for item in scenario.interferers:
        if not scenario.yard.contains(item.position_m):
            yield "Interferer {}: outside the yard, at ({:g}, {:g}, {:g}) m".format(item.name, *item.position_m)
    for carrier in scenario.carriers:
        yield f"Carrier {carrier.name}: {carrier.frequency_hz / 1e6:g} MHz from {carrier.bearing_deg:g} degrees"
    nature = scenario.nature.model_dump(mode="json", exclude_defaults=True, exclude={"moving"})
    if unknown := [f"{key} = {value}" for key, value in _flat(nature)]:
        yield f"The robot does not know ([nature]): {', '.join(unknown)}"


def _flat(table: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, object]]:
    """Yield dotted keys and values of nested tables."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _flat(cast("dict[str, Any]", value), f"{before}{key}.")
        else:
            yield f"{before}{key}", value


def _draw_scale(axes: Axes) -> None:
    """Draw a scale bar above the plan."""
    (left_m, right_m), above = axes.get_xlim(), axes.get_xaxis_transform()
    length_m = max(length for length in (1, 2, 5, 10, 20, 50) if length == 1 or length <= 0.2 * (right_m - left_m))
    ends_m = [left_m, left_m + length_m]
    axes.plot(ends_m, [1.012, 1.012], "|-", color="black", linewidth=2.0, transform=above, clip_on=False)
    axes.text(ends_m[1], 1.012, f"  {length_m} m", transform=above, va="center", fontsize=8)


def _draw_roads(axes: Axes, roads_m: Sequence[tuple[Point, Point]]) -> None:
    """Draw the roads as grey bands."""
    for start_m, end_m in roads_m:
        low_m = np.minimum(start_m, end_m) - 0.5 * ROAD_M
        width_m, height_m = np.abs(np.subtract(end_m, start_m)) + ROAD_M
        axes.add_patch(Rectangle((float(low_m[0]), float(low_m[1])), width_m, height_m, color="#e4e4e2", zorder=0.5))


def _draw_route(axes: Axes, scenario: Scenario) -> None:
    """Draw dock, waypoints, and the shortest path past them and back on the robot's map."""
    dock_m, is_planned = scenario.route.dock_m, scenario.route.waypoints_m == PLANNED
    stops_m = () if is_planned else scenario.route.stops_m
    if stops_m:
        site_map = SiteMap(scenario)
        paths, legs_m = LocalPaths(site_map), list[FloatArray]()
        for start_m, end_m in pairwise((dock_m, *stops_m, dock_m)):
            try:
                cells = paths.path(site_map.cell(start_m), site_map.cell(end_m))
            except ValueError:  # no path; the robot gives up such a waypoint
                continue
            legs_m.append(np.vstack([start_m, site_map.centres_m[cells], end_m]))
        for leg_m in legs_m:
            axes.plot(*leg_m.T, ":", color=ROUTE, linewidth=1.5, zorder=4, label="route")
    draw_waypoints(axes, {"dock_m": dock_m, "waypoints_m": stops_m})


def _draw_map_errors(axes: Axes, scenario: Scenario) -> None:
    """Draw the outlines of equipment where the robot's map differs from the yard."""
    known, true = scenario.known_yard, {item.name: item for item in scenario.yard.equipment}
    style: dict[str, Any] = {"fill": False, "edgecolor": MAP, "linewidth": 1.3, "linestyle": "--", "zorder": 5}
    for item in known.equipment:
        if true.get(item.name) == item:
            continue
        for number in range(item.solids.yaw_rad.size):
            axes.add_patch(outline(item.solids, number, **style))
        axes.plot([], [], "--", color=MAP, label="as the robot's map shows it")
        moved = true.get(item.name)
        text = f"{item.name}: only on the map" if moved is None else f"{item.name} on the map"
        labels_of(axes).add(text, item.solids.extent_m, SIDES, 0.0, fontsize=7, color=MAP)
        if moved is not None:
            axes.annotate("", item.position_m, moved.position_m, arrowprops={"arrowstyle": "->", "color": MAP})
    for name in scenario.map.missing:
        for number in range(true[name].solids.yaw_rad.size):
            axes.add_patch(outline(true[name].solids, number, **{**style, "linestyle": "-", "hatch": "xxxx"}))
        axes.plot([], [], "s", color="none", markeredgecolor=MAP, label="not on the robot's map")


def _draw_moving(axes: Axes, scenario: Scenario) -> None:
    """Draw the paths of people and vehicles."""
    for item in scenario.nature.moving:
        points_m = np.array(item.points_m)
        label = "path of a person or vehicle, not known"
        axes.plot(*points_m.T, "-.", color=MOVING, linewidth=1.3, zorder=4, label=label)
        middle_m = points_m[:2].mean(axis=0)
        labels_of(axes).add(item.name, (middle_m, middle_m), AROUND, 0.0, 3.0, fontsize=7, color=MOVING)


def _draw_sources(axes: Axes, scenario: Scenario) -> None:
    """Draw true sources, the sites among which they are drawn, and interferers in the yard."""
    labels = labels_of(axes)
    marks = cycle("*PhdX8")
    for source in scenario.sources:
        sites = scenario.candidate_sites(source)
        if len(sites) > 1:
            style: dict[str, Any] = {"color": "none", "markeredgecolor": SOURCE, "markersize": 9, "zorder": 7}
            places_m = [scenario.yard.site_position(name)[:2] for name in sites]
            label = f"source {source.name}, at one of {len(sites)} sites"
            axes.plot(*np.transpose(places_m), next(marks), label=label, **style)
        elif source.anywhere_at_m is None:
            place_m = (source.position_m or scenario.yard.site_position(sites[0]))[:2]
            axes.plot(*place_m, "*", color=SOURCE, markersize=11, zorder=7, label="source")
            labels.add(source.name, (place_m, place_m), AROUND, 0.0, 5.0, fontsize=8, color=SOURCE)
    for item in scenario.interferers:
        if scenario.yard.contains(item.position_m):
            points_m = np.array([item.position_m, *(item.path_m or ())])[:, :2]
            axes.plot(*points_m.T, "--", color=INTERFERER, linewidth=1.0, zorder=4)
            axes.plot(*points_m[0], "D", color=INTERFERER, markersize=6, zorder=7, label="interferer")
            labels.add(item.name, (points_m[0], points_m[0]), AROUND, 0.0, 4.0, fontsize=8, color=INTERFERER)
