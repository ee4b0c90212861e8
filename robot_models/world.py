"""MuJoCo model of a yard with one robot: floor, fence, equipment, and the robot's sensors and antenna elements."""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums and spec elements.

from __future__ import annotations

import mujoco
import numpy as np

from pdpatrol.robot_models.antenna_elements import AntennaElements, attach_elements
from pdpatrol.robot_models.description.robot_description import RobotDescription
from pdpatrol.robot_models.equipment.catalogue import FENCE_OPACITY, KIND_COLOURS, colour_of
from pdpatrol.robot_models.sensors import FLOOR_CONTYPE, OBSTACLE_CONTYPE, add_contact_sensors, add_lidar
from pdpatrol.robot_models.yard.pieces import Equipment
from pdpatrol.robot_models.yard.yard import Yard

CHASE = "chase"
"""Name of the camera that follows behind the robot, on its left. A robot's file can define its own."""

FENCE_HEIGHT_M = 1.8
"""Height of the fence (assumed), typical of substations."""

FENCE_THICKNESS_M = 0.1
"""Thickness of the fence. Assumed: many times the distance that a robot moves in one physics step."""


def build_spec(robot: RobotDescription, yard: Yard, elements: AntennaElements | None = None) -> mujoco.MjSpec:
    """Build an editable spec of the yard with one robot in it.

    Args:
        robot: Description of the robot, whose file is read again.
        yard: Fence and equipment.
        elements: Antenna elements of the robot; they do not change its motion.

    Returns:
        The spec. The first part of a piece of equipment is named `equipment/NAME`, the other parts
        `equipment/NAME/PART`, the fence `fence/SIDE`, the lidar beams `lidar_00` and so on, the contact sensors of the
        hull `hull/GEOM`. The sites of the antenna elements are named `element_1` and so on, each with its x axis along
        the boresight.
    """
    spec = mujoco.MjSpec.from_file(str(robot.xml_path))
    if spec.key("home") is None:
        spec.add_key(name="home", qpos=robot.home_qpos)
    if spec.camera(CHASE) is None:
        spec.body("base").add_camera(
            name=CHASE,
            mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM,
            pos=(-1.7, -1.4, 1.35),
            xyaxes=(0.63, -0.777, 0.0, 0.38, 0.31, 0.87),
        )
    add_lidar(spec, robot)
    add_contact_sensors(spec)
    if elements is not None:
        attach_elements(spec, elements)
    _add_yard(spec, yard)
    return spec


