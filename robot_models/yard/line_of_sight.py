"""Which lines are clear of equipment on plan, in a compiled loop."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_models.compiled import compiled
from robot_models.yard.solids import Footprints

FloatArray = NDArray[np.float64]

LEAST_STEP = 1e-12
"""A line that goes less far than this along one side of a box, metres, is taken to go so far."""


class Span(NamedTuple):
    """Shares of a line at which it comes between two sides, and leaves there again."""

    enters: float
    leaves: float


@compiled
def between(start: float, along: float, half: float) -> Span:
    """Where a line is between -half and half in one coordinate."""
    if abs(along) < LEAST_STEP:
        along = LEAST_STEP
    first, second = (-half - start) / along, (half - start) / along
    return Span(min(first, second), max(first, second))


@compiled
def is_clear(starts_m: FloatArray, end_m: FloatArray, short_m: FloatArray, footprints: Footprints) -> NDArray[np.bool_]:
    """Whether lines cross no footprint.

    Args:
        starts_m: Where they start, shape (n, 2), world frame.
        end_m: Where they all end, shape (2,).
        short_m: Length before the end that does not count for each solid, shape (n_solids,).
        footprints: Of the solids.

    Returns:
        Shape (n,).
    """
    clear = np.ones(len(starts_m), np.bool_)
    for k in range(footprints.radius_m.size):
        cos, sin, radius_m = footprints.cos_yaw[k], footprints.sin_yaw[k], footprints.radius_m[k]
        centre_x, centre_y = footprints.centre_m[k]
        end_x = cos * (end_m[0] - centre_x) + sin * (end_m[1] - centre_y)
        end_y = cos * (end_m[1] - centre_y) - sin * (end_m[0] - centre_x)
        for n in range(len(starts_m)):
            if not clear[n]:
                continue
            from_x, from_y = starts_m[n, 0] - centre_x, starts_m[n, 1] - centre_y
            x, y = cos * from_x + sin * from_y, cos * from_y - sin * from_x
            along_x, along_y = end_x - x, end_y - y
            square = max(along_x * along_x + along_y * along_y, LEAST_STEP * LEAST_STEP)
            last = 1.0 - min(short_m[k] / np.sqrt(square), 1.0)
            if radius_m > 0.0:
                nearest = min(max(-(x * along_x + y * along_y) / square, 0.0), last)
                past_x, past_y = x + nearest * along_x, y + nearest * along_y
                clear[n] = past_x * past_x + past_y * past_y >= radius_m * radius_m
            else:
                over_x = between(x, along_x, footprints.half_size_m[k, 0])
                over_y = between(y, along_y, footprints.half_size_m[k, 1])
                enters, leaves = max(over_x.enters, over_y.enters, 0.0), min(over_x.leaves, over_y.leaves, last)
                clear[n] = enters >= leaves
    return clear
