"""A mission as an MCAP file of ROS 2 messages: poses, transforms, scans, markers of yard, pulses and findings.

Frames: `map` is the yard's, `base_link` the robot's as it believes to stand, `laser` that of its lidar.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap_ros2.writer import Writer
from numpy.typing import NDArray

from dirmusic.locating.ellipse import outline95
from pdpatrol.missions.export.ros2_messages import definition
from pdpatrol.missions.record.mission_log import MissionLog

FloatArray = NDArray[np.float64]
Content = dict[str, Any]

CUBE, SPHERE, CYLINDER, LINE_STRIP, LINE_LIST, TEXT = 1, 2, 3, 4, 5, 9
"""Types of a visualization_msgs/Marker."""

ADD, DELETE = 0, 2
"""Actions of one."""

TOPICS = {
    "/tf": "tf2_msgs/TFMessage",
    "/pose": "geometry_msgs/PoseStamped",
    "/true_pose": "geometry_msgs/PoseStamped",
    "/scan": "sensor_msgs/LaserScan",
    "/yard": "visualization_msgs/MarkerArray",
    "/bearings": "visualization_msgs/MarkerArray",
    "/findings": "visualization_msgs/MarkerArray",
}
"""What is written, and as what."""

COLOURS = {"candidate": (1.0, 0.7, 0.16), "confirmed": (0.24, 0.86, 0.43), "outside": (0.6, 0.6, 0.63)}
BEARING_COLOUR = (1.0, 0.9, 0.43)
RAY_M, RAY_S = 25.0, 0.5
"""Length of the ray of a bearing, and how long it is shown."""

UNIX_TIME_S = 1e9
"""Times from here on (September 2001) are taken for Unix times: no survey lasts for decades."""

OUTLINE_POINTS = 37
SHAPES = {"box": CUBE, "cylinder": CYLINDER, "sphere": SPHERE, "ellipsoid": SPHERE}


def write_ros2_recording(log: MissionLog, path: Path) -> None:
    """Write a mission as MCAP.

    The recording begins at midnight UTC on the date of the inspection, or of 1 January 1970 where the log has no date.
    Field data whose times are Unix times keep them.
    """
    time_ns = _clock_ns(log.column("step", "time_s"), log.meta.get("date"))
    messages = sorted(_messages(log, time_ns), key=lambda message: message.step)
    with path.open("wb") as file, Writer(file) as writer:
        schemas = {
            name: writer.register_msgdef(name.replace("/", "/msg/"), definition(name))
            for name in dict.fromkeys(TOPICS.values())
        }
        for topic, step, content in messages:
            at_ns = int(time_ns[step])
            writer.write_message(topic, schemas[TOPICS[topic]], content, log_time=at_ns, publish_time=at_ns)


def _clock_ns(time_s: FloatArray, date: str | None) -> NDArray[np.int64]:
    """Convert times of steps to Unix time in nanoseconds, for at least one step."""
    if not time_s.size:
        time_s = np.zeros(1)
    if time_s[0] >= UNIX_TIME_S:
        return np.round(1e9 * time_s).astype(np.int64)
    start = datetime.fromisoformat(date or "1970-01-01").replace(tzinfo=UTC)
    return round(start.timestamp()) * 10**9 + np.round(1e9 * (time_s - time_s[0])).astype(np.int64)


class _Message(NamedTuple):
    """What is written on a topic at a step."""

    topic: str
    step: int
    content: Content


def _messages(log: MissionLog, time_ns: NDArray[np.int64]) -> Iterator[_Message]:
    """Of all topics, each in order of time."""
    step = log.table("step")

    def header(at: int, frame: str = "map") -> Content:
        return {"stamp": {"sec": int(time_ns[at] // 10**9), "nanosec": int(time_ns[at] % 10**9)}, "frame_id": frame}

    yield _Message("/yard", 0, {"markers": _yard_markers(log.meta, header(0))})
    lidar = log.meta.get("lidar")
    for at, pose in enumerate(step["pose"]):
        transforms = [_transform(header(at), "base_link", pose)]
        if lidar is not None:
            above = {"translation": _xyz(0.0, 0.0, lidar["height_m"]), "rotation": _turn(0.0)}
            transforms.append({"header": header(at, "base_link"), "child_frame_id": "laser", "transform": above})
        yield _Message("/tf", at, {"transforms": transforms})
        yield _Message("/pose", at, {"header": header(at), "pose": _pose(pose)})
    for at in np.flatnonzero(np.isfinite(step["true_pose"]).all(axis=-1)).tolist():
        yield _Message("/true_pose", at, {"header": header(at), "pose": _pose(step["true_pose"][at])})
    scan = log.table("scan")
    for at, range_m in zip(scan["step"].tolist(), scan["range_m"], strict=True):
        yield _Message("/scan", at, _scan(header(at, "laser"), range_m, log.meta["lidar"]))
    pulse_step, bearing = log.column("pulse", "step"), log.table("bearing")
    bearing_step = pulse_step[bearing["pulse"]]
    for at in np.unique(bearing_step).tolist():
        rays = _rays(step["pose"][at], bearing["bearing_rad"][bearing_step == at])
        shown = {"sec": 0, "nanosec": round(1e9 * RAY_S)}
        lines = _marker(header(at), LINE_LIST, "bearings", 0, BEARING_COLOUR, (0.05, 0.0, 0.0))
        yield _Message("/bearings", at, {"markers": [{**lines, "points": rays, "lifetime": shown}]})
    finding = log.table("finding")
    for at in np.unique(finding["step"]).tolist():
        rows = np.flatnonzero(finding["step"] == at)
        markers = [
            marker
            for row in rows
            for marker in _finding_markers({name: column[row] for name, column in finding.items()}, header(at))
        ]
        yield _Message("/findings", at, {"markers": markers})


def _scan(header: Content, range_m: FloatArray, lidar: Mapping[str, float]) -> Content:
    """Ranges from the middle of the robot, about which the beams start."""
    beams, turn = len(range_m), 2.0 * np.pi
    return {
        "header": header,
        "angle_min": 0.0,
        "angle_max": turn * (beams - 1) / beams,
        "angle_increment": turn / beams,
        "time_increment": 0.0,
        "scan_time": lidar["period_s"],
        "range_min": lidar["start_m"],
        "range_max": lidar["start_m"] + lidar["range_m"],
        "ranges": (lidar["start_m"] + range_m.astype(np.float64)).tolist(),
        "intensities": [],
    }


def _yard_markers(meta: Mapping[str, Any], header: Content) -> list[Content]:
    markers: list[Content] = []
    for number, solid in enumerate(meta.get("solids", {}).get("yard", ())):
        if solid["shape"] not in SHAPES:
            continue
        size = np.array(solid["size_m"])
        scale = 2.0 * (size[[0, 0, 1]] if solid["shape"] == "cylinder" else np.resize(size[size > 0.0], 3))
        w, x, y, z = solid["quaternion_wxyz"]
        place = {"position": _xyz(*solid["position_m"]), "orientation": {"x": x, "y": y, "z": z, "w": w}}
        red, green, blue, alpha = solid["rgba"]
        marker = _marker(header, SHAPES[solid["shape"]], solid["group"], number, (red, green, blue), scale)
        markers.append({**marker, "pose": place, "color": _rgba(red, green, blue, alpha)})
    for number, (name, place_m) in enumerate(meta.get("sites", {}).items()):
        text = _marker(header, TEXT, "sites", number, (0.8, 0.6, 0.35), (0.0, 0.0, 0.3))
        markers.append({**text, "text": name, "pose": {"position": _xyz(*place_m), "orientation": _turn(0.0)}})
    return markers


def _finding_markers(row: Mapping[str, Any], header: Content) -> list[Content]:
    """A point, its name and its 95 % ellipse on the ground; nothing for ghosts and for what is no more."""
    number, place, state = int(row["id"]), row["position_m"], str(row["state"])
    kinds = (("findings", SPHERE), ("names", TEXT), ("ellipses", LINE_STRIP))
    if state not in COLOURS:
        return [
            {**_marker(header, kind, space, number, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), "action": DELETE}
            for space, kind in kinds
        ]
    colour = COLOURS[state]
    point, text, outline = (
        _marker(header, kind, space, number, colour, scale)
        for (space, kind), scale in zip(kinds, ((0.4, 0.4, 0.4), (0.0, 0.0, 0.5), (0.06, 0.0, 0.0)), strict=True)
    )
    at = {"position": _xyz(*place), "orientation": _turn(0.0)}
    above = {"position": _xyz(place[0], place[1], place[2] + 0.5), "orientation": _turn(0.0)}
    ring = [_xyz(x, y, 0.05) for x, y in outline95(place[:2], row["covariance_m2"][:2, :2], OUTLINE_POINTS)]
    name = f"{'finding' if state == 'confirmed' else 'candidate'} {number}"
    return [{**point, "pose": at}, {**text, "pose": above, "text": name}, {**outline, "points": ring}]


def _rays(pose: FloatArray, bearing_rad: FloatArray) -> list[Content]:
    """Two points for each bearing."""
    start = _xyz(pose[0], pose[1], 0.6)
    ends = pose[:2] + RAY_M * np.column_stack([np.cos(bearing_rad), np.sin(bearing_rad)])
    return [point for x, y in ends for point in (start, _xyz(x, y, 0.6))]


def _marker(
    header: Content, kind: int, space: str, number: int, colour: tuple[float, ...], scale: Sequence[float] | FloatArray
) -> Content:
    nowhere = {"position": _xyz(0.0, 0.0, 0.0), "orientation": _turn(0.0)}
    no_header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    return {
        "header": header,
        "ns": space,
        "id": number,
        "type": kind,
        "action": ADD,
        "pose": nowhere,
        "scale": dict(zip("xyz", map(float, scale), strict=True)),
        "color": {**dict(zip("rgb", colour, strict=True)), "a": 1.0},
        "lifetime": {"sec": 0, "nanosec": 0},
        "frame_locked": False,
        "points": [],
        "colors": [],
        "texture_resource": "",
        "texture": {"header": no_header, "format": "", "data": []},
        "uv_coordinates": [],
        "text": "",
        "mesh_resource": "",
        "mesh_file": {"filename": "", "data": []},
        "mesh_use_embedded_materials": False,
    }


def _transform(header: Content, child: str, pose: FloatArray) -> Content:
    place = {"translation": _xyz(pose[0], pose[1], 0.0), "rotation": _turn(float(pose[2]))}
    return {"header": header, "child_frame_id": child, "transform": place}


def _pose(pose: FloatArray) -> Content:
    return {"position": _xyz(pose[0], pose[1], 0.0), "orientation": _turn(float(pose[2]))}


def _xyz(x: float, y: float, z: float) -> Content:
    return {"x": float(x), "y": float(y), "z": float(z)}


def _rgba(red: float, green: float, blue: float, alpha: float) -> Content:
    return {"r": red, "g": green, "b": blue, "a": alpha}


def _turn(yaw_rad: float) -> Content:
    """About z, as a quaternion."""
    return {"x": 0.0, "y": 0.0, "z": float(np.sin(0.5 * yaw_rad)), "w": float(np.cos(0.5 * yaw_rad))}