def physics_only(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """Copy a spec without cameras, lights, sensors that are not read, and geoms that cannot collide.

    The copy has the same state and motion, and its steps take a fifth less time (measured). Its lidar beams pass
    through the parts of the robot, as a real scanner filters them out. Sensors with a history, such as lidar and
    contacts, are part of the state.
    """
    lean = spec.copy()
    for geom in lean.body("base").find_all(mujoco.mjtObj.mjOBJ_GEOM):
        if geom.contype == geom.conaffinity == 0 and geom.mass == 0:
            lean.delete(geom)
        else:
            geom.material, geom.rgba = "", [0.0, 0.0, 0.0, 0.0]  # beams pass through invisible geoms
    unread = [sensor for sensor in lean.sensors if sensor.nsample == 0 and sensor.name != "gyro"]
    for element in (*unread, *lean.cameras, *lean.lights):
        lean.delete(element)
    return lean


def _add_yard(spec: mujoco.MjSpec, yard: Yard) -> None:
    """Add floor `floor`, light `sun`, fence `fence/SIDE` and equipment `equipment/NAME` around a robot.

    They are built in a separate spec and then attached, so that the defaults of the robot's file do not apply to them.
    """
    own = mujoco.MjSpec()
    _add_ground(own, yard)
    _add_fence(own, yard)
    for item in yard.equipment:
        add_equipment(own, item)
    spec.attach(own, frame=spec.worldbody.add_frame(), prefix="yard/")
    for element in (*spec.geoms, *spec.lights):
        element.name = element.name.removeprefix("yard/")
    size_x, size_y = yard.size_m
    spec.stat.center = [0.5 * size_x, 0.5 * size_y, 0.5]
    spec.stat.extent = 0.5 * float(np.hypot(size_x, size_y))
    spec.visual.headlight.ambient = [0.35, 0.35, 0.35]
    spec.visual.headlight.diffuse = [0.45, 0.45, 0.45]
    spec.visual.map.shadowclip = 2.0  # with 1, the far floor is outside the sun's shadow map and looks speckled


def _add_ground(spec: mujoco.MjSpec, yard: Yard) -> None:
    """Add floor, sky and light."""
    size_x, size_y = yard.size_m
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.45, 0.65, 0.85],
        rgb2=[0.90, 0.94, 0.97],
        width=256,
        height=1536,
    )
    spec.add_texture(
        name="paving",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        mark=mujoco.mjtMark.mjMARK_EDGE,
        rgb1=[0.56, 0.57, 0.56],
        rgb2=[0.52, 0.53, 0.52],
        markrgb=[0.45, 0.46, 0.45],
        width=256,
        height=256,
    )
    paving = spec.add_material(name="paving", texuniform=True)
    paving.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "paving"
    spec.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        pos=[0.5 * size_x, 0.5 * size_y, 0.0],
        size=[0.5 * size_x + 3.0, 0.5 * size_y + 3.0, 0.05],
        material="paving",
        contype=FLOOR_CONTYPE,
        conaffinity=0,
    )
    spec.worldbody.add_light(
        name="sun",
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=[0.5 * size_x, 0.5 * size_y, 22.0],  # if lower, the near corner of a yard is behind it and has no shadows
        dir=[0.4, 0.5, -1.0],
        diffuse=[0.6, 0.6, 0.6],
    )


def _add_fence(spec: mujoco.MjSpec, yard: Yard) -> None:
    """Add four thin boxes around the yard, with their inner faces on its boundary."""
    middle, half = 0.5 * np.array(yard.size_m), 0.5 * FENCE_THICKNESS_M
    for side, outward in {"south": (0, -1), "north": (0, 1), "west": (-1, 0), "east": (1, 0)}.items():
        spec.worldbody.add_geom(
            name=f"fence/{side}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=[*middle + (middle + half) * outward, 0.5 * FENCE_HEIGHT_M],
            size=[*np.where(outward, half, middle), 0.5 * FENCE_HEIGHT_M],
            rgba=[*KIND_COLOURS["fence"], FENCE_OPACITY],
            contype=OBSTACLE_CONTYPE,
            conaffinity=0,
        )


def add_equipment(spec: mujoco.MjSpec, item: Equipment) -> None:
    """Add a geom for each part of a piece of equipment."""
    solids = item.solids
    for k, part in enumerate(item.assembly.parts):
        half_height_m = 0.5 * (solids.top_m[k] - solids.bottom_m[k])
        is_round = solids.radius_m[k] > 0
        spec.worldbody.add_geom(
            name=f"equipment/{item.name}" if k == 0 else f"equipment/{item.name}/{part}",
            type=mujoco.mjtGeom.mjGEOM_CYLINDER if is_round else mujoco.mjtGeom.mjGEOM_BOX,
            pos=[*solids.centre_m[k], solids.bottom_m[k] + half_height_m],
            axisangle=[0.0, 0.0, 1.0, item.yaw_deg],
            size=[solids.radius_m[k], half_height_m, 0.0] if is_round else [*solids.half_size_m[k], half_height_m],
            rgba=[*colour_of(item.kind, part), FENCE_OPACITY if item.kind == "fence" else 1.0],
            group=1,
            contype=OBSTACLE_CONTYPE,
            conaffinity=0,
        )
