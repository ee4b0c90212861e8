"""Yard, route, true sources and robot as entities of a recording, and the shapes that several views share."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import ArrayLike

from dirmusic.arrays import FloatArray
from dirmusic.locating.rules import LocatingRules
from pdpatrol.missions.recording.labels import AROUND_PX, equipment_labels, fitting, pixel_m
from pdpatrol.missions.recording.palette import PALETTE, PHASES
from pdpatrol.robot_models.moving_bodies import MOVING_RGBA, described_moving

LEGEND = """\
**gold**: bearings of the latest pulses; **teal**: directions that fit the strongest; **orange**: where a source is \
likely; **blue**: robot and path; **grey**: route; **green**: path by wheels alone; **brown**: sites; \
**magenta**: truth.

**1?** is a candidate, **1** a finding, which is confirmed, with its 95 % ellipse.
"""


def confirm_m(meta: Mapping[str, Any]) -> float:
    """Return the largest semi-major axis of the 95 % ellipse of a confirmed finding."""
    locating = meta.get("scenario", {}).get("locating", {})
    return float(locating.get("confirm_semi_major_m") or LocatingRules.confirm_semi_major_m)


def labels_3d(places: Mapping[str, ArrayLike]) -> rr.Points3D:
    """Return labels at places x, y, z."""
    colour = PALETTE.label
    return rr.Points3D(list(places.values()), labels=list(places), colors=colour, radii=0.01, show_labels=True)


STEPS_PER_M = 64
"""Steps per metre to which lines are rounded, finer than a pixel: binary fractions shorten recordings by a tenth."""


def lines_3d(lines: Any, colour: int, width: float = 0.8) -> rr.LineStrips3D:  # noqa: ANN401 - nested sequences
    """Return lines whose width is in points of the screen; an array (n_lines, n_points, 3) is converted at once."""
    if isinstance(lines, np.ndarray):
        rounded = (np.rint(STEPS_PER_M * lines) / STEPS_PER_M).astype(np.float32)
    else:
        rounded = [np.rint(STEPS_PER_M * np.asarray(line)) / STEPS_PER_M for line in lines]
    return rr.LineStrips3D(rounded, colors=colour, radii=rr.Radius.ui_points(width))


def draw_scene(stream: rr.RecordingStream, meta: Mapping[str, Any]) -> None:
    """Draw everything that does not move, from the metadata of a log, and set the styles of phases and plots."""
    solids, sites = meta.get("solids", {}), meta.get("sites", {})
    (left, bottom), (right, top) = meta["bounds_m"]
    equipment, fence = (
        [solid for solid in solids.get("yard", ()) if solid["group"] == group] for group in ("equipment", "fence")
    )
    shapes: dict[str, Any] = {
        "world": rr.ViewCoordinates.RIGHT_HAND_Z_UP,
        "world/yard/ground": rr.Boxes3D(
            mins=[left, bottom, -0.05],
            sizes=[right - left, top - bottom, 0.04],
            colors=PALETTE.ground,
            fill_mode="solid",
        ),
        **_solids("world/yard/equipment", equipment, "solid"),
        **_solids("world/yard/fence", fence, "solid"),
        **_solids("world/yard/map", solids.get("map", ()), "majorwireframe"),
        **_solids("world/robot/body", solids.get("robot", ()), "solid"),
        "world/yard/sites": rr.Points3D(
            list(sites.values()), labels=list(sites), colors=PALETTE.site, radii=0.07, show_labels=False
        ),
        "world/robot/marker": rr.Arrows3D(
            origins=[0.7, 0.0, 1.5], vectors=[2.0, 0.0, 0.0], radii=0.22, colors=PALETTE.robot
        ),
        # a view that follows a camera looks through it; its frame is not drawn
        "world/camera": rr.Pinhole(
            fov_y=0.95,
            aspect_ratio=4.0,
            camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=1e-5,
            color=0,
            line_width=0,
        ),
        **_route_and_names(meta, equipment),
        **_truth(meta.get("truth", {})),
        "mission/legend": rr.TextDocument(LEGEND, media_type=rr.MediaType.MARKDOWN),
        "mission/phase": rr.StateConfiguration(
            values=list(PHASES),
            labels=[label for label, _ in PHASES.values()],
            colors=[colour for _, colour in PHASES.values()],
        ),
        "plots/directions/bearing": rr.SeriesPoints(colors=PALETTE.bearing, marker_sizes=1.5),
        "plots/directions/heading": rr.SeriesPoints(colors=PALETTE.robot, marker_sizes=1.5),
        "plots/uncertainty/limit": rr.SeriesLines(
            colors=PALETTE.line, widths=1.0, names=f"confirmed below {confirm_m(meta):g} m"
        ),
    }
    for path, shape in shapes.items():
        stream.log(path, shape, static=True)


def _route_and_names(meta: Mapping[str, Any], equipment: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return route, zones and the labels of equipment and waypoints that fit on the plan."""
    pixel_size_m, taken = pixel_m(meta["bounds_m"]), list[FloatArray]()
    with_sites = {site.partition("/")[0] for site in meta.get("sites", {})}
    names = equipment_labels(equipment, pixel_size_m, with_sites)
    shapes: dict[str, Any] = {"world/yard/names": labels_3d(fitting(names, pixel_size_m, taken))}
    if "route" in meta:
        stops = {"dock": meta["route"]["dock_m"]}
        stops |= {str(number): place_m for number, place_m in enumerate(meta["route"]["waypoints_m"], start=1)}
        places = {name: [x, y, 0.02] for name, (x, y) in stops.items()}
        shapes["world/route"] = rr.Points3D(list(places.values()), colors=PALETTE.route, radii=0.12)
        shapes["world/route/path"] = lines_3d([list(places.values())], PALETTE.route)
        shapes["world/route/numbers"] = labels_3d(fitting(places, pixel_size_m, taken, AROUND_PX))
    if zones := meta.get("scenario", {}).get("zones"):
        limits = [f"{zone['name']}, {zone['limit_mps']:g} m/s" for zone in zones]
        rings = [[[x, y, 0.03] for x, y in (*zone["polygon_m"], zone["polygon_m"][0])] for zone in zones]
        shapes["world/yard/zones"] = lines_3d(rings, PALETTE.zone, 1.5)
        middles = {name: [*np.mean(zone["polygon_m"], axis=0), 0.03] for name, zone in zip(limits, zones, strict=True)}
        shapes["world/yard/zones/limits"] = labels_3d(middles)
    return shapes


def _truth(truth: Mapping[str, Any]) -> dict[str, Any]:
    """Return sources, interferers, people and vehicles, which the robot does not know."""
    shapes: dict[str, Any] = {}
    if sources := [*truth.get("sources", ()), *truth.get("interferers", ())]:
        places = {f"true: {source['name']}": source["position_m"] for source in sources}
        shapes["world/truth/sources"] = rr.Points3D(list(places.values()), colors=PALETTE.truth, radii=0.22)
        shapes["world/truth/sources/names"] = labels_3d(places)
    for description in truth.get("moving", ()):
        body, _ = described_moving(description)
        solid = {
            "shape": "cylinder" if body.solid.radius_m > 0.0 else "box",
            "size_m": body.half_size_m,
            "position_m": [0.0, 0.0, 0.5 * body.solid.top_m],
            "quaternion_wxyz": [1.0, 0.0, 0.0, 0.0],
            "rgba": MOVING_RGBA[body.kind],
        }
        shapes |= _solids(f"world/truth/{body.label}", [solid], "solid")
    return shapes


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
