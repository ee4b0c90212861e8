"""Sight: how much of a wave comes straight from a target to a place, past all that stands between.

It is the same for nature and for whoever reads a map: the straight path of `find_ray_paths`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from pdpatrol.sensing.radio.lines import line
from pdpatrol.sensing.radio.obstruction import left_straight
from pdpatrol.sensing.radio.surroundings import Surroundings
from pdpatrol.sensing.radio.tables import Obstacle, Obstacles
from pdpatrol.sensing.radio.vectors import Vector

FloatArray = NDArray[np.float64]


class Sight:
    """What equipment leaves of straight waves.

    Args:
        surroundings: What stands about.
    """

    def __init__(self, surroundings: Surroundings) -> None:
        self._obstacles = surroundings.obstacles

    def __call__(self, places_m: FloatArray, target_m: FloatArray, within_m: float = 0.0) -> FloatArray:
        """Share of the amplitude that is left on the straight path, in [0, 1]; 0 behind metal, some behind porcelain.

        Args:
            places_m: From where one looks, shape (n, 3), world frame.
            target_m: At what, shape (3,).
            within_m: Equipment in so much of the way at the target's end takes nothing away, or in half its own
                thickness: a target on a surface, or a little within it, is in sight from outside, but not from beyond
                a post.

        Returns:
            Shape (n,).
        """
        places_m = np.ascontiguousarray(places_m, dtype=np.float64)
        return shares_left(places_m, np.ascontiguousarray(target_m, dtype=np.float64), within_m, self._obstacles)


@compiled
def depth_of(solid: Obstacle) -> float:
    """From the middle of its footprint to its nearest side."""
    return solid.radius_m if solid.radius_m > 0.0 else min(solid.half_x, solid.half_y)


@compiled
def shares_left(places_m: FloatArray, target_m: FloatArray, within_m: float, obstacles: Obstacles) -> FloatArray:
    """As `Sight`; of the solids of one piece of equipment, that counts which takes away most."""
    shares, target = np.ones(len(places_m)), Vector(target_m[0], target_m[1], target_m[2])
    for i in range(len(places_m)):
        place = Vector(places_m[i, 0], places_m[i, 1], places_m[i, 2])
        whole, of_piece = line(place, target), 1.0
        for k in range(obstacles.size):
            if k > 0 and obstacles[k].owner != obstacles[k - 1].owner:
                shares[i], of_piece = shares[i] * of_piece, 1.0
            way = whole
            if within_m > 0.0 and whole.length_m > 0.0:
                last = 1.0 - min(min(within_m, depth_of(obstacles[k])) / whole.length_m, 1.0)
                end = Vector(
                    place.x + last * (target.x - place.x),
                    place.y + last * (target.y - place.y),
                    place.z + last * (target.z - place.z),
                )
                way = line(place, end)
            of_piece = min(of_piece, left_straight(way, obstacles[k]))
            if of_piece == 0.0:
                break
        shares[i] *= of_piece
    return shares
