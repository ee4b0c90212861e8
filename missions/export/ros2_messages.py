"""Definitions of the ROS 2 messages that are written, fields and their types as of common_interfaces 4 (Humble)."""

from __future__ import annotations

import re

FIELDS: dict[str, str] = {
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
"""By package and name, the fields in order."""


def definition(name: str) -> str:
    """A message's definition followed by those of all that it is made of, as MCAP has it for the encoding ros2msg.

    Args:
        name: Such as `sensor_msgs/LaserScan`.
    """
    needed = [name]
    for one in needed:
        parts = re.findall(r"(\w+/\w+)(?:\[\])? \w+", FIELDS[one])
        needed += [part for part in dict.fromkeys(parts) if part not in needed]
    lines = [FIELDS[name].replace(", ", "\n")]
    for part in needed[1:]:
        lines += ["=" * 80, f"MSG: {part}", FIELDS[part].replace(", ", "\n")]
    return "\n".join(lines) + "\n"
