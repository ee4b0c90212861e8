"""Write a mission as an MCAP file of ROS 2 messages: poses, transforms, scans, and markers of yard and findings.

Frames: `map` of the yard, `base_link` of the robot at its estimated pose, `laser` of its lidar.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from mcap_ros2.writer import Writer
from numpy.typing import NDArray

from dirmusic.arrays import FloatArray
from dirmusic.locating.finding import outline95
from pdpatrol.missions.record.mission_log import MissionLog

Content = dict[str, Any]
"""Fields of a message; omitted fields are zero or empty."""

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

MARKER_TYPES = {"box": 1, "sphere": 2, "ellipsoid": 2, "cylinder": 3, "line_strip": 4, "line_list": 5, "text": 9}
"""Types of a visualization_msgs/Marker."""

DELETE_ALL = 3
"""Action of a visualization_msgs/Marker."""

COLOURS = {"candidate": (1.0, 0.7, 0.16), "confirmed": (0.24, 0.86, 0.43), "outside": (0.6, 0.6, 0.63)}


def write_ros2_recording(log: MissionLog, path: Path) -> None:
    """Write a mission as MCAP.

    The recording begins at midnight UTC on the date of the inspection, or on 1 January 1970 if the log has no date.
    Field data whose times are Unix times keep them.
    """
    time_ns = _clock_ns(log.column("step", "time_s"), log.meta.get("date"))
    messages = sorted(_messages(log, time_ns), key=lambda message: message[0])
    with path.open("wb") as file, Writer(file) as writer:
        schemas = {
            name: writer.register_msgdef(name.replace("/", "/msg/"), definition(name))
            for name in dict.fromkeys(TOPICS.values())
        }
        for step, topic, content in messages:
            at_ns = int(time_ns[step])
            writer.write_message(topic, schemas[TOPICS[topic]], content, log_time=at_ns, publish_time=at_ns)


def _clock_ns(time_s: FloatArray, date: str | None) -> NDArray[np.int64]:
    """Convert times of steps to Unix time in nanoseconds, for at least one step."""
    if not time_s.size:
        time_s = np.zeros(1)
    if time_s[0] >= 1e9:  # September 2001; no survey lasts for decades
        return np.round(1e9 * time_s).astype(np.int64)
    start = datetime.fromisoformat(date or "1970-01-01").replace(tzinfo=UTC)
    return round(start.timestamp()) * 10**9 + np.round(1e9 * (time_s - time_s[0])).astype(np.int64)


def definition(name: str) -> str:
    """Return the definition of a type of message, followed by those of all others, in the MCAP encoding ros2msg."""
    separator = "=" * 80
    others = [f"{separator}\nMSG: {other}\n{fields}\n" for other, fields in MESSAGE_FIELDS.items() if other != name]
    return "".join([f"{MESSAGE_FIELDS[name]}\n", *others]).replace(", ", "\n")


def _messages(log: MissionLog, time_ns: NDArray[np.int64]) -> Iterator[tuple[int, str, Content]]:
    """Yield step, topic and content of each message."""
    step = log.table("step")

    def header(at: int, frame: str = "map") -> Content:
        return {"stamp": {"sec": int(time_ns[at] // 10**9), "nanosec": int(time_ns[at] % 10**9)}, "frame_id": frame}

    yield 0, "/yard", {"markers": _yard_markers(log.meta, header(0))}
    lidar = log.meta.get("lidar")
    for at, pose in enumerate(step["pose"]):
        place = {"translation": _xyz(*pose[:2]), "rotation": _rotation(pose[2])}
        transforms = [{"header": header(at), "child_frame_id": "base_link", "transform": place}]
        if lidar is not None:
            mount = {"translation": _xyz(0.0, 0.0, lidar["height_m"]), "rotation": _rotation(0.0)}
            transforms.append({"header": header(at, "base_link"), "child_frame_id": "laser", "transform": mount})
        yield at, "/tf", {"transforms": transforms}
        yield at, "/pose", {"header": header(at), "pose": _pose(pose)}
        if np.isfinite(step["true_pose"][at]).all():
            yield at, "/true_pose", {"header": header(at), "pose": _pose(step["true_pose"][at])}
    scan = log.table("scan")
    for at, range_m in zip(scan["step"].tolist(), scan["range_m"], strict=True):
        yield at, "/scan", _scan(header(at, "laser"), range_m, log.meta["lidar"])
    bearing = log.table("bearing")
    bearing_step = log.column("pulse", "step")[bearing["pulse"]]
    for at in np.unique(bearing_step).tolist():
        rays = _marker(header(at), "line_list", "bearings", 0, (1.0, 0.9, 0.43), (0.05, 0.0, 0.0))
        start_m = step["pose"][at][:2]
        for azimuth_rad in bearing["bearing_rad"][bearing_step == at]:
            end_m = start_m + 25.0 * np.array([np.cos(azimuth_rad), np.sin(azimuth_rad)])
            rays["points"] += [_xyz(x, y, 0.6) for x, y in (start_m, end_m)]
        rays["lifetime"] = {"nanosec": 500_000_000}
        yield at, "/bearings", {"markers": [rays]}
    finding = log.table("finding")
    for at in np.unique(finding["step"]).tolist():
        markers: list[Content] = [{"header": header(at), "action": DELETE_ALL}]
        for row in np.flatnonzero(finding["step"] == at):
            markers += _finding_markers({name: column[row] for name, column in finding.items()}, header(at))
        yield at, "/findings", {"markers": markers}


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
        if solid["shape"] in MARKER_TYPES:
            size_m = np.array(solid["size_m"])
            scale = 2.0 * (size_m[[0, 0, 1]] if solid["shape"] == "cylinder" else np.resize(size_m[size_m > 0.0], 3))
            marker = _marker(header, solid["shape"], solid["group"], number, solid["rgba"], scale, solid["position_m"])
            marker["pose"]["orientation"] = dict(zip("wxyz", solid["quaternion_wxyz"], strict=True))
            markers.append(marker)
    for number, (name, place_m) in enumerate(meta.get("sites", {}).items()):
        markers.append(_marker(header, "text", "sites", number, (0.8, 0.6, 0.35), (0.0, 0.0, 0.3), place_m))
        markers[-1]["text"] = name
    return markers


def _finding_markers(row: Mapping[str, Any], header: Content) -> list[Content]:
    """Return point, name and 95 % ellipse of a finding; nothing for multipath ghosts and dropped findings."""
    number, state, place_m = int(row["id"]), str(row["state"]), row["position_m"]
    if state not in COLOURS:
        return []
    point = _marker(header, "sphere", "findings", number, COLOURS[state], (0.4, 0.4, 0.4), place_m)
    name = _marker(header, "text", "names", number, COLOURS[state], (0.0, 0.0, 0.5), (*place_m[:2], place_m[2] + 0.5))
    name["text"] = f"{'finding' if state == 'confirmed' else 'candidate'} {number}"
    ellipse = _marker(header, "line_strip", "ellipses", number, COLOURS[state], (0.06, 0.0, 0.0))
    ellipse["points"] = [_xyz(x, y, 0.05) for x, y in outline95(place_m[:2], row["covariance_m2"][:2, :2], 37)]
    return [point, name, ellipse]


def _marker(
    header: Content,
    kind: str,
    namespace: str,
    number: int,
    rgba: Sequence[float],
    scale: Sequence[float] | FloatArray,
    place_m: Sequence[float] | FloatArray = (0.0, 0.0, 0.0),
) -> Content:
    """Return a marker; a colour without opacity is opaque."""
    return {
        "header": header,
        "ns": namespace,
        "id": number,
        "type": MARKER_TYPES[kind],
        "pose": {"position": _xyz(*place_m), "orientation": _rotation(0.0)},
        "scale": _xyz(*scale),
        "color": {"a": 1.0} | dict(zip("rgba", rgba, strict=False)),
        "points": [],
    }


def _pose(pose: FloatArray) -> Content:
    """Return a pose of x, y and yaw."""
    return {"position": _xyz(*pose[:2]), "orientation": _rotation(pose[2])}


def _xyz(x: float, y: float, z: float = 0.0) -> Content:
    return {"x": float(x), "y": float(y), "z": float(z)}


def _rotation(yaw_rad: float) -> Content:
    """Return a rotation about z as a quaternion."""
    return {"z": float(np.sin(0.5 * yaw_rad)), "w": float(np.cos(0.5 * yaw_rad))}
