"""Tables of the map of the yard, its errors, and its position on Earth."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Annotated

from pydantic import Field

from pdpatrol.envs.scenario.base import Config
from pdpatrol.robot_models.yard.pieces import Equipment
from pdpatrol.robot_models.yard.quantities import MOST_PIECES, Coordinate, Name
from pdpatrol.robot_models.yard.yard import FENCE_TOLERANCE_M, Yard


class GeoreferenceConfig(Config, frozen=True):
    """Position of the yard's frame on the WGS 84 ellipsoid."""

    latitude_deg: Annotated[float, Field(ge=-85.0, le=85.0)]
    """Latitude of the origin, the south-west corner. Beyond 85 degrees meridians converge within a yard."""
    longitude_deg: Annotated[float, Field(ge=-180.0, le=180.0)]
    """Longitude of the origin, east positive."""
    heading_deg: Annotated[float, Field(ge=-360.0, le=360.0)] = 0.0
    """Direction of the y axis, clockwise from true north."""


class MovedPiece(Config, frozen=True):
    """A piece of equipment that the map shows at a wrong position."""

    name: Name
    by_m: tuple[Coordinate, Coordinate]
    """Displacement on the map relative to the true position, world frame."""

    def placed(self, item: Equipment) -> Equipment:
        """Return the piece as the map shows it."""
        x, y = item.position_m
        return type(item).model_validate({**item.model_dump(), "position_m": (x + self.by_m[0], y + self.by_m[1])})


class MapConfig(Config, frozen=True):
    """Differences between the map and the yard; by default the map is right.

    Planner, policies, Locator and report use the map. Physics, lidar, radio and scores use the yard.
    """

    missing: tuple[Name, ...] = Field(default=(), max_length=MOST_PIECES)
    """Pieces of the yard that the map does not show."""
    extra: tuple[Equipment, ...] = Field(default=(), max_length=MOST_PIECES)
    """Pieces that the map shows and the yard does not have."""
    moved: tuple[MovedPiece, ...] = Field(default=(), max_length=MOST_PIECES)

    def of(self, yard: Yard) -> Yard:
        """Return the yard as the map shows it, `yard` itself if the map is right.

        Args:
            yard: The true yard; `errors(yard)` must be empty.
        """
        if not (self.missing or self.extra or self.moved):
            return yard
        moved = {piece.name: piece for piece in self.moved}
        shown = [
            moved[item.name].placed(item) if item.name in moved else item
            for item in yard.equipment
            if item.name not in self.missing
        ]
        return Yard(size_m=yard.size_m, equipment=(*shown, *self.extra))

    def errors(self, yard: Yard) -> list[str]:
        """List the errors of this map of a yard, as `key: message`."""
        pieces = {item.name: item for item in yard.equipment}
        names = list(pieces)

        def unknown(name: str) -> str:
            near = get_close_matches(name, names, n=3) or names[:12]
            return f"no equipment `{name}` in this yard; known are {', '.join(near) or 'none'}"

        def misplaced(item: Equipment) -> bool:
            return not bool(yard.contains(item.position_m)) or yard.across_fence(item) > FENCE_TOLERANCE_M

        size = "{:g} x {:g} m".format(*yard.size_m)
        errors = [f"map.missing.{i}: {unknown(name)}" for i, name in enumerate(self.missing) if name not in pieces]
        if not errors and len(pieces) - len(set(self.missing)) + len(self.extra) > MOST_PIECES:
            errors.append(f"map.extra: the map must not show more than {MOST_PIECES} pieces of equipment")
        for i, item in enumerate(self.extra):
            if item.name in [*names, *(other.name for other in self.extra[:i])]:
                errors.append(f"map.extra.{i}.name: must be used once, got `{item.name}` again")
            if misplaced(item):
                errors.append(f"map.extra.{i}.position_m: must lie inside the yard ({size}), got {item.position_m}")
        for i, piece in enumerate(self.moved):
            if piece.name not in pieces:
                errors.append(f"map.moved.{i}.name: {unknown(piece.name)}")
                continue
            if piece.name in self.missing:
                errors.append(f"map.moved.{i}.name: must not be missing too, got `{piece.name}`")
            if piece.name in [other.name for other in self.moved[:i]]:
                errors.append(f"map.moved.{i}.name: must be moved once, got `{piece.name}` again")
            if misplaced(piece.placed(pieces[piece.name])):
                errors.append(f"map.moved.{i}.by_m: must leave the piece inside the yard ({size}), got {piece.by_m}")
        return errors
