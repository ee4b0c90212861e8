"""The map of the yard, and where it is wrong: what robot, planner, Locator and report know; where on Earth it lies."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Annotated

from pydantic import Field

from pdpatrol.envs.scenario.base import Config
from pdpatrol.robot_models.yard.pieces import Equipment
from pdpatrol.robot_models.yard.quantities import MOST_PIECES, Coordinate, Name
from pdpatrol.robot_models.yard.yard import FENCE_TOLERANCE_M, Yard


class GeoreferenceConfig(Config, frozen=True):
    """The yard's frame on the WGS 84 ellipsoid.

    Attributes:
        latitude_deg: Of the yard's origin, its south-west corner; below 85 degrees, where the meridians do not yet
            converge within a yard.
        longitude_deg: Of the same, east positive.
        heading_deg: Of the yard's y axis, clockwise from true north: 0 where the yard lies as its map says.
    """

    latitude_deg: Annotated[float, Field(ge=-85.0, le=85.0)]
    longitude_deg: Annotated[float, Field(ge=-180.0, le=180.0)]
    heading_deg: Annotated[float, Field(ge=-360.0, le=360.0)] = 0.0


class MovedPiece(Config, frozen=True):
    """A piece of equipment that the map shows elsewhere."""

    name: Name
    by_m: tuple[Coordinate, Coordinate]
    """From where it stands to where the map shows it, world frame."""

    def shown_at_m(self, piece: Equipment) -> tuple[float, float]:
        """Where the map shows the centre of `piece`, world frame."""
        return piece.position_m[0] + self.by_m[0], piece.position_m[1] + self.by_m[1]


class MapConfig(Config, frozen=True):
    """How the map differs from the yard; by default the map shows the yard as it is.

    Planner, policies, Locator and report go by the map. Physics, lidar, radio and scores go by the yard.
    """

    missing: tuple[Name, ...] = Field(default=(), max_length=MOST_PIECES)
    """Pieces of the yard that the map does not show."""
    extra: tuple[Equipment, ...] = Field(default=(), max_length=MOST_PIECES)
    """Pieces that the map shows and the yard does not have."""
    moved: tuple[MovedPiece, ...] = Field(default=(), max_length=MOST_PIECES)

    def of(self, yard: Yard) -> Yard:
        """The yard as the map has it: `yard` itself if the map differs in nothing, else a new one.

        Args:
            yard: The true one, of which this is a map without `faults`.
        """
        if not (self.missing or self.extra or self.moved):
            return yard
        moved = {piece.name: piece for piece in self.moved}
        shown = [
            _placed_at(item, moved[item.name].shown_at_m(item)) if item.name in moved else item
            for item in yard.equipment
            if item.name not in self.missing
        ]
        return Yard(size_m=yard.size_m, equipment=(*shown, *self.extra))

    def faults(self, yard: Yard) -> list[str]:
        """What makes this no map of `yard`, one line each; empty if it is one."""
        pieces = {item.name: item for item in yard.equipment}
        faults = [
            f"map.missing.{i}: {_unknown(name, pieces)}" for i, name in enumerate(self.missing) if name not in pieces
        ]
        n_shown = len(pieces) - len(set(self.missing)) + len(self.extra)
        if not faults and n_shown > MOST_PIECES:
            faults.append(f"map.extra: the map shows {n_shown} pieces of equipment; allowed are at most {MOST_PIECES}")
        taken = list(pieces)
        for i, item in enumerate(self.extra):
            if item.name in taken:
                faults.append(f"map.extra.{i}.name: `{item.name}` is taken; allowed is a name used once")
            if not yard.contains(item.position_m):
                faults.append(
                    f"map.extra.{i}.position_m: {item.position_m} is outside the yard; "
                    f"allowed is (0, 0) to {yard.size_m}"
                )
            elif yard.across_fence(item) > FENCE_TOLERANCE_M:
                faults.append(
                    f"map.extra.{i}.position_m: `{item.name}` at {item.position_m} reaches beyond the fence; "
                    f"allowed is all of it in (0, 0) to {yard.size_m}"
                )
            taken.append(item.name)
        names = [piece.name for piece in self.moved]
        for i, piece in enumerate(self.moved):
            if piece.name not in pieces:
                faults.append(f"map.moved.{i}.name: {_unknown(piece.name, pieces)}")
                continue
            if piece.name in self.missing:
                faults.append(f"map.moved.{i}.name: `{piece.name}` is missing too; allowed is one of the two")
            if piece.name in names[:i]:
                faults.append(f"map.moved.{i}.name: `{piece.name}` is moved already; allowed is once")
            shown_at_m = piece.shown_at_m(pieces[piece.name])
            if not yard.contains(shown_at_m):
                faults.append(
                    f"map.moved.{i}.by_m: {piece.by_m} puts `{piece.name}` at {shown_at_m}, outside the yard; "
                    f"allowed is (0, 0) to {yard.size_m}"
                )
            elif yard.across_fence(_placed_at(pieces[piece.name], shown_at_m)) > FENCE_TOLERANCE_M:
                faults.append(
                    f"map.moved.{i}.by_m: {piece.by_m} puts `{piece.name}` at {shown_at_m}, where it reaches beyond "
                    f"the fence; allowed is all of it in (0, 0) to {yard.size_m}"
                )
        return faults


def _unknown(name: str, pieces: dict[str, Equipment]) -> str:
    near = get_close_matches(name, pieces, n=3) or list(pieces)[:12]
    return f"no equipment `{name}` in this yard; allowed are {', '.join(near) or 'none: it has no equipment'}"


def _placed_at(item: Equipment, position_m: tuple[float, float]) -> Equipment:
    """The same piece elsewhere; made anew, for a copy would keep the solids that it has computed."""
    return type(item).model_validate({**item.model_dump(), "position_m": position_m})
