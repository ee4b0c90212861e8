"""Description of the visible solids of a world as plain data, to draw them without MuJoCo."""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums.

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np

from pdpatrol.robot_models.equipment import colour_of
from pdpatrol.robot_models.yard.pieces import Equipment


def describe_solids(model: mujoco.MjModel) -> dict[str, list[dict[str, Any]]]:
    """Describe the shapes of yard and robot.

    A robot is drawn by the geoms of the first three groups, which MuJoCo's viewer shows by default.

    Returns:
        Lists `yard` (world frame) and `robot` (frame of the robot's base, origin on the floor under the axle). Each
        solid has `name`, `group` (equipment, fence, robot), `shape`, `size_m` (MuJoCo's half sizes), `position_m`,
        `quaternion_wxyz` and `rgba`.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)  # in the pose of the model, the base is at the world's origin
    base = model.body("base").id
    shapes = {
        int(mujoco.mjtGeom.mjGEOM_BOX): "box",
        int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
        int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
        int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): "ellipsoid",
        int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    }
    solids: dict[str, list[dict[str, Any]]] = {"yard": [], "robot": []}
    for geom in range(model.ngeom):
        name = model.geom(geom).name
        is_robot = model.body_rootid[model.geom_bodyid[geom]] == base
        if int(model.geom_type[geom]) not in shapes or (is_robot and model.geom_group[geom] >= 3):
            continue
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, data.geom_xmat[geom])
        material = int(model.geom_matid[geom])
        rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
        solids["robot" if is_robot else "yard"].append(
            {
                "name": name or f"part_{geom}",
                "group": "robot" if is_robot else name.partition("/")[0],
                "shape": shapes[int(model.geom_type[geom])],
                "size_m": model.geom_size[geom].tolist(),
                "position_m": data.geom_xpos[geom].tolist(),
                "quaternion_wxyz": quaternion.tolist(),
                "rgba": [float(value) for value in rgba],
            }
        )
    return solids


def describe_equipment(pieces: Iterable[Equipment]) -> list[dict[str, Any]]:
    """Describe the shapes of equipment that is in no world, such as errors of a map, like `describe_solids`."""
    described: list[dict[str, Any]] = []
    for item in pieces:
        solids, half_yaw = item.solids, 0.5 * np.radians(item.yaw_deg)
        for k, part in enumerate(item.assembly.parts):
            half_height_m = 0.5 * (solids.top_m[k] - solids.bottom_m[k])
            is_round = solids.radius_m[k] > 0
            size_m = [solids.radius_m[k], half_height_m, 0.0] if is_round else [*solids.half_size_m[k], half_height_m]
            described.append(
                {
                    "name": f"equipment/{item.name}" if k == 0 else f"equipment/{item.name}/{part}",
                    "group": "map",
                    "shape": "cylinder" if is_round else "box",
                    "size_m": [float(value) for value in size_m],
                    "position_m": [*solids.centre_m[k].tolist(), float(solids.bottom_m[k] + half_height_m)],
                    "quaternion_wxyz": [float(np.cos(half_yaw)), 0.0, 0.0, float(np.sin(half_yaw))],
                    "rgba": list(colour_of(item.kind, part)),
                }
            )
    return described
