"""Content of the editor's page for a scenario file: outlines, places, keys and errors.

A file with errors is shown as far as it can be: each piece of equipment that is valid by itself has its outline.
"""

import fnmatch
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, TypeAdapter, ValidationError

from dirmusic import InputFileError
from pdpatrol.envs.plausibility import plausibility
from pdpatrol.envs.scenario import check_content
from pdpatrol.envs.scenario.base import as_tuples
from pdpatrol.envs.scenario.loader import scenario_schema
from pdpatrol.envs.user_code import UserCodeError
from pdpatrol.missions.editor.document import BOM, toml_text
from pdpatrol.robot_models.equipment.catalogue import CATALOGUE, colour_of
from pdpatrol.robot_models.yard.pieces import Equipment
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing.radio.materials import KIND_MATERIALS

Point = tuple[float, float]
"""Place in the yard, world frame, metres."""

Position = tuple[float, float] | tuple[float, float, float]
"""Place x, y, or x, y, z, world frame, metres."""

PIECE = TypeAdapter[Equipment](Equipment)
PLACE = TypeAdapter[Point](Point)
POSITION = TypeAdapter[Position](Position)

FORMS = {"catalogue": "CatalogueEquipment", "box": "BoxEquipment", "cylinder": "CylinderEquipment"}
"""Table of the schema that lists the keys of a piece, by its shape."""

NO_YARD = Yard(size_m=(40.0, 30.0))
"""Yard that is shown instead of one with errors."""


class Outline(BaseModel):
    """Solid from above: a box with four corners, or a circle, if its radius is not 0, around the first of them."""

    corners_m: list[Point]
    radius_m: float
    colour: str


class PieceView(BaseModel):
    """Piece of equipment; outlines (lower parts first) and sites are empty if the piece itself is invalid."""

    name: str
    form: str
    place_m: Point | None
    values: dict[str, str]
    outlines: list[Outline] = []
    sites_m: dict[str, Point] = {}


class SourceView(BaseModel):
    """Source with the places at which it may be."""

    name: str
    values: dict[str, str]
    places_m: list[Point]
    height_m: float | None
    """Height of a source with a position; None for one on sites or anywhere."""


class LineView(BaseModel):
    """Zone, path of a person or vehicle, or interferer with its path; it moves with all its points."""

    name: str
    kind: Literal["zone", "moving", "interferer"]
    path: tuple[str | int, ...]
    """Keys and index of its table."""
    form: str
    values: dict[str, str]
    is_closed: bool
    points_m: dict[str, list[Position]]
    """Valid points by their key, which holds one position or a list of them."""


class EditorView(BaseModel):
    """Scenario file as the page shows it. `values` are keys of tables with values in TOML, strings without quotes."""

    fence_m: list[Point]
    yard: dict[str, str]
    pieces: list[PieceView]
    route: dict[str, str]
    dock_m: Point | None
    waypoints_m: list[Point]
    sources: list[SourceView]
    lines: list[LineView]
    errors: list[str]
    notes: list[str]


def view_of(text: str, path: Path) -> EditorView:
    """Return the content of the page for the text of a file, which must be valid TOML."""
    data = tomllib.loads(text.removeprefix(BOM))
    yard, route = _table(data, "yard"), _table(data, "route")
    pieces = [_piece(row) for row in _rows(yard, "equipment")]
    sites_m = {f"{piece.name}/{site}": at_m for piece in pieces for site, at_m in piece.sites_m.items()}
    errors, notes = _check(text, path)
    waypoints = route.get("waypoints_m")
    return EditorView(
        fence_m=_fence(yard),
        yard=_values(yard),
        pieces=pieces,
        route=_values(route),
        dock_m=_place(route.get("dock_m")),
        waypoints_m=[_place(at) or (0.0, 0.0) for at in waypoints] if isinstance(waypoints, list) else [],
        sources=[_source(row, sites_m) for row in _rows(data, "sources")],
        lines=list(_lines(data)),
        errors=errors,
        notes=notes,
    )


def forms() -> dict[str, Any]:
    """Return the JSON Schemas of the tables that the page edits, with all kinds of equipment."""
    tables = scenario_schema()["$defs"]
    for shape, name in FORMS.items():
        keys = tables[name]["properties"]
        keys["kind"]["enum"] = sorted(CATALOGUE if shape == "catalogue" else KIND_MATERIALS)
        keys["shape"]["enum"] = list(FORMS)
    names = (*FORMS.values(), "SourceConfig", "RouteConfig", "Yard", "ZoneConfig", "MovingConfig", "InterfererConfig")
    return {name: tables[name]["properties"] for name in names}


def kinds_with_kv() -> list[str]:
    """Return the kinds of equipment whose size depends on the voltage."""
    return [kind for kind, shape in CATALOGUE.items() if shape.build_for is not None]


