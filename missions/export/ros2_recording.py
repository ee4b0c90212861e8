"""Write a mission as an MCAP file of ROS 2 messages: poses, transforms, scans, and markers of yard and findings.

Frames: `map` of the yard, `base_link` of the robot at its estimated pose, `laser` of its lidar.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap_ros2.writer import Writer
from numpy.typing import NDArray

from dirmusic.locating.finding import outline95
from pdpatrol.missions.record.mission_log import MissionLog

FloatArray = NDArray[np.float64]
Content = dict[str, Any]
"""Fields of a message; those that are left out are zero or empty."""

TOPICS = {
    "/tf": "tf2_msgs/TFMessage",
    "/pose": "geometry_msgs/PoseStamped",
    "/true_pose": "geometry_msgs/PoseStamped",
    "/scan": "sensor_msgs/LaserScan",
    "/yard": "visualization_msgs/MarkerArray",
    "/bearings": "visualization_msgs/MarkerArray",
    "/findings": "visualization_msgs/MarkerArray",
}
"""Type of the messages on each topic."""

MESSAGE_FIELDS: dict[str, str] = {
    "builtin_interfaces/Time": "int32 sec, uint32 nanosec",
    "builtin_interfaces/Duration": "int32 sec, uint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp, string frame_id",
    "std_msgs/ColorRGBA": "float32 r, float32 g, float32 b, float32 a",
    "geometry_msgs/Point": "float64 x, float64 y, float64 z",
    "geometry_msgs/Vector3": "float64 x, float64 y, float64 z",
    "geometry_msgs/Quaternion": "float64 x, float64 y, float64 z, float64 w",
    "geometry_msgs/Pose": "geometry_msgs/Point position, geometry_msgs/Quaternion orientation",
    "geometry_msgs/PoseStamped": "std_msgs/Header header, geometry_msgs/Pose pose",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation, geometry_msgs/Quaternion rotation",
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header, string child_frame_id, geometry_msgs/Transform transform"
    ),
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "sensor_msgs/LaserScan": (
        "std_msgs/Header header, float32 angle_min, float32 angle_max, float32 angle_increment, "
        "float32 time_increment, float32 scan_time, float32 range_min, float32 range_max, float32[] ranges, "
        "float32[] intensities"
    ),
    "sensor_msgs/CompressedImage": "std_msgs/Header header, string format, uint8[] data",
    "visualization_msgs/UVCoordinate": "float32 u, float32 v",
    "visualization_msgs/MeshFile": "string filename, uint8[] data",
    "visualization_msgs/Marker": (
        "std_msgs/Header header, string ns, int32 id, int32 type, int32 action, geometry_msgs/Pose pose, "
        "geometry_msgs/Vector3 scale, std_msgs/ColorRGBA color, builtin_interfaces/Duration lifetime, "
        "bool frame_locked, geometry_msgs/Point[] points, std_msgs/ColorRGBA[] colors, string texture_resource, "
        "sensor_msgs/CompressedImage texture, visualization_msgs/UVCoordinate[] uv_coordinates, string text, "
        "string mesh_resource, visualization_msgs/MeshFile mesh_file, bool mesh_use_embedded_materials"
    ),
    "visualization_msgs/MarkerArray": "visualization_msgs/Marker[] markers",
}
"""Fields of each type of message, in order, as in common_interfaces 4 (ROS 2 Humble)."""

CUBE, SPHERE, CYLINDER, LINE_STRIP, LINE_LIST, TEXT = 1, 2, 3, 4, 5, 9
"""Types of a visualization_msgs/Marker."""

SHAPES = {"box": CUBE, "cylinder": CYLINDER, "sphere": SPHERE, "ellipsoid": SPHERE}
COLOURS = {"candidate": (1.0, 0.7, 0.16), "confirmed": (0.24, 0.86, 0.43), "outside": (0.6, 0.6, 0.63)}

OUTLINE_POINTS = 37

UNIX_TIME_S = 1e9
"""Times from here on (September 2001) are taken for Unix times: no survey lasts for decades."""


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


def definition(name: str) -> str:
    """Return the definition of a message and of all that it contains, in the MCAP encoding ros2msg.

    Args:
        name: Type of the message, such as `sensor_msgs/LaserScan`.
    """
    needed = [name]
    for part in needed:
        contained = re.findall(r"(\w+/\w+)(?:\[\])? \w+", MESSAGE_FIELDS[part])
        needed += [each for each in dict.fromkeys(contained) if each not in needed]
    lines = [MESSAGE_FIELDS[name].replace(", ", "\n")]
    for part in needed[1:]:
        lines += ["=" * 80, f"MSG: {part}", MESSAGE_FIELDS[part].replace(", ", "\n")]
    return "\n".join(lines) + "\n"


class Message(NamedTuple):
    """Message on a topic at a step."""

    topic: str
    step: int
    content: Content


def _messages(log: MissionLog, time_ns: NDArray[np.int64]) -> Iterator[Message]:
    """Return the messages of each topic in order of time."""
    step = log.table("step")

    def header(at: int, frame: str = "map") -> Content:
        return {"stamp": {"sec": int(time_ns[at] // 10**9), "nanosec": int(time_ns[at] % 10**9)}, "frame_id": frame}

    yield Message("/yard", 0, {"markers": _yard_markers(log.meta, header(0))})
    lidar = log.meta.get("lidar")
    for at, pose in enumerate(step["pose"]):
        transforms = [
            {
                "header": header(at),
                "child_frame_id": "base_link",
                "transform": {"translation": _xyz(pose[0], pose[1]), "rotation": _rotation(pose[2])},
            }
        ]
        if lidar is not None:
            mount = {"translation": _xyz(z=lidar["height_m"]), "rotation": _rotation(0.0)}
            transforms.append({"header": header(at, "base_link"), "child_frame_id": "laser", "transform": mount})
        yield Message("/tf", at, {"transforms": transforms})
        yield Message("/pose", at, {"header": header(at), "pose": _pose(*pose)})
    for at in np.flatnonzero(np.isfinite(step["true_pose"]).all(axis=-1)).tolist():
        yield Message("/true_pose", at, {"header": header(at), "pose": _pose(*step["true_pose"][at])})
    scan = log.table("scan")
    for at, range_m in zip(scan["step"].tolist(), scan["range_m"], strict=True):
        yield Message("/scan", at, _scan(header(at, "laser"), range_m, log.meta["lidar"]))
    bearing = log.table("bearing")
    bearing_step = log.column("pulse", "step")[bearing["pulse"]]
    for at in np.unique(bearing_step).tolist():
        rays = _marker(header(at), LINE_LIST, "bearings", 0, (1.0, 0.9, 0.43), (0.05, 0.0, 0.0))
        rays["points"] = _ray_points(step["pose"][at], bearing["bearing_rad"][bearing_step == at])
        rays["lifetime"] = {"nanosec": 500_000_000}
        yield Message("/bearings", at, {"markers": [rays]})
    finding = log.table("finding")
    for at in np.unique(finding["step"]).tolist():
        markers: list[Content] = []
        for row in np.flatnonzero(finding["step"] == at):
            markers += _finding_markers({name: column[row] for name, column in finding.items()}, header(at))
        yield Message("/findings", at, {"markers": markers})


def _scan(header: Content, range_m: FloatArray, lidar: Mapping[str, float]) -> Content:
    """Return a scan with ranges from the axis of the robot, where the beams meet."""
    beam_rad = 2.0 * np.pi / len(range_m)
    return {
        "header": header,
        "angle_min": 0.0,
        "angle_max": 2.0 * np.pi - beam_rad,
        "angle_increment": beam_rad,
        "scan_time": lidar["period_s"],
        "range_min": lidar["start_m"],
        "range_max": lidar["start_m"] + lidar["range_m"],
        "ranges": (lidar["start_m"] + range_m.astype(np.float64)).tolist(),
    }


def _yard_markers(meta: Mapping[str, Any], header: Content) -> list[Content]:
    markers: list[Content] = []
    for number, solid in enumerate(meta.get("solids", {}).get("yard", ())):
        if solid["shape"] not in SHAPES:
            continue
        size_m = np.array(solid["size_m"])
        scale = 2.0 * (size_m[[0, 0, 1]] if solid["shape"] == "cylinder" else np.resize(size_m[size_m > 0.0], 3))
        marker = _marker(header, SHAPES[solid["shape"]], solid["group"], number, solid["rgba"], scale)
        orientation = dict(zip("wxyz", solid["quaternion_wxyz"], strict=True))
        markers.append({**marker, "pose": {"position": _xyz(*solid["position_m"]), "orientation": orientation}})
    for number, (name, place_m) in enumerate(meta.get("sites", {}).items()):
        marker = _marker(header, TEXT, "sites", number, (0.8, 0.6, 0.35), (0.0, 0.0, 0.3))
        markers.append({**marker, "text": name, "pose": {"position": _xyz(*place_m), "orientation": _rotation(0.0)}})
    return markers


def _finding_markers(row: Mapping[str, Any], header: Content) -> list[Content]:
    """Return point, name and 95 % ellipse of a finding; those of ghosts and dropped findings are deleted (action 2)."""
    number, state, (x, y, z) = int(row["id"]), str(row["state"]), row["position_m"]
    kinds = {
        "findings": (SPHERE, 0.4, 0.4, 0.4),
        "names": (TEXT, 0.0, 0.0, 0.5),
        "ellipses": (LINE_STRIP, 0.06, 0.0, 0.0),
    }
    colour = COLOURS.get(state, (0.0, 0.0, 0.0))
    markers = [_marker(header, kind, space, number, colour, scale) for space, (kind, *scale) in kinds.items()]
    if state not in COLOURS:
        return [{**marker, "action": 2} for marker in markers]
    point, name, ellipse = markers
    point["pose"]["position"] = _xyz(x, y, z)
    name["pose"]["position"] = _xyz(x, y, z + 0.5)
    name["text"] = f"{'finding' if state == 'confirmed' else 'candidate'} {number}"
    outline_m = outline95(row["position_m"][:2], row["covariance_m2"][:2, :2], OUTLINE_POINTS)
    ellipse["points"] = [_xyz(x, y, 0.05) for x, y in outline_m]
    return markers


def _ray_points(pose: FloatArray, bearing_rad: FloatArray) -> list[Content]:
    """Return the ends of a ray of 25 m for each bearing."""
    start = _xyz(pose[0], pose[1], 0.6)
    ends = pose[:2] + 25.0 * np.column_stack([np.cos(bearing_rad), np.sin(bearing_rad)])
    return [point for x, y in ends for point in (start, _xyz(x, y, 0.6))]


def _marker(
    header: Content, kind: int, space: str, number: int, rgb: Sequence[float], scale: Sequence[float] | FloatArray
) -> Content:
    """Return a marker without position; the colour may have an opacity."""
    return {
        "header": header,
        "ns": space,
        "id": number,
        "type": kind,
        "pose": {"orientation": _rotation(0.0)},
        "scale": _xyz(*scale),
        "color": {"a": 1.0} | dict(zip("rgba", rgb, strict=False)),
    }


def _pose(x: float, y: float, yaw_rad: float) -> Content:
    return {"position": _xyz(x, y), "orientation": _rotation(yaw_rad)}


def _xyz(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Content:
    return {"x": float(x), "y": float(y), "z": float(z)}


def _rotation(yaw_rad: float) -> Content:
    """Return a rotation about z as a quaternion."""
    return {"z": float(np.sin(0.5 * yaw_rad)), "w": float(np.cos(0.5 * yaw_rad))}
