"""Plan of a yard, seen from above: ground, equipment with its names, zones and route."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.patches import Circle, Patch, Polygon, Rectangle
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from dirmusic.arrays import FloatArray
from pdpatrol.envs.scenario.zone import ZoneConfig
from pdpatrol.missions.designations import bay_of, without_phase
from pdpatrol.missions.plan_labels import labels_of
from pdpatrol.robot_models.equipment.catalogue import colour_of
from pdpatrol.robot_models.yard.solids import YardSolids
from pdpatrol.robot_models.yard.yard import Yard

ROUTE, FENCE, NAME = "#2471a3", "#7b8a97", "#333d47"
"""Colours of the route, the fence, and the names of equipment."""

MOST_NAMES = 60
"""Largest number of names that are written in full."""

SIDES = ("below", "above", "right", "left", "centre")
"""Places of names."""


def draw_ground(axes: Axes, bounds_m: ArrayLike, north_deg: float = 0.0) -> None:
    """Draw axes in metres with equal scales, a light grid and a north arrow.

    Args:
        axes: Axes to draw on.
        bounds_m: South-west and north-east corner of the ground, shape (2, 2); the axes extend 1 m beyond.
        north_deg: Direction of true north, counter-clockwise from y.
    """
    (left, bottom), (right, top) = np.array(bounds_m) + np.array([[-1.0], [1.0]])
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    east, north = ("", "") if north_deg else (", east", ", north")
    axes.set(xlabel=f"x{east} (m)", ylabel=f"y{north} (m)")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(8, integer=True, steps=[1, 2, 5, 10]))
    axes.grid(color="#e3e8ec", linewidth=0.5)
    axes.set_axisbelow(True)
    style: Any = {"transform": axes.transAxes, "ha": "right", "va": "bottom", "weight": "bold", "linespacing": 0.9}
    axes.text(1.0, 1.005, "\N{UPWARDS ARROW}\nN", rotation=north_deg, **style)


def draw_yard(axes: Axes, yard: Yard) -> None:
    """Draw fence and equipment with its names from above, lower parts first."""
    solids, parts = yard.solids, [(item.kind, part) for item in yard.equipment for part in item.assembly.parts]
    outlines: list[Patch] = []
    for k in np.argsort(solids.top_m, kind="stable").tolist():
        colour = 0.5 + 0.5 * np.array(colour_of(*parts[k]))[:3]
        outlines.append(outline(solids, k, facecolor=colour, edgecolor="#5f6b76", linewidth=0.4))
    axes.add_collection(PatchCollection(outlines, match_original=True, zorder=1), autolim=False)
    axes.add_patch(Polygon(yard.fence.corners_m, fill=False, edgecolor=FENCE, linewidth=1.4, zorder=2))
    _label_equipment(axes, yard)


def outline(solids: YardSolids, number: int, **style: Any) -> Patch:  # noqa: ANN401 - properties of a patch
    """Return the outline of one of several solids, seen from above."""
    centre_m, half_m, radius_m = solids.centre_m[number], solids.half_size_m[number], float(solids.radius_m[number])
    if radius_m > 0.0:
        return Circle(tuple(centre_m), radius_m, **style)
    yaw_deg, (x_m, y_m) = np.degrees(solids.yaw_rad[number]), 2.0 * half_m
    return Rectangle(tuple(centre_m - half_m), x_m, y_m, angle=yaw_deg, rotation_point="center", **style)


def _label_equipment(axes: Axes, yard: Yard) -> None:
    """Label the equipment, with one label for the phases of a piece; in a large yard, label bays and pieces in them."""
    corners_m = dict[str, list[FloatArray]]()
    for item in yard.equipment:
        corners_m.setdefault(without_phase(item.name), []).extend(item.solids.extent_m)
    labels, is_large, bays = labels_of(axes), len(corners_m) > MOST_NAMES, dict[str, list[FloatArray]]()
    for name, corners in corners_m.items():
        low_m, high_m = np.min(corners, axis=0), np.max(corners, axis=0)
        bay = bay_of(name) if is_large else None
        if bay:
            bays.setdefault(bay, []).extend([low_m, high_m])
        text, size_pt = name.removeprefix(f"{bay}_"), 6.0 if is_large else 7.0
        rank = 3.0 + 1.0 / (1.0 + float((high_m - low_m).max()))  # the largest pieces first
        labels.add(text, (low_m, high_m), SIDES, rank, fontsize=size_pt, color=NAME)
    for bay, corners in bays.items():
        (left_m, _), (right_m, top_m) = np.min(corners, axis=0), np.max(corners, axis=0)
        northern_edge_m = (left_m, top_m), (right_m, top_m)
        labels.add(bay, northern_edge_m, ("above", *SIDES), 2.0, fontsize=8.0, weight="bold", color=NAME)


def draw_zones(axes: Axes, zones: Sequence[ZoneConfig]) -> None:
    """Draw zones with their speed limits."""
    for zone in zones:
        axes.add_patch(Polygon(zone.polygon_m, facecolor="#f9a825", alpha=0.18, linewidth=0.0, zorder=0.5))
        axes.add_patch(Polygon(zone.polygon_m, fill=False, edgecolor="#f9a825", linestyle="--", zorder=0.6))
        middle_m, label = np.mean(zone.polygon_m, axis=0), f"{zone.name}, {zone.limit_mps:g} m/s"
        labels_of(axes).add(label, (middle_m, middle_m), ("centre", *SIDES), 1.5, fontsize=6.5, color="#8d5a00")


def draw_waypoints(axes: Axes, route: Mapping[str, Any], size_pt: float = 6.0) -> None:
    """Draw dock and waypoints with numbers of a font size; of several at one place, the first has its number."""
    axes.plot(*route["dock_m"], "s", color=ROUTE, markersize=7, label="dock", zorder=5)
    style: Any = {"color": "white", "markeredgecolor": ROUTE, "markersize": 1.6 * size_pt, "zorder": 5}
    for number, place_m in enumerate(route["waypoints_m"], start=1):
        axes.plot(*place_m, "o", label="waypoint, in order", **style)
        centre: Any = {"places": ("centre",), "rank": 1.0, "path_effects": []}
        labels_of(axes).add(str(number), (place_m, place_m), fontsize=size_pt, color=ROUTE, **centre)


def draw_legend(axes: Axes) -> None:
    """Explain each label once, below the axes."""
    handles = dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
    style: Any = {"loc": "outside lower center", "ncols": 3, "fontsize": 7.5, "frameon": False, "borderpad": 1.0}
    axes.figure.legend(handles.values(), handles, **style)
