"""Boxes and upright cylinders: as data in the frame of their equipment, and many of them at once in the yard."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, NonNegativeFloat, PositiveFloat

FloatArray = NDArray[np.float64]


class Solid(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """What box and cylinder share; frame of the equipment: footprint as at yaw 0, z up from the ground."""

    centre_m: tuple[float, float] = (0.0, 0.0)
    bottom_m: NonNegativeFloat = 0.0
    top_m: PositiveFloat


class Box(Solid, frozen=True):
    """A tank, a cabinet, a wall."""

    footprint_m: tuple[PositiveFloat, PositiveFloat]


class Cylinder(Solid, frozen=True):
    """A bushing, an insulator, a pole."""

    radius_m: PositiveFloat


class Placed(NamedTuple):
    """A solid where its equipment stands: position of that on the ground, and its yaw."""

    solid: Solid
    position_m: tuple[float, float]
    yaw_rad: float


class Solids:
    """Many solids at once, world frame. The last axis of every result runs over the solids.

    Args:
        placed: The solids and where they stand.

    Attributes:
        centre_m: Middle of the footprints, shape (n_solids, 2).
        yaw_rad: Shape (n_solids,).
        half_size_m: Half the sides of boxes, shape (n_solids, 2); 0 for cylinders.
        radius_m: Of cylinders, shape (n_solids,); 0 for boxes.
        bottom_m: Height above ground, shape (n_solids,).
        top_m: Height above ground, shape (n_solids,).
    """

    def __init__(self, placed: Sequence[Placed]) -> None:
        self.yaw_rad = np.array([yaw for _, _, yaw in placed], dtype=np.float64)
        self._cos, self._sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        own = np.array([solid.centre_m for solid, _, _ in placed], dtype=np.float64).reshape(-1, 2)
        turned = np.stack(
            [self._cos * own[:, 0] - self._sin * own[:, 1], self._sin * own[:, 0] + self._cos * own[:, 1]], axis=-1
        )
        self.centre_m: FloatArray = np.array([at for _, at, _ in placed], dtype=np.float64).reshape(-1, 2) + turned
        sides = [solid.footprint_m if isinstance(solid, Box) else (0.0, 0.0) for solid, _, _ in placed]
        self.half_size_m = 0.5 * np.array(sides, dtype=np.float64).reshape(-1, 2)
        self.radius_m = np.array(
            [solid.radius_m if isinstance(solid, Cylinder) else 0.0 for solid, _, _ in placed], dtype=np.float64
        )
        self.bottom_m = np.array([solid.bottom_m for solid, _, _ in placed], dtype=np.float64)
        self.top_m = np.array([solid.top_m for solid, _, _ in placed], dtype=np.float64)

    def take(self, chosen: NDArray[np.bool_]) -> Solids:
        """The solids that a mask (n_solids,) marks, in the same order."""
        some = object.__new__(Solids)
        for name, column in vars(self).items():
            setattr(some, name, column[chosen])
        return some

    @property
    def extent_m(self) -> tuple[FloatArray, FloatArray]:
        """South-west and north-east corner of what all of them cover, each (2,)."""
        turn = np.abs(np.array([[self._cos, self._sin], [self._sin, self._cos]]))
        half_m = np.einsum("ijn,nj->ni", turn, self.half_size_m) + self.radius_m[:, np.newaxis]
        return (self.centre_m - half_m).min(axis=0), (self.centre_m + half_m).max(axis=0)

    def horizontal_distance(self, points_m: FloatArray) -> FloatArray:
        """Signed distance of points (..., 2 or 3) to the footprints, negative inside; (..., n_solids), metres."""
        x, y = self._local(points_m)
        half_x, half_y = self.half_size_m.T
        beyond_x, beyond_y = np.abs(x) - half_x, np.abs(y) - half_y
        outside = np.sqrt(np.square(np.maximum(beyond_x, 0.0)) + np.square(np.maximum(beyond_y, 0.0)))
        return outside + np.minimum(np.maximum(beyond_x, beyond_y), 0.0) - self.radius_m

    def distance(self, points_m: FloatArray) -> FloatArray:
        """Signed distance of points (..., 3) to the surfaces, negative inside; shape (..., n_solids), metres."""
        sideways = self.horizontal_distance(points_m)
        height_m = points_m[..., 2, np.newaxis]
        upward = np.maximum(height_m - self.top_m, self.bottom_m - height_m)
        outside = np.hypot(np.maximum(sideways, 0.0), np.maximum(upward, 0.0))
        return np.where((sideways > 0) | (upward > 0), outside, np.maximum(sideways, upward))

    def _local(self, points_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Points (..., 2 or 3) in the frame of each footprint: along and across it, both (..., n_solids)."""
        x, y = points_m[..., :1] - self.centre_m[:, 0], points_m[..., 1:2] - self.centre_m[:, 1]
        return self._cos * x + self._sin * y, self._cos * y - self._sin * x
