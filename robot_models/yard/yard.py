"""Yard data: fence, equipment, and candidate discharge sites on the equipment.

World frame: x east, y north, z up, origin on the ground at the south-west corner of the fence. This module does not
need MuJoCo, so that scenarios can be checked and paths planned without a model.
"""

from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, Field, model_validator

from dirmusic.arrays import BoolArray, FloatArray, IntArray
from pdpatrol.robot_models.yard.pieces import Equipment, placed_solids
from pdpatrol.robot_models.yard.quantities import MOST_PIECES, YardLength
from pdpatrol.robot_models.yard.solids import YardSolids

FENCE_TOLERANCE_M = 0.01
"""Largest length by which equipment may extend beyond the fence. Assumed: the width of a pencil line on a yard plan."""

TILE_M = 5.0
"""Side of the tiles into which points are grouped when many distances are computed."""

ROBOT_HEIGHT_M = 0.75
"""Maximum height of a robot (assumed). Robots can pass below equipment whose bottom is higher."""


class Yard(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """Fenced rectangular yard with equipment."""

    size_m: tuple[YardLength, YardLength] = Field(description="length along x (east) and y (north), at most 400 m")
    equipment: tuple[Equipment, ...] = Field(default=(), max_length=MOST_PIECES)

    @model_validator(mode="after")
    def _names_are_unique_and_inside(self) -> Self:
        errors: list[str] = []
        names = [item.name for item in self.equipment]
        for index, item in enumerate(self.equipment):
            if item.name in names[:index]:
                errors.append(f"equipment.{index}.name: must be unique, got `{item.name}` again")
            if (across_m := self.across_fence(item)) > FENCE_TOLERANCE_M:
                errors.append(
                    f"equipment.{index}.position_m: all of `{item.name}` must lie in (0, 0) to {self.size_m}; at "
                    f"{item.position_m} it extends {across_m:.2f} m beyond the fence"
                )
        if errors:
            raise ValueError("\n".join(errors))
        return self

    @cached_property
    def solids(self) -> YardSolids:
        """Parts of all equipment, world frame, in file order."""
        return placed_solids(self.equipment)

    @property
    def owner(self) -> IntArray:
        """Index of the piece of equipment that each solid belongs to, shape (n_solids,)."""
        return self.solids.owner

    @cached_property
    def _obstacles(self) -> YardSolids:
        """Solids that a robot cannot pass below."""
        return self.solids.take(self.solids.bottom_m < ROBOT_HEIGHT_M)

    def across_fence(self, item: Equipment) -> float:
        """Return the horizontal distance by which a piece of equipment extends beyond the fence; negative inside."""
        low_m, high_m = item.solids.extent_m
        return float(np.maximum(-low_m, high_m - self.size_m).max())

    def contains(self, points_m: ArrayLike) -> BoolArray:
        """Return whether world points (..., 2 or 3) lie inside the fence; shape (...)."""
        points = np.asarray(points_m, dtype=np.float64)[..., :2]
        return np.all((points >= 0.0) & (points <= self.size_m), axis=-1)

    def clearance(self, points_m: ArrayLike) -> FloatArray:
        """Return the horizontal distance from world points (..., 2) to the nearest obstacle or fence; negative inside.

        Equipment that a robot can pass below is not an obstacle.
        """
        points = np.asarray(points_m, dtype=np.float64)[..., :2]
        to_fence = np.minimum(points, self.size_m - points).min(axis=-1)
        return np.minimum(to_fence, self._to_equipment(points))

    def _to_equipment(self, points_m: FloatArray) -> FloatArray:
        """Return the horizontal distance from points (..., 2) to the nearest obstacle, tile by tile for many distances.

        If one solid is farther from the middle of a tile than another by more than the tile's diagonal, it cannot be
        the nearest solid to any point of the tile. Leaving out such solids makes time and memory almost independent of
        the amount of equipment.
        """
        solids = self._obstacles
        if points_m.size * solids.yaw_rad.size <= 2_000_000:
            return solids.horizontal_distance(points_m).min(axis=-1, initial=np.inf)
        flat_m = points_m.reshape(-1, 2)
        tiles, tile = np.unique(np.floor(flat_m / TILE_M), axis=0, return_inverse=True)
        order = np.argsort(tile, kind="stable")
        least_m = np.empty(len(flat_m))
        for corner, rows in zip(tiles, np.split(order, np.cumsum(np.bincount(tile))[:-1]), strict=True):
            far_m = solids.horizontal_distance(TILE_M * (corner + 0.5))
            near = solids.take(far_m <= far_m.min() + np.sqrt(2.0) * TILE_M)
            least_m[rows] = near.horizontal_distance(flat_m[rows]).min(axis=-1)
        return least_m.reshape(points_m.shape[:-1])

    def free_place(self, rng: np.random.Generator, clearance_m: float) -> FloatArray:
        """Draw a place on the ground with at least a given clearance, uniformly distributed, shape (2,)."""
        while True:
            place_m = rng.uniform([0.0, 0.0], self.size_m)
            if self.clearance(place_m) >= clearance_m:
                return place_m

    @cached_property
    def _sites(self) -> dict[str, tuple[Equipment, str]]:
        """Piece and own name of each site, by `equipment/site`, in file order."""
        return {f"{item.name}/{site}": (item, site) for item in self.equipment for site in item.assembly.sites}

    def site_names(self) -> tuple[str, ...]:
        """List every candidate discharge site as `equipment/site`, in file order."""
        return tuple(self._sites)

    def site_position(self, name: str) -> FloatArray:
        """Return the world position (3,), metres, from which a discharge on the site `equipment/site` radiates."""
        if name not in self._sites:
            raise ValueError(f"no site `{name}` in this yard; available: {', '.join(self._sites) or 'none'}")
        item, site = self._sites[name]
        return item.site_position(site)

    def enclosing_equipment(self, points_m: ArrayLike) -> str | None:
        """Return the name of the first piece of equipment that encloses a world point, or None.

        Args:
            points_m: One point, shape (3,), or several of which any may be enclosed, shape (n, 3).
        """
        is_inside = self.solids.distance(np.atleast_2d(np.asarray(points_m, dtype=np.float64))) < 0
        owners = self.owner[is_inside.any(axis=0)]
        return self.equipment[int(owners[0])].name if owners.size else None

    def obstacles_at(self, points_m: ArrayLike) -> set[str]:
        """Return the set of names of the obstacles nearest to world points (n, 2): `equipment/NAME`, `fence/SIDE`."""
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
        names = ["fence/west", "fence/south", "fence/east", "fence/north"]
        names += [f"equipment/{self.equipment[owner].name}" for owner in self.owner.tolist()]
        to_equipment = np.abs(self.solids.horizontal_distance(points))
        to_equipment[:, self.solids.bottom_m >= ROBOT_HEIGHT_M] = np.inf
        distance_m = np.concatenate([points, self.size_m - points, to_equipment], axis=-1)
        return {names[k] for k in set(distance_m.argmin(axis=-1).tolist())}
