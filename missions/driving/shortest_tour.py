"""The shortest way past several places: what one who knows where the discharges are would drive."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, permutations

import numpy as np
from numpy.typing import NDArray

from pdpatrol.missions.driving.site_map import ShortestPaths, SiteMap

FloatArray = NDArray[np.float64]


def shortest_tour(site_map: SiteMap, places_m: Sequence[FloatArray], within_m: float) -> float:
    """Length of the shortest way from the dock to within some distance of each place, in the best order.

    From each place it goes on to the nearest ground from which the next is near enough.

    Args:
        site_map: Where the robot can drive.
        places_m: At most a handful, each of shape (2,), world frame.
        within_m: How near it has to come, on plan.

    Returns:
        Its length, metres; 0 without any place, infinite if one cannot be come near to.
    """
    near = [np.linalg.norm(site_map.centres_m - place_m, axis=-1) <= within_m for place_m in places_m]
    reached: dict[int, ShortestPaths] = {}
    legs: dict[tuple[int, int], tuple[int, float]] = {}

    def leg(start: int, place: int) -> tuple[int, float]:
        """The cell where the way from a cell to a place ends, and its length."""
        if (start, place) not in legs:
            if start not in reached:
                reached[start] = site_map.reach(site_map.centres_m[start])
            weighted_m = np.where(near[place], reached[start].length_m, np.inf)
            end = int(weighted_m.argmin())
            length_m = path_length(reached[start].path(end)) if np.isfinite(weighted_m[end]) else np.inf
            legs[start, place] = end, length_m
        return legs[start, place]

    shortest_m = np.inf if places_m else 0.0
    for order in permutations(range(len(places_m))):
        cell, total_m = site_map.cell(site_map.route.dock_m), 0.0
        for place in order:
            cell, length_m = leg(cell, place)
            total_m += length_m
            if total_m >= shortest_m:
                break
        shortest_m = min(shortest_m, total_m)
    return float(shortest_m)


def path_length(points_m: FloatArray) -> float:
    """Length of the way through points, shape (n, 2), metres."""
    return float(sum(np.linalg.norm(after - before) for before, after in pairwise(points_m)))
