"""What stands about: flat faces that mirror, solids in the way, what both are made of; and straight lines between."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.bearing.gain_delay import SPEED_OF_LIGHT_MPS
from pdpatrol.sensing.radio.materials import GRAVEL, KIND_MATERIALS, ROUND_MATERIALS, Material, Substance
from pdpatrol.sensing.radio.tables import GROUND, Faces, Obstacles, Solids, face_table, obstacle_table

FloatArray = NDArray[np.float64]

OWN_FACE_M = 0.05
"""A face this close to the source is a part of it (assumed): its mirror image lies within a third of a wavelength, and
the source's amplitude is what both radiate together."""


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
        faces: Flat faces that mirror, the ground among them, rows of `FACE`.
        ground: What the ground is made of; it mirrors nothing where there is none.
        obstacles: Solids that the pieces are made of, with their own materials.
        by_two_walls: Whether rays count that two upright faces mirror, one after the other.
    """

    faces: NDArray[np.void]
    ground: Substance
    obstacles: Obstacles
    by_two_walls: bool

    @classmethod
    def of_kinds(cls, kinds: Sequence[str], faces: Faces, solids: Solids, ground: Material = GRAVEL) -> Self:
        """Equipment of known kinds, one for each piece; what is round may be of another material than what is flat.

        Raises:
            KeyError: If a kind is not in `KIND_MATERIALS`.
        """
        flat = [KIND_MATERIALS[kind] for kind in kinds]
        round_ones = [ROUND_MATERIALS.get(kind, KIND_MATERIALS[kind]) for kind in kinds]
        pairs = zip(solids.owner, solids.radius_m, strict=True)
        return cls._of(
            flat, [(round_ones if r > 0.0 else flat)[int(piece)] for piece, r in pairs], faces, solids, ground
        )

    @classmethod
    def of_materials(cls, pieces: Sequence[Material], faces: Faces, solids: Solids, ground: Material = GRAVEL) -> Self:
        """Equipment of known materials, one for each piece."""
        return cls._of(pieces, [pieces[int(piece)] for piece in solids.owner], faces, solids, ground)

    @classmethod
    def _of(
        cls,
        of_pieces: Sequence[Material],
        of_solids: Sequence[Material],
        faces: Faces,
        solids: Solids,
        ground: Material,
    ) -> Self:
        is_there = bool((faces.owner == GROUND).any())
        table = face_table([*of_pieces, ground], faces, solids)
        below = ground if is_there else ground._replace(flat_share=0.0)
        return cls(table, below.substance, obstacle_table(solids, of_solids), False)

    @classmethod
    def free_space(cls) -> Self:
        """Nothing about, not even the ground."""
        return cls.of_materials([], Faces.none(), Solids.none())


def _length(vectors: FloatArray) -> FloatArray:
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
