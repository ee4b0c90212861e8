"""A yard on plan, to scale: what stands in it, fence, north, and the marks that pictures of a report share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.patches import Rectangle
from matplotlib.patheffects import AbstractPathEffect, withStroke
from matplotlib.text import OffsetFrom
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray
from scipy.cluster.hierarchy import fclusterdata

from dirmusic.locating.finding import outline95
from pdpatrol.missions.report.records import FindingRecord
from pdpatrol.robot_models.equipment import colour_of
from pdpatrol.robot_models.yard.pieces import Equipment
from pdpatrol.robot_models.yard.yard import Yard

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

Side = Literal["left", "center", "right"]
SIDES: dict[int, Side] = {1: "left", 0: "center", -1: "right"}
"""Of a label, that which is near its mark, by where inwards is along x."""

LABEL_SHARE = 0.08
"""Share of the longer side of a picture that the id of a finding takes, about."""

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
    """Place, 95 % ellipse and id of a finding."""
    colour = COLOURS[finding.state]
    position_m = np.array(finding.position_m[:2])
    outline_m = outline95(position_m, np.array(finding.covariance_m2)[:2, :2], 60)
    axes.plot(*outline_m.T, color=colour, linewidth=1.3, zorder=7)
    axes.plot(*position_m, "+", color=colour, markersize=7, markeredgewidth=1.4, zorder=7)
    _write_ids(axes, [finding], position_m, np.array([10.0, 10.0]))


def draw_beyond(axes: Axes, findings: Sequence[FindingRecord]) -> None:
    """Mark findings beyond the picture at its edge; those that are nearer to each other than labels share one."""
    if not findings:
        return
    corners_m = np.array([axes.get_xlim(), axes.get_ylim()]).T
    edge_m = np.clip([finding.position_m[:2] for finding in findings], *corners_m)
    for finding, place_m in zip(findings, edge_m, strict=True):
        axes.plot(*place_m, "D", color=COLOURS[finding.state], markersize=7, markeredgewidth=1.4, zorder=7)
    apart_m = LABEL_SHARE * float((corners_m[1] - corners_m[0]).max())
    group = fclusterdata(edge_m, apart_m, "distance", method="single") if len(findings) > 1 else np.ones(1)
    for number in np.unique(group):
        members = np.flatnonzero(group == number).tolist()
        place_m = edge_m[members].mean(axis=0)
        inwards = (place_m <= corners_m[0]).astype(float) - (place_m >= corners_m[1])
        _write_ids(axes, [findings[k] for k in members], place_m, 12.0 * inwards, SIDES[int(inwards[0])])


def is_beyond(axes: Axes, finding: FindingRecord) -> bool:
    """Whether a finding lies outside the picture."""
    corners_m = np.array([axes.get_xlim(), axes.get_ylim()]).T
    position_m = np.array(finding.position_m[:2])
    return bool((position_m < corners_m[0]).any() or (position_m > corners_m[1]).any())


def _write_ids(
    axes: Axes, findings: Sequence[FindingRecord], place_m: FloatArray, off_pt: FloatArray, side: Side = "center"
) -> None:
    """Ids of findings on their colour, a side of them so many points off a place."""
    axes.annotate(
        ", ".join(str(finding.id) for finding in findings),
        place_m.tolist(),
        off_pt.tolist(),
        textcoords="offset points",
        ha=side,
        va="center",
        fontsize=8.5,
        fontweight="bold",
        color="white",
        bbox={"boxstyle": "round,pad=0.25", "facecolor": COLOURS[findings[0].state], "edgecolor": "white"},
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
