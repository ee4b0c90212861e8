"""The yard as data: its fence, its equipment, and where on the equipment a discharge may sit.

World frame: x east, y north, z up, origin on the ground at the south-west corner of the fence. Nothing here
needs MuJoCo, so a scenario can be checked, and a path planned, without building a model.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, Discriminator, Field, PositiveFloat, Tag, model_validator

from robot_models.equipment import CATALOGUE, Assembly
from robot_models.yard.solids import Box, Cylinder, Placed, Solids

FloatArray = NDArray[np.float64]

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
YardLength = Annotated[float, Field(gt=0.0, le=200.0)]
Sites = Mapping[Name, tuple[float, float, float]]

SURFACE_TOLERANCE_M = 0.01
"""How far from the surface a site may be written (assumed; the width of a pencil line on a yard plan)."""

SITE_STANDOFF_M = 0.02
"""How far outside the surface a discharge on a site radiates (assumed), so that its own face does not hide it."""

ROBOT_HEIGHT_M = 0.75
"""The robot passes below what begins higher than this: its own height and a hand's breadth."""

SIGHT_HEIGHT_M = 2.0
"""On plan, what begins higher than this hides nothing from a robot whose antennas are 0.6 m high (assumed)."""

KERB_HEIGHT_M = 0.4
"""On plan, what ends lower than this, such as a kerb or a door step, hides nothing from those antennas (assumed)."""


