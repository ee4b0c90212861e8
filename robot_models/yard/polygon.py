"""Simple polygons in the plane: checks, points inside, and distances."""

from collections.abc import Iterator, Sequence
from itertools import combinations, pairwise
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

from dirmusic.arrays import BoolArray, FloatArray
from pdpatrol.robot_models.yard.quantities import Coordinate

LEAST_SIDE_M = 0.1
"""Shortest side. Assumed; a shorter one is a slip of the pen."""

Corner = tuple[Coordinate, Coordinate]


def _sides(corners_m: Sequence[Corner]) -> Iterator[tuple[Corner, Corner]]:
    return pairwise((*corners_m, corners_m[0]))


def _is_left(a: Corner, b: Corner, c: Corner) -> float:
    """Return twice the signed area of a triangle, positive if it is counter-clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _cross(a: Corner, b: Corner, c: Corner, d: Corner) -> bool:
    """Return whether the sides from a to b and from c to d have a point in common."""
    of_c, of_d, of_a, of_b = _is_left(a, b, c), _is_left(a, b, d), _is_left(c, d, a), _is_left(c, d, b)
    if of_c == of_d == 0.0:  # on one line
        low, high = np.minimum(a, b), np.maximum(a, b)
        return bool((np.maximum(low, np.minimum(c, d)) <= np.minimum(high, np.maximum(c, d))).all())
    return of_c * of_d <= 0.0 and of_a * of_b <= 0.0


def check_polygon(corners_m: tuple[Corner, ...]) -> tuple[Corner, ...]:
    """Return the corners of a polygon.

    Raises:
        ValueError: If a side is too short, or sides touch or cross, with one line for the first such fault.
    """
    sides = list(_sides(corners_m))
    for number, side in enumerate(sides, start=1):
        if np.hypot(*np.subtract(*side)) < LEAST_SIDE_M:
            raise ValueError(
                f"sides must be {LEAST_SIDE_M:g} m or longer, side {number} runs from {side[0]} to {side[1]}"
            )
    for (i, one), (k, other) in combinations(enumerate(sides), 2):
        if k - i == 1 or k - i == len(sides) - 1:  # they share a corner, and must not turn back
            shared, ends = (one[1], (one[0], other[1])) if k - i == 1 else (one[0], (one[1], other[0]))
            along = np.dot(np.subtract(ends[0], shared), np.subtract(ends[1], shared))
            is_crossing = _is_left(ends[0], shared, ends[1]) == 0.0 and along > 0.0
        else:
            is_crossing = _cross(*one, *other)
        if is_crossing:
            raise ValueError(
                f"sides must not touch or cross, side {i + 1} from {one[0]} to {one[1]} meets side {k + 1} from "
                f"{other[0]} to {other[1]}"
            )
    return corners_m


PolygonCorners = Annotated[tuple[Corner, ...], Field(min_length=3, max_length=200), AfterValidator(check_polygon)]
"""Corners of a polygon in order, in either sense; the last is joined to the first."""


class Polygon:
    """Simple polygon.

    Args:
        corners_m: Corners in order, in either sense.

    Attributes:
        corners_m: Corners, counter-clockwise, shape (n, 2).
        length_m: Lengths of the sides; side k runs from corner k to the next, shape (n,).
        along: Unit vectors along the sides, shape (n, 2).
    """

    def __init__(self, corners_m: Sequence[Corner]) -> None:
        corners = np.array(corners_m, dtype=np.float64)
        x, y = corners.T
        if float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) < 0.0:
            corners = corners[::-1]
        self.corners_m = corners
        side_m = np.roll(corners, -1, axis=0) - corners
        self.length_m = np.hypot(*side_m.T)
        self.along = side_m / self.length_m[:, np.newaxis]

    @property
    def is_convex(self) -> bool:
        """True if no corner points inwards."""
        (x, y), (next_x, next_y) = self.along.T, np.roll(self.along, -1, axis=0).T
        return bool((x * next_y - y * next_x >= 0.0).all())

    def sampled(self, spacing_m: float) -> FloatArray:
        """Return points on the boundary, at most a spacing apart along each side, shape (n, 2)."""
        ends = zip(self.corners_m, np.roll(self.corners_m, -1, axis=0), self.length_m.tolist(), strict=True)
        return np.concatenate([np.linspace(a, b, 2 + int(length_m / spacing_m)) for a, b, length_m in ends])

    def to_side(self, points_m: FloatArray, side: int) -> FloatArray:
        """Return the distance from points (..., 2) to one side, shape (...)."""
        (x, y), (along_x, along_y) = self.corners_m[side], self.along[side]
        dx, dy = points_m[..., 0] - x, points_m[..., 1] - y
        along_m = dx * along_x + dy * along_y
        beyond_m = np.maximum(np.maximum(-along_m, along_m - self.length_m[side]), 0.0)
        return np.hypot(along_x * dy - along_y * dx, beyond_m)

    def is_inside(self, points_m: FloatArray) -> BoolArray:
        """Return whether points (..., 2) lie inside, shape (...); on the boundary, either may be returned."""
        x, y = points_m[..., 0], points_m[..., 1]
        inside = np.zeros(x.shape, dtype=np.bool_)
        for (start_x, start_y), (end_x, end_y) in zip(
            self.corners_m.tolist(), np.roll(self.corners_m, -1, axis=0).tolist(), strict=True
        ):
            if start_y != end_y:
                at_x = start_x + (y - start_y) * ((end_x - start_x) / (end_y - start_y))
                inside ^= ((start_y > y) != (end_y > y)) & (x < at_x)
        return inside

    def signed_distance(self, points_m: FloatArray) -> FloatArray:
        """Return the distance from points (..., 2) to the boundary, negative outside, shape (...)."""
        distance_m = np.full(points_m.shape[:-1], np.inf)
        for side in range(len(self.length_m)):
            distance_m = np.minimum(distance_m, self.to_side(points_m, side))
        return np.where(self.is_inside(points_m), distance_m, -distance_m)
