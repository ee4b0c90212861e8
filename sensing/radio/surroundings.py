"""What stands about: flat faces that mirror, solids in the way, what both are made of; and straight lines between."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.bearing.gain_delay import SPEED_OF_LIGHT_MPS
from dirmusic.compiled import compiled
from sensing.radio.materials import GRAVEL, KIND_MATERIALS, ROUND_MATERIALS, Material, Materials, Substance

FloatArray = NDArray[np.float64]

OWN_FACE_M = 0.05
"""A face this close to the source is a part of it (assumed): its mirror image lies within a third of a wavelength, and
the source's amplitude is what both radiate together."""


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
    [
        *((name, np.float64) for name in (*Shape._fields, *Substance._fields)),
        ("mirrors", np.float64),
        ("owner", np.intp),
        ("bends", np.bool_),
    ]
)
"""A solid with its `Shape` and its `Substance`, about the largest share of an amplitude that it mirrors if it is round,
the piece of equipment that it is a part of, and whether waves bend round its edges. Rows of one array: compiled
functions take that at no cost."""

Obstacles = NDArray[np.void]
"""What stands in the way, rows of `OBSTACLE`."""

Obstacle = Any
"""One row of it."""


def obstacles_of(solids: Solids, materials: Sequence[Material]) -> Obstacles:
    """Solids, and what each is made of."""
    table = np.empty(solids.owner.size, OBSTACLE)
    table["x"], table["y"] = solids.centre_m.T
    table["cos"], table["sin"] = np.cos(solids.yaw_rad), np.sin(solids.yaw_rad)
    table["half_x"], table["half_y"] = solids.half_size_m.T
    table["radius_m"] = solids.radius_m
    table["reach_m"] = np.maximum(np.hypot(table["half_x"], table["half_y"]), solids.radius_m)
    table["bottom_m"], table["top_m"] = solids.bottom_m, solids.top_m
    of = Materials.of(materials)
    for name in Substance._fields:
        table[name] = getattr(of, name)
    table["mirrors"] = [material.mirrors for material in materials]
    table["owner"], table["bends"] = solids.owner, [material.bends for material in materials]
    return table


@compiled
def shape_of(of: Obstacle) -> Shape:
    """Of a solid."""
    return Shape(of.x, of.y, of.cos, of.sin, of.half_x, of.half_y, of.radius_m, of.reach_m, of.bottom_m, of.top_m)


@compiled
def substance_of_solid(of: Obstacle) -> Substance:
    """What a solid is made of."""
    return Substance(of.permittivity, of.conductivity_spm, of.passes, of.flat_share)


def solids_behind(faces: Faces, solids: Solids) -> NDArray[np.intp]:
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


class Rays(NamedTuple):
    """Straight lines in free space from elements to points, frame as the points given.

    Attributes:
        sight_m: From element to point, shape (..., n_elements, 3).
        range_m: Length, shape (..., n_elements).
    """

    sight_m: FloatArray
    range_m: FloatArray

    @property
    def spreading(self) -> FloatArray:
        """Amplitude over that at 1 m: one over the range in metres, in three dimensions."""
        return 1.0 / self.range_m

    @property
    def delay_s(self) -> FloatArray:
        """Travel time."""
        return self.range_m / SPEED_OF_LIGHT_MPS

    @property
    def azimuth_rad(self) -> FloatArray:
        """Horizontal direction in which an element sees the point."""
        return np.arctan2(self.sight_m[..., 1], self.sight_m[..., 0])

    @property
    def elevation_rad(self) -> FloatArray:
        """Elevation at which an element sees the point."""
        return np.arctan2(self.sight_m[..., 2], np.hypot(self.sight_m[..., 0], self.sight_m[..., 1]))


def rays_between(elements_m: FloatArray, points_m: FloatArray) -> Rays:
    """Lines from elements (n_elements, 3) to points (..., 3) of the same frame, metres."""
    sight = points_m[..., np.newaxis, :] - elements_m
    return Rays(sight, _length(sight))


def in_array_frame(points_m: FloatArray, world_from_array: FloatArray) -> FloatArray:
    """World points (..., 3) in the frame of an array at `world_from_array` (4, 4)."""
    return (points_m - world_from_array[:3, 3]) @ world_from_array[:3, :3]


def level_transform(pose: FloatArray) -> FloatArray:
    """`world_from_array`, shape (4, 4), of an array that stands level on the ground at (x m, y m, yaw rad)."""
    x, y, yaw = pose
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array([[cos, -sin, 0.0, x], [sin, cos, 0.0, y], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


class Surroundings(NamedTuple):
    """What stands about, and what it is made of.

    Attributes:
        faces: Flat faces that mirror.
        materials: Of the faces of each piece of equipment, and of the ground, which is last, for its owner is -1.
        obstacles: Solids that the pieces are made of, with their own materials.
        behind: Of each face the obstacle whose face it is, or `NOBODY`, shape (n_faces,).
    """

    faces: Faces
    materials: Materials
    obstacles: Obstacles
    behind: NDArray[np.intp]

    @classmethod
    def of_kinds(cls, kinds: Sequence[str], faces: Faces, solids: Solids, ground: Material = GRAVEL) -> Self:
        """Equipment of known kinds, one for each piece; what is round may be of another material than what is flat.

        Raises:
            KeyError: If a kind is not in `KIND_MATERIALS`.
        """
        flat = [KIND_MATERIALS[kind] for kind in kinds]
        round_ones = [ROUND_MATERIALS.get(kind, KIND_MATERIALS[kind]) for kind in kinds]
        pairs = zip(solids.owner, solids.radius_m, strict=True)
        of_solids = [(round_ones if radius_m > 0.0 else flat)[int(piece)] for piece, radius_m in pairs]
        return cls(faces, Materials.of([*flat, ground]), obstacles_of(solids, of_solids), solids_behind(faces, solids))

    @classmethod
    def of_materials(cls, pieces: Sequence[Material], faces: Faces, solids: Solids, ground: Material = GRAVEL) -> Self:
        """Equipment of known materials, one for each piece."""
        of_solids = [pieces[int(piece)] for piece in solids.owner]
        return cls(
            faces, Materials.of([*pieces, ground]), obstacles_of(solids, of_solids), solids_behind(faces, solids)
        )

    @classmethod
    def free_space(cls) -> Self:
        """Nothing about, not even the ground."""
        nothing = np.empty((0, 3))
        faces = Faces(nothing, nothing, np.empty((0, 2, 3)), np.empty((0, 2)), np.empty(0, dtype=np.intp))
        return cls.of_materials([], faces, Solids.none())


def _length(vectors: FloatArray) -> FloatArray:
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