def _check(text: str, path: Path) -> tuple[list[str], list[str]]:
    """Return the errors of a scenario, and the notes on one without errors."""
    try:
        return [], list(plausibility(check_content(text.encode(), path)))
    except InputFileError as error:
        return list(error.faults), []
    except UserCodeError as error:
        return [str(error)], []


def _table(data: dict[str, Any], key: str) -> dict[str, Any]:
    value = data.get(key)
    return value if isinstance(value, dict) else {}


def _rows(data: dict[str, Any], key: str) -> list[dict[str, Any]]:
    rows = data.get(key)
    return [row if isinstance(row, dict) else {} for row in rows] if isinstance(rows, list) else []


def _values(table: dict[str, Any]) -> dict[str, str]:
    """Return the keys of a table, without equipment, which is shown on the plan."""
    return {
        key: value if isinstance(value, str) else toml_text(value) for key, value in table.items() if key != "equipment"
    }


def _place(value: Any) -> Point | None:  # noqa: ANN401 - files may contain any value
    """Return the first two numbers of a value, or None if it does not begin with two."""
    try:
        return PLACE.validate_python(value[:2])
    except (TypeError, ValidationError):
        return None


def _fence(yard: dict[str, Any]) -> list[Point]:
    fence = {key: as_tuples(yard[key]) for key in ("size_m", "fence_m") if key in yard}
    try:
        shown = Yard.model_validate(fence)
    except ValidationError:
        shown = NO_YARD
    return shown.fence.corners_m.tolist()


def _piece(row: dict[str, Any]) -> PieceView:
    name, form = str(row.get("name", "")), FORMS.get(str(row.get("shape", "catalogue")), "CatalogueEquipment")
    shown = PieceView(name=name, form=form, place_m=_place(row.get("position_m")), values=_values(row))
    try:
        piece = PIECE.validate_python(as_tuples(row))
    except ValidationError:
        return shown
    solids, parts = piece.solids, list(piece.assembly.parts)
    outlines = [
        Outline(
            corners_m=solids.corners_m[k].round(3).tolist(),
            radius_m=float(solids.radius_m[k]),
            colour="#" + "".join(f"{round(255 * share):02x}" for share in colour_of(piece.kind, parts[k])),
        )
        for k in solids.top_m.argsort(kind="stable").tolist()
    ]
    sites_m = {site: tuple(piece.site_on_surface(site)[:2].round(3).tolist()) for site in piece.assembly.sites}
    return shown.model_copy(update={"outlines": outlines, "sites_m": sites_m})


def _source(row: dict[str, Any], sites_m: dict[str, Point]) -> SourceView:
    entries, position = row.get("sites"), row.get("position_m")
    entries = [entry for entry in entries if isinstance(entry, str)] if isinstance(entries, list) else []
    names = dict.fromkeys(name for entry in entries for name in fnmatch.filter(sites_m, entry))
    at_m = _place(position)
    height_m = position[2] if isinstance(position, list) and at_m and len(position) == 3 else None
    return SourceView(
        name=str(row.get("name", "")),
        values=_values(row),
        places_m=[sites_m[name] for name in names] + ([] if at_m is None else [at_m]),
        height_m=height_m,
    )


def _lines(data: dict[str, Any]) -> Iterator[LineView]:
    """Yield zones, people and vehicles, and interferers."""
    zones, moving, interferers = (
        _rows(data, "zones"),
        _rows(_table(data, "nature"), "moving"),
        _rows(data, "interferers"),
    )
    for k, row in enumerate(zones):
        yield _line(row, "zone", ("zones", k), "ZoneConfig", "polygon_m", is_closed=True)
    for k, row in enumerate(moving):
        yield _line(row, "moving", ("nature", "moving", k), "MovingConfig", "path_m", is_closed=row.get("loop") is True)
    for k, row in enumerate(interferers):
        yield _line(row, "interferer", ("interferers", k), "InterfererConfig", "position_m", "path_m", is_closed=False)


def _line(
    row: dict[str, Any],
    kind: Literal["zone", "moving", "interferer"],
    path: tuple[str | int, ...],
    form: str,
    *keys: str,
    is_closed: bool,
) -> LineView:
    """Return a line with the points of keys."""
    points = {key: _positions(row[key] if key != "position_m" else [row[key]]) for key in keys if key in row}
    return LineView(
        name=str(row.get("name", "")),
        kind=kind,
        path=path,
        form=form,
        values=_values(row),
        is_closed=is_closed,
        points_m={key: positions for key, positions in points.items() if positions},
    )


def _positions(value: Any) -> list[Position]:  # noqa: ANN401 - files may contain any value
    """Return a list of positions, or an empty one if it has another value."""
    try:
        return [POSITION.validate_python(tuple(place)) for place in value]
    except (TypeError, ValidationError):
        return []
