"""Ray paths from sources to arrays, straight or by one mirror, found in a compiled loop."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from sensing.radio.surroundings import OWN_FACE_M, Faces

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]


class RayPaths(NamedTuple):
    """Paths to an array as broken lines; a row is a path, those of one source follow one another, the direct one first.

    Attributes:
        source: Number of the source, shape (n_paths,).
        from_m: Source, or its mirror image, shape (n_paths, 3).
        coefficient: Reflection coefficient of the face, 1 for a direct path, shape (n_paths,).
        starts_m: Where the two segments of each path start, one after the other, shape (2 n_paths, 3); the first
            segment of a direct path has no length.
        ends_m: Where the segments end, shape (2 n_paths, 3).
        first: The first path of each source, shape (n_sources,).
        n_paths: Number of paths of each source, shape (n_sources,).
    """

    source: IntArray
    from_m: FloatArray
    coefficient: FloatArray
    starts_m: FloatArray
    ends_m: FloatArray
    first: IntArray
    n_paths: IntArray


@compiled
def find_ray_paths(
    sources_m: FloatArray,
    is_emitting: BoolArray,
    centre_m: FloatArray,
    faces: Faces,
    reflection: FloatArray,
) -> RayPaths:
    """Direct paths, and those by one mirror, from the sources that emit to the centre of an array.

    Args:
        sources_m: Shape (n_sources, 3), world frame.
        is_emitting: Which sources emit, shape (n_sources,).
        centre_m: Middle of the array, shape (3,).
        faces: Flat rectangles that mirror.
        reflection: Reflection coefficients of the faces, shape (n_faces,).
    """
    n_sources = is_emitting.size
    n_most = is_emitting.sum() * (1 + reflection.size)
    source = np.empty(n_most, np.intp)
    from_m, coefficient = np.empty((n_most, 3)), np.empty(n_most)
    starts_m, ends_m = np.empty((2 * n_most, 3)), np.empty((2 * n_most, 3))
    first, n_paths = np.zeros(n_sources, np.intp), np.zeros(n_sources, np.intp)
    point_m = np.empty(3)
    n = 0
    for s in range(n_sources):
        if not is_emitting[s]:
            continue
        first[s] = n
        at_m = sources_m[s]
        for f in range(-1, reflection.size):
            from_m[n] = at_m
            coefficient[n] = 1.0
            point_m[:] = at_m
            if f >= 0:
                if reflection[f] == 0.0:
                    continue
                depth_m = height_m = 0.0
                for i in range(3):
                    depth_m += (at_m[i] - faces.centre_m[f, i]) * faces.normal[f, i]
                    height_m += (centre_m[i] - faces.centre_m[f, i]) * faces.normal[f, i]
                if depth_m <= OWN_FACE_M or height_m <= 0.0:
                    continue
                share = depth_m / (depth_m + height_m)
                along_m = across_m = 0.0
                for i in range(3):
                    from_m[n, i] = at_m[i] - 2.0 * depth_m * faces.normal[f, i]
                    point_m[i] = from_m[n, i] + share * (centre_m[i] - from_m[n, i])
                    along_m += (point_m[i] - faces.centre_m[f, i]) * faces.axes[f, 0, i]
                    across_m += (point_m[i] - faces.centre_m[f, i]) * faces.axes[f, 1, i]
                if abs(along_m) > faces.half_size_m[f, 0] or abs(across_m) > faces.half_size_m[f, 1]:
                    continue
                coefficient[n] = reflection[f]
            source[n] = s
            starts_m[2 * n], starts_m[2 * n + 1] = at_m, centre_m
            ends_m[2 * n] = ends_m[2 * n + 1] = point_m  # a line may end on a face, but not start there
            n += 1
        n_paths[s] = n - first[s]
    return RayPaths(source[:n], from_m[:n], coefficient[:n], starts_m[: 2 * n], ends_m[: 2 * n], first, n_paths)
