"""Surroundings of sources and robots: reflecting faces, obstacles, and their materials."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic.arrays import FloatArray, IntArray
from dirmusic.compiled import compiled, compiled_inner
from pdpatrol.sensing.radio.geometry import UprightSolid, Vector, shift
from pdpatrol.sensing.radio.materials import GRAVEL, KIND_MATERIALS, ROUND_MATERIALS, Material

GROUND, NO_SOLID = -1, -1
"""Owner of the face of the ground; and index that stands for "no solid"."""

_MATERIAL_COLUMNS = [(name, np.float64) for name in Material._fields]

FACE = np.dtype(
    (
        np.record,
        [
            *((name, np.float64) for name in ("x", "y", "z", "normal_x", "normal_y", "normal_z")),
            *((f"{axis}_{name}", np.float64) for axis in ("first", "second") for name in ("x", "y", "z", "half_m")),
            *_MATERIAL_COLUMNS,
            ("owner", np.intp),
            ("solid", np.intp),
            ("diffracts", np.bool_),
        ],
    )
)
"""Row of a flat reflecting rectangle (see `flat_face`), with its `Material`, the index of the solid that it bounds or
`NO_SOLID`, and whether the edges of that solid diffract."""

OBSTACLE = np.dtype(
    (
        np.record,
        [
            *((name, np.float64) for name in UprightSolid._fields),
            *_MATERIAL_COLUMNS,
            ("largest_reflection", np.float64),
            ("owner", np.intp),
            ("diffracts", np.bool_),
        ],
    )
)
"""Row of an `UprightSolid` with its `Material`, `largest_reflection` and `diffracts` of that material, and the index of
the piece of equipment to which it belongs. A single array of rows is faster for compiled functions than many arrays."""

Rows = NDArray[Any]
Row = Any


def upright_solids(
    *,
    centre_m: FloatArray,
    yaw_rad: FloatArray,
    half_size_m: FloatArray,
    radius_m: FloatArray,
    bottom_m: FloatArray,
    top_m: FloatArray,
    owner: IntArray,
) -> Rows:
    """Create rows of `OBSTACLE`, without materials, for upright boxes and cylinders.

    Args:
        centre_m: Centres of the footprints, shape (n_solids, 2), world frame.
        yaw_rad: Yaws, shape (n_solids,).
        half_size_m: Half the sides of boxes, shape (n_solids, 2); 0 for cylinders.
        radius_m: Radii of cylinders, shape (n_solids,); 0 for boxes.
        bottom_m: Heights of the bottoms above ground, shape (n_solids,).
        top_m: Heights of the tops above ground, shape (n_solids,).
        owner: Index of the piece of equipment, shape (n_solids,); the solids of one piece are adjacent.
    """
    rows = np.zeros(owner.size, OBSTACLE)
    rows["x"], rows["y"] = centre_m.T
    rows["cos"], rows["sin"] = np.cos(yaw_rad), np.sin(yaw_rad)
    rows["half_x"], rows["half_y"] = half_size_m.T
    rows["reach_m"] = np.maximum(np.hypot(rows["half_x"], rows["half_y"]), radius_m)
    rows["radius_m"], rows["bottom_m"], rows["top_m"], rows["owner"] = radius_m, bottom_m, top_m, owner
    return rows


def flat_face(
    centre_m: ArrayLike,
    normal: ArrayLike,
    sides: ArrayLike,
    half_size_m: tuple[float, float],
    owner: int,
    solid: int = NO_SOLID,
) -> Rows:
    """Create one row of `FACE`, without material.

    Args:
        centre_m: Centre, shape (3,), world frame.
        normal: Unit vector out of the equipment, shape (3,).
        sides: Unit vectors along the two sides, shape (2, 3).
        half_size_m: Half the length of the two sides; may be infinite.
        owner: Index of the piece of equipment; `GROUND` for the ground.
        solid: Index of the solid that the face bounds, or `NO_SOLID`.
    """
    row = np.zeros(1, FACE)
    vectors = np.asarray([centre_m, normal, *np.asarray(sides)])
    for name, vector in zip(("{}", "normal_{}", "first_{}", "second_{}"), vectors, strict=True):
        for axis, component in zip("xyz", vector, strict=True):
            row[name.format(axis)] = component
    row["first_half_m"], row["second_half_m"] = half_size_m
    row["owner"], row["solid"] = owner, solid
    return row


def ground_face() -> Rows:
    """Create the face of the ground."""
    return flat_face(np.zeros(3), np.eye(3)[2], np.eye(3)[:2], (np.inf, np.inf), GROUND)


def faces_of(solids: Rows) -> Rows:
    """Create the faces of the ground and of the four sides and the top of every box; cylinders have no flat face."""
    faces = [ground_face()]
    for k in np.flatnonzero(solids["radius_m"] == 0).tolist():
        x, y, cos, sin, half_x, half_y, _, _, bottom_m, top_m = solids[k].tolist()[: len(UprightSolid._fields)]
        half_z, ahead, left, up = 0.5 * (top_m - bottom_m), (cos, sin, 0.0), (-sin, cos, 0.0), (0.0, 0.0, 1.0)
        for sign, normal, depth_m, sides, half_size_m in (
            (1, ahead, half_x, (left, up), (half_y, half_z)),
            (-1, ahead, half_x, (left, up), (half_y, half_z)),
            (1, left, half_y, (ahead, up), (half_x, half_z)),
            (-1, left, half_y, (ahead, up), (half_x, half_z)),
            (1, up, half_z, (ahead, left), (half_x, half_y)),
        ):
            out = sign * np.array(normal)
            centre_m = np.array([x, y, bottom_m + half_z]) + depth_m * out
            faces.append(flat_face(centre_m, out, sides, half_size_m, int(solids["owner"][k]), k))
    return np.concatenate(faces)


class Surroundings(NamedTuple):
    """Faces and solids with their materials.

    Attributes:
        faces: Flat reflecting faces including the ground, rows of `FACE`.
        ground: Material of the ground; without a ground, one that does not reflect.
        obstacles: Solids of the equipment, rows of `OBSTACLE`.
        second_order: Whether rays reflected by two upright faces are included.
    """

    faces: Rows
    ground: Material
    obstacles: Rows
    second_order: bool

    @classmethod
    def of_kinds(cls, kinds: Sequence[str], solids: Rows, *, second_order: bool = False) -> Self:
        """Create surroundings from the kind of each piece of equipment, with a gravel ground.

        Raises:
            KeyError: If a kind is not in `KIND_MATERIALS`.
        """
        flat = [KIND_MATERIALS[kind] for kind in kinds]
        curved = [ROUND_MATERIALS.get(kind, KIND_MATERIALS[kind]) for kind in kinds]
        made = cls.of_materials(flat, faces_of(solids), solids, curved=curved)
        return made._replace(second_order=second_order)

    @classmethod
    def of_materials(
        cls,
        materials: Sequence[Material],
        faces: Rows | None = None,
        solids: Rows | None = None,
        ground: Material = GRAVEL,
        curved: Sequence[Material] | None = None,
    ) -> Self:
        """Create surroundings from the material of each piece of equipment.

        Args:
            materials: Material of each piece of equipment.
            faces: Reflecting faces; None for none.
            solids: Solids of the equipment; None for none.
            ground: Material of the ground.
            curved: Material of the cylinders of each piece; None to use that of the piece.
        """
        faces = np.empty(0, FACE) if faces is None else faces.copy()
        solids = np.empty(0, OBSTACLE) if solids is None else solids.copy()
        if GROUND not in faces["owner"]:
            ground = ground._replace(flat_share=0.0)
        of_faces = [[*materials, ground][piece] for piece in faces["owner"]]  # the owner of the ground is -1
        of_solids = [
            (curved or materials if radius_m > 0.0 else materials)[piece]
            for piece, radius_m in zip(solids["owner"], solids["radius_m"], strict=True)
        ]
        for rows, of_rows in ((faces, of_faces), (solids, of_solids)):
            for name in (*Material._fields, "diffracts"):
                rows[name] = [getattr(material, name) for material in of_rows]
        faces["diffracts"] &= faces["solid"] != NO_SOLID
        solids["largest_reflection"] = [material.largest_reflection for material in of_solids]
        return cls(faces, ground, solids, second_order=False)

    @classmethod
    def free_space(cls) -> Self:
        """Create empty surroundings, without a ground."""
        return cls.of_materials([])


@compiled
def solid_of(obstacle: Row) -> UprightSolid:
    """Return the shape of an obstacle."""
    o = obstacle
    return UprightSolid(o.x, o.y, o.cos, o.sin, o.half_x, o.half_y, o.radius_m, o.reach_m, o.bottom_m, o.top_m)


@compiled_inner
def material_of(row: Row) -> Material:
    """Return the material of an obstacle or a face."""
    return Material(row.permittivity, row.conductivity_spm, row.transmission, row.flat_share)


@compiled_inner
def centre_of(face: Row) -> Vector:
    """Return the centre of a face."""
    return Vector(face.x, face.y, face.z)


@compiled_inner
def normal_of(face: Row) -> Vector:
    """Return the normal of a face, a unit vector that points out of the equipment."""
    return Vector(face.normal_x, face.normal_y, face.normal_z)


@compiled_inner
def rim_distance(face: Row, point: Vector) -> float:
    """Return the distance, in metres, of a point in the plane of a face from the rim of the face; negative outside."""
    off = shift(point, centre_of(face), -1.0)
    first_m = abs(off.x * face.first_x + off.y * face.first_y + off.z * face.first_z)
    second_m = abs(off.x * face.second_x + off.y * face.second_y + off.z * face.second_z)
    return min(face.first_half_m - first_m, face.second_half_m - second_m)


def level_transform(pose: FloatArray) -> FloatArray:
    """Return `world_from_array`, shape (4, 4), of a level array on the ground at the pose (x m, y m, yaw rad)."""
    x, y, yaw = pose
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array([[cos, -sin, 0.0, x], [sin, cos, 0.0, y], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
