"""Surroundings of sources and robots: reflecting faces, solids in the way, and their materials."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled, compiled_inner
from pdpatrol.sensing.radio.geometry import UprightSolid, Vector, shift
from pdpatrol.sensing.radio.materials import GRAVEL, KIND_MATERIALS, ROUND_MATERIALS, Material

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

GROUND, NO_SOLID = -1, -1
"""Owner of the face of the ground; index in place of a solid where there is none."""

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
"""Row of a face as of `Faces`, with its `Material`, the index of the solid that it bounds, or `NO_SOLID`, and whether
the edges of that solid diffract."""

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
"""Row of an `UprightSolid` with its `Material`, the `largest_reflection` and `diffracts` of that, and the index of the
piece of equipment that it belongs to. One array of rows costs a compiled function less than many arrays."""

Rows = NDArray[Any]
Row = Any


class Faces(NamedTuple):
    """Flat rectangles that reflect, world frame; a row is a face.

    Attributes:
        centre_m: Centres, shape (n_faces, 3).
        normal: Unit vectors out of the equipment, shape (n_faces, 3).
        axes: Unit vectors along the two sides, shape (n_faces, 2, 3).
        half_size_m: Half the length of the two sides, shape (n_faces, 2); may be infinite.
        owner: Index of the piece of equipment, shape (n_faces,); `GROUND` for the ground.
    """

    centre_m: FloatArray
    normal: FloatArray
    axes: FloatArray
    half_size_m: FloatArray
    owner: IntArray

    @classmethod
    def none(cls) -> Self:
        """Return an empty table."""
        return cls(np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 2, 3)), np.empty((0, 2)), np.empty(0, np.intp))

    @classmethod
    def of(cls, solids: UprightSolids) -> Self:
        """Return the ground, and the four sides and the top of every box; cylinders have no flat face."""
        up = np.array([0.0, 0.0, 1.0])
        faces = [(np.zeros(3), up, np.eye(3)[:2], np.full(2, np.inf), GROUND)]
        for k in np.flatnonzero(solids.radius_m == 0).tolist():
            yaw, (half_x, half_y) = solids.yaw_rad[k], solids.half_size_m[k]
            x, y = np.array([[np.cos(yaw), np.sin(yaw), 0.0], [-np.sin(yaw), np.cos(yaw), 0.0]])
            half_z = 0.5 * (solids.top_m[k] - solids.bottom_m[k])
            middle = np.array([*solids.centre_m[k], solids.bottom_m[k] + half_z])
            for normal, depth, axes, half_size_m in (
                (x, half_x, (y, up), (half_y, half_z)),
                (-x, half_x, (y, up), (half_y, half_z)),
                (y, half_y, (x, up), (half_x, half_z)),
                (-y, half_y, (x, up), (half_x, half_z)),
                (up, half_z, (x, y), (half_x, half_y)),
            ):
                faces.append(
                    (middle + depth * normal, normal, np.array(axes), np.array(half_size_m), int(solids.owner[k]))
                )
        centre, normals, all_axes, half_size, owners = (np.array(column) for column in zip(*faces, strict=True))
        return cls(centre, normals, all_axes, half_size, owners.astype(np.intp))


class UprightSolids(NamedTuple):
    """Upright boxes and cylinders, world frame; a row is a solid, and those of one piece of equipment are adjacent.

    Attributes:
        centre_m: Middles of the footprints, shape (n_solids, 2).
        yaw_rad: Yaws, shape (n_solids,).
        half_size_m: Half the sides of boxes, shape (n_solids, 2); 0 for cylinders.
        radius_m: Radii of cylinders, shape (n_solids,); 0 for boxes.
        bottom_m: Heights of the bottoms above ground, shape (n_solids,).
        top_m: Heights of the tops above ground, shape (n_solids,).
        owner: Index of the piece of equipment, shape (n_solids,).
    """

    centre_m: FloatArray
    yaw_rad: FloatArray
    half_size_m: FloatArray
    radius_m: FloatArray
    bottom_m: FloatArray
    top_m: FloatArray
    owner: IntArray

    @classmethod
    def none(cls) -> Self:
        """Return an empty table."""
        none, flat = np.empty(0), np.empty((0, 2))
        return cls(flat, none, flat, none, none, none, np.empty(0, np.intp))


class Surroundings(NamedTuple):
    """Faces and solids with their materials.

    Attributes:
        faces: Flat reflecting faces including the ground, rows of `FACE`.
        ground: Material of the ground; without a ground, one that does not reflect.
        obstacles: Solids of the equipment, rows of `OBSTACLE`.
        second_order: True where rays reflected by two upright faces count.
    """

    faces: Rows
    ground: Material
    obstacles: Rows
    second_order: bool

    @classmethod
    def of_kinds(cls, kinds: Sequence[str], faces: Faces, solids: UprightSolids, ground: Material = GRAVEL) -> Self:
        """Make surroundings of equipment of known kinds, one kind for each piece.

        Raises:
            KeyError: If a kind is not in `KIND_MATERIALS`.
        """
        flat = [KIND_MATERIALS[kind] for kind in kinds]
        curved = [ROUND_MATERIALS.get(kind, KIND_MATERIALS[kind]) for kind in kinds]
        return cls.of_materials(flat, faces, solids, ground, curved)

    @classmethod
    def of_materials(
        cls,
        materials: Sequence[Material],
        faces: Faces,
        solids: UprightSolids,
        ground: Material = GRAVEL,
        curved: Sequence[Material] | None = None,
    ) -> Self:
        """Make surroundings of equipment of known materials.

        Args:
            materials: Material of each piece of equipment.
            faces: Reflecting faces.
            solids: Solids of the equipment.
            ground: Material of the ground.
            curved: Material of the cylinders of each piece; None if it is that of the piece.
        """
        is_round = solids.radius_m > 0.0
        of_solids = [
            (curved or materials if is_curved else materials)[int(piece)]
            for piece, is_curved in zip(solids.owner, is_round, strict=True)
        ]
        if GROUND not in faces.owner:
            ground = ground._replace(flat_share=0.0)
        face_rows = _face_rows([*materials, ground], faces, solids)
        return cls(face_rows, ground, _obstacle_rows(of_solids, solids), second_order=False)

    @classmethod
    def free_space(cls) -> Self:
        """Make empty surroundings, without a ground."""
        return cls.of_materials([], Faces.none(), UprightSolids.none())


def _obstacle_rows(materials: Sequence[Material], solids: UprightSolids) -> Rows:
    rows = np.empty(solids.owner.size, OBSTACLE)
    rows["x"], rows["y"] = solids.centre_m.T
    rows["cos"], rows["sin"] = np.cos(solids.yaw_rad), np.sin(solids.yaw_rad)
    rows["half_x"], rows["half_y"] = solids.half_size_m.T
    rows["reach_m"] = np.maximum(np.hypot(rows["half_x"], rows["half_y"]), solids.radius_m)
    for name in ("radius_m", "bottom_m", "top_m", "owner"):
        rows[name] = getattr(solids, name)
    for name in (*Material._fields, "largest_reflection", "diffracts"):
        rows[name] = [getattr(material, name) for material in materials]
    return rows


def _face_rows(materials: Sequence[Material], faces: Faces, solids: UprightSolids) -> Rows:
    """Make the rows of all faces; the ground's material is the last one, since its owner is -1."""
    rows, own = np.empty(faces.owner.size, FACE), [materials[int(piece)] for piece in faces.owner]
    for i, name in enumerate(("x", "y", "z")):
        rows[name], rows[f"normal_{name}"] = faces.centre_m[:, i], faces.normal[:, i]
        rows[f"first_{name}"], rows[f"second_{name}"] = faces.axes[:, :, i].T
    rows["first_half_m"], rows["second_half_m"] = faces.half_size_m.T
    for name in Material._fields:
        rows[name] = [getattr(material, name) for material in own]
    rows["owner"], rows["solid"] = faces.owner, _bounded_solids(faces, solids)
    rows["diffracts"] = np.array([material.diffracts for material in own], np.bool_) & (rows["solid"] != NO_SOLID)
    return rows


