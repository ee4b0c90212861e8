"""What arrives at the elements by each path, in compiled loops: gain, spreading, obstruction, delay."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.pattern import Boresight, gain_towards
from dirmusic.bearing.gain_delay import SPEED_OF_LIGHT_MPS
from dirmusic.compiled import compiled
from pdpatrol.sensing.array.array_table import ArrayTable
from pdpatrol.sensing.array.gain_grid import look_up_gains
from pdpatrol.sensing.radio.propagation import Propagation
from pdpatrol.sensing.radio.ray_paths import RayPaths, find_ray_paths
from pdpatrol.sensing.radio.vectors import Vector

FloatArray = NDArray[np.float64]


class Arrivals(NamedTuple):
    """What arrives at the elements; a row is a ray path.

    Attributes:
        delay_s: Travel time, shape (n_paths, n_elements).
        amplitude: For a peak of 1 V at 1 m, complex, in each band, shape (n_paths, n_elements, n_bands):
            exp(-j omega delay) times it is what comes of a steady wave exp(j omega t). One band where the pattern is
            the same at all frequencies.
        loudest: What the largest magnitude at any element does not exceed, shape (n_paths,).
        loudest_s: Travel time to the element with that, shape (n_paths,).
    """

    delay_s: FloatArray
    amplitude: NDArray[np.complex128]
    loudest: FloatArray
    loudest_s: FloatArray


@compiled
def arrive(ray_paths: RayPaths, robot: int, world_from_array: FloatArray, arrays: ArrayTable) -> Arrivals:
    """Delay and amplitude of each ray path at each element of a robot's array.

    Args:
        ray_paths: The paths.
        robot: Row of the robot.
        world_from_array: Poses of the arrays, shape (n_robots, 4, 4).
        arrays: One for each robot.
    """
    n_paths, n_elements, n_bands = ray_paths.source.size, arrays.elements_m.shape[1], arrays.grid.band_peak.size
    delay_s, amplitude = np.empty((n_paths, n_elements)), np.empty((n_paths, n_elements, n_bands), np.complex128)
    has_grid, gain = arrays.grid.gain.size > 0, np.empty(n_bands)
    loudest, loudest_s = np.empty(n_paths), np.empty(n_paths)
    r, w = robot, world_from_array[robot]
    for p in range(n_paths):
        extra_m = ray_paths.extra_m[p]
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
            boresight = Boresight(of[0], of[1], of[2], of[3])
            if has_grid:
                look_up_gains(arrays.grid, boresight, ex, ey, ez, gain)
            else:
                gain[0] = gain_towards(arrays.pattern, boresight, ex, ey, ez)
            length_m = extra_m + range_m
            delay_s[p, e] = length_m / SPEED_OF_LIGHT_MPS
            level = 0.0
            for b in range(n_bands):
                with_errors = arrays.gain_factors[r, e] * gain[b] + arrays.gain_offsets[r, e]
                amplitude[p, e, b] = ray_paths.coefficient[p] * (with_errors / length_m)
                level += arrays.grid.band_peak[b] * abs(amplitude[p, e, b])
            if level > loudest[p]:
                loudest[p], loudest_s[p] = level, delay_s[p, e]
    return Arrivals(delay_s, amplitude, loudest, loudest_s)


class Propagated(NamedTuple):
    """The ray paths from sources to arrays, and what arrives by each."""

    ray_paths: RayPaths
    arrivals: Arrivals


@compiled
def propagate(robot: int, faintest: FloatArray, world_from_array: FloatArray, propagation: Propagation) -> Propagated:
    """All paths from a robot's sources to the elements of its array.

    Which faces mirror a source to an array, and what stands in between, is asked for the centre of its elements: an
    array is small against equipment.

    Args:
        robot: Row of the robot.
        faintest: As of `find_ray_paths`, for its sources.
        world_from_array: Poses of the arrays, shape (n_robots, 4, 4).
        propagation: Sources and arrays, and what surrounds them.
    """
    arrays, sources, w = propagation.arrays, propagation.sources, world_from_array[robot]
    x = y = z = 0.0
    n_elements = arrays.elements_m.shape[1]
    for e in range(n_elements):
        x += arrays.elements_m[robot, e, 0] / n_elements
        y += arrays.elements_m[robot, e, 1] / n_elements
        z += arrays.elements_m[robot, e, 2] / n_elements
    centre = Vector(
        w[0, 0] * x + w[0, 1] * y + w[0, 2] * z + w[0, 3],
        w[1, 0] * x + w[1, 1] * y + w[1, 2] * z + w[1, 3],
        w[2, 0] * x + w[2, 1] * y + w[2, 2] * z + w[2, 3],
    )
    ray_paths = find_ray_paths(
        sources.positions_m[robot], sources.axes[robot], faintest, centre, propagation.surroundings
    )
    return Propagated(ray_paths, arrive(ray_paths, robot, world_from_array, arrays))
