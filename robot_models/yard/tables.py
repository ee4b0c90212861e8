"""A yard's solids and flat faces as named columns of plain arrays, for whoever computes with all of them at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdpatrol.robot_models.yard.solids import YardSolids

FloatArray = NDArray[np.float64]

GROUND = -1
"""Owner of the ground's face."""


class SolidTable(NamedTuple):
    """Upright boxes and cylinders, world frame; a row is a solid.

    Attributes:
        centre_m: Middle of the footprint, shape (n_solids, 2).
        yaw_rad: Shape (n_solids,).
        half_size_m: Half the sides of boxes, shape (n_solids, 2); 0 for cylinders.
        radius_m: Of cylinders, shape (n_solids,); 0 for boxes.
        bottom_m: Height above ground, shape (n_solids,).
        top_m: Height above ground, shape (n_solids,).
        owner: Number of the piece of equipment that each solid is a part of, shape (n_solids,).
    """

    centre_m: FloatArray
    yaw_rad: FloatArray
    half_size_m: FloatArray
    radius_m: FloatArray
    bottom_m: FloatArray
    top_m: FloatArray
    owner: NDArray[np.intp]


class FaceTable(NamedTuple):
    """Flat rectangles, world frame; a row is a face.

    Attributes:
        centre_m: Shape (n_faces, 3).
        normal: Unit vectors out of the equipment, shape (n_faces, 3).
        axes: Unit vectors along the two sides, shape (n_faces, 2, 3).
        half_size_m: Half the length of the two sides, shape (n_faces, 2); infinite for the ground.
        owner: Number of the piece of equipment that each face belongs to, shape (n_faces,); `GROUND` for the ground.
    """

    centre_m: FloatArray
    normal: FloatArray
    axes: FloatArray
    half_size_m: FloatArray
    owner: NDArray[np.intp]


def solid_table(solids: YardSolids, owner: NDArray[np.intp]) -> SolidTable:
    """All solids of a yard, and the piece of equipment that each is a part of."""
    return SolidTable(
        centre_m=solids.centre_m,
        yaw_rad=solids.yaw_rad,
        half_size_m=solids.half_size_m,
        radius_m=solids.radius_m,
        bottom_m=solids.bottom_m,
        top_m=solids.top_m,
        owner=owner,
    )


def face_table(solids: YardSolids, owner: NDArray[np.intp]) -> FaceTable:
    """Return the ground, and the four sides and the top of every box; cylinders have no flat face."""
    faces = [(np.zeros(3), np.eye(3)[2], np.eye(3)[:2], np.full(2, np.inf), GROUND)]
    up = np.array([0.0, 0.0, 1.0])
    for k in np.flatnonzero(solids.radius_m == 0).tolist():
        yaw, (half_x, half_y) = solids.yaw_rad[k], solids.half_size_m[k]
        x, y = np.array([[np.cos(yaw), np.sin(yaw), 0.0], [-np.sin(yaw), np.cos(yaw), 0.0]])
        half_z = 0.5 * (solids.top_m[k] - solids.bottom_m[k])
        middle = np.array([*solids.centre_m[k], solids.bottom_m[k] + half_z])
        for normal, depth, (first, second) in (
            (x, half_x, ((y, half_y), (up, half_z))),
            (-x, half_x, ((y, half_y), (up, half_z))),
            (y, half_y, ((x, half_x), (up, half_z))),
            (-y, half_y, ((x, half_x), (up, half_z))),
            (up, half_z, ((x, half_x), (y, half_y))),
        ):
            axes, half_size_m = np.array([first[0], second[0]]), np.array([first[1], second[1]])
            faces.append((middle + depth * normal, normal, axes, half_size_m, int(owner[k])))
    centre, normal, axes, half_size, owners = (np.array(column) for column in zip(*faces, strict=True))
    return FaceTable(centre, normal, axes, half_size, owners.astype(np.intp))