def _bounded_solids(faces: Faces, solids: UprightSolids) -> IntArray:
    """Find for each face the box of the same equipment that lies 1 um behind its middle, or `NO_SOLID`."""
    inside_m = (faces.centre_m - 1e-6 * faces.normal)[:, np.newaxis]
    off_x, off_y = np.moveaxis(inside_m[..., :2] - solids.centre_m, -1, 0)
    cos, sin = np.cos(solids.yaw_rad), np.sin(solids.yaw_rad)
    is_behind = (
        (np.abs(cos * off_x + sin * off_y) < solids.half_size_m[:, 0])
        & (np.abs(cos * off_y - sin * off_x) < solids.half_size_m[:, 1])
        & (solids.bottom_m < inside_m[..., 2])
        & (inside_m[..., 2] < solids.top_m)
        & (solids.owner == faces.owner[:, np.newaxis])
    )
    return np.where(is_behind.any(axis=1), np.argmax(np.pad(is_behind, ((0, 0), (0, 1))), axis=1), NO_SOLID)


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
    """Return the unit vector out of the equipment."""
    return Vector(face.normal_x, face.normal_y, face.normal_z)


@compiled_inner
def rim_distance(face: Row, point: Vector) -> float:
    """Return the distance of a point in the plane of a face from its rim, metres; negative outside."""
    off = shift(point, centre_of(face), -1.0)
    first_m = abs(off.x * face.first_x + off.y * face.first_y + off.z * face.first_z)
    second_m = abs(off.x * face.second_x + off.y * face.second_y + off.z * face.second_z)
    return min(face.first_half_m - first_m, face.second_half_m - second_m)


def level_transform(pose: FloatArray) -> FloatArray:
    """Return `world_from_array`, shape (4, 4), of an array that stands level on the ground at (x m, y m, yaw rad)."""
    x, y, yaw = pose
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array([[cos, -sin, 0.0, x], [sin, cos, 0.0, y], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
