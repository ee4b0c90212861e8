"""What arrives at the elements by each path, in compiled loops: gain, spreading, obstruction, delay."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.pattern_table import Boresight, gain_towards
from dirmusic.bearing.gain_delay import SPEED_OF_LIGHT_MPS
from dirmusic.compiled import compiled
from sensing.array.array_table import ArrayTable
from sensing.radio.obstruction import cross
from sensing.radio.propagation import Propagation
from sensing.radio.ray_paths import RayPaths, find_ray_paths

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


class Arrivals(NamedTuple):
    """What arrives at the elements; a row is a ray path.

    Attributes:
        delay_s: Travel time, shape (n_paths, n_elements).
        amplitude: For a peak of 1 V at 1 m, with its sign, shape (n_paths, n_elements).
        loudest: Largest magnitude of `amplitude`, shape (n_paths,).
        loudest_s: Travel time to the element with that magnitude, shape (n_paths,).
    """

    delay_s: FloatArray
    amplitude: FloatArray
    loudest: FloatArray
    loudest_s: FloatArray


@compiled
def arrive(
    ray_paths: RayPaths,
    is_crossed: BoolArray,
    log_loss: FloatArray,
    robot: int,
    world_from_array: FloatArray,
    arrays: ArrayTable,
) -> Arrivals:
    """Delay and amplitude of each ray path at each element of a robot's array.

    Args:
        ray_paths: The paths.
        is_crossed: Which pieces of equipment the segments of the paths cross, shape (2 n_paths, n_pieces).
        log_loss: Logarithm of the amplitude that each piece lets pass, shape (n_pieces,).
        robot: Row of the robot.
        world_from_array: Poses of the arrays, shape (n_robots, 4, 4).
        arrays: One for each robot.
    """
    n_paths, n_elements = ray_paths.source.size, arrays.elements_m.shape[1]
    delay_s, amplitude = np.empty((n_paths, n_elements)), np.empty((n_paths, n_elements))
    loudest, loudest_s = np.empty(n_paths), np.empty(n_paths)
    r, w = robot, world_from_array[robot]
    for p in range(n_paths):
        left = 0.0
        for k in range(log_loss.size):
            left += (int(is_crossed[2 * p, k]) + int(is_crossed[2 * p + 1, k])) * log_loss[k]
        factor = ray_paths.coefficient[p] * np.exp(left)
        dx, dy, dz = (
            ray_paths.from_m[p, 0] - w[0, 3],
            ray_paths.from_m[p, 1] - w[1, 3],
            ray_paths.from_m[p, 2] - w[2, 3],
        )
        x = dx * w[0, 0] + dy * w[1, 0] + dz * w[2, 0]
        y = dx * w[0, 1] + dy * w[1, 1] + dz * w[2, 1]
        z = dx * w[0, 2] + dy * w[1, 2] + dz * w[2, 2]
        loudest[p] = -1.0
        for e in range(n_elements):
            ex, ey, ez = x - arrays.elements_m[r, e, 0], y - arrays.elements_m[r, e, 1], z - arrays.elements_m[r, e, 2]
            range_m = np.sqrt(ex * ex + ey * ey + ez * ez)
            of = arrays.boresights[r, e]
            gain = gain_towards(arrays.pattern, Boresight(of[0], of[1], of[2], of[3]), ex, ey, ez)
            delay_s[p, e] = range_m / SPEED_OF_LIGHT_MPS
            amplitude[p, e] = (arrays.gain_factors[r, e] * gain + arrays.gain_offsets[r, e]) * factor / range_m
            if abs(amplitude[p, e]) > loudest[p]:
                loudest[p], loudest_s[p] = abs(amplitude[p, e]), delay_s[p, e]
    return Arrivals(delay_s, amplitude, loudest, loudest_s)


class Propagated(NamedTuple):
    """The ray paths from sources to arrays, and what arrives by each."""

    ray_paths: RayPaths
    arrivals: Arrivals


@compiled
def propagate(robot: int, is_emitting: BoolArray, world_from_array: FloatArray, propagation: Propagation) -> Propagated:
    """All paths from a robot's sources that emit to the elements of its array.

    Which faces mirror a source to an array, and what stands in between, is asked for the centre of its elements: an
    array is small against equipment.

    Args:
        robot: Row of the robot.
        is_emitting: Which of its sources emit, shape (n_sources,).
        world_from_array: Poses of the arrays, shape (n_robots, 4, 4).
        propagation: Sources and arrays, and what surrounds them.
    """
    arrays, around, w = propagation.arrays, propagation.surroundings, world_from_array[robot]
    n_elements = arrays.elements_m.shape[1]
    centre_m = w[:3, 3].copy()
    for i in range(3):
        for e in range(n_elements):
            for j in range(3):
                centre_m[i] += w[i, j] * arrays.elements_m[robot, e, j] / n_elements
    sources_m = propagation.sources.positions_m[robot]
    ray_paths = find_ray_paths(sources_m, is_emitting, centre_m, around.faces, around.reflection)
    is_crossed = cross(ray_paths.starts_m, ray_paths.ends_m, around.obstacles, around.log_loss.size)
    return Propagated(ray_paths, arrive(ray_paths, is_crossed, around.log_loss, robot, world_from_array, arrays))
