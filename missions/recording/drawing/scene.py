"""What stands still in a recording: ground, equipment, body of the robot, route, true sources."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from pdpatrol.missions.recording import paths
from pdpatrol.missions.recording.drawing import palette
from pdpatrol.missions.recording.drawing.canvas import Canvas

FloatArray = NDArray[np.float64]

FILL_MODES = {paths.MAP: "majorwireframe"}
"""How solids of a path are drawn that are not drawn solid."""


NAME_NORTH_M = 1.8


def draw_scene(canvas: Canvas, meta: Mapping[str, Any]) -> None:
    """Draw all that does not move, from the facts of a mission."""
    canvas.still(paths.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    if "bounds_m" in meta:
        low, high = (np.array(corner) for corner in meta["bounds_m"])
        ground = rr.Boxes3D(
            centers=[[*(0.5 * (low + high)), -0.03]],
            half_sizes=[[*(0.5 * (high - low)), 0.02]],
            colors=[palette.GROUND],
            fill_mode="solid",
        )
        canvas.still(paths.GROUND, ground)
    solids = meta.get("solids", {})
    by_group = {"equipment": paths.EQUIPMENT, "fence": paths.FENCE}
    for group, path in by_group.items():
        _draw_solids(canvas, path, [s for s in solids.get("yard", []) if s["group"] == group])
    _draw_solids(canvas, paths.MAP, solids.get("map", []))
    _draw_solids(canvas, paths.BODY, solids.get("robot", []))
    with_sites = {name.partition("/")[0] for name in meta.get("sites", {})}
    tops = {name: top for name, top in _tops(solids.get("yard", [])).items() if name in with_sites}
    _draw_points(canvas, paths.EQUIPMENT_NAMES, tops, palette.NAME, 0.01)
    if not solids:  # field data: of the robot no more is known than where it stood
        _draw_points(canvas, paths.BODY, {"array": [0.0, 0.0, 0.3]}, palette.ROBOT, 0.3, labelled=False)
    _draw_points(canvas, paths.SITES, meta.get("sites", {}), palette.SITE, 0.07, labelled=False)
    if "route" in meta:
        _draw_route(canvas, meta)
    _draw_truth(canvas, meta.get("truth", {}))


def _draw_route(canvas: Canvas, meta: Mapping[str, Any]) -> None:
    stops = {str(i + 1): [*p, 0.02] for i, p in enumerate(meta["route"]["waypoints_m"])}
    _draw_points(canvas, paths.ROUTE, {"dock": [*meta["route"]["dock_m"], 0.02], **stops}, palette.STOP, 0.1)
    if way_m := meta.get("route_path_m"):
        line = np.column_stack([way_m, np.full(len(way_m), 0.02)])
        canvas.still(paths.ROUTE_WAY, rr.LineStrips3D([line], colors=[palette.ROUTE], radii=rr.Radius.ui_points([0.6])))


def _draw_truth(canvas: Canvas, truth: Mapping[str, Any]) -> None:
    radiating = [*truth.get("sources", []), *truth.get("interferers", [])]
    named = {f"true: {source['name']}": source["position_m"] for source in radiating}
    _draw_points(canvas, paths.TRUE_SOURCES, named, palette.TRUTH, 0.22, labelled=False)
    ways = [[source["position_m"], source["moves_to_m"]] for source in radiating if "moves_to_m" in source]
    if ways:
        canvas.still(paths.TRUE_WAYS, rr.LineStrips3D(ways, colors=[palette.TRUTH], radii=[0.05]))
    above = {name: [x, y, z + 1.5] for name, (x, y, z) in named.items()}
    _draw_points(canvas, paths.TRUE_NAMES, above, palette.NAME, 0.01)


def _tops(solids: Sequence[Mapping[str, Any]]) -> dict[str, list[float]]:
    """Name of each piece of equipment, and a place above it, north of the middle, where labels of findings are not."""
    pieces: dict[str, list[FloatArray]] = {}
    for solid in solids:
        if solid["group"] == "equipment":
            pieces.setdefault(solid["name"].split("/")[1], []).append(np.array(solid["position_m"]))
    above: dict[str, list[float]] = {}
    for name, centres in pieces.items():
        (x, y, _), top = np.mean(centres, axis=0), np.max(centres, axis=0)[2]
        above[name] = [float(x), float(y) + NAME_NORTH_M, float(top)]
    return above


def _draw_points(
    canvas: Canvas,
    path: str,
    points: Mapping[str, Sequence[float]],
    colour: palette.Colour,
    radius_m: float,
    *,
    labelled: bool = True,
) -> None:
    if points:
        places, names = list(points.values()), list(points)
        drawn = rr.Points3D(places, labels=names, colors=[colour], radii=[radius_m], show_labels=labelled)
        canvas.still(path, drawn)


def _draw_solids(canvas: Canvas, path: str, solids: Sequence[dict[str, Any]]) -> None:
    """One batch for each kind of shape."""
    for shape in sorted({solid["shape"] for solid in solids}):
        some = [solid for solid in solids if solid["shape"] == shape]
        size = np.array([solid["size_m"] for solid in some])
        centre = np.array([solid["position_m"] for solid in some])
        common: dict[str, Any] = {
            "quaternions": np.roll([solid["quaternion_wxyz"] for solid in some], -1, axis=-1),  # to xyzw
            "colors": np.round(255 * np.array([solid["rgba"] for solid in some])).astype(np.uint8),
            "labels": [solid["name"].removeprefix("equipment/") for solid in some],
            "show_labels": False,
            "fill_mode": FILL_MODES.get(path, "solid"),
        }
        drawn: Any
        if shape == "box":
            drawn = rr.Boxes3D(half_sizes=size, centers=centre, **common)
        elif shape == "cylinder":
            drawn = rr.Cylinders3D(lengths=2 * size[:, 1], radii=size[:, 0], centers=centre, **common)
        elif shape == "capsule":
            foot = centre - size[:, 1, np.newaxis] * _z_axis(common["quaternions"])  # Rerun's capsule starts there
            drawn = rr.Capsules3D(lengths=2 * size[:, 1], radii=size[:, 0], translations=foot, **common)
        else:
            half = size if shape == "ellipsoid" else np.repeat(size[:, :1], 3, axis=1)
            drawn = rr.Ellipsoids3D(half_sizes=half, centers=centre, **common)
        canvas.still(f"{path}/{shape}", drawn)


def _z_axis(quaternion_xyzw: FloatArray) -> FloatArray:
    """Where the z axis points after a turn, shape (n, 3)."""
    x, y, z, w = np.asarray(quaternion_xyzw).T
    return np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=-1)
