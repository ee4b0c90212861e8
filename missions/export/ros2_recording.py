"""Write a mission as an MCAP file of ROS 2 messages: poses, transforms, scans, pulses, markers of yard and findings.

Frames: `map` of the yard, `base_link` of the robot at its estimated pose, `laser` of its lidar.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from operator import itemgetter
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
    "/pulses": "pdpatrol_msgs/Pulse",
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
    "pdpatrol_msgs/Pulse": (
        "std_msgs/Header header, float64[] strengths_v, float64[] std_v, float64 mains_phase_rad, bool is_clipped"
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
"""Fields of each type of message, in order, as in common_interfaces 4 (ROS 2 Humble).

`pdpatrol_msgs/Pulse` is our own: strengths of a pulse in all channels, their standard deviations by noise, mains phase
or NaN, and whether a channel was clipped.
"""

MARKER_TYPES = {"box": 1, "sphere": 2, "ellipsoid": 2, "cylinder": 3, "line_strip": 4, "line_list": 5, "text": 9}
"""Types of a visualization_msgs/Marker."""

DELETE_ALL = 3
"""Action of a visualization_msgs/Marker."""

COLOURS = {"candidate": (1.0, 0.7, 0.16), "confirmed": (0.24, 0.86, 0.43), "outside": (0.6, 0.6, 0.63)}
"""Colours of findings by state; those in another state are not shown."""


def write_ros2_recording(log: MissionLog, path: Path) -> None:
    """Write a mission as MCAP.

    The recording begins at midnight UTC on the date of the inspection, or on 1 January 1970 if the log has no date.
    Field data whose times are Unix times keep them.
    """
    time_ns = _clock_ns(log.column("step", "time_s"), log.meta.get("date"))
    with path.open("wb") as file, Writer(file) as writer:
        schemas = {
            name: writer.register_msgdef(name.replace("/", "/msg/"), definition(name)) for name in set(TOPICS.values())
        }
        for step, topic, content in sorted(_messages(log, time_ns), key=itemgetter(0)):
            writer.write_message(topic, schemas[TOPICS[topic]], content, int(time_ns[step]))


def _clock_ns(time_s: FloatArray, date: str | None) -> NDArray[np.int64]:
    """Convert times of steps to Unix time in nanoseconds, for at least one step."""
    start_ns, since_s = np.int64(0), time_s if time_s.size else np.zeros(1)
    if since_s[0] < 1e9:  # September 2001; no survey lasts for decades
        start_ns = np.datetime64(date or "1970-01-01", "ns").astype(np.int64)
        since_s = since_s - since_s[0]
    return start_ns + np.round(1e9 * since_s).astype(np.int64)


def definition(name: str) -> str:
    """Return the definition of a type of message, followed by those of all others, in the MCAP encoding ros2msg."""
    separator = "=" * 80
    others = [f"{separator}\nMSG: {other}\n{fields}\n" for other, fields in MESSAGE_FIELDS.items() if other != name]
    return "".join([f"{MESSAGE_FIELDS[name]}\n", *others]).replace(", ", "\n")


def _messages(log: MissionLog, time_ns: NDArray[np.int64]) -> Iterator[tuple[int, str, Content]]:
    """Yield step, topic and content of each message."""
    step, lidar = log.table("step"), log.meta.get("lidar")

    def header(at: int, frame: str = "map") -> Content:
        sec, nanosec = divmod(int(time_ns[at]), 10**9)
        return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": frame}

    yield 0, "/yard", {"markers": _yard_markers(log.meta, header(0))}
    for at, (pose, true_pose) in enumerate(zip(step["pose"], step["true_pose"], strict=True)):
        place = {"translation": _xyz(pose[:2]), "rotation": _rotation(pose[2])}
        transforms = [{"header": header(at), "child_frame_id": "base_link", "transform": place}]
        if lidar is not None:
            mount = {"translation": {"z": lidar["height_m"]}, "rotation": {"w": 1.0}}
            transforms.append({"header": header(at, "base_link"), "child_frame_id": "laser", "transform": mount})
        yield at, "/tf", {"transforms": transforms}
        yield at, "/pose", {"header": header(at), "pose": _pose(pose)}
        if np.isfinite(true_pose).all():
            yield at, "/true_pose", {"header": header(at), "pose": _pose(true_pose)}
    scan = log.table("scan")
    for at, range_m in zip(scan["step"].tolist(), scan["range_m"], strict=True):
        yield at, "/scan", _scan(header(at, "laser"), range_m, log.meta["lidar"])
    for at, content in _pulses(log):
        yield at, "/pulses", {"header": header(at, "base_link"), **content}
    bearing = log.table("bearing")
    bearing_step = log.column("pulse", "step")[bearing["pulse"]]
    for at in np.unique(bearing_step).tolist():
        rays = [
            {"x": along_m * np.cos(azimuth_rad), "y": along_m * np.sin(azimuth_rad), "z": 0.6}
            for azimuth_rad in bearing["azimuth_rad"][bearing_step == at]
            for along_m in (0.0, 25.0)
        ]
        style = "line_list", "bearings", 0, (1.0, 0.9, 0.43), [0.05]
        lifetime = {"nanosec": 500_000_000}
        yield at, "/bearings", {"markers": [_marker(header(at, "base_link"), *style, points=rays, lifetime=lifetime)]}
    finding = log.table("finding")
    for at in np.unique(finding["step"]).tolist():
        markers: list[Content] = [{"header": header(at), "action": DELETE_ALL}]
        for row in np.flatnonzero(finding["step"] == at):
            markers += _finding_markers({name: column[row] for name, column in finding.items()}, header(at))
        yield at, "/findings", {"markers": markers}


def _pulses(log: MissionLog) -> Iterator[tuple[int, Content]]:
    """Yield step and content of each pulse; in channels that `locate` had left out, the strength is zero."""
    pulse, survey = log.table("pulse"), log.meta.get("field_data", {})
    channels = survey.get("channels", range(log.meta["n_elements"]))
    shape = len(pulse["step"]), survey.get("n_channels", log.meta["n_elements"])
    strengths_v, std_v = np.zeros(shape), np.ones(shape)
    strengths_v[:, channels], std_v[:, channels] = pulse["strengths_v"], pulse["std_v"]
    others = zip(pulse["mains_phase_rad"].tolist(), pulse["is_clipped"].tolist(), strict=True)
    for at, volts, std, (phase_rad, is_clipped) in zip(pulse["step"].tolist(), strengths_v, std_v, others, strict=True):
        values = {"strengths_v": volts.tolist(), "std_v": std.tolist()}
        yield at, {**values, "mains_phase_rad": phase_rad, "is_clipped": is_clipped}


def _scan(header: Content, range_m: FloatArray, lidar: Mapping[str, float]) -> Content:
    """Return a scan with ranges from the axis of the robot, where the beams meet."""
    beam_rad = 2.0 * np.pi / range_m.size
    return {
        "header": header,
        "angle_max": 2.0 * np.pi - beam_rad,
        "angle_increment": beam_rad,
        "scan_time": lidar["period_s"],
        "range_min": lidar["start_m"],
        "range_max": lidar["start_m"] + lidar["range_m"],
        "ranges": (lidar["start_m"] + range_m).tolist(),
    }


def _yard_markers(meta: Mapping[str, Any], header: Content) -> list[Content]:
    markers = [
        _marker(header, "text", "sites", number, (0.8, 0.6, 0.35), [0.0, 0.0, 0.3], place_m, text=name)
        for number, (name, place_m) in enumerate(meta.get("sites", {}).items())
    ]
    for number, solid in enumerate(meta.get("solids", {}).get("yard", ())):
        if solid["shape"] in MARKER_TYPES:
            size_m = np.array(solid["size_m"])
            scale = 2.0 * (size_m[[0, 0, 1]] if solid["shape"] == "cylinder" else np.resize(size_m[size_m > 0.0], 3))
            marker = _marker(header, solid["shape"], solid["group"], number, solid["rgba"], scale, solid["position_m"])
            marker["pose"]["orientation"] = dict(zip("wxyz", solid["quaternion_wxyz"], strict=True))
            markers.append(marker)
    return markers


def _finding_markers(row: Mapping[str, Any], header: Content) -> list[Content]:
    """Return point, name and 95 % ellipse of a finding; nothing for dropped findings."""
    number, colour, place_m = row["id"], COLOURS.get(row["state"]), row["position_m"]
    if colour is None:
        return []
    outline_m = outline95(place_m[:2], row["covariance_m2"][:2, :2], 37)
    above_m = place_m + np.array([0.0, 0.0, 0.5])
    return [
        _marker(header, "sphere", "findings", number, colour, [0.4, 0.4, 0.4], place_m),
        _marker(header, "text", "names", number, colour, [0.0, 0.0, 0.5], above_m, text=f"finding {number}"),
        _marker(header, "line_strip", "ellipses", number, colour, [0.06], points=[*map(_xyz, outline_m)]),
    ]


def _marker(
    header: Content,
    kind: str,
    namespace: str,
    number: int,
    rgba: Sequence[float],
    scale: Sequence[float] | FloatArray,
    place_m: Sequence[float] | FloatArray = (),
    **others: Any,  # noqa: ANN401 - fields of many types
) -> Content:
    """Return a marker, with other fields as given; a colour without opacity is opaque."""
    return {
        "header": header,
        "ns": namespace,
        "id": number,
        "type": MARKER_TYPES[kind],
        "pose": {"position": _xyz(place_m), "orientation": {"w": 1.0}},
        "scale": _xyz(scale),
        "color": dict(zip("rgba", (*rgba, 1.0), strict=False)),
        **others,
    }


def _pose(pose: FloatArray) -> Content:
    """Return a pose of x, y and yaw."""
    return {"position": _xyz(pose[:2]), "orientation": _rotation(pose[2])}


def _xyz(values: Iterable[float]) -> Content:
    """Return a point or vector; missing coordinates are zero."""
    return dict(zip("xyz", values, strict=False))


def _rotation(yaw_rad: float) -> Content:
    """Return a rotation about z as a quaternion."""
    return {"z": np.sin(0.5 * yaw_rad), "w": np.cos(0.5 * yaw_rad)}
