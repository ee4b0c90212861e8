"""Yard and robot as one MuJoCo model: a robot, its sensors and antenna elements, and what is around it."""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums and spec elements.

from __future__ import annotations

from collections.abc import Sequence

import mujoco

from pdpatrol.robot_models.antenna.elements import AntennaElements, attach_elements
from pdpatrol.robot_models.description.robot_description import RobotDescription
from pdpatrol.robot_models.description.robot_parts import BASE, HOME
from pdpatrol.robot_models.sensors import add_contact_sensors, add_lidar
from pdpatrol.robot_models.yard.scenery import add_yard
from pdpatrol.robot_models.yard.yard import Yard

CHASE = "chase"
"""Camera that stays behind the robot, to its left; a robot's file may have one of its own."""

CHASE_FROM_M = (-1.7, -1.4, 1.35)
CHASE_AXES = (0.63, -0.777, 0.0, 0.38, 0.31, 0.87)
"""Where it is, and its x and y axes, if the file has none; frame of the base."""


def build_spec(robot: RobotDescription, yard: Yard, elements: AntennaElements | None = None) -> mujoco.MjSpec:
    """Describe the yard with one robot in it, still editable.

    Args:
        robot: Whose file is read anew.
        yard: Fence and equipment.
        elements: The antenna elements that the robot carries; they change nothing about how it moves.

    Returns:
        The spec. Equipment is named `equipment/NAME`, its further parts `equipment/NAME/PART`, the fence `fence/SIDE`,
        the beams of the lidar `lidar_00` and so on, the sensors of what the hull touches `hull/GEOM`, the sites of
        the antenna elements `element_1` and so on, each with its x axis along the look.
    """
    spec = mujoco.MjSpec.from_file(str(robot.xml_path))
    spec.modelname = "yard"
    if not any(key.name == HOME for key in spec.keys):
        spec.add_key(name=HOME, qpos=robot.home_qpos)
    if spec.camera(CHASE) is None:
        follows = mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM
        spec.body(BASE).add_camera(name=CHASE, mode=follows, pos=CHASE_FROM_M, xyaxes=CHASE_AXES)
    add_lidar(spec, robot)
    add_contact_sensors(spec)
    if elements is not None:
        attach_elements(spec, elements)
    add_yard(spec, yard)
    return spec


def physics_only(spec: mujoco.MjSpec, sensors: Sequence[str]) -> mujoco.MjSpec:
    """The same world for physics alone: no geoms that nothing can touch, only the sensors named, no cameras nor lights.

    It moves as the whole one does, in the same state, and steps by a fifth faster (measured). Its lidar sees through
    the robot's own parts, as the filter of a scanner does. Sensors with a history stay: the state holds it.
    """
    lean = spec.copy()
    is_kept = {sensor.name: sensor.name in sensors or sensor.nsample > 0 for sensor in lean.sensors}
    at_sites = [sensor for sensor in lean.sensors if sensor.objtype == mujoco.mjtObj.mjOBJ_SITE]
    read_at = {sensor.objname for sensor in at_sites if is_kept[sensor.name]}
    robots = [geom for geom in lean.geoms if geom.parent.name != lean.worldbody.name]
    idle = [
        *(geom for geom in robots if geom.contype == geom.conaffinity == 0 and geom.mass == 0),
        *(sensor for sensor in lean.sensors if not is_kept[sensor.name]),
        *(site for site in lean.sites if site.name not in read_at),
        *lean.cameras,
        *lean.lights,
    ]
    for element in idle:
        lean.delete(element)
    for geom in lean.body(BASE).find_all(mujoco.mjtObj.mjOBJ_GEOM):
        geom.material, geom.rgba = "", [0.0, 0.0, 0.0, 0.0]  # beams pass what is not to be seen
    return lean
