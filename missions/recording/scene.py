"""What stands still in a recording: ground, equipment, robot body, route, true sources; and the colours of all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from missions.recording import blueprint as paths

FloatArray = NDArray[np.float64]

COLOURS = {
    "candidate": (255, 178, 40),
    "confirmed": (60, 220, 110),
    "outside": (150, 150, 160),
    "ghost": (170, 120, 120),
    "bearing": (255, 232, 110),
    "spectrum": (90, 220, 255),
    "trajectory": (120, 190, 255),
    "odometry": (150, 220, 160),
    "truth": (255, 70, 200),
    "route": (200, 205, 210),
    "robot": (235, 235, 240),
    "site": (200, 150, 90),
    "ground": (64, 70, 72),
    "likelihood": (235, 140, 60),
}

ELEMENT_COLOURS = ((230, 90, 80), (240, 170, 60), (225, 225, 90), (90, 200, 110), (90, 160, 240), (190, 110, 230))


FILL_MODES = {paths.EQUIPMENT: "transparentfillmajorwireframe", paths.MAP: "majorwireframe"}
"""How solids of a path are drawn that are not drawn solid."""


def log_scene(stream: rr.RecordingStream, meta: Mapping[str, Any]) -> None:
    """Log all that does not move, and the style of what does, from the facts of a mission."""
    _still(stream, paths.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    if "bounds_m" in meta:
        low, high = (np.array(corner) for corner in meta["bounds_m"])
        ground = rr.Boxes3D(
            centers=[[*(0.5 * (low + high)), -0.03]],
            half_sizes=[[*(0.5 * (high - low)), 0.02]],
            colors=[COLOURS["ground"]],
            fill_mode="solid",
        )
        _still(stream, paths.GROUND, ground)
    solids = meta.get("solids", {})
    by_group = {"equipment": paths.EQUIPMENT, "fence": paths.FENCE}
    for group, path in by_group.items():
        _draw_solids(stream, path, [s for s in solids.get("yard", []) if s["group"] == group])
    _draw_solids(stream, paths.MAP, solids.get("map", []))
    _draw_solids(stream, paths.BODY, solids.get("robot", []))
    if not solids:  # field data: of the robot no more is known than where it stood
        _draw_points(stream, paths.BODY, {"array": [0.0, 0.0, 0.3]}, COLOURS["robot"], 0.3, labelled=False)
    _draw_points(stream, paths.SITES, meta.get("sites", {}), COLOURS["site"], 0.07, labelled=False)
    if "route" in meta:
        stops = {str(i + 1): [*p, 0.02] for i, p in enumerate(meta["route"]["waypoints_m"])}
        _draw_points(stream, paths.ROUTE, {"dock": [*meta["route"]["dock_m"], 0.02], **stops}, COLOURS["route"], 0.15)
    truth = meta.get("truth", {})
    radiating = [*truth.get("sources", []), *truth.get("interferers", [])]
    named = {f"true: {source['name']}": source["position_m"] for source in radiating}
    _draw_points(stream, paths.TRUE_SOURCES, named, COLOURS["truth"], 0.22, labelled=False)
    ways = [[source["position_m"], source["moves_to_m"]] for source in radiating if "moves_to_m" in source]
    if ways:
        _still(stream, paths.TRUE_WAYS, rr.LineStrips3D(ways, colors=[COLOURS["truth"]], radii=[0.05]))
    above = {name: [x, y, z + 1.5] for name, (x, y, z) in named.items()}
    _draw_points(stream, paths.TRUE_NAMES, above, COLOURS["truth"], 0.01)
    lines = {
        paths.TRAJECTORY: ("trajectory", 0.05),
        paths.ODOMETRY: ("odometry", 0.02),
        paths.TRUE_TRAJECTORY: ("truth", 0.02),
        paths.BEARINGS: ("bearing", 0.035),
        paths.SPECTRUM: ("spectrum", 0.06),
    }
    for path, (colour, radius) in lines.items():
        _still(stream, path, rr.LineStrips3D.from_fields(colors=[COLOURS[colour]], radii=[radius]))
    for element in range(meta["n_elements"]):
        colour = ELEMENT_COLOURS[element % len(ELEMENT_COLOURS)]
        style = rr.SeriesPoints(names=[f"element {element + 1}"], colors=[colour], marker_sizes=[1.5])
        _still(stream, f"{paths.STRENGTHS}/{element + 1}", style)
    for name in ("speed (m/s)", "yaw rate (rad/s)"):
        _still(stream, f"{paths.COMMAND}/{name.split(' (')[0].replace(' ', '_')}", rr.SeriesLines(names=[name]))


def _draw_points(
    stream: rr.RecordingStream,
    path: str,
    points: Mapping[str, Sequence[float]],
    colour: tuple[int, int, int],
    radius_m: float,
    *,
    labelled: bool = True,
) -> None:
    if points:
        _still(
            stream,
            path,
            rr.Points3D(
                list(points.values()), labels=list(points), colors=[colour], radii=[radius_m], show_labels=labelled
            ),
        )


def _draw_solids(stream: rr.RecordingStream, path: str, solids: Sequence[dict[str, Any]]) -> None:
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
        _still(stream, f"{path}/{shape}", drawn)


def _still(stream: rr.RecordingStream, path: str, archetype: Any) -> None:  # noqa: ANN401 - any archetype
    stream.log(path, archetype, static=True)


def _z_axis(quaternion_xyzw: FloatArray) -> FloatArray:
    """Where the z axis points after a turn, shape (n, 3)."""
    x, y, z, w = np.asarray(quaternion_xyzw).T
    return np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=-1)
