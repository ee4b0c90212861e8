"""What the pattern of the elements is off by, as states of the joint fit.

All elements are of one make and share it: an amount that depends on the angle off the boresight, a part of it in the
plane, and parts that grow with the sine of the elevation and with its square. A robot that drives round a source, or
keeps it in one direction while it drives, finds it out, where noise would be believed again at every look.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.element_errors import OFF_PLANE
from dirmusic.array.model import ArrayModel
from dirmusic.array.pattern import Boresight, GainInDirection
from dirmusic.compiled import compiled

FloatArray = NDArray[np.float64]

N_HARMONICS = 7
"""Of the angle off the boresight, from the first on; a constant hardly turns a bearing."""

SHARE_LEFT = 0.25
"""Of the deviation of the gain, what its states do not explain and stays noise: of the computed helices a sixth to a
fourth up to 45 degrees of elevation (measured)."""

N_TERMS = 6 * N_HARMONICS
"""States: cosine and sine of each harmonic in the plane, then the same per sine of the elevation, then per its square.
"""


def deviation_spread(array: ArrayModel) -> FloatArray:
    """Standard deviation of each state, in units of gain, shape (N_TERMS,); none where the pattern is believed."""
    if array.spread.pattern == 0.0:
        return np.empty(0)
    level = array.spread.pattern * array.manifold.table.gain.max() / math.sqrt(N_HARMONICS)
    return level * np.repeat([1.0, OFF_PLANE, OFF_PLANE], 2 * N_HARMONICS)


def deviation_upside_down(states: FloatArray) -> FloatArray:
    """States (n_terms,), or none, of a deviation that is above the plane what the given one is below."""
    in_plane, by_sine, by_square = np.split(states, 3)
    return np.concatenate([in_plane, -by_sine, by_square])


@compiled
def deviation_towards(
    states: FloatArray, boresight: Boresight, x: float, y: float, z: float, terms: FloatArray
) -> GainInDirection:
    """What the gain is off by along a vector of length 1, and its slopes per radian of azimuth and elevation.

    Args:
        states: See `N_TERMS`; none are zero.
        boresight: Of the element.
        x: Component of the vector in the frame of the boresight, as y and z; z is up.
        y: As said.
        z: As said.
        terms: Becomes the slope of the gain by each state, shape (N_TERMS,).
    """
    gain, by_azimuth, by_elevation = 0.0, 0.0, 0.0
    n, level = states.size // 3, max(math.hypot(x, y), 1e-9)
    cos_off = (boresight.cos_azimuth * x + boresight.sin_azimuth * y) / level
    sin_off = (boresight.cos_azimuth * y - boresight.sin_azimuth * x) / level
    cos, sin = 1.0, 0.0
    for m in range(n // 2):
        cos, sin = cos * cos_off - sin * sin_off, sin * cos_off + cos * sin_off
        by_cos, by_sin = 0.0, 0.0
        for part, share, by_sine in ((0, 1.0, 0.0), (1, z, 1.0), (2, z * z, 2.0 * z)):
            of_cos, of_sin = part * n + 2 * m, part * n + 2 * m + 1
            terms[of_cos], terms[of_sin] = share * cos, share * sin
            by_cos += share * states[of_cos]
            by_sin += share * states[of_sin]
            by_elevation += level * by_sine * (states[of_cos] * cos + states[of_sin] * sin)
        gain += by_cos * cos + by_sin * sin
        by_azimuth += (m + 1) * (by_sin * cos - by_cos * sin)
    return GainInDirection(gain, by_azimuth, by_elevation)
