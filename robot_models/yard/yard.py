"""Yard data: fence, equipment, and candidate discharge sites on the equipment.

World frame: x east, y north, z up, origin on the ground at the south-west corner of the rectangle around the fence.
This module does not need MuJoCo, so that scenarios can be checked and paths planned without a model.
"""

from collections.abc import Mapping
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, Field, model_validator

from dirmusic.arrays import BoolArray, FloatArray, IntArray
from pdpatrol.robot_models.yard.pieces import Equipment, placed_solids
from pdpatrol.robot_models.yard.polygon import Polygon, PolygonCorners
from pdpatrol.robot_models.yard.quantities import LEAST_YARD_M, MOST_PIECES, MOST_YARD_M, YardLength
from pdpatrol.robot_models.yard.solids import YardSolids

FENCE_TOLERANCE_M = 0.01
"""Largest length by which equipment may extend beyond the fence. Assumed: the width of a pencil line on a yard plan."""

FENCE_SPACING_M = 0.1
"""Distance of the points of a fence that are looked for within equipment. Assumed; no kind is thinner."""

SIDES = ("south", "east", "north", "west")
"""Names of the sides of a rectangular fence. The sides of a polygon are numbered from 1, counter-clockwise."""

TILE_M = 5.0
"""Side of the tiles into which points are grouped when many distances are computed."""

ROBOT_HEIGHT_M = 0.75
"""Maximum height of a robot (assumed). Robots can pass below equipment whose bottom is higher."""


def _leave_size_to_the_fence(schema: dict[str, Any]) -> None:
    """State in the JSON Schema that the size may be left out."""
    schema["required"].remove("size_m")


