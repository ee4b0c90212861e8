"""From source to element: spreading and delay, what stands in between, and what mirrors.

Geometric optics of the first order: the direct path, and one reflection in every flat face, as if from the source's
mirror image. Edges do not diffract and round equipment does not mirror; what bends round equipment is part of its loss.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.gain_delay import SPEED_OF_LIGHT_MPS
from sensing.materials import GRAVEL, KIND_MATERIALS

FloatArray = NDArray[np.float64]
Crossed = Callable[[FloatArray, FloatArray], NDArray[np.bool_]]
"""(starts (n, 3), ends (n, 3)) -> which pieces of equipment each line crosses, (n, n_pieces); one of no length crosses
none. Handed in: sensing knows no physics engine."""

OWN_FACE_M = 0.05
"""A face this close to the source is a part of it (assumed): its mirror image lies within a third of a wavelength, and
the source's amplitude is what both radiate together."""


class Faces(NamedTuple):
    """Flat rectangles that mirror, world frame.

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


class Paths(NamedTuple):
    """All that leads from sources to the elements; a row is a direct path or a reflection.

    Attributes:
        source: Number of the source, shape (n_paths,).
        rays: From the source, or from its mirror image, in the array frame; shapes (n_paths, n_elements).
        factor: What reflection and equipment in between leave of the amplitude, shape (n_paths,).
    """

    source: NDArray[np.intp]
    rays: Rays
    factor: FloatArray


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


class Surroundings:
    """What stands about: equipment that weakens, and faces that mirror.

    Args:
        faces: That mirror.
        reflection: Amplitude reflection coefficient of each face, shape (n_faces,).
        loss: Amplitude that each piece of equipment lets pass, in (0, 1], shape (n_pieces,).
        crossed: Which pieces a segment crosses.
    """

    def __init__(self, faces: Faces, reflection: FloatArray, loss: FloatArray, crossed: Crossed) -> None:
        self.faces = faces
        self.reflection = reflection
        self.log_loss = np.log(loss)
        self.crossed = crossed

    @classmethod
    def of_kinds(cls, kinds: Sequence[str], faces: Faces, crossed: Crossed) -> Self:
        """Equipment of known kinds, one for each piece, on gravel.

        Raises:
            KeyError: If a kind is not in `KIND_MATERIALS`.
        """
        materials = [*(KIND_MATERIALS[kind] for kind in kinds), GRAVEL]  # the ground last: its owner is -1
        loss_db, reflection = np.array(materials, dtype=np.float64).T
        return cls(
            faces=faces,
            reflection=reflection[faces.owner],
            loss=10 ** (-loss_db[:-1] / 20),
            crossed=crossed,
        )

    @classmethod
    def free_space(cls) -> Self:
        """Nothing about, not even the ground."""
        nothing = np.empty((0, 3))
        faces = Faces(nothing, nothing, np.empty((0, 2, 3)), np.empty((0, 2)), np.empty(0, dtype=np.intp))
        return cls(faces, np.empty(0), np.empty(0), lambda _, ends: np.empty((len(ends), 0), dtype=np.bool_))

    def passed(self, starts_m: FloatArray, ends_m: FloatArray) -> FloatArray:
        """Amplitude left by the equipment between starts and ends, each (n, 3); shape (n,)."""
        if self.log_loss.size == 0 or len(starts_m) == 0:
            return np.ones(len(starts_m))
        return np.exp((self.crossed(starts_m, ends_m) * self.log_loss).sum(axis=-1))


class Mirrors:
    """Sources that stay where they are and their mirror images: computed once for a yard.

    Args:
        surroundings: Of the yard.
        sources_m: Shape (n_sources, 3), world frame.
    """

    def __init__(self, surroundings: Surroundings, sources_m: FloatArray) -> None:
        self.surroundings = surroundings
        self.sources_m = sources_m
        faces, n = surroundings.faces, len(sources_m)
        depth_m = np.einsum("sfi,fi->sf", sources_m[:, np.newaxis] - faces.centre_m, faces.normal)
        mirrored, face = np.nonzero((depth_m > OWN_FACE_M) & (surroundings.reflection != 0))
        depth_m = depth_m[mirrored, face]
        images_m = sources_m[mirrored] - 2 * depth_m[:, np.newaxis] * faces.normal[face]
        # A row for each source, as if it were the image in a face without bounds at its own place, then for each image.
        self._source = np.concatenate([np.arange(n), mirrored])
        self._from_m = np.concatenate([sources_m, images_m])
        self._depth_m = np.concatenate([np.zeros(n), depth_m])
        self._ahead_m = np.concatenate([np.ones(n), np.zeros(face.size)])  # no normal: always on the good side
        self._normal = np.concatenate([np.zeros((n, 3)), faces.normal[face]])
        self._centre_m = np.concatenate([sources_m, faces.centre_m[face]])
        self._axes = np.concatenate([np.zeros((n, 2, 3)), faces.axes[face]])
        self._half_size_m = np.concatenate([np.zeros((n, 2)), faces.half_size_m[face]])
        self._reflection = np.concatenate([np.ones(n), surroundings.reflection[face]])

    def trace(self, on_air: NDArray[np.bool_], elements_m: FloatArray, world_from_array: FloatArray) -> Paths:
        """Paths from some of the sources to all elements, the direct ones first.

        Which faces mirror a source to the array, and what stands in between, is asked for the centre of its elements:
        an array is small against equipment.

        Args:
            on_air: Which sources, shape (n_sources,).
            elements_m: Shape (n_elements, 3), array frame.
            world_from_array: Shape (4, 4).
        """
        rotation, origin_m = world_from_array[:3, :3], world_from_array[:3, 3]
        centre_m = rotation @ (np.add.reduce(elements_m) / len(elements_m)) + origin_m
        height_m = np.einsum("ni,ni->n", centre_m - self._centre_m, self._normal) + self._ahead_m
        share = self._depth_m / (self._depth_m + np.maximum(height_m, 0.0))
        point_m = self._from_m + share[:, np.newaxis] * (centre_m - self._from_m)
        along_m = np.einsum("ni,nai->na", point_m - self._centre_m, self._axes)
        on_face = (np.abs(along_m) <= self._half_size_m).all(axis=-1)
        path = np.flatnonzero(on_face & (height_m > 0) & on_air[self._source])
        source, point_m = self._source[path], point_m[path]
        # Both legs end on the face: a line may end there, but not start. A direct path has but the second.
        starts_m = np.concatenate([self.sources_m[source], centre_m + np.zeros(point_m.shape)])
        passed = self.surroundings.passed(starts_m, np.concatenate([point_m, point_m]))
        return Paths(
            source=source,
            rays=rays_between(elements_m, in_array_frame(self._from_m[path], world_from_array)),
            factor=self._reflection[path] * passed[: path.size] * passed[path.size :],
        )


def _length(vectors: FloatArray) -> FloatArray:
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
