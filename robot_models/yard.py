"""The yard as data: its fence, its equipment, and where on the equipment a discharge may sit.

World frame: x east, y north, z up, origin on the ground at the south-west corner of the fence. Nothing here
needs MuJoCo, so a scenario can be checked, and a path planned, without building a model.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, Field, PositiveFloat, model_validator

FloatArray = NDArray[np.float64]

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
YardLength = Annotated[float, Field(gt=0.0, le=200.0)]

SURFACE_TOLERANCE_M = 0.01
"""How far from the surface a site may be written (assumed; the width of a pencil line on a yard plan)."""

SITE_STANDOFF_M = 0.02
"""How far outside the surface a discharge on a site radiates (assumed), so that its own face does not hide it."""


class _Equipment(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """What box and cylinder share: a solid that stands on the ground and hides what is behind it."""

    name: Name
    kind: Name = Field(description="kind of equipment, for example power_transformer")
    position_m: tuple[float, float] = Field(description="centre of the footprint, world frame")
    yaw_deg: float = 0.0
    height_m: PositiveFloat
    sites: Mapping[Name, tuple[float, float, float]] = Field(
        default_factory=dict, description="candidate discharge sites on the surface, equipment frame (z from ground)"
    )

    def _footprint_distance(self, local_m: FloatArray) -> FloatArray:
        """Signed distance of (..., 2) points in the equipment frame to the footprint, negative inside."""
        raise NotImplementedError

    def _footprint_crossed(self, start_m: FloatArray, end_m: FloatArray) -> NDArray[np.bool_]:
        """Whether segments between points (..., 2) of the equipment frame cross the footprint; shape (...)."""
        raise NotImplementedError

    def _to_local(self, points_m: FloatArray) -> FloatArray:
        cos, sin = np.cos(np.radians(self.yaw_deg)), np.sin(np.radians(self.yaw_deg))
        x, y = np.moveaxis(points_m[..., :2] - np.asarray(self.position_m), -1, 0)
        return np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)

    def horizontal_distance(self, points_m: ArrayLike) -> FloatArray:
        """Signed distance of world points (..., 2 or 3) to the footprint, negative inside; shape (...), metres."""
        return self._footprint_distance(self._to_local(np.asarray(points_m, dtype=np.float64)))

    def crossed(self, start_m: FloatArray, end_m: FloatArray) -> NDArray[np.bool_]:
        """Whether horizontal segments between world points (..., 2) cross the footprint; shape (...)."""
        return self._footprint_crossed(self._to_local(start_m), self._to_local(end_m))

    def distance(self, points_m: ArrayLike) -> FloatArray:
        """Signed distance of world points (..., 3) to the solid, negative inside; shape (...), metres."""
        points = np.asarray(points_m, dtype=np.float64)
        sideways = self.horizontal_distance(points)
        upward = np.maximum(points[..., 2] - self.height_m, -points[..., 2])
        outside = np.hypot(np.maximum(sideways, 0.0), np.maximum(upward, 0.0))
        return np.where((sideways > 0) | (upward > 0), outside, np.maximum(sideways, upward))

    def site_position(self, site: str) -> FloatArray:
        """Where a discharge on `site` radiates: the site moved `SITE_STANDOFF_M` out of the surface; (3,), world."""
        local = np.asarray(self.sites[site])
        cos, sin = np.cos(np.radians(self.yaw_deg)), np.sin(np.radians(self.yaw_deg))
        on_surface = np.array(
            [
                self.position_m[0] + cos * local[0] - sin * local[1],
                self.position_m[1] + sin * local[0] + cos * local[1],
                local[2],
            ]
        )
        step = 1e-4 * np.eye(3)
        gradient = self.distance(on_surface + step) - self.distance(on_surface - step)
        return on_surface + SITE_STANDOFF_M * gradient / np.linalg.norm(gradient)

    @model_validator(mode="after")
    def _sites_lie_on_the_surface(self) -> Self:
        faults: list[str] = []
        for site, (x, y, z) in self.sites.items():
            sideways = float(self._footprint_distance(np.array([x, y])))
            on_side = abs(sideways) <= SURFACE_TOLERANCE_M and 0 < z <= self.height_m
            on_top = abs(z - self.height_m) <= SURFACE_TOLERANCE_M and sideways <= SURFACE_TOLERANCE_M
            if not (on_side or on_top):
                faults.append(
                    f"sites.{site}: ({x:g}, {y:g}, {z:g}) is {abs(sideways):.2f} m "
                    f"{'inside' if sideways < 0 else 'outside'} the outline at height {z:g} m of {self.height_m:g} m; "
                    f"allowed is the surface, to {SURFACE_TOLERANCE_M} m: a side, or the top"
                )
        if faults:
            raise ValueError("\n".join(faults))
        return self


class BoxEquipment(_Equipment, frozen=True):
    """Equipment with a rectangular footprint: a tank, a cabinet, a building."""

    shape: Literal["box"]
    footprint_m: tuple[PositiveFloat, PositiveFloat] = Field(description="length along x and y of the equipment frame")

    def _footprint_distance(self, local_m: FloatArray) -> FloatArray:
        beyond = np.abs(local_m) - 0.5 * np.asarray(self.footprint_m)
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1)
        return outside + np.minimum(beyond.max(axis=-1), 0.0)

    def _footprint_crossed(self, start_m: FloatArray, end_m: FloatArray) -> NDArray[np.bool_]:
        along = end_m - start_m
        along = np.where(np.abs(along) < 1e-12, 1e-12, along)
        half = 0.5 * np.asarray(self.footprint_m)
        first, second = (-half - start_m) / along, (half - start_m) / along
        enters, leaves = np.minimum(first, second).max(axis=-1), np.maximum(first, second).min(axis=-1)
        return np.maximum(enters, 0.0) < np.minimum(leaves, 1.0)


class CylinderEquipment(_Equipment, frozen=True):
    """Equipment with a round footprint: a bushing, a current transformer, a tank."""

    shape: Literal["cylinder"]
    radius_m: PositiveFloat

    def _footprint_distance(self, local_m: FloatArray) -> FloatArray:
        return np.linalg.norm(local_m, axis=-1) - self.radius_m

    def _footprint_crossed(self, start_m: FloatArray, end_m: FloatArray) -> NDArray[np.bool_]:
        along = end_m - start_m
        length = np.maximum(np.square(along).sum(axis=-1), 1e-24)
        nearest = np.clip(-(start_m * along).sum(axis=-1) / length, 0.0, 1.0)
        return self._footprint_distance(start_m + nearest[..., np.newaxis] * along) < 0


Equipment = Annotated[BoxEquipment | CylinderEquipment, Field(discriminator="shape")]


class Yard(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """A fenced rectangle of ground with equipment on it."""

    size_m: tuple[YardLength, YardLength] = Field(description="length along x (east) and y (north), at most 200 m")
    equipment: tuple[Equipment, ...] = ()

    @model_validator(mode="after")
    def _names_are_unique_and_inside(self) -> Self:
        faults: list[str] = []
        names = [item.name for item in self.equipment]
        for index, item in enumerate(self.equipment):
            if item.name in names[:index]:
                faults.append(f"equipment.{index}.name: `{item.name}` is taken; allowed is a name used once")
            if not self.contains(item.position_m):
                faults.append(
                    f"equipment.{index}.position_m: {item.position_m} is outside the yard; "
                    f"allowed is (0, 0) to {self.size_m}"
                )
        if faults:
            raise ValueError("\n".join(faults))
        return self

    def faces(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, NDArray[np.intp]]:
        """Flat rectangles that radio waves are mirrored by: the ground, and the four sides and the top of every box.

        Returns:
            Plain arrays, world frame: centres (n_faces, 3); unit normals out of the equipment (n_faces, 3); unit
            vectors along the two sides (n_faces, 2, 3); half the length of the two sides (n_faces, 2), infinite for the
            ground; and the number of the piece of equipment, -1 for the ground (n_faces,).
        """
        faces = [(np.zeros(3), np.eye(3)[2], np.eye(3)[:2], np.full(2, np.inf), -1)]
        for number, item in enumerate(self.equipment):
            if not isinstance(item, BoxEquipment):
                continue
            yaw = np.radians(item.yaw_deg)
            x, y = np.array([[np.cos(yaw), np.sin(yaw), 0.0], [-np.sin(yaw), np.cos(yaw), 0.0]])
            up = np.array([0.0, 0.0, 1.0])
            half_x, half_y, half_z = 0.5 * item.footprint_m[0], 0.5 * item.footprint_m[1], 0.5 * item.height_m
            middle = np.array([*item.position_m, half_z])
            for normal, depth, (first, second) in (
                (x, half_x, ((y, half_y), (up, half_z))),
                (-x, half_x, ((y, half_y), (up, half_z))),
                (y, half_y, ((x, half_x), (up, half_z))),
                (-y, half_y, ((x, half_x), (up, half_z))),
                (up, half_z, ((x, half_x), (y, half_y))),
            ):
                axes, half_size_m = np.array([first[0], second[0]]), np.array([first[1], second[1]])
                faces.append((middle + depth * normal, normal, axes, half_size_m, number))
        centre, normal, sides, half_size, owner = (np.array(column) for column in zip(*faces, strict=True))
        return centre, normal, sides, half_size, owner.astype(np.intp)

    def contains(self, points_m: ArrayLike) -> NDArray[np.bool_]:
        """Whether world points (..., 2 or 3) lie inside the fence; shape (...)."""
        points = np.asarray(points_m, dtype=np.float64)[..., :2]
        return np.all((points >= 0.0) & (points <= np.asarray(self.size_m)), axis=-1)

    def clearance(self, points_m: ArrayLike) -> FloatArray:
        """Horizontal distance of world points (..., 2) to the nearest equipment or fence, negative inside; metres."""
        points = np.asarray(points_m, dtype=np.float64)[..., :2]
        to_fence = np.minimum(points, np.asarray(self.size_m) - points).min(axis=-1)
        return np.minimum.reduce([to_fence, *(item.horizontal_distance(points) for item in self.equipment)])

    def in_sight(self, points_m: ArrayLike, target_m: ArrayLike, ignore_m: float = 0.0) -> NDArray[np.bool_]:
        """Whether no equipment lies between points (n, 2) and a target (2,), on plan; shape (n,).

        Args:
            points_m: World frame.
            target_m: World frame.
            ignore_m: Equipment in so much of the way at the target's end does not count: a target on a surface, or a
                little within it, is in sight from outside.
        """
        points, target = np.asarray(points_m, dtype=np.float64), np.asarray(target_m, dtype=np.float64)
        sight = target - points
        range_m = np.linalg.norm(sight, axis=-1, keepdims=True)
        end = target - sight * np.minimum(ignore_m / np.maximum(range_m, 1e-9), 1.0)
        clear = np.ones(len(points), dtype=np.bool_)
        for item in self.equipment:
            clear &= ~item.crossed(points, end)
        return clear

    def site_names(self) -> tuple[str, ...]:
        """Every candidate discharge site as `equipment/site`, in file order."""
        return tuple(f"{item.name}/{site}" for item in self.equipment for site in item.sites)

    def site_position(self, name: str) -> FloatArray:
        """World position (3,) at which a discharge on the site `equipment/site` radiates, metres."""
        equipment, _, site = name.partition("/")
        for item in self.equipment:
            if item.name == equipment and site in item.sites:
                return item.site_position(site)
        raise ValueError(f"no site `{name}` in this yard; known are {', '.join(self.site_names()) or 'none'}")

    def enclosing_equipment(self, position_m: ArrayLike) -> str | None:
        """Name of the equipment that encloses a world position (3,), or None."""
        return next((item.name for item in self.equipment if item.distance(position_m) < 0), None)

    def nearest_equipment(self, position_m: ArrayLike) -> str | None:
        """Name of the equipment whose outline is horizontally nearest to a world position (2,), or None."""
        if not self.equipment:
            return None
        return min(self.equipment, key=lambda item: float(item.horizontal_distance(position_m))).name
