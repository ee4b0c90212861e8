"""Features of a GeoJSON file (RFC 7946), with one line per error."""

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, ValidationError

from dirmusic import InputFileError
from dirmusic.arrays import FloatArray
from dirmusic.input_file import read_whole
from pdpatrol.envs.scenario.base import error_lines
from pdpatrol.missions.record.words import counted

MAX_BYTES = 50_000_000
"""Maximum size of a file. Assumed; a map of a large substation takes a hundredth."""

OWN = "pdpatrol"
"""Property with the keys of a piece as in a scenario file."""

OUT_OF_RANGE = {"less_than_equal", "greater_than_equal"}
"""Types of the errors of coordinates that are not longitude and latitude."""

Longitude = Annotated[float, Field(ge=-180.0, le=180.0, allow_inf_nan=False)]
Latitude = Annotated[float, Field(ge=-85.0, le=85.0, allow_inf_nan=False)]


def _without_height(value: Any) -> Any:  # noqa: ANN401 - files may contain any value
    if isinstance(value, list) and len(value) < 2:
        raise ValueError(f"must be longitude and latitude, got {value!r:.60}")
    return value[:2] if isinstance(value, list) else value


def _closed(ring: list[tuple[float, float]]) -> list[tuple[float, float]]:
    if ring[0] != ring[-1]:
        raise ValueError(f"must end where it begins, at {ring[0]}, got {ring[-1]}")
    return ring


Position = Annotated[tuple[Longitude, Latitude], BeforeValidator(_without_height)]


Line = Annotated[list[Position], Field(min_length=2)]
Ring = Annotated[list[Position], Field(min_length=4), AfterValidator(_closed)]
Rings = Annotated[list[Ring], Field(min_length=1)]


class _Point(BaseModel):
    type: Literal["Point"]
    coordinates: Position


class _LineString(BaseModel):
    type: Literal["LineString"]
    coordinates: Line


class _Polygon(BaseModel):
    type: Literal["Polygon"]
    coordinates: Rings


class _MultiPoint(BaseModel):
    type: Literal["MultiPoint"]
    coordinates: list[Position]


class _MultiLineString(BaseModel):
    type: Literal["MultiLineString"]
    coordinates: list[Line]


class _MultiPolygon(BaseModel):
    type: Literal["MultiPolygon"]
    coordinates: list[Rings]


class _Shape(BaseModel):
    geometry: Annotated[
        _Point | _LineString | _Polygon | _MultiPoint | _MultiLineString | _MultiPolygon, Field(discriminator="type")
    ]


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
    """Content of a map.

    Attributes:
        features: Features that are understood.
        notes: Lines on features that are left out and on assumptions.
        is_located: True if the map states its position on Earth.
    """

    features: list[MapFeature]
    notes: list[str]
    is_located: bool


