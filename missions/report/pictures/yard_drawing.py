"""A yard on plan, to scale: what stands in it, fence, north, and the marks that pictures of a report share."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.patches import Rectangle
from matplotlib.patheffects import AbstractPathEffect, withStroke
from matplotlib.text import OffsetFrom
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from dirmusic.locating.ellipse import outline95
from missions.report.records import FindingRecord
from robot_models.equipment import colour_of
from robot_models.yard.pieces import Equipment
from robot_models.yard.yard import Yard

FloatArray = NDArray[np.float64]

COLOURS = {
    "route": "#2471a3",
    "confirmed": "#b3261e",
    "candidate": "#b9770e",
    "outside": "#7d6608",
    "fence": "#7b8a97",
    "name": "#333d47",
    "inspected": "#1e8449",
    "heard_narrowly": "#d68910",
    "not_inspected": "#6c3483",
    "bearing": "#5dade2",
}

N_ROUND = 20
"""Corners of the polygon that stands for a circle."""

PALER = 0.5
"""How far the colours of equipment are drawn towards white: marks must stand out."""

FEW_PIECES = 14
"""Up to so many have larger names."""

OUTLINE: list[AbstractPathEffect] = [withStroke(linewidth=2.2, foreground="white")]


def draw_yard(axes: Axes, yard: Yard, *, with_names: bool) -> None:
    """Equipment from above, the lower parts first, and the fence."""
    pieces = [(item, k) for item in yard.equipment for k in range(len(item.assembly.parts))]
    pieces.sort(key=lambda piece: float(piece[0].solids.top_m[piece[1]]))
    outlines = [_outline(item, k) for item, k in pieces]
    colours = [_colour(item, list(item.assembly.parts)[k]) for item, k in pieces]
    axes.add_collection(PolyCollection(outlines, facecolors=colours, edgecolors="#5f6b76", linewidths=0.4, zorder=1))
    axes.add_patch(Rectangle((0, 0), *yard.size_m, fill=False, edgecolor=COLOURS["fence"], linewidth=1.4, zorder=2))
    if with_names:
        for item in yard.equipment:
            _write_name(axes, item, 7.0 if len(yard.equipment) <= FEW_PIECES else 5.5)


def draw_frame(axes: Axes, low_m: ArrayLike, high_m: ArrayLike) -> None:
    """Axes in metres of one scale, the arrow to the north, and light lines of a grid."""
    (left, bottom), (right, top) = np.asarray(low_m), np.asarray(high_m)
    axes.set(xlim=(left, right), ylim=(bottom, top), xlabel="x, east (m)", ylabel="y, north (m)")
    axes.set_aspect("equal")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(8, integer=True, steps=[1, 2, 5, 10]))
    axes.grid(color="#e3e8ec", linewidth=0.5)
    axes.set_axisbelow(True)
    corner = OffsetFrom(axes.patch, (1.0, 1.0))
    axes.annotate(
        "N",
        xy=(-8.0, -27.0),
        xycoords=corner,
        ha="center",
        va="center",
        fontsize=8,
        fontweight="bold",
        color=COLOURS["name"],
        zorder=9,
    )
    axes.annotate(
        "",
        xy=(-8.0, -3.0),
        xytext=(-8.0, -22.0),
        xycoords=corner,
        textcoords=corner,
        arrowprops={"arrowstyle": "-|>", "color": COLOURS["name"], "shrinkA": 0, "shrinkB": 0},
        zorder=9,
    )


def draw_finding(axes: Axes, finding: FindingRecord) -> None:
    """Place, 95 % ellipse and id of a finding; what lies beyond the picture is marked at its edge."""
    colour = COLOURS[finding.state]
    position_m, covariance_m2 = np.array(finding.position_m[:2]), np.array(finding.covariance_m2)[:2, :2]
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    shown_m = np.clip(position_m, (left, bottom), (right, top))
    axes.plot(*outline95(position_m, covariance_m2, 60).T, color=colour, linewidth=1.3, zorder=7)
    is_inside = bool((shown_m == position_m).all())
    axes.plot(*shown_m, "+" if is_inside else "D", color=colour, markersize=7, markeredgewidth=1.4, zorder=7)
    middle_m = np.array([0.5 * (left + right), 0.5 * (bottom + top)])
    to_x, to_y = np.where(shown_m < middle_m, 11, -11) if not is_inside else (10, 10)
    text = str(finding.id) if is_inside else f"{finding.id}: at ({position_m[0]:.0f}, {position_m[1]:.0f}) m"
    axes.annotate(
        text,
        (float(shown_m[0]), float(shown_m[1])),
        (float(to_x), float(to_y)),
        textcoords="offset points",
        ha="center" if is_inside else "left" if to_x > 0 else "right",
        va="center",
        fontsize=8.5,
        fontweight="bold",
        color="white",
        bbox={"boxstyle": "round,pad=0.25", "facecolor": colour, "edgecolor": "white"},
        zorder=8,
    )


def _outline(item: Equipment, k: int) -> FloatArray:
    """Corners of part k of a piece, on plan, shape (n, 2)."""
    solids = item.solids
    if solids.radius_m[k] > 0.0:
        angle = 2 * np.pi / N_ROUND * np.arange(N_ROUND)
        return solids.centre_m[k] + solids.radius_m[k] * np.column_stack([np.cos(angle), np.sin(angle)])
    cos, sin = np.cos(solids.yaw_rad[k]), np.sin(solids.yaw_rad[k])
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * solids.half_size_m[k]
    return solids.centre_m[k] + corners @ np.array([[cos, sin], [-sin, cos]])


def _colour(item: Equipment, part: str) -> tuple[float, float, float]:
    red, green, blue = (PALER + (1.0 - PALER) * value for value in colour_of(item.kind, part)[:3])
    return red, green, blue


def _write_name(axes: Axes, item: Equipment, size_pt: float) -> None:
    """The name of a piece below it, or in the middle of a long one."""
    low_m, high_m = item.solids.extent_m
    width_m, height_m = high_m - low_m
    is_large = min(width_m, height_m) > 2.5
    x, y = 0.5 * (low_m[0] + high_m[0]), 0.5 * (low_m[1] + high_m[1]) if is_large else low_m[1]
    text = axes.annotate(
        item.name,
        (float(x), float(y)),
        (0, 0 if is_large else -1.5),
        textcoords="offset points",
        ha="center",
        va="center" if is_large else "top",
        fontsize=size_pt,
        clip_on=True,
        color=COLOURS["name"],
        zorder=6,
    )
    text.set_path_effects(OUTLINE)
