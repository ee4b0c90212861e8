"""Surroundings of sources and robots: reflecting faces, obstacles, and their materials."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic.arrays import FloatArray, IntArray
from dirmusic.compiled import compiled, compiled_inner
from pdpatrol.sensing.radio.geometry import UprightSolid, Vector, dot, half_size, minus, vector_of
from pdpatrol.sensing.radio.materials import GRAVEL, KIND_MATERIALS, ROUND_MATERIALS, Material

GROUND = -1
"""Index that stands for the ground instead of a solid."""

_MATERIAL_COLUMNS = [
    *((name, np.float64) for name in (*Material._fields, "largest_reflection")),
    ("diffracts", np.bool_),
]

FACE = np.dtype(
    (
        np.record,
        [
            ("centre_m", np.float64, 3),
            ("normal", np.float64, 3),
            ("sides", np.float64, (2, 3)),
            ("half_size_m", np.float64, 2),
            ("solid", np.intp),
            *_MATERIAL_COLUMNS,
        ],
    )
)
"""Row of a flat reflecting rectangle (see `flat_face`) with the properties of its `Material`."""

OBSTACLE = np.dtype(
    (
        np.record,
        [*((name, np.float64) for name in UprightSolid._fields), ("owner", np.intp), *_MATERIAL_COLUMNS],
    )
)
"""Row of an `UprightSolid` with the properties of its `Material`, and the index of the piece of equipment to which it
belongs. A single array of rows is faster for compiled functions than many arrays."""

PIECE = np.dtype(
    (
        np.record,
        [
            *((name, np.float64) for name in ("x", "y", "half_x", "half_y", "bottom_m", "top_m", "parameter")),
            ("first", np.intp),
            ("end", np.intp),
        ],
    )
)
"""Row of a piece of equipment: box around its solids with sides along the world axes, its first solid and that after
its last one, and room for the largest `shadow_parameter` of its solids. Most pieces are far from a ray, and then none
of their solids needs to be examined."""

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
    rows["radius_m"], rows["bottom_m"], rows["top_m"], rows["owner"] = radius_m, bottom_m, top_m, owner
    return rows


def flat_face(centre_m: ArrayLike, normal: ArrayLike, sides: ArrayLike, half_size_m: ArrayLike, solid: int) -> Rows:
    """Create one row of `FACE`, without material.

    Args:
        centre_m: Centre, shape (3,), world frame.
        normal: Unit vector out of the equipment, shape (3,).
        sides: Unit vectors along the two sides, shape (2, 3).
        half_size_m: Half the length of the two sides, shape (2,).
        solid: Index of the solid that the face bounds.
    """
    row = np.zeros(1, FACE)
    row["centre_m"], row["normal"], row["sides"] = centre_m, normal, sides
    row["half_size_m"], row["solid"] = half_size_m, solid
    return row


def faces_of(solids: Rows) -> Rows:
    """Create the faces of all boxes that reflect, four sides and the top; cylinders have no flat face."""
    faces = [np.empty(0, FACE)]
    for k in np.flatnonzero((solids["radius_m"] == 0.0) & (solids["flat_share"] > 0.0)).tolist():
        box = solids[k]
        axes = np.array([[box.cos, box.sin, 0.0], [-box.sin, box.cos, 0.0], [0.0, 0.0, 1.0]])
        half_m = np.array([box.half_x, box.half_y, 0.5 * (box.top_m - box.bottom_m)])
        for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1), (2, 1)):
            normal = sign * axes[axis]
            centre_m = [box.x, box.y, box.bottom_m + half_m[2]] + half_m[axis] * normal
            face = flat_face(centre_m, normal, np.delete(axes, axis, axis=0), np.delete(half_m, axis), k)
            for name, _ in _MATERIAL_COLUMNS:
                face[name] = box[name]
            faces.append(face)
    return np.concatenate(faces)


def made_of(rows: Rows, materials: Sequence[Material]) -> Rows:
    """Return rows of `FACE` or `OBSTACLE` with the properties of the materials, one for each row."""
    rows = rows.copy()
    for name, _ in _MATERIAL_COLUMNS:
        rows[name] = [getattr(material, name) for material in materials]
    return rows


class Surroundings(NamedTuple):
    """Faces and solids with their materials; by default free space, without a ground.

    Attributes:
        faces: Flat reflecting faces, rows of `FACE`.
        ground: Material of the ground; without a ground, one that does not reflect.
        obstacles: Solids of the equipment, rows of `OBSTACLE`.
        second_order: Whether rays reflected by two upright faces are included.
    """

    faces: Rows = np.empty(0, FACE)
    ground: Material = GRAVEL._replace(flat_share=0.0)
    obstacles: Rows = np.empty(0, OBSTACLE)
    second_order: bool = False

    @classmethod
    def of_kinds(
        cls, kinds: Sequence[str], solids: Rows, *, ground: Material = GRAVEL, second_order: bool = False
    ) -> Self:
        """Create surroundings from the kind of each piece of equipment.

        Raises:
            KeyError: If a kind is not in `KIND_MATERIALS`.
        """
        materials = [
            (ROUND_MATERIALS if solid.radius_m > 0.0 else KIND_MATERIALS)[kinds[int(solid.owner)]] for solid in solids
        ]
        obstacles = made_of(solids, materials)
        return cls(faces_of(obstacles), ground, obstacles, second_order)


@compiled
def solid_of(obstacle: Row) -> UprightSolid:
    """Return the shape of an obstacle."""
    o = obstacle
    return UprightSolid(o.x, o.y, o.cos, o.sin, o.half_x, o.half_y, o.radius_m, o.bottom_m, o.top_m)


@compiled
def pieces_of(obstacles: Rows) -> Rows:
    """Return the pieces of equipment to which obstacles belong, rows of `PIECE`."""
    pieces, n, first = np.empty(obstacles.size, PIECE), 0, 0
    while first < obstacles.size:
        low_x, low_y, bottom_m = np.inf, np.inf, np.inf
        high_x, high_y, top_m, end = -np.inf, -np.inf, -np.inf, first
        while end < obstacles.size and obstacles[end].owner == obstacles[first].owner:
            solid = solid_of(obstacles[end])
            half_x, half_y = half_size(solid, 1.0, 0.0)
            low_x, high_x = min(low_x, solid.x - half_x), max(high_x, solid.x + half_x)
            low_y, high_y = min(low_y, solid.y - half_y), max(high_y, solid.y + half_y)
            bottom_m, top_m, end = min(bottom_m, solid.bottom_m), max(top_m, solid.top_m), end + 1
        piece = pieces[n]
        piece.x, piece.half_x = 0.5 * (low_x + high_x), 0.5 * (high_x - low_x)
        piece.y, piece.half_y = 0.5 * (low_y + high_y), 0.5 * (high_y - low_y)
        piece.bottom_m, piece.top_m, piece.first, piece.end = bottom_m, top_m, first, end
        first, n = end, n + 1
    return pieces[:n]


@compiled_inner
def material_of(row: Row) -> Material:
    """Return the material of an obstacle or a face."""
    return Material(row.permittivity, row.conductivity_spm, row.transmission, row.flat_share)


@compiled_inner
def rim_distance(face: Row, point: Vector) -> float:
    """Return the distance, in metres, of a point in the plane of a face from the rim of the face; negative outside."""
    off = minus(point, vector_of(face.centre_m))
    first_m, second_m = abs(dot(off, vector_of(face.sides[0]))), abs(dot(off, vector_of(face.sides[1])))
    return min(face.half_size_m[0] - first_m, face.half_size_m[1] - second_m)


def level_transform(pose: FloatArray) -> FloatArray:
    """Return `world_from_array`, shape (4, 4), of a level array on the ground at the pose (x m, y m, yaw rad)."""
    x, y, yaw = pose
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array([[cos, -sin, 0.0, x], [sin, cos, 0.0, y], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
