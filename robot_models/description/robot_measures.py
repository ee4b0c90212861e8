"""Measures of a robot that its file does not give directly: its driven wheels, and the extent of its geoms."""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums.

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from dirmusic.arrays import FloatArray, IntArray


def driven_wheels(model: mujoco.MjModel) -> tuple[IntArray, IntArray, IntArray]:
    """Find the driven wheels: hinges whose names begin with `left_wheel` or `right_wheel`, the left ones first.

    Returns:
        Index of the joint of each wheel, index of the first actuator of that joint (-1 if it has none), and side of the
        wheel (0 for left, 1 for right), each of shape (n_wheels,).
    """
    found = [
        (joint, side)
        for side, prefix in enumerate(("left_wheel", "right_wheel"))
        for joint in range(model.njnt)
        if model.joint(joint).name.startswith(prefix)
    ]
    joint, side = np.array(found, dtype=np.intp).reshape(-1, 2).T
    driven = np.where(model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT, model.actuator_trnid[:, 0], -1).tolist()
    actuator = [driven.index(number) if number in driven else -1 for number in joint.tolist()]
    return joint, np.array(actuator, dtype=np.intp), side


def extents(
    model: mujoco.MjModel, data: mujoco.MjData, geoms: Sequence[int] | IntArray, directions: FloatArray
) -> FloatArray:
    r"""Compute the extent of each geom in each direction, from the origin of the world (support function).

    .. math:: h(d) = \max_{p} d \cdot p

    The maximum is over the points p of the geom. Other geoms than primitives and meshes are replaced by their bounding
    spheres.

    Args:
        model: Model of the geoms.
        data: Data of the model after `mj_kinematics`.
        geoms: Indices of the geoms.
        directions: Unit vectors, world frame, shape (n_directions, 3).

    Returns:
        Extents, shape (n_geoms, n_directions), metres.
    """
    return np.array(
        [
            directions @ data.geom_xpos[geom] + _support(model, geom, directions @ data.geom_xmat[geom].reshape(3, 3))
            for geom in geoms
        ]
    )


def _support(model: mujoco.MjModel, geom: int, directions: FloatArray) -> FloatArray:
    """Compute the extents, shape (n,), of a geom from its centre, in directions of its frame, shape (n, 3)."""
    size_m, along = model.geom_size[geom], np.abs(directions[:, 2])
    match mujoco.mjtGeom(int(model.geom_type[geom])):
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            return size_m[0] + size_m[1] * along
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            return size_m[0] * np.sqrt(np.maximum(1.0 - along**2, 0.0)) + size_m[1] * along
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return np.sqrt(np.square(directions * size_m).sum(axis=-1))
        case mujoco.mjtGeom.mjGEOM_BOX:
            return np.abs(directions) @ size_m
        case mujoco.mjtGeom.mjGEOM_MESH:
            mesh = int(model.geom_dataid[geom])
            first, n = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            return (directions @ model.mesh_vert[first : first + n].T.astype(np.float64)).max(axis=-1)
        case _:
            return np.full(len(directions), model.geom_rbound[geom])
