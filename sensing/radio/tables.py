"""What stands about as rows of tables, which compiled functions take at no cost, unlike many arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from pdpatrol.sensing.radio.materials import Material, Substance
from pdpatrol.sensing.radio.vectors import Vector

FloatArray = NDArray[np.float64]

GROUND = -1
"""In place of the number of a piece of equipment: the ground."""

NOBODY = -1
"""In place of the number of a solid."""

JUST_BEHIND_M = 1e-6
"""So far behind a face is the solid whose face it is."""


class Faces(NamedTuple):
    """Flat rectangles that mirror, world frame; a row is a face.

    Attributes:
        centre_m: Shape (n_faces, 3).
        normal: Unit vectors out of the equipment, shape (n_faces, 3).
        axes: Unit vectors along the two sides, shape (n_faces, 2, 3).
        half_size_m: Half the length of the two sides, shape (n_faces, 2); may be infinite.
        owner: Piece of equipment that the face belongs to, shape (n_faces,); -1 for the ground.
    """

    centre_m: FloatArray
    normal: FloatArray
    axes: FloatArray
    half_size_m: FloatArray
    owner: NDArray[np.intp]

    @classmethod
    def none(cls) -> Self:
        """Nothing."""
        nothing = np.empty((0, 3))
        return cls(nothing, nothing, np.empty((0, 2, 3)), np.empty((0, 2)), np.empty(0, dtype=np.intp))


class Solids(NamedTuple):
    """Upright boxes and cylinders, world frame.

    Attributes:
        centre_m: Middle of the footprint, shape (n_solids, 2).
        yaw_rad: Shape (n_solids,).
        half_size_m: Half the sides of boxes, shape (n_solids, 2); 0 for cylinders.
        radius_m: Of cylinders, shape (n_solids,); 0 for boxes.
        bottom_m: Height above ground, shape (n_solids,).
        top_m: Height above ground, shape (n_solids,).
        owner: Piece of equipment that each is a part of, shape (n_solids,).
    """

    centre_m: FloatArray
    yaw_rad: FloatArray
    half_size_m: FloatArray
    radius_m: FloatArray
    bottom_m: FloatArray
    top_m: FloatArray
    owner: NDArray[np.intp]

    @classmethod
    def none(cls) -> Self:
        """Nothing."""
        nothing, flat = np.empty(0), np.empty((0, 2))
        return cls(flat, nothing, flat, nothing, nothing, nothing, np.empty(0, np.intp))


class Shape(NamedTuple):
    """One solid, as compiled loops hand it on.

    Attributes:
        x: Middle of the footprint.
        y: Likewise.
        cos: Cosine of its yaw.
        sin: Sine of its yaw.
        half_x: Half its first side; 0 for a cylinder.
        half_y: Half its second side; 0 for a cylinder.
        radius_m: Of a cylinder; 0 for a box.
        reach_m: Farthest point of the footprint from its middle.
        bottom_m: Height above ground.
        top_m: Height above ground.
    """

    x: float
    y: float
    cos: float
    sin: float
    half_x: float
    half_y: float
    radius_m: float
    reach_m: float
    bottom_m: float
    top_m: float


OBSTACLE = np.dtype(
    (
        np.record,
        [
            *((name, np.float64) for name in (*Shape._fields, *Substance._fields)),
            ("mirrors", np.float64),
            ("owner", np.intp),
            ("bends", np.bool_),
        ],
    )
)
"""A solid with its `Shape` and its `Substance`, about the largest share of an amplitude that it mirrors if it is round,
the piece of equipment that it is a part of, and whether waves bend round its edges. Rows of one array: compiled
functions take that at no cost."""

Obstacles = NDArray[np.void]
"""What stands in the way, rows of `OBSTACLE`."""

Obstacle = Any
"""One row of it."""


def obstacle_table(solids: Solids, materials: Sequence[Material]) -> Obstacles:
    """Solids, and what each is made of."""
    table = np.empty(solids.owner.size, OBSTACLE)
    table["x"], table["y"] = solids.centre_m.T
    table["cos"], table["sin"] = np.cos(solids.yaw_rad), np.sin(solids.yaw_rad)
    table["half_x"], table["half_y"] = solids.half_size_m.T
    table["radius_m"] = solids.radius_m
    table["reach_m"] = np.maximum(np.hypot(table["half_x"], table["half_y"]), solids.radius_m)
    table["bottom_m"], table["top_m"] = solids.bottom_m, solids.top_m
    _fill_in(table, materials)
    table["mirrors"] = [material.mirrors for material in materials]
    table["owner"], table["bends"] = solids.owner, [material.bends for material in materials]
    return table


@compiled
def shape_of(of: Obstacle) -> Shape:
    """Of a solid."""
    return Shape(of.x, of.y, of.cos, of.sin, of.half_x, of.half_y, of.radius_m, of.reach_m, of.bottom_m, of.top_m)


@compiled
def substance_of(row: Obstacle | Face) -> Substance:
    """What a solid is made of, or a face."""
    return Substance(row.permittivity, row.conductivity_spm, row.passes, row.flat_share)


FACE = np.dtype(
    (
        np.record,
        [
            *((name, np.float64) for name in ("x", "y", "z", "normal_x", "normal_y", "normal_z")),
            *((f"{axis}_{name}", np.float64) for axis in ("first", "second") for name in ("x", "y", "z", "half_m")),
            *((name, np.float64) for name in Substance._fields),
            *((name, np.intp) for name in ("owner", "behind")),
            ("bends", np.bool_),
        ],
    )
)
"""A face as of `Faces`, with its `Substance`, the obstacle whose face it is, or `NOBODY`, and whether waves bend round
the edges of that."""

Face = Any
"""One row."""


def face_table(materials: Sequence[Material], faces: Faces, solids: Solids) -> NDArray[np.void]:
    """Faces as rows of `FACE`.

    Args:
        materials: Of the faces of each piece of equipment, and of the ground, which is last, for its owner is -1.
        faces: The faces.
        solids: All solids.
    """
    table = np.empty(faces.owner.size, FACE)
    for i, name in enumerate(("x", "y", "z")):
        table[name], table[f"normal_{name}"] = faces.centre_m[:, i], faces.normal[:, i]
        table[f"first_{name}"], table[f"second_{name}"] = faces.axes[:, :, i].T
    table["first_half_m"], table["second_half_m"] = faces.half_size_m.T
    own = [materials[int(piece)] for piece in faces.owner]
    _fill_in(table, own)
    table["owner"], table["behind"] = faces.owner, _solids_behind(faces, solids)
    table["bends"] = [of.bends and behind != NOBODY for of, behind in zip(own, table["behind"], strict=True)]
    return table


@compiled
def middle_of(face: Face) -> Vector:
    """Its middle."""
    return Vector(face.x, face.y, face.z)


@compiled
def normal_of(face: Face) -> Vector:
    """Unit vector out of the equipment."""
    return Vector(face.normal_x, face.normal_y, face.normal_z)


@compiled
def to_rim(face: Face, off: Vector) -> float:
    """How far a point of its plane, seen from its middle, lies inside of its rim; negative outside."""
    first_m = abs(off.x * face.first_x + off.y * face.first_y + off.z * face.first_z)
    second_m = abs(off.x * face.second_x + off.y * face.second_y + off.z * face.second_z)
    return min(face.first_half_m - first_m, face.second_half_m - second_m)


def _fill_in(table: NDArray[np.void], materials: Sequence[Material]) -> None:
    columns = zip(*(material.substance for material in materials), strict=True) if materials else [()] * 4
    for name, column in zip(Substance._fields, columns, strict=True):
        table[name] = column


def _solids_behind(faces: Faces, solids: Solids) -> NDArray[np.intp]:
    """Of each face the solid right behind its middle, a box of the same piece of equipment, or `NOBODY`."""
    inside_m = (faces.centre_m - JUST_BEHIND_M * faces.normal)[:, np.newaxis]
    off_x, off_y = np.moveaxis(inside_m[..., :2] - solids.centre_m, -1, 0)
    cos, sin = np.cos(solids.yaw_rad), np.sin(solids.yaw_rad)
    is_behind = (
        (np.abs(cos * off_x + sin * off_y) < solids.half_size_m[:, 0])
        & (np.abs(cos * off_y - sin * off_x) < solids.half_size_m[:, 1])
        & (solids.bottom_m < inside_m[..., 2])
        & (inside_m[..., 2] < solids.top_m)
        & (solids.owner == faces.owner[:, np.newaxis])
    )
    nobody = np.full((faces.owner.size, 1), True)
    found = np.concatenate([is_behind, nobody], axis=1).argmax(axis=1)
    return np.where(found < solids.owner.size, found, NOBODY)
