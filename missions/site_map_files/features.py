"""Features of a GeoJSON file (RFC 7946), with one line per error."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, BeforeValidator, Field, ValidationError

from dirmusic import InputFileError
from dirmusic.arrays import FloatArray
from dirmusic.input_file import read_whole
from pdpatrol.envs.scenario.base import error_lines

MAX_BYTES = 50_000_000
"""Maximum size of a file. Assumed; a map of a large substation takes a hundredth."""

Longitude = Annotated[float, Field(ge=-180.0, le=180.0, allow_inf_nan=False)]
Latitude = Annotated[float, Field(ge=-85.0, le=85.0, allow_inf_nan=False)]


def _without_height(value: Any) -> Any:  # noqa: ANN401 - files may contain any value
    return value[:2] if isinstance(value, list) else value


Position = Annotated[tuple[Longitude, Latitude], BeforeValidator(_without_height)]


class _Point(BaseModel):
    type: Literal["Point"]
    coordinates: Position


class _LineString(BaseModel):
    type: Literal["LineString"]
    coordinates: Annotated[list[Position], Field(min_length=2)]


class _Polygon(BaseModel):
    type: Literal["Polygon"]
    coordinates: Annotated[list[Annotated[list[Position], Field(min_length=4)]], Field(min_length=1)]


class _Shape(BaseModel):
    geometry: Annotated[_Point | _LineString | _Polygon, Field(discriminator="type")]


class MapFeature(NamedTuple):
    """Feature of a map.

    Attributes:
        place: Number and name in the file, for messages.
        tags: Its properties.
        shape: Kind of its geometry.
        points_deg: Longitude and latitude, shape (n, 2); of a polygon the outer ring, without its last point.
        kind: Kind of equipment if the map states it; otherwise the tags do.
        is_turned: True if the first side of a polygon is the direction of the x axis of the piece.
    """

    place: str
    tags: Mapping[str, Any]
    shape: Literal["Point", "LineString", "Polygon"]
    points_deg: FloatArray
    kind: str | None = None
    is_turned: bool = False


class MapContent(NamedTuple):
    """Features of a map, notes on what was left out, and whether the map states its position on Earth."""

    features: list[MapFeature]
    notes: list[str]
    is_located: bool


def read_features(path: Path) -> MapContent:
    """Read the features of a GeoJSON file.

    Raises:
        InputFileError: If the file cannot be read or has errors; all of them are listed.
    """
    try:
        data: Any = json.loads(read_whole(path, MAX_BYTES).decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise InputFileError([f"{path}: is not valid JSON: {error}"]) from None
    found = data.get("features") if isinstance(data, dict) and data.get("type") == "FeatureCollection" else None
    if not isinstance(found, list) or not found:
        raise InputFileError([f"{path}: must be a GeoJSON FeatureCollection with features"])
    features: list[MapFeature] = []
    errors: list[str] = []
    for number, item in enumerate(found):
        try:
            features.append(_feature(number, item))
        except ValidationError as error:
            errors += [f"{path}: features.{number}.{line}" for line in error_lines(error, _Shape)]
    if errors:
        raise InputFileError(errors)
    return MapContent(features, [], is_located=True)


def _feature(number: int, item: Any) -> MapFeature:  # noqa: ANN401 - files may contain any value
    geometry = _Shape.model_validate(item).geometry
    properties = item.get("properties") or {}
    nested = properties.get("tags")
    tags = properties | nested if isinstance(nested, dict) else properties
    name = tags.get("@id") or item.get("id") or tags.get("ref") or tags.get("name")
    if isinstance(geometry, _Point):
        points = [geometry.coordinates]
    else:
        points = geometry.coordinates if isinstance(geometry, _LineString) else geometry.coordinates[0][:-1]
    place = f"features.{number}" + (f" ({name})" if name else "")
    return MapFeature(place, tags, geometry.type, np.array(points, dtype=np.float64))