def read_features(path: Path) -> MapContent:
    """Read the features of a GeoJSON file.

    Raises:
        InputFileError: If the file cannot be read or has errors; all of them are listed.
    """
    content = read_whole(path, MAX_BYTES)
    try:
        data: Any = json.loads(content.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise InputFileError([f"{path}: is not valid JSON: {error}"]) from None
    found = data.get("features") if isinstance(data, dict) and data.get("type") == "FeatureCollection" else None
    if not isinstance(found, list) or not found:
        raise InputFileError([f"{path}: must be a GeoJSON FeatureCollection with features"])
    if crs := _wrong_crs(data):
        raise InputFileError([f"{path}: crs: must be WGS 84 (EPSG:4326 or CRS84), as RFC 7946 requires, got {crs:.60}"])
    features: list[MapFeature] = []
    notes: list[str] = []
    errors: list[str] = []
    types: set[str] = set()
    for number, item in enumerate(found):
        try:
            if isinstance(item, dict) and _is_empty(item.get("geometry", item)):
                notes.append(f"{_place(number, item, _tags(item))}: has no geometry; left out")
            else:
                features += _features(number, item, notes)
        except ValidationError as error:
            errors += [f"features.{number}{'' if line[0] == ':' else '.'}{line}" for line in error_lines(error, _Shape)]
            types |= {each["type"] for each in error.errors()}
    if len(errors) > 1 and not features and types <= OUT_OF_RANGE:
        errors = [f"must have longitude and latitude on WGS 84, as RFC 7946 requires: {errors[0]}"]
    if errors:
        raise InputFileError([f"{path}: {line}" for line in errors])
    if not features:
        raise InputFileError([f"{path}: must have features with a geometry, got none", *notes])
    return MapContent(features, notes, is_located=True)


def _wrong_crs(data: Mapping[str, Any]) -> str:
    """Return the coordinate reference system of older GeoJSON if it is not WGS 84, else nothing."""
    crs: Any = data.get("crs")
    if not crs:
        return ""
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = str(properties.get("name") or properties.get("code") or crs) if isinstance(properties, dict) else str(crs)
    return "" if re.search(r"(CRS84h?|(^|[:/])4326)$", name, re.IGNORECASE) else name


def _is_empty(geometry: Any) -> bool:  # noqa: ANN401 - files may contain any value
    """Return whether a geometry is null, or has no parts, which means the same (RFC 7946, section 3.1)."""
    is_multiple = isinstance(geometry, dict) and str(geometry.get("type")).startswith("Multi")
    return geometry is None or (is_multiple and geometry.get("coordinates") == [])


def _tags(item: Mapping[str, Any]) -> dict[str, Any]:
    """Return the properties of a feature, with keys in lower case.

    Tags of OpenStreetMap may also be in a table `tags`, or in the texts `tags` (JSON) or `other_tags`, as GDAL writes
    them.
    """
    properties: Any = item.get("properties")
    properties = properties if isinstance(properties, dict) else {}
    nested, other = properties.get("tags"), properties.get("other_tags")
    if isinstance(nested, str):
        try:
            nested = json.loads(nested)
        except ValueError:
            nested = None
    tags: dict[str, Any] = properties | nested if isinstance(nested, dict) else properties
    tags = tags | dict(re.findall(r'"([^"]*)"=>"([^"]*)"', other)) if isinstance(other, str) else tags
    return {key.lower(): value for key, value in tags.items()}


def _place(number: int, item: Mapping[str, Any], tags: Mapping[str, Any]) -> str:
    name = tags.get("@id") or item.get("id") or tags.get("ref") or tags.get("name")
    return f"features.{number}" + (f" ({name})" if name else "")


def _features(number: int, item: Any, notes: list[str]) -> Iterator[MapFeature]:  # noqa: ANN401 - any value
    """Yield the feature, or one for each part of its geometry; of polygons, the outer rings.

    Args:
        number: Number of the feature in the file.
        item: The feature.
        notes: Notes, to which one is added if inner rings are left out.

    Raises:
        ValidationError: If the geometry is not valid.
    """
    stated = item.get("geometry") if isinstance(item, dict) else None
    if (
        isinstance(stated, dict)
        and stated.get("type") == "GeometryCollection"
        and isinstance(stated.get("geometries"), list)
    ):
        for part in stated["geometries"]:
            yield from _features(number, {**item, "geometry": part}, notes)
        return
    geometry = _Shape.model_validate(item).geometry
    tags = _tags(item)
    place = _place(number, item, tags)
    match geometry:
        case _Point() | _MultiPoint():
            shape, parts = "Point", [[each] for each in _parts(geometry)]
        case _LineString() | _MultiLineString():
            shape, parts = "LineString", _parts(geometry)
        case _:
            shape, parts = "Polygon", [rings[0][:-1] for rings in _parts(geometry)]
            if n_inner := sum(len(rings) - 1 for rings in _parts(geometry)):
                notes.append(f"{place}: {counted(n_inner, 'inner ring')} left out")
    for part in parts:
        yield MapFeature(place, tags, shape, np.array(part, dtype=np.float64))


def _parts(geometry: Any) -> list[Any]:  # noqa: ANN401 - one of the geometries above
    """Return the coordinates of each part of a geometry."""
    return geometry.coordinates if geometry.type.startswith("Multi") else [geometry.coordinates]
