"""Plan of a drawn substation: roads, equipment, route, and the designation of each bay."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from pdpatrol.envs.substation.drawing import ROAD_M
from pdpatrol.envs.substation.substation import Substation
from pdpatrol.missions.report.figures import draw_ground, draw_legend, draw_yard
from pdpatrol.robot_models.equipment.voltages import VOLTAGES

INCHES_PER_SPACING = 0.46
"""Distance of two phases in the picture, inches, so that their names fit next to each other."""

ROUTE_COLOUR = "#0b5cad"


def draw_substation_picture(substation: Substation, path: Path) -> None:
    """Draw a substation from above to a PNG file."""
    size_m, yard = np.array(substation.size_m), substation.yard
    inches_per_m = INCHES_PER_SPACING / VOLTAGES[substation.parameters.kv].spacing_m
    figure = Figure(figsize=tuple(inches_per_m * (size_m + 2.0) + (1.2, 1.6)), layout="constrained")
    axes = figure.subplots()
    draw_ground(axes, [np.zeros(2), size_m])
    _draw_roads(axes, substation)
    draw_yard(axes, yard)
    axes.plot(
        *np.array([substation.dock_m, *substation.waypoints_m]).T, ":", color=ROUTE_COLOUR, linewidth=1.4, label="route"
    )
    axes.plot(*np.array(substation.waypoints_m).T, ".", color=ROUTE_COLOUR, markersize=5, label="waypoint")
    axes.plot(*substation.dock_m, "s", color=ROUTE_COLOUR, markersize=8, label="dock")
    drawn = substation.parameters
    axes.set_title(
        f"{drawn.kv} kV, {drawn.scheme.replace('_', ' ')}, {drawn.n_bays} bays, seed {drawn.seed}: "
        f"{len(yard.equipment)} pieces, {len(yard.site_names())} sites",
        fontsize=11,
    )
    draw_legend(axes)
    figure.savefig(path, dpi=110, format="png")


def _draw_roads(axes: Axes, substation: Substation) -> None:
    """Draw the roads as grey bands."""
    for start_m, end_m in substation.roads_m:
        low_m = np.minimum(start_m, end_m) - 0.5 * ROAD_M
        width_m, height_m = np.abs(np.subtract(end_m, start_m)) + ROAD_M
        axes.add_patch(Rectangle((float(low_m[0]), float(low_m[1])), width_m, height_m, color="#e4e4e2", zorder=0.5))