class Yard(
    BaseModel,
    frozen=True,
    strict=True,
    extra="forbid",
    allow_inf_nan=False,
    json_schema_extra=_leave_size_to_the_fence,
):
    """Fenced yard with equipment."""

    size_m: tuple[YardLength, YardLength]
    """Length along x (east) and y (north). Required without `fence_m`, and otherwise its extent."""
    fence_m: PolygonCorners | None = None
    """Corners of a polygonal fence in order, with 0 as the lowest x and y; by default the fence is a rectangle."""
    equipment: tuple[Equipment, ...] = Field(default=(), max_length=MOST_PIECES)
    """Pieces of equipment: of a kind from the catalogue, or a box or cylinder."""

    @model_validator(mode="before")
    @classmethod
    def _size_is_that_of_the_fence(cls, data: Any) -> Any:  # noqa: ANN401 - files may contain any value
        """Add the size of a polygonal fence, if that can be computed."""
        if not isinstance(data, Mapping) or data.get("size_m") is not None or data.get("fence_m") is None:
            return data
        try:
            x_m, y_m = np.array(data["fence_m"], dtype=np.float64).max(axis=0).clip(LEAST_YARD_M, MOST_YARD_M).tolist()
        except (TypeError, ValueError):
            x_m = y_m = 1.0  # the fence has an error, which is reported
        return {**data, "size_m": (x_m, y_m)}

    @model_validator(mode="after")
    def _names_are_unique_and_inside(self) -> Self:
        errors: list[str] = []
        if self.fence_m is not None:
            low_m, high_m = np.min(self.fence_m, axis=0).tolist(), np.max(self.fence_m, axis=0).tolist()
            if low_m != [0.0, 0.0]:
                errors.append(f"fence_m: the lowest x and y must be 0, got {low_m[0]:g} and {low_m[1]:g}")
            elif tuple(high_m) != self.size_m:
                errors.append(f"size_m: must be {tuple(high_m)}, the extent of fence_m, or left out, got {self.size_m}")
            if errors:
                raise ValueError("\n".join(errors))
        names = [item.name for item in self.equipment]
        for index, item in enumerate(self.equipment):
            if item.name in names[:index]:
                errors.append(f"equipment.{index}.name: must be unique, got `{item.name}` again")
            if (across_m := self.across_fence(item)) > FENCE_TOLERANCE_M:
                errors.append(
                    f"equipment.{index}.position_m: all of `{item.name}` must lie in {self._inside}; at "
                    f"{item.position_m} it extends {across_m:.2f} m beyond the fence"
                )
        if errors:
            raise ValueError("\n".join(errors))
        return self

    @property
    def _inside(self) -> str:
        return f"(0, 0) to {self.size_m}" if self.fence_m is None else "the fence, `fence_m`"

    @cached_property
    def fence(self) -> Polygon:
        """Fence as a polygon."""
        x_m, y_m = self.size_m
        return Polygon(self.fence_m or ((0.0, 0.0), (x_m, 0.0), (x_m, y_m), (0.0, y_m)))

    @property
    def side_names(self) -> tuple[str, ...]:
        """Names of the sides of the fence, `fence/SIDE`, in their order."""
        sides = SIDES if self.fence_m is None else range(1, 1 + len(self.fence_m))
        return tuple(f"fence/{side}" for side in sides)

    def fence_solids(self, thickness_m: float, height_m: float) -> YardSolids:
        """Return a box for each side of the fence, with its inner face on the side; the owner is the side."""
        fence, zeros = self.fence, np.zeros(len(self.side_names))
        outward = np.column_stack([fence.along[:, 1], -fence.along[:, 0]])
        middle_m = 0.5 * (fence.corners_m + np.roll(fence.corners_m, -1, axis=0))
        angle = np.arctan2(fence.along[:, 1], fence.along[:, 0])
        n_quarters = np.round(angle / (0.5 * np.pi))  # boxes along x and y are not turned, so that no digit is lost
        half_m = 0.5 * np.column_stack([fence.length_m, np.full(zeros.size, thickness_m)])
        is_upright = n_quarters.astype(int) % 2 == 1
        half_m[is_upright] = half_m[is_upright, ::-1]
        return YardSolids(
            centre_m=middle_m + 0.5 * thickness_m * outward,
            yaw_rad=angle - n_quarters * (0.5 * np.pi),
            half_size_m=half_m,
            radius_m=zeros,
            bottom_m=zeros,
            top_m=zeros + height_m,
            owner=np.arange(zeros.size),
        )

    @cached_property
    def _fence_points_m(self) -> FloatArray:
        """Points on a fence that is not convex, of which equipment must be free; shape (n, 2)."""
        return np.empty((0, 2)) if self.fence.is_convex else self.fence.sampled(FENCE_SPACING_M)

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
        beyond_m = -float(self.to_fence(item.solids).min())
        if len(self._fence_points_m):  # a corner that points inwards may lie in the piece
            low_m, high_m = item.solids.extent_m
            is_near = ((self._fence_points_m > low_m) & (self._fence_points_m < high_m)).all(axis=-1)
            within_m = -item.solids.horizontal_distance(self._fence_points_m[is_near])
            beyond_m = max(beyond_m, float(within_m.max(initial=-np.inf)))
        return beyond_m

    def to_fence(self, solids: YardSolids) -> FloatArray:
        """Return the distance of each solid's corners or outline from the fence, negative beyond it, (n_solids,)."""
        return self.fence.signed_distance(solids.corners_m).min(axis=-1) - solids.radius_m

    def contains(self, points_m: ArrayLike) -> BoolArray:
        """Return whether world points (..., 2 or 3) lie inside the fence; shape (...)."""
        points = np.asarray(points_m, dtype=np.float64)[..., :2]
        return self.fence.signed_distance(points) >= 0.0

    def clearance(self, points_m: ArrayLike) -> FloatArray:
        """Return the horizontal distance from world points (..., 2) to the nearest obstacle or fence; negative inside.

        Equipment that a robot can pass below is not an obstacle.
        """
        points = np.asarray(points_m, dtype=np.float64)[..., :2]
        return np.minimum(self.fence.signed_distance(points), self._to_equipment(points))

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
        names = [*self.side_names]
        names += [f"equipment/{self.equipment[owner].name}" for owner in self.owner.tolist()]
        to_equipment = np.abs(self.solids.horizontal_distance(points))
        to_equipment[:, self.solids.bottom_m >= ROBOT_HEIGHT_M] = np.inf
        to_sides = np.column_stack([self.fence.to_side(points, side) for side in range(len(self.side_names))])
        distance_m = np.concatenate([to_sides, to_equipment], axis=-1)
        return {names[k] for k in set(distance_m.argmin(axis=-1).tolist())}
