"""How far the geoms of a robot extend in a direction: hence its footprint, its height, the radius of its wheels."""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums.

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LEVEL = np.stack([f(np.radians(np.arange(0.0, 360.0, 1.0))) for f in (np.cos, np.sin, np.zeros_like)], axis=-1)
"""Level unit vectors all round, a degree apart, shape (360, 3), of which an outline is made: it is right to 4e-5."""

UP, DOWN = np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 0.0, -1.0]])


def extents(model: mujoco.MjModel, data: mujoco.MjData, geoms: Sequence[int], directions: FloatArray) -> FloatArray:
    r"""Support of each geom about the origin of the body `base`: how far it extends in each direction.

    .. math:: h(d) = \max_{p} d \cdot p

    over the points p of the geom. A shape that is none of MuJoCo's primitives or meshes counts as its bounding sphere.

    Args:
        model: With a body `base`.
        data: After `mj_kinematics`.
        geoms: Numbers of the geoms.
        directions: Unit vectors, frame of the base, shape (n_directions, 3).

    Returns:
        Shape (n_geoms, n_directions), metres.
    """
    base = model.body("base").id
    world_from_base = data.xmat[base].reshape(3, 3)
    found = np.empty((len(geoms), len(directions)))
    for row, geom in enumerate(geoms):
        centre = world_from_base.T @ (data.geom_xpos[geom] - data.xpos[base])
        base_from_geom = world_from_base.T @ data.geom_xmat[geom].reshape(3, 3)
        found[row] = directions @ centre + _about_its_centre(model, geom, directions @ base_from_geom)
    return found


def _about_its_centre(model: mujoco.MjModel, geom: int, directions: FloatArray) -> FloatArray:
    """Support of a geom about its own centre, in directions (n, 3) of its own frame; shape (n,)."""
    kind, (a, b, _) = mujoco.mjtGeom(int(model.geom_type[geom])), model.geom_size[geom]
    along = np.abs(directions[:, 2])
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return np.full(len(directions), a)
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return a + b * along
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return a * np.sqrt(np.maximum(1.0 - along**2, 0.0)) + b * along
    if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        return np.sqrt(np.square(directions * model.geom_size[geom]).sum(axis=-1))
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return np.abs(directions) @ model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        first, n = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        return (directions @ model.mesh_vert[first : first + n].T.astype(np.float64)).max(axis=-1)
    return np.full(len(directions), model.geom_rbound[geom])
