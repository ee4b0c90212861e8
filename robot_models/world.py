"""MuJoCo model of a yard with one robot: floor, fence, equipment, and the robot's sensors and antenna elements.

`describe_solids` describes its visible solids as plain data, so that they can be drawn without MuJoCo.
"""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums and spec elements.

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from pdpatrol.robot_models.description.robot_description import RobotDescription
from pdpatrol.robot_models.equipment.catalogue import FENCE_OPACITY, KIND_COLOURS, colour_of
from pdpatrol.robot_models.moving_bodies import MovingBody, add_moving_bodies
from pdpatrol.robot_models.sensors import (
    OBSTACLE_CONTYPE,
    AntennaElements,
    add_contact_sensors,
    add_lidar,
    attach_elements,
)
from pdpatrol.robot_models.yard.pieces import Equipment
from pdpatrol.robot_models.yard.yard import Yard

GROUND = Path(__file__).parent / "yard" / "ground.xml"
"""Floor, sky and light of every yard."""

CHASE = "chase"
"""Name of the camera that follows behind the robot, on its left. A robot's file can define its own."""

FENCE_HEIGHT_M = 1.8
"""Height of the fence (assumed), typical of substations."""

FENCE_THICKNESS_M = 0.1
"""Thickness of the fence. Assumed: many times the distance that a robot moves in one physics step."""


def build_spec(
    robot: RobotDescription, yard: Yard, elements: AntennaElements | None = None, moving: Sequence[MovingBody] = ()
) -> mujoco.MjSpec:
    """Build an editable spec of the yard with one robot in it.

    Args:
        robot: Description of the robot, whose file is read again.
        yard: Fence and equipment.
        elements: Antenna elements of the robot; they do not change its motion.
        moving: People and vehicles, as mocap bodies `moving/NAME` at the origin.

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
    add_moving_bodies(spec, moving)
    return spec


def build_yard(yard: Yard) -> mujoco.MjSpec:
    """Build a spec of floor, fence and equipment without a robot, named as in `build_spec`."""
    spec = mujoco.MjSpec()
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
    own, middle_m = mujoco.MjSpec.from_file(str(GROUND)), 0.5 * np.array(yard.size_m)
    floor = own.geom("floor")
    floor.pos[:2], floor.size[:2] = middle_m, middle_m + 3.0
    own.light("sun").pos = [*middle_m, 22.0]  # if lower, the near corner of a yard is behind it and has no shadows
    _add_fence(own, yard)
    for item in yard.equipment:
        add_equipment(own, item)
    spec.attach(own, frame=spec.worldbody.add_frame(), prefix="yard/")
    for element in (*spec.geoms, *spec.lights):
        element.name = element.name.removeprefix("yard/")
    spec.stat.center = [*middle_m, 0.5]
    spec.stat.extent = np.hypot(*middle_m)
    spec.visual.headlight.ambient = [0.35, 0.35, 0.35]
    spec.visual.headlight.diffuse = [0.45, 0.45, 0.45]
    spec.visual.map.shadowclip = 2.0  # with 1, the far floor is outside the sun's shadow map and looks speckled


def _add_fence(spec: mujoco.MjSpec, yard: Yard) -> None:
    """Add a thin box for each side of the fence, with its inner face on the side."""
    boxes = yard.fence_solids(FENCE_THICKNESS_M, FENCE_HEIGHT_M)
    for k, name in enumerate(yard.side_names):
        spec.worldbody.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=[*boxes.centre_m[k], 0.5 * FENCE_HEIGHT_M],
            axisangle=[0.0, 0.0, 1.0, np.degrees(boxes.yaw_rad[k])],
            size=[*boxes.half_size_m[k], 0.5 * FENCE_HEIGHT_M],
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


def describe_solids(model: mujoco.MjModel) -> dict[str, list[dict[str, Any]]]:
    """Describe the shapes of the yard and the robot.

    Of the robot, only the geoms in groups 0 to 2 are included, which MuJoCo's viewer shows by default.

    Returns:
        Lists `yard` (world frame) and `robot` (frame of the robot's base, origin on the floor under the axle). Each
        solid has `name`, `group` (equipment, fence, robot), `shape`, `size_m` (MuJoCo's half sizes), `position_m`,
        `quaternion_wxyz` and `rgba`.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)  # in the reference pose, the base is at the world's origin
    shapes = ("box", "cylinder", "sphere", "ellipsoid", "capsule")
    solids: dict[str, list[dict[str, Any]]] = {"yard": [], "robot": []}
    for geom in range(model.ngeom):
        name, body = model.geom(geom).name, int(model.geom_bodyid[geom])
        is_robot = body > 0
        if model.body_mocapid[body] >= 0:  # people and vehicles
            continue
        shape = mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()
        if shape not in shapes or (is_robot and model.geom_group[geom] >= 3):
            continue
        quaternion, material = np.empty(4), int(model.geom_matid[geom])
        mujoco.mju_mat2Quat(quaternion, data.geom_xmat[geom])
        rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
        solids["robot" if is_robot else "yard"].append(
            {
                "name": name or f"part_{geom}",
                "group": "robot" if is_robot else name.partition("/")[0],
                "shape": shape,
                "size_m": model.geom_size[geom].tolist(),
                "position_m": data.geom_xpos[geom].tolist(),
                "quaternion_wxyz": quaternion.tolist(),
                "rgba": rgba.tolist(),
            }
        )
    return solids


def describe_equipment(pieces: Iterable[Equipment]) -> list[dict[str, Any]]:
    """Describe the shapes of equipment outside a world, such as wrong entries of a map, as in `describe_solids`."""
    spec = mujoco.MjSpec()
    for item in pieces:
        add_equipment(spec, item)
    return [{**solid, "group": "map"} for solid in describe_solids(spec.compile())["yard"]]
