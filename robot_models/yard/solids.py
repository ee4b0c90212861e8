"""Boxes and upright cylinders: single solids in the frame of their equipment, and arrays of solids in the yard."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dirmusic.arrays import BoolArray, FloatArray, IntArray


class Solid(NamedTuple):
    """Box or upright cylinder in the frame of its equipment: x and y turn with the yaw, z is up.

    Attributes:
        top_m: Height of the top above the ground.
        bottom_m: Height of the bottom above the ground.
        centre_m: Middle of the footprint.
        footprint_m: Length of a box along x and y; 0 for a cylinder.
        radius_m: Radius of a cylinder; 0 for a box.
    """

    top_m: float
    bottom_m: float = 0.0
    centre_m: tuple[float, float] = (0.0, 0.0)
    footprint_m: tuple[float, float] = (0.0, 0.0)
    radius_m: float = 0.0


@dataclass(frozen=True, eq=False)  # compared by identity, because yards are compared by their fields
class YardSolids:
    """Arrays of solids, world frame. The last axis of every result runs over the solids.

    Attributes:
        centre_m: Middle of the footprints, shape (n_solids, 2).
        yaw_rad: Yaw of the boxes, shape (n_solids,).
        half_size_m: Half the side lengths of boxes, shape (n_solids, 2); 0 for cylinders.
        radius_m: Radius of cylinders, shape (n_solids,); 0 for boxes.
        bottom_m: Height of the bottom above the ground, shape (n_solids,).
        top_m: Height of the top above the ground, shape (n_solids,).
        owner: Index of the piece of equipment that each solid belongs to, shape (n_solids,).
    """

    centre_m: FloatArray
    yaw_rad: FloatArray
    half_size_m: FloatArray
    radius_m: FloatArray
    bottom_m: FloatArray
    top_m: FloatArray
    owner: IntArray

    def take(self, chosen: BoolArray | IntArray) -> YardSolids:
        """Return the solids that a mask (n_solids,) or an array of indices selects, in the same order."""
        return YardSolids(*(column[chosen] for column in vars(self).values()))

    @property
    def extent_m(self) -> tuple[FloatArray, FloatArray]:
        """South-west and north-east corners of the area that the solids cover, each of shape (2,)."""
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        turn = np.abs(np.array([[cos, sin], [sin, cos]]))
        half_m = np.einsum("ijn,nj->ni", turn, self.half_size_m) + self.radius_m[:, np.newaxis]
        return (self.centre_m - half_m).min(axis=0), (self.centre_m + half_m).max(axis=0)

    @property
    def corners_m(self) -> FloatArray:
        """Corners of the footprints of boxes, counter-clockwise, shape (n_solids, 4, 2); of cylinders the middle."""
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        turn = np.moveaxis(np.array([[cos, -sin], [sin, cos]]), -1, 0)
        signs = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
        return self.centre_m[:, np.newaxis] + (signs * self.half_size_m[:, np.newaxis]) @ np.swapaxes(turn, 1, 2)

    def horizontal_distance(self, points_m: FloatArray) -> FloatArray:
        """Return signed distances from points (..., 2 or 3) to the footprints, negative inside; (..., n_solids)."""
        dx, dy = points_m[..., :1] - self.centre_m[:, 0], points_m[..., 1:2] - self.centre_m[:, 1]
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        x, y = cos * dx + sin * dy, cos * dy - sin * dx
        half_x, half_y = self.half_size_m.T
        beyond_x, beyond_y = np.abs(x) - half_x, np.abs(y) - half_y
        outside = np.sqrt(np.square(np.maximum(beyond_x, 0.0)) + np.square(np.maximum(beyond_y, 0.0)))
        return outside + np.minimum(np.maximum(beyond_x, beyond_y), 0.0) - self.radius_m

    def distance(self, points_m: FloatArray) -> FloatArray:
        """Return signed distances from points (..., 3) to the surfaces, negative inside; shape (..., n_solids)."""
        sideways = self.horizontal_distance(points_m)
        height_m = points_m[..., 2, np.newaxis]
        upward = np.maximum(height_m - self.top_m, self.bottom_m - height_m)
        outside = np.hypot(np.maximum(sideways, 0.0), np.maximum(upward, 0.0))
        return np.where((sideways > 0) | (upward > 0), outside, np.maximum(sideways, upward))
