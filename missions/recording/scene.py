"""Yard, route and true sources, which do not move, and the robot with its trajectories, commands and battery."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr
from scipy.spatial.transform import Rotation

from dirmusic.angles import wrap
from pdpatrol.missions.recording.bins import LogBin, labels_3d, lines_3d, set_step

TRUTH = 0xFF46C8FF

TRAJECTORIES = {
    "world/trajectory": ("pose", 0.06, 0x78BEFFFF, 1.5),
    "world/truth/trajectory": ("true_pose", 0.04, TRUTH, 0.8),
    "world/odometry": ("odometry", 0.03, 0x6E8273FF, 0.8),
}
"""Column of the log, height above ground in metres, colour and width in points of each trajectory."""


def draw_scene(stream: rr.RecordingStream, meta: Mapping[str, Any]) -> None:
    """Draw everything that does not move, from the metadata of a log."""
    solids, sites, truth = meta.get("solids", {}), meta.get("sites", {}), meta.get("truth", {})
    sources = [*truth.get("sources", ()), *truth.get("interferers", ())]
    groups = {
        group: [solid for solid in solids.get("yard", ()) if solid["group"] == group]
        for group in ("equipment", "fence")
    }
    shapes: dict[str, Any] = {
        "world": rr.ViewCoordinates.RIGHT_HAND_Z_UP,
        **_solids("world/yard/equipment", groups["equipment"]),
        **_solids("world/yard/fence", groups["fence"]),
        **_solids("world/yard/map", solids.get("map", ()), fill_mode="majorwireframe"),
        **_solids("world/robot/body", solids.get("robot", ())),
        "world/yard/names": labels_3d(_name_places(groups["equipment"], sites)),
        "world/yard/sites": rr.Points3D(
            list(sites.values()), labels=list(sites), colors=[0xC8965AFF], radii=[0.07], show_labels=False
        ),
        # the camera of a view follows an entity only if it has a shape of its own; field data have no solids
        "world/robot": rr.Points3D([[0.0, 0.0, 0.3]], radii=[0.05 if solids else 0.3], colors=[0xEBEBF0FF]),
        "world/robot/marker": rr.Arrows3D(
            origins=[[0.7, 0.0, 1.5]], vectors=[[2.0, 0.0, 0.0]], radii=[0.22], colors=[0x2896FFFF]
        ),
        "plots/command": rr.SeriesLines(names=["speed (m/s)", "yaw rate (rad/s)"]),
    }
    if sources:
        places = {f"true: {source['name']}": source["position_m"] for source in sources}
        moves = [[source["position_m"], source["moves_to_m"]] for source in sources if "moves_to_m" in source]
        shapes["world/truth/sources"] = rr.Points3D(list(places.values()), colors=[TRUTH], radii=[0.22])
        shapes["world/truth/names"] = labels_3d({name: [x, y, z + 1.5] for name, (x, y, z) in places.items()})
        shapes["world/truth/moves"] = lines_3d(moves, TRUTH)
    if "bounds_m" in meta:
        low, high = (np.array(corner) for corner in meta["bounds_m"])
        centre, half = [*(0.5 * (low + high)), -0.03], [*(0.5 * (high - low)), 0.02]
        shapes["world/yard/ground"] = rr.Boxes3D(
            centers=[centre], half_sizes=[half], colors=[0x404648FF], fill_mode="solid"
        )
    if "route" in meta:
        stops = {"dock": meta["route"]["dock_m"]}
        stops |= {str(number): place_m for number, place_m in enumerate(meta["route"]["waypoints_m"], start=1)}
        shapes["world/route"] = labels_3d({name: [x, y, 0.02] for name, (x, y) in stops.items()}, 0.1)
        shapes["world/route/path"] = lines_3d([[[x, y, 0.02] for x, y in stops.values()]], 0x969EA8FF)
    for path, shape in shapes.items():
        stream.log(path, shape, static=True)


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
            stream.log(path, lines_3d([line], colour, width))
    for command, battery in zip(part.tables["step"]["command"][-1:], part.tables["step"]["battery"][-1:], strict=True):
        stream.log("plots/directions/heading", rr.Scalars(np.degrees(wrap(part.pose(part.end - 1)[2]))))
        if np.isfinite(command).all():
            stream.log("plots/command", rr.Scalars(command))
        if np.isfinite(battery):
            stream.log("plots/battery", rr.Scalars(100.0 * battery))


def _name_places(equipment: Sequence[Mapping[str, Any]], sites: Mapping[str, Any]) -> dict[str, list[float]]:
    """Return a place for the name of each piece with sites: 1.8 m north of its highest part, away from findings."""
    with_sites, places = {site.partition("/")[0] for site in sites}, dict[str, list[float]]()
    for solid in equipment:
        name, (x, y, z) = solid["name"].split("/")[1], solid["position_m"]
        if name in with_sites and (name not in places or z > places[name][2]):
            places[name] = [x, y + 1.8, z]
    return places


def _solids(path: str, solids: Sequence[Mapping[str, Any]], fill_mode: str = "solid") -> dict[str, Any]:
    """Return an archetype for each kind of shape, by its path."""
    shapes: dict[str, Any] = {}
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
        length, radius = 2 * size[:, 1], size[:, 0]
        if shape == "box":
            drawn = rr.Boxes3D(half_sizes=size, centers=centre, **style)
        elif shape == "cylinder":
            drawn = rr.Cylinders3D(lengths=length, radii=radius, centers=centre, **style)
        elif shape == "capsule":  # Rerun's capsules start at their translation and extend along z
            start = centre - size[:, 1, np.newaxis] * Rotation.from_quat(xyzw).apply([0.0, 0.0, 1.0])
            drawn = rr.Capsules3D(lengths=length, radii=radius, translations=start, **style)
        else:
            half = size if shape == "ellipsoid" else np.repeat(size[:, :1], 3, axis=1)
            drawn = rr.Ellipsoids3D(half_sizes=half, centers=centre, **style)
        shapes[f"{path}/{shape}"] = drawn
    return shapes
