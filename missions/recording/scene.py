"""Yard, route and true sources, which do not move, and the robot with its trajectories, commands and battery."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr
from scipy.spatial.transform import Rotation

from dirmusic.angles import wrap
from pdpatrol.missions.recording.bins import LogBin, set_step

TRUTH, WHITE = 0xFF46C8FF, 0xFFFFFFFF

TRAJECTORIES = {
    "world/trajectory": ("pose", 0.06, 0x78BEFFFF, 1.5),
    "world/truth/trajectory": ("true_pose", 0.04, TRUTH, 0.8),
    "world/odometry": ("odometry", 0.03, 0x6E8273FF, 0.8),
}
"""Column of the log, height above ground in metres, colour and width in points of each trajectory."""


def draw_scene(stream: rr.RecordingStream, meta: Mapping[str, Any]) -> None:
    """Draw everything that does not move, from the metadata of a log."""
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    if "bounds_m" in meta:
        low, high = (np.array(corner) for corner in meta["bounds_m"])
        centre, half = [*(0.5 * (low + high)), -0.03], [*(0.5 * (high - low)), 0.02]
        ground = rr.Boxes3D(centers=[centre], half_sizes=[half], colors=[0x404648FF], fill_mode="solid")
        stream.log("world/yard/ground", ground, static=True)
    solids = meta.get("solids", {})
    equipment, fence = (
        [solid for solid in solids.get("yard", []) if solid["group"] == group] for group in ("equipment", "fence")
    )
    _draw_solids(stream, "world/yard/equipment", equipment)
    _draw_solids(stream, "world/yard/fence", fence)
    _draw_solids(stream, "world/yard/map", solids.get("map", []), fill_mode="majorwireframe")
    _draw_solids(stream, "world/robot/body", solids.get("robot", []))
    sites = meta.get("sites", {})
    names = _name_places(equipment, {site.partition("/")[0] for site in sites})
    _draw_points(stream, "world/yard/names", names, WHITE, 0.01)
    _draw_points(stream, "world/yard/sites", sites, 0xC8965AFF, 0.07, labelled=False)
    if not solids:  # field data: only the poses of the array are known
        _draw_points(stream, "world/robot/body", {"array": [0.0, 0.0, 0.3]}, 0xEBEBF0FF, 0.3, labelled=False)
    # the camera of a view follows an entity only if it has a shape of its own
    stream.log("world/robot", rr.Points3D([[0, 0, 0]], radii=[0.05], colors=[0xEBEBF0FF]), static=True)
    arrow = rr.Arrows3D(origins=[[0.7, 0.0, 1.5]], vectors=[[2.0, 0.0, 0.0]], radii=[0.22], colors=[0x2896FFFF])
    stream.log("world/robot/marker", arrow, static=True)
    stream.log("plots/command", rr.SeriesLines(names=["speed (m/s)", "yaw rate (rad/s)"]), static=True)
    if "route" in meta:
        route = {"dock": meta["route"]["dock_m"]}
        route |= {str(number): place_m for number, place_m in enumerate(meta["route"]["waypoints_m"], start=1)}
        _draw_points(stream, "world/route", {name: [x, y, 0.02] for name, (x, y) in route.items()}, WHITE, 0.1)
    if meta.get("route_path_m"):
        line = [[x, y, 0.02] for x, y in meta["route_path_m"]]
        path = rr.LineStrips3D([line], colors=[0x969EA8FF], radii=rr.Radius.ui_points([0.6]))
        stream.log("world/route/path", path, static=True)
    _draw_truth(stream, meta.get("truth", {}))


def draw_motion(stream: rr.RecordingStream, part: LogBin) -> None:
    """Draw the poses of a bin; each trajectory grows by the line of one bin."""
    for step in range(part.first_step, part.end):
        x, y, yaw_rad = part.pose(step)
        set_step(stream, part.log, step)
        turn = rr.RotationAxisAngle([0, 0, 1], radians=yaw_rad)
        stream.log("world/robot", rr.Transform3D(translation=[x, y, 0.0], rotation_axis_angle=turn))
    for path, (column, height_m, colour, width) in TRAJECTORIES.items():
        pose = part.log.column("step", column, max(part.first_step - 1, 0), part.end)
        if part.end > part.first_step and np.isfinite(pose).all():
            line = np.column_stack([pose[:, :2], np.full(len(pose), height_m)])
            stream.log(path, rr.LineStrips3D([line], colors=[colour], radii=rr.Radius.ui_points([width])))
    for command, battery in zip(part.tables["step"]["command"][-1:], part.tables["step"]["battery"][-1:], strict=True):
        stream.log("plots/directions/heading", rr.Scalars(np.degrees(wrap(part.pose(part.end - 1)[2]))))
        if np.isfinite(command).all():
            stream.log("plots/command", rr.Scalars(command))
        if np.isfinite(battery):
            stream.log("plots/battery", rr.Scalars(100.0 * battery))


def _draw_truth(stream: rr.RecordingStream, truth: Mapping[str, Any]) -> None:
    sources = [*truth.get("sources", []), *truth.get("interferers", [])]
    places = {f"true: {source['name']}": source["position_m"] for source in sources}
    _draw_points(stream, "world/truth/sources", places, TRUTH, 0.22, labelled=False)
    above = {name: [x, y, z + 1.5] for name, (x, y, z) in places.items()}
    _draw_points(stream, "world/truth/names", above, WHITE, 0.01)
    lines = [[source["position_m"], source["moves_to_m"]] for source in sources if "moves_to_m" in source]
    if lines:
        stream.log("world/truth/moves", rr.LineStrips3D(lines, colors=[TRUTH], radii=[0.05]), static=True)


def _name_places(equipment: Sequence[Mapping[str, Any]], with_sites: set[str]) -> dict[str, list[float]]:
    """Return a place for the name of each piece with sites: above it, 1.8 m north, where no finding has its label."""
    parts_m: dict[str, list[Any]] = {}
    for solid in equipment:
        name = solid["name"].split("/")[1]
        if name in with_sites:
            parts_m.setdefault(name, []).append(solid["position_m"])
    means_m = {name: np.mean(centres, axis=0) for name, centres in parts_m.items()}
    return {name: [x, y + 1.8, max(part[2] for part in parts_m[name])] for name, (x, y, _) in means_m.items()}


def _draw_points(
    stream: rr.RecordingStream,
    path: str,
    points: Mapping[str, Sequence[float]],
    colour: int,
    radius_m: float,
    *,
    labelled: bool = True,
) -> None:
    if points:
        places, names = list(points.values()), list(points)
        drawn = rr.Points3D(places, labels=names, colors=[colour], radii=[radius_m], show_labels=labelled)
        stream.log(path, drawn, static=True)


def _draw_solids(
    stream: rr.RecordingStream, path: str, solids: Sequence[Mapping[str, Any]], fill_mode: str = "solid"
) -> None:
    """Draw solids, one entity for each kind of shape."""
    for shape in sorted({solid["shape"] for solid in solids}):
        own = [solid for solid in solids if solid["shape"] == shape]
        size, centre = (np.array([solid[key] for solid in own]) for key in ("size_m", "position_m"))
        xyzw = np.roll([solid["quaternion_wxyz"] for solid in own], -1, axis=-1)
        style: dict[str, Any] = {
            "quaternions": xyzw,
            "colors": np.round(255 * np.array([solid["rgba"] for solid in own])).astype(np.uint8),
            "labels": [solid["name"].removeprefix("equipment/") for solid in own],
            "show_labels": False,
            "fill_mode": fill_mode,
        }
        drawn: Any
        if shape == "box":
            drawn = rr.Boxes3D(half_sizes=size, centers=centre, **style)
        elif shape == "cylinder":
            drawn = rr.Cylinders3D(lengths=2 * size[:, 1], radii=size[:, 0], centers=centre, **style)
        elif shape == "capsule":  # Rerun's capsules start at their translation and extend along z
            start = centre - size[:, 1, np.newaxis] * Rotation.from_quat(xyzw).apply([0.0, 0.0, 1.0])
            drawn = rr.Capsules3D(lengths=2 * size[:, 1], radii=size[:, 0], translations=start, **style)
        else:
            half = size if shape == "ellipsoid" else np.repeat(size[:, :1], 3, axis=1)
            drawn = rr.Ellipsoids3D(half_sizes=half, centers=centre, **style)
        stream.log(f"{path}/{shape}", drawn, static=True)
