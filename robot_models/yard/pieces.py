"""Pieces of equipment in a yard: single boxes and cylinders, and kinds from the catalogue."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, Discriminator, Field, Tag, model_validator

from dirmusic.arrays import FloatArray
from pdpatrol.robot_models.equipment.assembly import Assembly
from pdpatrol.robot_models.equipment.catalogue import CATALOGUE, assemble
from pdpatrol.robot_models.equipment.voltages import Kv
from pdpatrol.robot_models.yard.quantities import (
    MOST_SITES,
    AssetId,
    Coordinate,
    Height,
    Length,
    Name,
    NominalKv,
    PhaseName,
    StretchedLength,
    Yaw,
)
from pdpatrol.robot_models.yard.solids import Solid, YardSolids

Sites = Annotated[Mapping[Name, tuple[Coordinate, Coordinate, Coordinate]], Field(max_length=MOST_SITES)]

SURFACE_TOLERANCE_M = 0.01
"""Maximum distance of a site from the surface of its equipment (assumed): the width of a pencil line on a yard plan."""

SITE_STANDOFF_M = 0.02
"""Distance from the surface at which a discharge at a site radiates (assumed), so that the surface does not hide it."""


class _Equipment(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """A piece of equipment with a name, a kind, and a position on the ground."""

    name: Name
    """Name of the piece, used once in the yard."""
    position_m: tuple[Coordinate, Coordinate]
    """Centre of the footprint, world frame: x east, y north."""
    yaw_deg: Yaw = 0.0
    """Rotation about the centre, counter-clockwise; at 0 the x axis of the piece points east."""
    asset_id: AssetId | None = None
    """Number in the register of the owner, for reports."""
    phase: PhaseName | None = None
    """Phase of the mains, for reports."""

    @cached_property
    def assembly(self) -> Assembly:
        """Parts and sites, in the frame of the equipment."""
        raise NotImplementedError

    @cached_property
    def solids(self) -> YardSolids:
        """Solids of the parts, world frame."""
        return placed_solids([self])

    def site_on_surface(self, site: str) -> FloatArray:
        """Return the position of a site on the surface, world frame, shape (3,)."""
        x, y, z = self.assembly.sites[site]
        cos, sin = np.cos(np.radians(self.yaw_deg)), np.sin(np.radians(self.yaw_deg))
        return np.array([self.position_m[0] + cos * x - sin * y, self.position_m[1] + sin * x + cos * y, z])

    def site_position(self, site: str) -> FloatArray:
        """Return the point from which a discharge at a site radiates, world frame, shape (3,).

        It is `SITE_STANDOFF_M` off the surface.
        """
        on_surface, step = self.site_on_surface(site), 1e-4 * np.eye(3)
        after, before = (self.solids.distance(on_surface + way).min(axis=-1) for way in (step, -step))
        return on_surface + SITE_STANDOFF_M * (after - before) / np.linalg.norm(after - before)


def placed_solids(pieces: Sequence[_Equipment]) -> YardSolids:
    """Place the solids of pieces of equipment in the world frame."""
    parts = [item.assembly.parts.values() for item in pieces]
    solids = [solid for each in parts for solid in each]
    owner = np.repeat(np.arange(len(pieces)), [len(each) for each in parts])
    columns = zip(*solids, strict=True) if solids else ((),) * 5
    top_m, bottom_m, own, sides_m, radius_m = (np.array(values, dtype=np.float64) for values in columns)
    position_m = np.array([item.position_m for item in pieces]).reshape(-1, 2)[owner]
    yaw_rad = np.radians([item.yaw_deg for item in pieces])[owner]
    (x, y), cos, sin = own.reshape(-1, 2).T, np.cos(yaw_rad), np.sin(yaw_rad)
    centre_m = position_m + np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
    return YardSolids(centre_m, yaw_rad, 0.5 * sides_m.reshape(-1, 2), radius_m, bottom_m, top_m, owner)


class _PlainEquipment(_Equipment, frozen=True):
    """A single solid on the ground."""

    kind: Name
    """Kind of equipment, which determines its material and colour."""
    height_m: Height
    """Height above the ground."""
    kv: NominalKv | None = None
    """Nominal voltage, for reports."""
    sites: Sites = Field(default_factory=dict)
    """Discharge sites on the surface by name: x and y from the centre in the frame of the piece, z from the ground."""

    @model_validator(mode="after")
    def _sites_lie_on_the_surface(self) -> Self:
        errors: list[str] = []
        for site, (x, y, z) in self.sites.items():
            off_m = float(self.solids.distance(self.site_on_surface(site)).min())
            if z <= 0 or abs(off_m) > SURFACE_TOLERANCE_M:
                where = f"{abs(off_m):.2f} m {'inside' if off_m < 0 else 'outside'}" if z > 0 else "below the ground"
                errors.append(
                    f"sites.{site}: must lie on a side or on the top, to {SURFACE_TOLERANCE_M} m; "
                    f"({x:g}, {y:g}, {z:g}) is {where}"
                )
        if errors:
            raise ValueError("\n".join(errors))
        return self


class BoxEquipment(_PlainEquipment, frozen=True):
    """A single box, such as a tank, a cabinet or a building."""

    shape: Literal["box"]
    """States that the piece is a single box."""
    footprint_m: tuple[Length, Length]
    """Length along the x axis and width along the y axis of the piece."""

    @cached_property
    def assembly(self) -> Assembly:
        """Parts and sites, in the frame of the equipment."""
        return Assembly({"body": Solid(footprint_m=self.footprint_m, top_m=self.height_m)}, self.sites)


class CylinderEquipment(_PlainEquipment, frozen=True):
    """A single upright cylinder, such as a bushing, a current transformer or a tank."""

    shape: Literal["cylinder"]
    """States that the piece is a single upright cylinder."""
    radius_m: Length
    """Radius of the cylinder."""

    @cached_property
    def assembly(self) -> Assembly:
        """Parts and sites, in the frame of the equipment."""
        return Assembly({"body": Solid(radius_m=self.radius_m, top_m=self.height_m)}, self.sites)


class CatalogueEquipment(_Equipment, frozen=True):
    """Equipment of a kind whose shape and sites are in the catalogue, see `robot_models/equipment`."""

    shape: Literal["catalogue"] = "catalogue"
    """May be left out: the kind determines the shape."""
    kind: Name
    """Kind of equipment from the catalogue."""
    length_m: StretchedLength | None = None
    """Length along the x axis of the piece, for kinds of any length; by default that of the catalogue."""
    kv: Kv | None = None
    """Voltage level, for kinds whose size depends on it; by default the size of a compact 110 kV yard."""

    @model_validator(mode="after")
    def _is_in_the_catalogue(self) -> Self:
        shape = CATALOGUE.get(self.kind)
        if shape is None:
            raise ValueError(
                f'kind: must be one of {", ".join(CATALOGUE)}, or any kind with shape = "box" or "cylinder"; '
                f"got `{self.kind}`"
            )
        if self.length_m is not None and not shape.stretches:
            raise ValueError(f"length_m: must be left out for a {self.kind}, which has one size; got {self.length_m:g}")
        if self.kv is not None and shape.build_for is None:
            raise ValueError(f"kv: must be left out for a {self.kind}, which has one size for all; got {self.kv}")
        return self

    @cached_property
    def assembly(self) -> Assembly:
        """Parts and sites, in the frame of the equipment."""
        return assemble(self.kind, self.length_m, self.kv)


def _shape_of(value: Any) -> str:  # noqa: ANN401 - files may contain any value
    shape = value.get("shape", "catalogue") if isinstance(value, Mapping) else getattr(value, "shape", "catalogue")
    return f"[{shape}]"  # keys of a file never contain brackets


Equipment = Annotated[
    Annotated[BoxEquipment, Tag("[box]")]
    | Annotated[CylinderEquipment, Tag("[cylinder]")]
    | Annotated[CatalogueEquipment, Tag("[catalogue]")],
    Discriminator(_shape_of),
]
