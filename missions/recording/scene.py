"""Yard, route, true sources, robot and pulses as entities of a recording, and the shapes that several views share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import ArrayLike, NDArray

from dirmusic import GainManifold
from dirmusic.angles import wrap
from dirmusic.arrays import FloatArray, IntArray
from pdpatrol.missions.record.log_contents import described_manifold
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.wording import PHASES
from pdpatrol.robot_models.moving_bodies import MOVING_RGBA, described_moving

TRUTH = 0xFF46C8FF

AZIMUTHS_RAD = np.radians(np.arange(0.0, 360.0, 2.0))
"""Azimuths at which pseudo-spectra are computed."""

ARRAY_HEIGHT_M = 0.6
"""Height above ground at which rays and rings are drawn; roughly that of the array."""

BEARING = 0xFFE86EFF


@dataclass(frozen=True)
class LogBin:
    """Rows of a log that belong to a few consecutive steps; a bin may contain events without steps.

    Attributes:
        log: Log of the mission.
        first: Number of the first row, by the name of the table.
        tables: Rows of the bin, by the name of the table.
    """

    log: MissionLog
    first: Mapping[str, int]
    tables: Mapping[str, dict[str, NDArray[Any]]]

    @property
    def end(self) -> int:
        """Row after the last step."""
        return self.first["step"] + self.tables["step"]["time_s"].size


def set_step(stream: rr.RecordingStream, log: MissionLog, step: int) -> None:
    """Set the time for the following calls of `stream.log` to a step of a mission; zero before the first step."""
    stream.set_time("sim_time", duration=log.column("step", "time_s", step, step + 1).sum())  # of one value or none
    stream.set_time("step", sequence=step)


def at_steps(log: MissionLog, steps: IntArray) -> list[rr.TimeColumn]:
    """Return the times of steps (n,) for `stream.send_columns`."""
    time_s = log.column("step", "time_s")[steps]
    return [rr.TimeColumn("sim_time", duration=time_s), rr.TimeColumn("step", sequence=steps)]


def labels_3d(places: Mapping[str, ArrayLike], radius_m: float = 0.01, colour: int = 0xFFFFFFFF) -> rr.Points3D:
    """Return labelled points at places x, y, z."""
    return rr.Points3D(list(places.values()), labels=list(places), colors=colour, radii=radius_m, show_labels=True)


def lines_3d(lines: Any, colour: int, width: float = 0.8) -> rr.LineStrips3D:  # noqa: ANN401 - nested sequences
    """Return lines whose width is in points of the screen."""
    return rr.LineStrips3D(lines, colors=colour, radii=rr.Radius.ui_points(width))


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
    if zones := meta.get("scenario", {}).get("zones"):
        names = [f"{zone['name']}, {zone['limit_mps']:g} m/s" for zone in zones]
        rings = [[[x, y, 0.03] for x, y in (*zone["polygon_m"], zone["polygon_m"][0])] for zone in zones]
        shapes["world/yard/zones"] = rr.LineStrips3D(
            rings, colors=0xF9A825FF, radii=rr.Radius.ui_points(1.5), labels=names, show_labels=True
        )
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
    for path, shape in shapes.items():
        stream.log(path, shape, static=True)


def draw_motion(stream: rr.RecordingStream, part: LogBin) -> None:
    """Draw poses and phases of a bin; each trajectory grows by the line of one bin."""
    first, end = part.first["step"], part.end
    times, pose = at_steps(part.log, np.arange(first, end)), part.tables["step"]["pose"]
    stream.send_columns("world/robot", times, _moves(pose))
    for description in part.log.meta.get("truth", {}).get("moving", ()):
        body, track = described_moving(description)
        moves = _moves(track.pose(part.tables["step"]["time_s"]))
        stream.send_columns(f"world/truth/{body.label}", times, moves)
    stream.send_columns("mission/phase", times, rr.StateChange.columns(state=part.tables["step"]["phase"]))
    stream.log("plots/directions/heading", rr.Scalars(np.degrees(wrap(pose[-1, 2]))))
    for path, column, height_m, colour, width in (
        ("world/trajectory", "pose", 0.06, 0x78BEFFFF, 1.5),
        ("world/truth/trajectory", "true_pose", 0.04, TRUTH, 0.8),
        ("world/odometry", "odometry", 0.03, 0x6E8273FF, 0.8),
    ):
        pose = part.log.column("step", column, max(first - 1, 0), end)
        if np.isfinite(pose).all():
            line = np.column_stack([pose[:, :2], np.full(len(pose), height_m)])
            stream.log(path, lines_3d([line], colour, width))


def _moves(pose: FloatArray) -> Any:  # noqa: ANN401 - columns of a type that Rerun does not export
    """Return transforms for poses x m, y m, yaw rad, shape (n, 3)."""
    turns = [rr.RotationAxisAngle([0, 0, 1], radians=angle) for angle in pose[:, 2].tolist()]
    translation_m = np.column_stack([pose[:, :2], 0.0 * pose[:, 2]])
    return rr.Transform3D.columns(translation=translation_m, rotation_axis_angle=turns)


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


def draw_pulses(stream: rr.RecordingStream, part: LogBin) -> None:
    """Draw the bearings of a bin as rays and over time, the strongest pulse as a ring, and the median strengths."""
    bearing_rad, rows = part.tables["bearing"]["bearing_rad"], part.tables["bearing"]["pulse"] - part.first["pulse"]
    if not rows.size:
        for path in ("world/bearings", "world/spectrum"):
            stream.log(path, rr.Clear.flat())
        return
    step, strengths_v = part.tables["pulse"]["step"][rows], part.tables["pulse"]["strengths_v"][rows]
    pose = part.tables["step"]["pose"][step - part.first["step"]]
    start_m = np.column_stack([pose[:, :2], np.full(rows.size, ARRAY_HEIGHT_M)])
    ahead = np.column_stack([np.cos(bearing_rad), np.sin(bearing_rad), np.zeros(rows.size)])
    stream.log("world/bearings", lines_3d(np.stack([start_m, start_m + 25.0 * ahead], axis=1), BEARING, 1.0))
    strongest = int(np.linalg.norm(strengths_v, axis=-1).argmax())
    manifold = described_manifold(part.log.meta["array"])
    ring_m = _ring(pose[strongest], strengths_v[strongest], manifold)
    stream.log("world/spectrum", lines_3d([ring_m], 0x5ADCFFFF, 1.5))
    level_db = 20.0 * np.log10(np.maximum(np.median(strengths_v, axis=0), 1e-3))  # zeros: elements that face away
    stream.log("plots/strengths", rr.Scalars(level_db))
    degrees = rr.Scalars.columns(scalars=np.degrees(bearing_rad))
    stream.send_columns("plots/directions/bearing", at_steps(part.log, step), degrees)


def _ring(pose: FloatArray, strengths_v: FloatArray, manifold: GainManifold) -> FloatArray:
    """Return the pseudo-spectrum of a pulse as a closed line around a pose, radius 0.8 m at zero and 3 m at the peak.

    It follows eq. (13) to (15) of the Dir-MUSIC paper, with 1.001 for 1 so that the peak is not infinite.
    """
    gain = manifold.gain(AZIMUTHS_RAD)
    fit = strengths_v @ gain / (np.linalg.norm(strengths_v) * np.linalg.norm(gain, axis=0))
    spectrum = 1.0 / (1.001 - np.square(fit))
    angle = np.append(AZIMUTHS_RAD, 0.0) + pose[2]
    radius_m = 0.8 + 2.2 * np.append(spectrum, spectrum[0]) / spectrum.max()
    x, y = pose[0] + radius_m * np.cos(angle), pose[1] + radius_m * np.sin(angle)
    return np.column_stack([x, y, np.full(angle.size, ARRAY_HEIGHT_M)])
