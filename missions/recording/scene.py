"""Yard, route and true sources, which do not move, and the robot with its trajectories and phases."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr

from dirmusic.angles import wrap
from pdpatrol.missions.recording.bins import LogBin, at_steps, labels_3d, lines_3d
from pdpatrol.missions.recording.pulses import BEARING
from pdpatrol.missions.report.wording import PHASES

TRUTH = 0xFF46C8FF


def draw_scene(stream: rr.RecordingStream, meta: Mapping[str, Any]) -> None:
    """Draw everything that does not move, from the metadata of a log, and set the styles of phases and directions."""
    solids, sites, truth = meta.get("solids", {}), meta.get("sites", {}), meta.get("truth", {})
    sources, ((left, bottom), (right, top)) = (
        [*truth.get("sources", ()), *truth.get("interferers", ())],
        meta["bounds_m"],
    )
    equipment, fence = (
        [solid for solid in solids.get("yard", ()) if solid["group"] == group] for group in ("equipment", "fence")
    )
    pieces = {site.partition("/")[0]: [x, y + 1.8, z] for site, (x, y, z) in sites.items()}  # away from findings
    shapes: dict[str, Any] = {
        "world": rr.ViewCoordinates.RIGHT_HAND_Z_UP,
        "world/yard/ground": rr.Boxes3D(
            mins=[left, bottom, -0.05],
            sizes=[right - left, top - bottom, 0.04],
            colors=0x404648FF,
            fill_mode="solid",
        ),
        **_solids("world/yard/equipment", equipment, "transparentfillmajorwireframe"),  # the robot may be behind it
        **_solids("world/yard/fence", fence, "solid"),
        **_solids("world/yard/map", solids.get("map", ()), "majorwireframe"),
        **_solids("world/robot/body", solids.get("robot", ()), "solid"),
        "world/yard/names": labels_3d(pieces),
        "world/yard/sites": rr.Points3D(
            list(sites.values()), labels=list(sites), colors=0xC8965AFF, radii=0.07, show_labels=False
        ),
        "plots/directions/bearing": rr.SeriesPoints(colors=BEARING, marker_sizes=1.5),
        "plots/directions/heading": rr.SeriesPoints(colors=0x2896FFFF, marker_sizes=1.5),
        "mission/phase": rr.StateConfiguration(values=list(PHASES), labels=list(PHASES.values())),
        # the camera of a view follows an entity only if it has its own shape; field data have no solids
        "world/robot": rr.Points3D([0.0, 0.0, 0.3], radii=0.1, colors=0xEBEBF0FF),
        "world/robot/marker": rr.Arrows3D(
            origins=[0.7, 0.0, 1.5], vectors=[2.0, 0.0, 0.0], radii=0.22, colors=0x2896FFFF
        ),
    }
    if sources:
        places = {f"true: {source['name']}": source["position_m"] for source in sources}
        shapes["world/truth/sources"] = labels_3d(places, 0.22, TRUTH)
    if "route" in meta:
        stops = {"dock": meta["route"]["dock_m"]}
        stops |= {str(number): place_m for number, place_m in enumerate(meta["route"]["waypoints_m"], start=1)}
        shapes["world/route"] = labels_3d({name: [x, y, 0.02] for name, (x, y) in stops.items()}, 0.1)
        shapes["world/route/path"] = lines_3d([[[x, y, 0.02] for x, y in stops.values()]], 0x969EA8FF)
    for path, shape in shapes.items():
        stream.log(path, shape, static=True)


def draw_motion(stream: rr.RecordingStream, part: LogBin) -> None:
    """Draw poses and phases of a bin; each trajectory grows by the line of one bin."""
    first, end = part.first["step"], part.end
    times, (x, y, yaw_rad) = at_steps(part.log, np.arange(first, end)), part.tables["step"]["pose"].T
    turns = [rr.RotationAxisAngle([0, 0, 1], radians=angle) for angle in yaw_rad.tolist()]
    moves = rr.Transform3D.columns(translation=np.column_stack([x, y, 0.0 * x]), rotation_axis_angle=turns)
    stream.send_columns("world/robot", times, moves)
    stream.send_columns("mission/phase", times, rr.StateChange.columns(state=part.tables["step"]["phase"]))
    stream.log("plots/directions/heading", rr.Scalars(np.degrees(wrap(yaw_rad[-1]))))
    for path, column, height_m, colour, width in (
        ("world/trajectory", "pose", 0.06, 0x78BEFFFF, 1.5),
        ("world/truth/trajectory", "true_pose", 0.04, TRUTH, 0.8),
        ("world/odometry", "odometry", 0.03, 0x6E8273FF, 0.8),
    ):
        pose = part.log.column("step", column, max(first - 1, 0), end)
        if np.isfinite(pose).all():
            line = np.column_stack([pose[:, :2], np.full(len(pose), height_m)])
            stream.log(path, lines_3d([line], colour, width))


def _solids(path: str, solids: Sequence[Mapping[str, Any]], fill_mode: str) -> dict[str, Any]:
    """Return an archetype for each kind of shape, keyed by path; capsules are drawn without their ends."""
    shapes: dict[str, Any] = {}
    for shape in sorted({solid["shape"] for solid in solids}):
        own = [solid for solid in solids if solid["shape"] == shape]
        size = np.array([solid["size_m"] for solid in own])
        style: dict[str, Any] = {
            "centers": [solid["position_m"] for solid in own],
            "quaternions": np.roll([solid["quaternion_wxyz"] for solid in own], -1, axis=-1),  # xyzw
            "colors": np.array([solid["rgba"] for solid in own]),
            "fill_mode": fill_mode,
        }
        if shape == "box":
            drawn = rr.Boxes3D(half_sizes=size, **style)
        elif shape in ("cylinder", "capsule"):
            drawn = rr.Cylinders3D(lengths=2 * size[:, 1], radii=size[:, 0], **style)
        else:
            drawn = rr.Ellipsoids3D(half_sizes=size if shape == "ellipsoid" else size[:, [0, 0, 0]], **style)
        shapes[f"{path}/{shape}"] = drawn
    return shapes
