"""Paths from sources to elements, traced in compiled loops: what `propagation` describes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.elevation import NEAR_AXIS
from dirmusic.bearing.gain_delay import SPEED_OF_LIGHT_MPS
from dirmusic.compiled import compiled
from sensing.array import ArrayTable
from sensing.radio.surroundings import OWN_FACE_M, Faces, Obstacles, Surroundings

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]


class RayPaths(NamedTuple):
    """Paths as broken lines; a row is a path, those of one source and robot follow one another, the direct one first.

    Attributes:
        robot: Number of the robot that it leads to, shape (n_paths,).
        source: Number of the source among the robot's own, shape (n_paths,).
        from_m: Source, or its mirror image, shape (n_paths, 3).
        coefficient: Reflection coefficient of the face, 1 for a direct path, shape (n_paths,).
        starts_m: Where its two segments start, one after the other, shape (2 n_paths, 3); the first segment of a direct
            path has no length.
        ends_m: Where they end, shape (2 n_paths, 3).
        first: The first path of each robot and source, shape (n_robots, n_sources).
        n_paths: How many, shape (n_robots, n_sources).
    """

    robot: IntArray
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
    """Direct paths, and those by one mirror, from sources on the air to the centres of arrays.

    Args:
        sources_m: Shape (n_robots, n_sources, 3), world frame.
        is_emitting: Which of them count, shape (n_robots, n_sources).
        centre_m: Middle of each array, shape (n_robots, 3).
        faces: That mirror.
        reflection: Their coefficients, shape (n_faces,).
    """
    n_robots, n_sources = is_emitting.shape
    n_most = is_emitting.sum() * (1 + reflection.size)
    robot, source = np.empty(n_most, np.intp), np.empty(n_most, np.intp)
    from_m, coefficient = np.empty((n_most, 3)), np.empty(n_most)
    starts_m, ends_m = np.empty((2 * n_most, 3)), np.empty((2 * n_most, 3))
    first, n_paths = np.zeros((n_robots, n_sources), np.intp), np.zeros((n_robots, n_sources), np.intp)
    point_m = np.empty(3)
    n = 0
    for r in range(n_robots):
        for s in range(n_sources):
            if not is_emitting[r, s]:
                continue
            first[r, s] = n
            at_m, to_m = sources_m[r, s], centre_m[r]
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
                        height_m += (to_m[i] - faces.centre_m[f, i]) * faces.normal[f, i]
                    if depth_m <= OWN_FACE_M or height_m <= 0.0:
                        continue
                    share = depth_m / (depth_m + height_m)
                    along_m = across_m = 0.0
                    for i in range(3):
                        from_m[n, i] = at_m[i] - 2.0 * depth_m * faces.normal[f, i]
                        point_m[i] = from_m[n, i] + share * (to_m[i] - from_m[n, i])
                        along_m += (point_m[i] - faces.centre_m[f, i]) * faces.axes[f, 0, i]
                        across_m += (point_m[i] - faces.centre_m[f, i]) * faces.axes[f, 1, i]
                    if abs(along_m) > faces.half_size_m[f, 0] or abs(across_m) > faces.half_size_m[f, 1]:
                        continue
                    coefficient[n] = reflection[f]
                robot[n], source[n] = r, s
                starts_m[2 * n], starts_m[2 * n + 1] = at_m, to_m
                ends_m[2 * n] = ends_m[2 * n + 1] = point_m  # a line may end on a face, but not start there
                n += 1
            n_paths[r, s] = n - first[r, s]
    return RayPaths(
        robot[:n],
        source[:n],
        from_m[:n],
        coefficient[:n],
        starts_m[: 2 * n],
        ends_m[: 2 * n],
        first,
        n_paths,
    )


BARELY = 1e-9
"""Share of a line at its ends within which a surface does not count."""


@compiled
def _within(low: float, high: float, start: float, change: float) -> tuple[float, float]:
    """From which share of a line to which a coordinate that changes evenly is between two bounds."""
    if change == 0.0:
        return (-np.inf, np.inf) if low < start < high else (np.inf, -np.inf)
    first, second = (low - start) / change, (high - start) / change
    return min(first, second), max(first, second)


@compiled
def cross(starts_m: FloatArray, ends_m: FloatArray, obstacles: Obstacles, n_pieces: int) -> BoolArray:
    """Which pieces of equipment straight lines cross. One that ends on a surface does not cross it.

    Args:
        starts_m: Shape (n_lines, 3), world frame.
        ends_m: Shape (n_lines, 3).
        obstacles: Solids of the pieces.
        n_pieces: How many pieces there are.

    Returns:
        Shape (n_lines, n_pieces).
    """
    crossed = np.zeros((len(starts_m), n_pieces), np.bool_)
    for k in range(obstacles.owner.size):
        cos, sin = np.cos(obstacles.yaw_rad[k]), np.sin(obstacles.yaw_rad[k])
        radius_m, piece = obstacles.radius_m[k], obstacles.owner[k]
        for i in range(len(starts_m)):
            if crossed[i, piece]:
                continue
            x, y = starts_m[i, 0] - obstacles.centre_m[k, 0], starts_m[i, 1] - obstacles.centre_m[k, 1]
            dx, dy = ends_m[i, 0] - starts_m[i, 0], ends_m[i, 1] - starts_m[i, 1]
            enters, leaves = _within(
                obstacles.bottom_m[k], obstacles.top_m[k], starts_m[i, 2], ends_m[i, 2] - starts_m[i, 2]
            )
            if radius_m > 0.0:
                along, speed = x * dx + y * dy, dx * dx + dy * dy
                inside = along * along - speed * (x * x + y * y - radius_m * radius_m)
                if inside <= 0.0 or speed == 0.0:
                    if speed > 0.0 or x * x + y * y >= radius_m * radius_m:
                        continue
                else:
                    enters = max(enters, (-along - np.sqrt(inside)) / speed)
                    leaves = min(leaves, (-along + np.sqrt(inside)) / speed)
            else:
                half = obstacles.half_size_m[k]
                first = _within(-half[0], half[0], cos * x + sin * y, cos * dx + sin * dy)
                second = _within(-half[1], half[1], cos * y - sin * x, cos * dy - sin * dx)
                enters, leaves = max(enters, first[0], second[0]), min(leaves, first[1], second[1])
            long_enough = dx != 0.0 or dy != 0.0 or ends_m[i, 2] != starts_m[i, 2]
            if long_enough and max(enters, 0.0) < min(leaves, 1.0) and enters < 1.0 - BARELY and leaves > BARELY:
                crossed[i, piece] = True
    return crossed


@compiled
def _between(table: FloatArray, slope: FloatArray, angle_rad: float) -> float:
    """Cubic through values and slopes per step of a function tabulated once round the circle."""
    n = table.size
    at = angle_rad * (n / (2.0 * np.pi))
    low = np.floor(at)
    t = at - low
    i = int(low) % n
    j = (i + 1) % n
    rise = table[j] - table[i]
    return table[i] + t * (
        slope[i] + t * (3.0 * rise - 2.0 * slope[i] - slope[j] + t * (slope[i] + slope[j] - 2.0 * rise))
    )


@compiled
def gain_towards(table: FloatArray, slope: FloatArray, cos: float, sin: float, x: float, y: float, up: float) -> float:
    r"""Gain of an element with a level boresight along a vector of any length: `dirmusic.elevation.gain_in_space`.

    Args:
        table: Gain in the plane over the angle off boresight, even steps once round from 0, shape (n,).
        slope: Its slope per step, shape (n,).
        cos: Of the boresight's azimuth.
        sin: Of the boresight's azimuth.
        x: Of the vector, array frame.
        y: Of the vector.
        up: Of the vector.
    """
    ahead, left = cos * x + sin * y, cos * y - sin * x
    sin_psi = np.sqrt(left * left + up * up)
    psi = np.arctan2(sin_psi, ahead)
    half_roll = 0.5 * left / max(sin_psi, NEAR_AXIS)
    return (0.5 + half_roll) * _between(table, slope, psi) + (0.5 - half_roll) * _between(table, slope, -psi)


class Arrivals(NamedTuple):
    """What reaches the elements; a row is a path.

    Attributes:
        delay_s: Travel time, shape (n_paths, n_elements).
        amplitude: For a peak of 1 V at 1 m, with its sign, shape (n_paths, n_elements).
        loudest: Largest magnitude of `amplitude`, shape (n_paths,).
        loudest_s: Travel time to that element, shape (n_paths,).
    """

    delay_s: FloatArray
    amplitude: FloatArray
    loudest: FloatArray
    loudest_s: FloatArray


@compiled
def arrive(
    ray_paths: RayPaths, is_crossed: BoolArray, log_loss: FloatArray, world_from_array: FloatArray, arrays: ArrayTable
) -> Arrivals:
    """Delay and amplitude of paths at each element of its robot's array.

    Args:
        ray_paths: The paths.
        is_crossed: Which pieces of equipment the ray_paths cross, shape (2 n_paths, n_pieces).
        log_loss: Logarithm of the amplitude that each piece lets pass, shape (n_pieces,).
        world_from_array: Shape (n_robots, 4, 4).
        arrays: Of the robots.
    """
    n_paths, n_elements = ray_paths.robot.size, arrays.elements_m.shape[1]
    delay_s, amplitude = np.empty((n_paths, n_elements)), np.empty((n_paths, n_elements))
    loudest, loudest_s = np.empty(n_paths), np.empty(n_paths)
    for p in range(n_paths):
        r = ray_paths.robot[p]
        left = 0.0
        for k in range(log_loss.size):
            left += (int(is_crossed[2 * p, k]) + int(is_crossed[2 * p + 1, k])) * log_loss[k]
        factor = ray_paths.coefficient[p] * np.exp(left)
        dx, dy, dz = (
            ray_paths.from_m[p, 0] - world_from_array[r, 0, 3],
            ray_paths.from_m[p, 1] - world_from_array[r, 1, 3],
            ray_paths.from_m[p, 2] - world_from_array[r, 2, 3],
        )
        w = world_from_array[r]
        x = dx * w[0, 0] + dy * w[1, 0] + dz * w[2, 0]
        y = dx * w[0, 1] + dy * w[1, 1] + dz * w[2, 1]
        z = dx * w[0, 2] + dy * w[1, 2] + dz * w[2, 2]
        loudest[p] = -1.0
        for e in range(n_elements):
            ex, ey, ez = x - arrays.elements_m[r, e, 0], y - arrays.elements_m[r, e, 1], z - arrays.elements_m[r, e, 2]
            range_m = np.sqrt(ex * ex + ey * ey + ez * ez)
            cos, sin = arrays.boresight_cos_sin[r, e]
            gain = gain_towards(arrays.pattern_gain, arrays.pattern_slope, cos, sin, ex, ey, ez)
            delay_s[p, e] = range_m / SPEED_OF_LIGHT_MPS
            amplitude[p, e] = (arrays.gain_factors[r, e] * gain + arrays.gain_offsets[r, e]) * factor / range_m
            if abs(amplitude[p, e]) > loudest[p]:
                loudest[p], loudest_s[p] = abs(amplitude[p, e]), delay_s[p, e]
    return Arrivals(delay_s, amplitude, loudest, loudest_s)


@compiled
def trace(
    sources_m: FloatArray,
    is_emitting: BoolArray,
    world_from_array: FloatArray,
    arrays: ArrayTable,
    surroundings: Surroundings,
) -> tuple[RayPaths, Arrivals]:
    """All paths from sources on the air to the elements of each robot's own array.

    Which faces mirror a source to an array, and what stands in between, is asked for the centre of its elements: an
    array is small against equipment.

    Args:
        sources_m: Of each robot its own, shape (n_robots, n_sources, 3), world frame.
        is_emitting: Which of them, shape (n_robots, n_sources).
        world_from_array: Shape (n_robots, 4, 4).
        arrays: Of the robots.
        surroundings: Of all of them.
    """
    n_robots, n_elements = arrays.elements_m.shape[:2]
    centre_m = np.zeros((n_robots, 3))
    for r in range(n_robots):
        for i in range(3):
            for e in range(n_elements):
                for j in range(3):
                    centre_m[r, i] += world_from_array[r, i, j] * arrays.elements_m[r, e, j] / n_elements
            centre_m[r, i] += world_from_array[r, i, 3]
    ray_paths = find_ray_paths(sources_m, is_emitting, centre_m, surroundings.faces, surroundings.reflection)
    is_crossed = cross(ray_paths.starts_m, ray_paths.ends_m, surroundings.obstacles, surroundings.log_loss.size)
    return ray_paths, arrive(ray_paths, is_crossed, surroundings.log_loss, world_from_array, arrays)