class _Equipment(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """What all pieces share: a name, a kind, and a place on the ground."""

    name: Name
    position_m: tuple[float, float] = Field(description="centre of the footprint, world frame")
    yaw_deg: float = 0.0

    @property
    def assembly(self) -> Assembly:
        """Parts and sites, in the equipment's own frame."""
        raise NotImplementedError

    @property
    def placed(self) -> tuple[Placed, ...]:
        """Its parts where they stand."""
        return tuple(Placed(part, self.position_m, np.radians(self.yaw_deg)) for part in self.assembly.parts.values())

    @cached_property
    def solids(self) -> Solids:
        """Its parts, world frame."""
        return Solids(self.placed)

    def site_position(self, site: str) -> FloatArray:
        """Where a discharge on `site` radiates: the site moved `SITE_STANDOFF_M` out of the surface; (3,), world."""
        x, y, z = self.assembly.sites[site]
        cos, sin = np.cos(np.radians(self.yaw_deg)), np.sin(np.radians(self.yaw_deg))
        on_surface = np.array([self.position_m[0] + cos * x - sin * y, self.position_m[1] + sin * x + cos * y, z])
        step = 1e-4 * np.eye(3)
        gradient = self._distance(on_surface + step) - self._distance(on_surface - step)
        return on_surface + SITE_STANDOFF_M * gradient / np.linalg.norm(gradient)

    def _distance(self, points_m: FloatArray) -> FloatArray:
        return self.solids.distance(points_m).min(axis=-1)


class _PlainEquipment(_Equipment, frozen=True):
    """One solid that stands on the ground."""

    kind: Name = Field(description="kind of equipment, for example power_transformer")
    height_m: PositiveFloat
    sites: Sites = Field(
        default_factory=dict, description="candidate discharge sites on the surface, equipment frame (z from ground)"
    )

    @model_validator(mode="after")
    def _sites_lie_on_the_surface(self) -> Self:
        faults: list[str] = []
        at_origin = Solids([Placed(part, (0.0, 0.0), 0.0) for part in self.assembly.parts.values()])
        for site, (x, y, z) in self.sites.items():
            sideways = float(at_origin.horizontal_distance(np.array([x, y])).min())
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


class BoxEquipment(_PlainEquipment, frozen=True):
    """A single box: a tank, a cabinet, a building."""

    shape: Literal["box"]
    footprint_m: tuple[PositiveFloat, PositiveFloat] = Field(description="length along x and y of the equipment frame")

    @property
    def assembly(self) -> Assembly:
        """See `_Equipment`."""
        return Assembly({"body": Box(footprint_m=self.footprint_m, top_m=self.height_m)}, self.sites)


class CylinderEquipment(_PlainEquipment, frozen=True):
    """A single upright cylinder: a bushing, a current transformer, a tank."""

    shape: Literal["cylinder"]
    radius_m: PositiveFloat

    @property
    def assembly(self) -> Assembly:
        """See `_Equipment`."""
        return Assembly({"body": Cylinder(radius_m=self.radius_m, top_m=self.height_m)}, self.sites)


class CatalogueEquipment(_Equipment, frozen=True):
    """Equipment of a kind whose shape and sites are known: see `robot_models/equipment`."""

    shape: Literal["catalogue"] = "catalogue"
    kind: str
    length_m: PositiveFloat | None = Field(default=None, description="along x of its own frame, where a kind stretches")

    @model_validator(mode="after")
    def _is_in_the_catalogue(self) -> Self:
        kind = CATALOGUE.get(self.kind)
        if kind is None:
            raise ValueError(
                f"kind: no shape is known for `{self.kind}`; allowed are {', '.join(CATALOGUE)}, or any kind with "
                'shape = "box" or "cylinder"'
            )
        if self.length_m is not None and not kind.stretches:
            raise ValueError(f"length_m: got {self.length_m:g}; allowed is none, for a {self.kind} has one size")
        return self

    @property
    def assembly(self) -> Assembly:
        """See `_Equipment`."""
        kind = CATALOGUE[self.kind]
        return kind.build(kind.length_m if self.length_m is None else self.length_m)


def _shape_of(value: Any) -> str:  # noqa: ANN401 - what a file holds may be anything
    shape = value.get("shape", "catalogue") if isinstance(value, Mapping) else getattr(value, "shape", "catalogue")
    return str(shape)


Equipment = Annotated[
    Annotated[BoxEquipment, Tag("box")]
    | Annotated[CylinderEquipment, Tag("cylinder")]
    | Annotated[CatalogueEquipment, Tag("catalogue")],
    Discriminator(_shape_of),
]


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

    @cached_property
    def solids(self) -> Solids:
        """All parts of all equipment, world frame, in file order."""
        return Solids([placed for item in self.equipment for placed in item.placed])

    @cached_property
    def owner(self) -> NDArray[np.intp]:
        """Number of the piece of equipment that each of the solids belongs to, shape (n_solids,)."""
        return np.repeat(np.arange(len(self.equipment)), [len(item.placed) for item in self.equipment]).astype(np.intp)

    @cached_property
    def _in_the_robots_way(self) -> Solids:
        return self.solids.take(self.solids.bottom_m < ROBOT_HEIGHT_M)

    @cached_property
    def _in_the_line_of_sight(self) -> Solids:
        return self.solids.take((self.solids.bottom_m < SIGHT_HEIGHT_M) & (self.solids.top_m > KERB_HEIGHT_M))

    def faces(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, NDArray[np.intp]]:
        """Flat rectangles that radio waves are mirrored by: the ground, and the four sides and the top of every box.

        Returns:
            Plain arrays, world frame: centres (n_faces, 3); unit normals out of the equipment (n_faces, 3); unit
            vectors along the two sides (n_faces, 2, 3); half the length of the two sides (n_faces, 2), infinite for the
            ground; and the number of the piece of equipment, -1 for the ground (n_faces,).
        """
        faces = [(np.zeros(3), np.eye(3)[2], np.eye(3)[:2], np.full(2, np.inf), -1)]
        solids, up = self.solids, np.array([0.0, 0.0, 1.0])
        for k in np.flatnonzero(solids.radius_m == 0).tolist():
            yaw, (half_x, half_y) = solids.yaw_rad[k], solids.half_size_m[k]
            x, y = np.array([[np.cos(yaw), np.sin(yaw), 0.0], [-np.sin(yaw), np.cos(yaw), 0.0]])
            half_z = 0.5 * (solids.top_m[k] - solids.bottom_m[k])
            middle = np.array([*solids.centre_m[k], solids.bottom_m[k] + half_z])
            for normal, depth, (first, second) in (
                (x, half_x, ((y, half_y), (up, half_z))),
                (-x, half_x, ((y, half_y), (up, half_z))),
                (y, half_y, ((x, half_x), (up, half_z))),
                (-y, half_y, ((x, half_x), (up, half_z))),
                (up, half_z, ((x, half_x), (y, half_y))),
            ):
                axes, half_size_m = np.array([first[0], second[0]]), np.array([first[1], second[1]])
                faces.append((middle + depth * normal, normal, axes, half_size_m, int(self.owner[k])))
        centre, normal, sides, half_size, owner = (np.array(column) for column in zip(*faces, strict=True))
        return centre, normal, sides, half_size, owner.astype(np.intp)

    def obstacles(
        self,
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, NDArray[np.intp]]:
        """All solids as plain arrays, world frame; a row is a solid.

        Returns:
            Middle of the footprints (n, 2), yaws (n,), half sizes (n, 2), radii (n,), heights of bottom and top (n,)
            each, as of `Solids`, and the number of the piece of equipment that each belongs to (n,).
        """
        solids = self.solids
        return (
            solids.centre_m,
            solids.yaw_rad,
            solids.half_size_m,
            solids.radius_m,
            solids.bottom_m,
            solids.top_m,
            self.owner,
        )

    def contains(self, points_m: ArrayLike) -> NDArray[np.bool_]:
        """Whether world points (..., 2 or 3) lie inside the fence; shape (...)."""
        points = np.asarray(points_m, dtype=np.float64)[..., :2]
        return np.all((points >= 0.0) & (points <= np.asarray(self.size_m)), axis=-1)

    def clearance(self, points_m: ArrayLike) -> FloatArray:
        """Horizontal distance of world points (..., 2) to fence or equipment in a robot's way, negative inside."""
        points = np.asarray(points_m, dtype=np.float64)[..., :2]
        to_fence = np.minimum(points, np.asarray(self.size_m) - points).min(axis=-1)
        return np.minimum(to_fence, self._in_the_robots_way.horizontal_distance(points).min(axis=-1, initial=np.inf))

    def free_place(self, rng: np.random.Generator, clearance_m: float) -> FloatArray:
        """Somewhere on the ground with so much room around it, shape (2,), evenly drawn."""
        while True:
            place_m = rng.uniform([0.0, 0.0], self.size_m)
            if self.clearance(place_m) >= clearance_m:
                return place_m

    def in_sight(self, points_m: ArrayLike, target_m: ArrayLike, ignore_m: float = 0.0) -> NDArray[np.bool_]:
        """Whether no equipment lies between points (n, 2) and a target (2,), on plan; shape (n,).

        Args:
            points_m: World frame.
            target_m: World frame.
            ignore_m: Equipment in so much of the way at the target's end does not count, or in half its own thickness:
                a target on a surface, or a little within it, is in sight from outside, but not from beyond a post.
        """
        points, target = np.asarray(points_m, dtype=np.float64), np.asarray(target_m, dtype=np.float64)
        solids = self._in_the_line_of_sight
        crossed = solids.crossed(points, np.broadcast_to(target, points.shape), np.minimum(ignore_m, solids.depth_m))
        return np.asarray(~crossed.any(axis=-1))

    def site_names(self) -> tuple[str, ...]:
        """Every candidate discharge site as `equipment/site`, in file order."""
        return tuple(f"{item.name}/{site}" for item in self.equipment for site in item.assembly.sites)

    def site_position(self, name: str) -> FloatArray:
        """World position (3,) at which a discharge on the site `equipment/site` radiates, metres."""
        equipment, _, site = name.partition("/")
        for item in self.equipment:
            if item.name == equipment and site in item.assembly.sites:
                return item.site_position(site)
        raise ValueError(f"no site `{name}` in this yard; known are {', '.join(self.site_names()) or 'none'}")

    def enclosing_equipment(self, position_m: ArrayLike) -> str | None:
        """Name of the equipment that encloses a world position (3,), or None."""
        inside = np.flatnonzero(self.solids.distance(np.asarray(position_m, dtype=np.float64)) < 0)
        return self.equipment[int(self.owner[inside[0]])].name if inside.size else None

    def covering_equipment(self, position_m: ArrayLike) -> str | None:
        """Name of the equipment whose outline covers a world position (2,) in a robot's way, or None."""
        over = self.solids.horizontal_distance(np.asarray(position_m, dtype=np.float64)) < 0
        inside = np.flatnonzero(over & (self.solids.bottom_m < ROBOT_HEIGHT_M))
        return self.equipment[int(self.owner[inside[0]])].name if inside.size else None

    def obstacles_at(self, points_m: ArrayLike) -> set[str]:
        """What a robot touches at world points (n, 2): `equipment/NAME` or `fence/SIDE`, whichever is nearest."""
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
        names = ["fence/west", "fence/south", "fence/east", "fence/north"]
        names += [f"equipment/{self.equipment[owner].name}" for owner in self.owner.tolist()]
        to_equipment = np.abs(self.solids.horizontal_distance(points))
        to_equipment[:, self.solids.bottom_m >= ROBOT_HEIGHT_M] = np.inf
        distance_m = np.concatenate([points, np.asarray(self.size_m) - points, to_equipment], axis=-1)
        return {names[k] for k in set(distance_m.argmin(axis=-1).tolist())}

    def nearest_equipment(self, position_m: ArrayLike) -> str | None:
        """Name of the equipment whose outline is horizontally nearest to a world position (2,), or None."""
        if not self.equipment:
            return None
        distance_m = self.solids.horizontal_distance(np.asarray(position_m, dtype=np.float64))
        return self.equipment[int(self.owner[distance_m.argmin()])].name
