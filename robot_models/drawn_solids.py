"""Description of the visible solids of a world as plain data, so that they can be drawn without MuJoCo."""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums.

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np

from pdpatrol.robot_models.world import add_equipment
from pdpatrol.robot_models.yard.pieces import Equipment


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
        name, is_robot = model.geom(geom).name, bool(model.geom_bodyid[geom] > 0)
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
