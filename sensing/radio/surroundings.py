"""From source to element: spreading and delay, what stands in between, and what mirrors.

Geometric optics of the first order: the direct path, and one reflection in every flat face, as if from the source's
mirror image. Edges do not diffract and round equipment does not mirror; what bends round equipment is part of its loss.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.bearing.gain_delay import SPEED_OF_LIGHT_MPS
from dirmusic.compiled import compiled
from sensing.radio.materials import GRAVEL, KIND_MATERIALS, Material, Materials

FloatArray = NDArray[np.float64]

OWN_FACE_M = 0.05
"""A face this close to the source is a part of it (assumed): its mirror image lies within a third of a wavelength, and
the source's amplitude is what both radiate together."""


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


class Obstacles(NamedTuple):
    """What stands in the way, as compiled loops read it; a row is a solid.

    Attributes:
        solids: Boxes and cylinders.
        heading: Cosine and sine of their yaw, shape (n_solids, 2).
        reach_m: Farthest point of each footprint from its middle, shape (n_solids,).
        bends: Whether waves bend round its edges, shape (n_solids,).
    """

    solids: Solids
    heading: FloatArray
    reach_m: FloatArray
    bends: NDArray[np.bool_]

    @classmethod
    def of(cls, solids: Solids, bends: NDArray[np.bool_]) -> Self:
        """Solids, of which some bend waves round their edges."""
        heading = np.stack([np.cos(solids.yaw_rad), np.sin(solids.yaw_rad)], axis=-1)
        return cls(solids, heading, np.maximum(np.linalg.norm(solids.half_size_m, axis=-1), solids.radius_m), bends)


class Shape(NamedTuple):
    """One solid, as compiled loops hand it on: as of `Solids` and `Obstacles`."""

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


@compiled
def shape_of(obstacles: Obstacles, k: int) -> Shape:
    """Solid k."""
    solids = obstacles.solids
    return Shape(
        solids.centre_m[k, 0],
        solids.centre_m[k, 1],
        obstacles.heading[k, 0],
        obstacles.heading[k, 1],
        solids.half_size_m[k, 0],
        solids.half_size_m[k, 1],
        solids.radius_m[k],
        obstacles.reach_m[k],
        solids.bottom_m[k],
        solids.top_m[k],
    )


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
        materials: Of each piece of equipment, and of the ground, which is last: the owner of its face is -1.
        obstacles: Solids that the pieces are made of.
    """

    faces: Faces
    materials: Materials
    obstacles: Obstacles

    @classmethod
    def of_kinds(cls, kinds: Sequence[str], faces: Faces, solids: Solids, ground: Material = GRAVEL) -> Self:
        """Equipment of known kinds, one for each piece.

        Raises:
            KeyError: If a kind is not in `KIND_MATERIALS`.
        """
        return cls.of_materials([KIND_MATERIALS[kind] for kind in kinds], faces, solids, ground)

    @classmethod
    def of_materials(cls, pieces: Sequence[Material], faces: Faces, solids: Solids, ground: Material = GRAVEL) -> Self:
        """Equipment of known materials, one for each piece."""
        bends = np.array([pieces[int(piece)].bends for piece in solids.owner], dtype=np.bool_)
        return cls(faces, Materials.of(pieces, ground), Obstacles.of(solids, bends & (solids.radius_m == 0.0)))

    @classmethod
    def free_space(cls) -> Self:
        """Nothing about, not even the ground."""
        nothing = np.empty((0, 3))
        faces = Faces(nothing, nothing, np.empty((0, 2, 3)), np.empty((0, 2)), np.empty(0, dtype=np.intp))
        return cls(faces, Materials.of([], GRAVEL), Obstacles.of(Solids.none(), np.empty(0, np.bool_)))


def _length(vectors: FloatArray) -> FloatArray:
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
