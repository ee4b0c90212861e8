"""What straight lines cross on their way, in a compiled loop."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from sensing.radio.surroundings import Obstacles

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

BARELY = 1e-9
"""Share of a line at its ends within which a surface does not count."""


class Inside(NamedTuple):
    """From which share of a line to which it lies inside of something; if it leaves before it enters, nowhere."""

    enters: float
    leaves: float


@compiled
def _between(low: float, high: float, start: float, change: float) -> Inside:
    """Where a coordinate that changes evenly along a line, from `start` by `change`, lies between two bounds."""
    if change == 0.0:
        return Inside(-np.inf, np.inf) if low < start < high else Inside(np.inf, -np.inf)
    first, second = (low - start) / change, (high - start) / change
    return Inside(min(first, second), max(first, second))


@compiled
def cross(starts_m: FloatArray, ends_m: FloatArray, obstacles: Obstacles, n_pieces: int) -> BoolArray:
    """Which pieces of equipment straight lines cross. A line that ends on a surface does not cross it.

    Args:
        starts_m: Where the lines start, shape (n_lines, 3), world frame.
        ends_m: Where the lines end, shape (n_lines, 3).
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
            enters, leaves = _between(
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
                first = _between(-half[0], half[0], cos * x + sin * y, cos * dx + sin * dy)
                second = _between(-half[1], half[1], cos * y - sin * x, cos * dy - sin * dx)
                enters, leaves = max(enters, first.enters, second.enters), min(leaves, first.leaves, second.leaves)
            long_enough = dx != 0.0 or dy != 0.0 or ends_m[i, 2] != starts_m[i, 2]
            if long_enough and max(enters, 0.0) < min(leaves, 1.0) and enters < 1.0 - BARELY and leaves > BARELY:
                crossed[i, piece] = True
    return crossed
