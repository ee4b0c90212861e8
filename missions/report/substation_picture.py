"""Plan of a substation: roads, equipment, route, and the designation of each bay."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from pdpatrol.envs.substation.drawing import ROAD_M
from pdpatrol.envs.substation.substation import Point, Substation
from pdpatrol.missions.report.figures import draw_ground, draw_legend, draw_yard
from pdpatrol.robot_models.equipment.voltages import VOLTAGES
from pdpatrol.robot_models.yard.pieces import CatalogueEquipment
from pdpatrol.robot_models.yard.yard import Yard

INCHES_PER_SPACING = 0.46
"""Distance of two phases in the picture, inches, so that their names fit next to each other."""

ROUTE_COLOUR = "#0b5cad"


def draw_substation_picture(substation: Substation, path: Path) -> None:
    """Draw a substation from above to a PNG file."""
    drawn = substation.parameters
    title = f"{drawn.kv} kV, {drawn.scheme.replace('_', ' ')}, {drawn.n_bays} bays, seed {drawn.seed}"
    route_m = [substation.dock_m, *substation.waypoints_m]
    draw_site_picture(substation.yard, route_m, title, path, substation.roads_m)


def draw_site_picture(
    yard: Yard, route_m: Sequence[Point], title: str, path: Path, roads_m: Sequence[tuple[Point, Point]] = ()
) -> None:
    """Draw a yard from above to a PNG file.

    Args:
        yard: The yard.
        route_m: Dock and waypoints.
        title: Title, to which the numbers of pieces and sites are added.
        path: File to write.
        roads_m: Start and end of each road.
    """
    size_m = np.array(yard.size_m)
    levels = {each.kv for each in yard.equipment if isinstance(each, CatalogueEquipment) and each.kv is not None}
    inches_per_m = INCHES_PER_SPACING / VOLTAGES[min(levels, default=110)].spacing_m
    figure = Figure(figsize=tuple(inches_per_m * (size_m + 2.0) + (1.2, 1.6)), layout="constrained")
    axes = figure.subplots()
    draw_ground(axes, [np.zeros(2), size_m])
    _draw_roads(axes, roads_m)
    draw_yard(axes, yard)
    if len(route_m) > 1:
        axes.plot(*np.array(route_m).T, ":", color=ROUTE_COLOUR, linewidth=1.4, label="route")
        axes.plot(*np.array(route_m[1:]).T, ".", color=ROUTE_COLOUR, markersize=5, label="waypoint")
    axes.plot(*route_m[0], "s", color=ROUTE_COLOUR, markersize=8, label="dock")
    axes.set_title(f"{title}: {len(yard.equipment)} pieces, {len(yard.site_names())} sites", fontsize=11)
    draw_legend(axes)
    figure.savefig(path, dpi=110, format="png")


def _draw_roads(axes: Axes, roads_m: Sequence[tuple[Point, Point]]) -> None:
    """Draw the roads as grey bands."""
    for start_m, end_m in roads_m:
        low_m = np.minimum(start_m, end_m) - 0.5 * ROAD_M
        width_m, height_m = np.abs(np.subtract(end_m, start_m)) + ROAD_M
        axes.add_patch(Rectangle((float(low_m[0]), float(low_m[1])), width_m, height_m, color="#e4e4e2", zorder=0.5))
