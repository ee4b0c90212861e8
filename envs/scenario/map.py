"""Scenario tables for the errors of the yard's map and for its position on Earth."""

from operator import add
from typing import Annotated

from pydantic import Field, ValidationError

from pdpatrol.envs.scenario.base import error_lines, known_names
from pdpatrol.robot_models.yard.pieces import Equipment
from pdpatrol.robot_models.yard.quantities import MOST_PIECES, Coordinate, Name
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing.quantities import Config


class GeoreferenceConfig(Config):
    """Position of the yard's frame on the WGS 84 ellipsoid."""

    latitude_deg: Annotated[float, Field(ge=-85.0, le=85.0)]
    """Latitude of the origin, the south-west corner. Beyond 85 degrees the meridians converge noticeably in a yard."""
    longitude_deg: Annotated[float, Field(ge=-180.0, le=180.0)]
    """Longitude of the origin, east positive."""
    heading_deg: Annotated[float, Field(ge=-360.0, le=360.0)] = 0.0
    """Direction of the y axis, clockwise from true north."""


class MovedPiece(Config):
    """Piece of equipment that the map shows at a wrong position."""

    name: Name
    """Name of the piece of equipment."""
    by_m: tuple[Coordinate, Coordinate]
    """Displacement on the map relative to the true position, world frame."""


class MapConfig(Config):
    """Accuracy of the map as the operator believes it, and differences between map and yard, by default none.

    Planner, policies, Locator and report use the map. Physics, lidar, radio and scores use the yard.
    """

    accuracy_m: Annotated[float, Field(ge=0.0, le=5.0)] = 0.15
    """Believed standard deviation of each horizontal coordinate of a piece of equipment; all sites of a piece are
    displaced together. The probabilities of the sites of a finding include it. Assumed: as-built drawings are some
    decimetres off. Set 0.025 for a laser scan of level of accuracy 20 (USIBD C220: 5 cm at 95 %)."""

    missing: tuple[Name, ...] = Field(default=(), max_length=MOST_PIECES)
    """Pieces in the yard that the map does not show."""
    extra: tuple[Equipment, ...] = Field(default=(), max_length=MOST_PIECES)
    """Pieces on the map that do not exist in the yard."""
    moved: tuple[MovedPiece, ...] = Field(default=(), max_length=MOST_PIECES)
    """Pieces that the map shows at a wrong position."""

    def of(self, yard: Yard) -> Yard:
        """Return the yard as the map shows it, or `yard` itself if the map is correct.

        Args:
            yard: True yard; `errors(yard)` must be empty.
        """
        if not (self.missing or self.extra or self.moved):
            return yard
        moved, shown = {piece.name: piece.by_m for piece in self.moved}, list[Equipment]()
        for item in yard.equipment:
            if item.name in moved:
                place_m = tuple(map(add, item.position_m, moved[item.name]))
                item = type(item).model_validate({**item.model_dump(), "position_m": place_m})
            if item.name not in self.missing:
                shown.append(item)
        return Yard(size_m=yard.size_m, fence_m=yard.fence_m, equipment=(*shown, *self.extra))

    def errors(self, yard: Yard) -> list[str]:
        """List the invalid keys of this table for a given yard, as `key: message`."""
        names = tuple(item.name for item in yard.equipment)
        given = [(f"missing.{i}", name) for i, name in enumerate(self.missing)]
        given += [(f"moved.{i}.name", piece.name) for i, piece in enumerate(self.moved)]
        errors = [
            f"map.{key}: no equipment `{name}` in this yard; available: {known_names(names, name)}"
            for key, name in given
            if name not in names
        ]
        if not errors:
            try:
                self.of(yard)
            except ValidationError as error:
                errors = [f"map: {line}" for line in error_lines(error, Yard)]
        return errors
