"""Compiled functions for the arrivals of pulses at the elements of an array along every ray path."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.pattern import Boresight, gain_towards
from dirmusic.arrays import FloatArray
from dirmusic.compiled import compiled
from pdpatrol.sensing.array.array_table import ArrayTable, look_up_gains
from pdpatrol.sensing.quantities import SPEED_OF_LIGHT_MPS
from pdpatrol.sensing.radio.geometry import Frame, Vector, frame_of, minus, to_frame, to_world, vector_of
from pdpatrol.sensing.radio.ray_paths import RayPaths, find_ray_paths
from pdpatrol.sensing.radio.surroundings import Surroundings


class Propagation(NamedTuple):
    """Sources, array and surroundings of one robot.

    Attributes:
        positions_m: Positions of the sources, shape (n_sources, 3), world frame.
        axes: Linear polarisations of the sources, unit vectors, shape (n_sources, 3).
        burst_s: Durations of bursts, 0 for sources of pulses, shape (n_sources,).
        array: Antenna array of the robot.
        surroundings: Faces and solids.
    """

    positions_m: FloatArray
    axes: FloatArray
    burst_s: FloatArray
    array: ArrayTable
    surroundings: Surroundings


class Arrivals(NamedTuple):
    """Signals at the elements for a pulse of 1 V at 1 m; a row is a ray path.

    Attributes:
        delay_s: Travel times, shape (n_paths, n_elements).
        amplitude: Complex amplitudes in each band, shape (n_paths, n_elements, n_bands). Multiplied by
            exp(-j omega delay), they are the response to a steady wave exp(j omega t). There is a single band if the
            pattern does not depend on frequency.
        peak: Upper bound of the signal over all elements, shape (n_paths,).
        peak_s: Travel time to the element with that bound, shape (n_paths,).
    """

    delay_s: FloatArray
    amplitude: NDArray[np.complex128]
    peak: FloatArray
    peak_s: FloatArray


@compiled
def arrive(ray_paths: RayPaths, pose: Frame, array: ArrayTable) -> Arrivals:
    """Compute the delay and amplitude of each ray path at each element of an array.

    Args:
        ray_paths: Paths to the middle of the array.
        pose: Frame of the array.
        array: The array.
    """
    rows, elements_m = ray_paths.rows, array.elements_m
    n_paths, n_elements, n_bands = rows.size, len(elements_m), array.band_peak.size
    has_grid, gain = array.grid.size > 0, np.empty(n_bands)
    delay_s, amplitude = np.empty((n_paths, n_elements)), np.empty((n_paths, n_elements, n_bands), np.complex128)
    peak, peak_s = np.empty(n_paths), np.empty(n_paths)
    for p in range(n_paths):
        path = rows[p]
        at = to_frame(pose, Vector(path.x, path.y, path.z))
        peak[p] = -1.0
        for e in range(n_elements):
            x, y, z = minus(at, vector_of(elements_m[e]))
            b = array.boresights[e]
            boresight = Boresight(b[0], b[1], b[2], b[3])
            if has_grid:
                look_up_gains(array.grid, boresight, x, y, z, gain)
            else:
                gain[0] = gain_towards(array.pattern, boresight, x, y, z)
            length_m = path.extra_m + np.sqrt(x * x + y * y + z * z)
            delay_s[p, e] = length_m / SPEED_OF_LIGHT_MPS
            level = 0.0
            for band in range(n_bands):
                with_errors = array.gain_factors[e] * gain[band] + array.gain_offsets[e]
                amplitude[p, e, band] = path.coefficient * (with_errors / length_m)
                level += array.band_peak[band] * abs(amplitude[p, e, band])
            if level > peak[p]:
                peak[p], peak_s[p] = level, delay_s[p, e]
    return Arrivals(delay_s, amplitude, peak, peak_s)


@compiled
def propagate(least: FloatArray, world_from_array: FloatArray, propagation: Propagation) -> tuple[RayPaths, Arrivals]:
    """Find all paths from the sources to the array, and compute their arrivals at the elements.

    Paths are traced to the middle of the elements, because an array is small compared with equipment.

    Args:
        least: Weakest amplitude of each source, as in `find_ray_paths`.
        world_from_array: Pose of the array, shape (4, 4).
        propagation: Sources, array and surroundings.
    """
    positions_m, axes, _, array, surroundings = propagation
    pose = frame_of(world_from_array)
    ray_paths = find_ray_paths(positions_m, axes, least, to_world(pose, array.middle_m), surroundings)
    return ray_paths, arrive(ray_paths, pose, array)
