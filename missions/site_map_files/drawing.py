"""Features of a drawing in the format DXF, by the names of its blocks and layers."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from ezdxf import bbox, units
from ezdxf.disassemble import recursive_decompose
from ezdxf.document import Drawing
from ezdxf.dynblkhelper import get_dynamic_block_definition
from ezdxf.entities import Arc, Circle, DXFEntity, DXFGraphic, DXFTagStorage, Insert, Point
from ezdxf.entities.geodata import InvalidGeoDataException
from ezdxf.filemanagement import readfile
from ezdxf.layouts import BlockLayout
from ezdxf.math import X_AXIS, Y_AXIS, Vec3
from ezdxf.path import make_path
from pyproj import Transformer
from pyproj.exceptions import ProjError

from dirmusic import InputFileError
from dirmusic.arrays import FloatArray
from dirmusic.input_file import opened
from pdpatrol.envs.scenario.map import GeoreferenceConfig
from pdpatrol.missions.site_map_files.features import MAX_BYTES, MapContent, MapFeature
from pdpatrol.missions.site_map_files.geodesy import longitude_latitude
from pdpatrol.missions.site_map_files.name_mapping import GROUND, NamedKind, NameMapping
from pdpatrol.missions.site_map_files.site_frame import ring_area
from pdpatrol.missions.site_map_files.site_pieces import RINGS, WALLS
from pdpatrol.robot_models.equipment.catalogue import CATALOGUE

NOWHERE = GeoreferenceConfig(latitude_deg=0.0, longitude_deg=0.0)
"""Place that stands for that of a drawing without one; meridians are parallel there."""

FLATTENING_M = 0.02
"""Maximum distance of an arc from its chords (assumed)."""

CLOSED_M = 0.001
"""Distance of the ends of a line up to which it is closed (assumed), as of ends that were rounded."""

LEAST_SITE_M = 5.0
"""Length below which the unit of a drawing is wrong (assumed): of yards of 5 to 400 m drawn in metres, if it is mm."""

LEAST_M = 0.05
"""Length below which a line or the side of an area is an error (assumed), as of the thinnest pieces."""

NAME_ATTRIBUTES = ("name", "ref", "tag", "designation")
"""Attributes of a block that may hold the name of a piece, in lower case."""

IN_WORLD = {"LINE", "POINT"}
"""Types whose coordinates are those of the world, whatever their extrusion."""

FILLS = {"HATCH", "MPOLYGON", "IMAGE", "WIPEOUT", "VIEWPORT"}
"""Types that fill an area whose outline is another entity, or no area."""

PER_METRE = {21: 3937 / 1200, 22: 3937 / 100, 23: 3937 / 3600, 24: 3937 / 1200 / 5280}
"""US survey foot, inch, yard and mile as values of $INSUNITS (AutoCAD DXF reference), in units per metre."""

TEXTS = {"TEXT", "MTEXT", "ATTDEF", "ATTRIB", "DIMENSION", "LEADER", "MULTILEADER"}


class _Drawn(NamedTuple):
    """Entity of the model space, or one within a block of unknown name.

    Attributes:
        entity: The entity, in world coordinates.
        place: Its type, handle, and block or layer, for messages.
        label: The block or layer under which it is counted if it is not understood.
        row: Kind that its name stands for.
        is_hidden: True if it is invisible, or its layer is off or frozen.
    """

    entity: DXFGraphic
    place: str
    label: str
    row: NamedKind | None
    is_hidden: bool


class _DrawnFeature(NamedTuple):
    """Feature as in `MapFeature`, with its points in metres, shape (n, 2)."""

    place: str
    tags: Mapping[str, Any]
    shape: Literal["Point", "LineString", "Polygon"]
    points_m: FloatArray
    kind: str
    is_turned: bool


def read_drawing(path: Path, mapping: NameMapping) -> MapContent:
    """Read the features of a DXF file.

    Args:
        path: The file.
        mapping: Kinds by names of blocks and layers.

    Raises:
        InputFileError: If the file cannot be read or has errors; all of them are listed.
    """
    document = _opened(path)
    unit_m, notes = _unit(document, path)
    errors: list[str] = []
    found: list[_DrawnFeature] = []
    unknown: Counter[tuple[str, str]] = Counter()
    hidden: Counter[tuple[str, str]] = Counter()
    without_kv: dict[tuple[str, str], None] = {}
    for drawn in _entities(document.modelspace(), mapping, ""):
        row, type_ = drawn.row, drawn.entity.dxftype()
        if drawn.is_hidden:
            hidden[drawn.label, type_] += 1
            continue
        try:
            _check(drawn)
            if row is None or (row.kind != GROUND and type_ in TEXTS | FILLS):
                unknown[drawn.label, type_] += 1
            elif row.kind != GROUND:
                found.append(_feature(drawn, row, unit_m))
                if row.kv is None and (shape := CATALOGUE.get(row.kind)) is not None and shape.build_for is not None:
                    without_kv[drawn.label, row.kind] = None
        except TypeError:  # of `make_path`, for all that is no line
            unknown[drawn.label, type_] += 1
        except ValueError as error:
            errors.append(f"{path}: {drawn.place}: {error}")
        except ArithmeticError:
            errors.append(f"{path}: {drawn.place}: must have a size")
    size_m = np.ptp(np.concatenate([each.points_m for each in found]), axis=0) if len(found) > 1 else [LEAST_SITE_M]
    if max(size_m) < LEAST_SITE_M:
        unit, size = units.unit_name(document.header.get("$INSUNITS", 0)), " x ".join(f"{each:.3g}" for each in size_m)
        raise InputFileError([f"{path}: must be at least {LEAST_SITE_M:g} m long, got {size} m; $INSUNITS is {unit}"])
    need = "needs a voltage: kv = 110, 220 or 400 in a table for --mapping, got none"
    errors += [f"{path}: {label}: {kind} {need}" for label, kind in without_kv]
    if errors:
        raise InputFileError(errors)
    notes += [f"{label}: {n} {type_} not understood; left out" for (label, type_), n in sorted(unknown.items())]
    reason = "invisible, or on a layer that is off or frozen; left out"
    notes += [f"{label}: {n} {type_} {reason}" for (label, type_), n in sorted(hidden.items())]
    for layout in (each for each in document.layouts if not each.is_modelspace):
        rows = [each.row for each in _entities(layout, mapping, "")]
        if n_known := sum(row is not None and row.kind != GROUND for row in rows):
            notes.append(f"layout {layout.name}: {n_known} of known names on paper, not in the model; left out")
    if not found:
        raise InputFileError([f"{path}: must contain equipment, got none that is known", *notes])
    to_degrees, is_located = _to_degrees(document, unit_m, notes, np.concatenate([each.points_m for each in found]))
    features = [
        MapFeature(place, tags, shape, to_degrees(points_m), kind, is_turned)
        for place, tags, shape, points_m, kind, is_turned in found
    ]
    return MapContent(features, notes, is_located)


def _opened(path: Path) -> Drawing:
    with opened(path, MAX_BYTES):  # states why a file cannot be opened
        pass
    try:
        return readfile(path)
    except Exception as error:  # damaged bytes raise errors of many types
        raise InputFileError([f"{path}: must be a DXF file: {error}"]) from None


def _unit(document: Drawing, path: Path) -> tuple[float, list[str]]:
    """Return the unit of a drawing in metres, and a note if it is assumed."""
    number = document.header.get("$INSUNITS", 0)
    if number == 0:
        return 1.0, [f"{path}: has no unit ($INSUNITS); metres are assumed"]
    known = dict(enumerate(units.METER_FACTOR)) | PER_METRE
    per_metre = known.get(number) if number else None
    if per_metre is None:
        raise InputFileError([f"{path}: $INSUNITS must be a unit of length such as 4 (mm) or 6 (m), got {number}"])
    return 1.0 / per_metre, []


def _entities(entities: Iterable[DXFGraphic], mapping: NameMapping, handle: str) -> Iterator[_Drawn]:
    """Yield the entities whose names are known, in blocks of unknown name as well, and those that are not known.

    Args:
        entities: Entities of the model space, or of a placed block.
        mapping: Kinds by names.
        handle: Handle of the placed block, or empty.
    """
    for entity in entities:
        own_handle = handle or str(entity.dxf.handle)
        if not isinstance(entity, DXFGraphic):  # of a program that ezdxf does not know
            layer = entity.graphic_properties().get("layer", "0") if isinstance(entity, DXFTagStorage) else "0"
            yield _Drawn(entity, f"{entity.dxftype()} {own_handle}", f"layer {layer}", None, False)
            continue
        label, row = f"layer {entity.dxf.layer}", mapping.row(entity.dxf.layer)
        if isinstance(entity, Insert):
            if entity.mcount > 1 and not _is_hidden(entity):
                yield from _entities(entity.multi_insert(), mapping, own_handle)
                continue
            dynamic = get_dynamic_block_definition(entity)  # whose shape may be in an anonymous block such as *U12
            name = entity.dxf.name if dynamic is None else dynamic.name
            label, row = f"block {name}", mapping.row(name) or row
        place = f"{entity.dxftype()} {own_handle} of {label}"
        block = entity.block() if isinstance(entity, Insert) else None
        is_open = row is None and block is not None and not _is_hidden(entity) and not _contains_itself(block)
        if is_open and isinstance(entity, Insert) and block is not None and _may_be_known(block, mapping):
            inner = list(_entities(entity.virtual_entities(), mapping, own_handle))
            if any(each.row is not None for each in inner):
                yield from inner
                continue
        if isinstance(entity, Insert) and row is not None and row.kind in (*RINGS, *WALLS) and block is not None:
            lines = (each for each in entity.virtual_entities() if _shows_size(each) and each.dxftype() not in FILLS)
            inner = [each for each in lines if not isinstance(each, Insert)]
            yield from (_Drawn(each, place, label, row, _is_hidden(entity)) for each in inner)
            if inner:
                continue
        yield _Drawn(entity, place, label, row, _is_hidden(entity))


def _check(drawn: _Drawn) -> None:
    """Check that an entity of known name lies in the plane, and that a block is defined without itself.

    Raises:
        ValueError: With one line that says what must hold.
    """
    entity = drawn.entity
    if drawn.row is not None and entity.dxf.is_supported("extrusion") and entity.dxftype() not in IN_WORLD:
        extrusion = Vec3(entity.dxf.get("extrusion", (0.0, 0.0, 1.0)))
        if not np.isclose(abs(extrusion.normalize().z), 1.0):
            raise ValueError(f"must lie in the plane of the drawing, got the extrusion {extrusion.round(3)}")
    if not isinstance(entity, Insert):
        return
    block = entity.block()
    if block is None:
        raise ValueError(f"the block must be defined in the file, got `{entity.dxf.name}`")
    if _contains_itself(block):
        raise ValueError("a block must not contain itself")


def _nested(block: BlockLayout) -> dict[str, BlockLayout]:
    """Return the blocks that a block contains, at any depth, by their names."""
    found, waiting = dict[str, BlockLayout](), [block]
    while waiting:
        for insert in waiting.pop().query("INSERT"):
            inner = insert.block() if isinstance(insert, Insert) else None
            if inner is not None and inner.name not in found:
                found[inner.name] = inner
                waiting.append(inner)
    return found


def _contains_itself(block: BlockLayout) -> bool:
    """Return whether a block, or one within it, contains itself."""
    return any(name in _nested(each) for name, each in {block.name: block, **_nested(block)}.items())


def _may_be_known(block: BlockLayout, mapping: NameMapping) -> bool:
    """Return whether a name within a block is known, or anonymous, as those of dynamic blocks."""
    nested = _nested(block)
    is_known = any(name.startswith("*") or mapping.row(name) for name in nested)
    entities = (entity for each in (block, *nested.values()) for entity in each if isinstance(entity, DXFGraphic))
    return is_known or any(mapping.row(entity.dxf.layer) for entity in entities)


def _feature(drawn: _Drawn, row: NamedKind, unit_m: float) -> _DrawnFeature:
    """Return the feature of an entity.

    Raises:
        TypeError: If the entity is neither a block nor a point, a circle or a line.
        ValueError: If it has no size, with one line that says what must hold.
    """
    entity, shape, is_turned = drawn.entity, "Point", False
    tags = {"voltage": str(1000 * row.kv) if row.kv else "", "height": row.height_m or "", "yaw_deg": row.yaw_deg}
    tags |= {"barrier": "fence"} if row.kind == "fence" else {}  # of which one may be the outline
    if isinstance(entity, Insert):
        points_m, shape, is_turned = unit_m * _corners(entity, row, unit_m), "Polygon", True
        x_axis, y_axis = (entity.matrix44().transform_direction(axis).vec2 for axis in (X_AXIS, Y_AXIS))
        if x_axis.det(y_axis) < 0.0:
            points_m, tags["yaw_deg"] = points_m[[1, 0, 3, 2]], -row.yaw_deg  # mirrored; the y axis is kept
        names = {each.dxf.tag.lower(): each.dxf.text for each in entity.attribs}
        tags["name"] = next((names[key] for key in NAME_ATTRIBUTES if names.get(key)), "")
    elif isinstance(entity, Circle) and not isinstance(entity, Arc):
        points_m = unit_m * _plane([entity.ocs().to_wcs(entity.dxf.center)])
        if not entity.dxf.radius > 0.0:
            raise ValueError(f"the radius must be positive, got {entity.dxf.radius:g}")
    elif isinstance(entity, Point):
        points_m = unit_m * _plane([entity.dxf.location])
    else:
        line = make_path(entity)
        points_m = unit_m * _plane(line.flattening(FLATTENING_M / unit_m)) if len(line) else np.empty((0, 2))
        is_closed = len(points_m) > 2 and np.linalg.norm(points_m[-1] - points_m[0]) <= CLOSED_M
        shape = "Polygon" if is_closed else "LineString"
    if not np.isfinite(points_m).all():
        raise ValueError("the coordinates must be finite, got " + str(points_m[~np.isfinite(points_m)][0]))
    if shape == "LineString" and (length_m := _length(points_m)) < LEAST_M:
        raise ValueError(f"a line must be at least {LEAST_M:g} m long, got {length_m:.3g} m")
    if shape == "Polygon" and not is_turned:
        points_m = points_m[:-1]
        if (area_m2 := ring_area(points_m)) < LEAST_M**2:
            raise ValueError(f"a closed line must enclose an area of at least {LEAST_M**2:g} m2, got {area_m2:.3g} m2")
    return _DrawnFeature(drawn.place, tags, shape, points_m, row.kind, is_turned)


def _length(points_m: FloatArray) -> float:
    """Return the length of a line through points (n, 2)."""
    return float(np.linalg.norm(np.diff(points_m, axis=0), axis=-1).sum())


def _corners(insert: Insert, row: NamedKind, unit_m: float) -> FloatArray:
    """Return the corners of the rectangle around a placed block, along its axes, x axis first, shape (4, 2).

    A block without lines is a square of one metre around its base point, and one whose lines are on a straight line is
    one metre wide, unless its kind has the size of the block.
    """
    block = insert.block()
    assert block is not None
    lines = (each for each in block if _shows_size(each))
    extent = bbox.extents(filter(_shows_size, recursive_decompose(lines)), fast=True)
    shape, half = CATALOGUE.get(row.kind), 0.5 / unit_m
    has_own_size = shape is not None and not shape.stretches
    if extent.has_data and max(extent.size.x, extent.size.y) > 0.0:
        pad = Vec3(*(half if has_own_size and side == 0.0 else 0.0 for side in extent.size.vec2))
        low, high = extent.extmin - pad, extent.extmax + pad
    elif has_own_size:
        base = Vec3(block.base_point)
        low, high = base - Vec3(half, half), base + Vec3(half, half)
    else:
        raise ValueError(f"the block must have lines that show the size of a {row.kind}, got none")
    corners = [(low.x, low.y), (high.x, low.y), (high.x, high.y), (low.x, high.y)]
    return _plane(insert.matrix44().transform_vertices([Vec3(*each) for each in corners]))


def _shows_size(entity: DXFEntity) -> bool:
    """Return whether an entity within a block is a visible line, no label and no auxiliary point."""
    if not isinstance(entity, DXFGraphic) or entity.dxftype() in TEXTS or isinstance(entity, Point):
        return False
    return not _is_hidden(entity) and entity.dxf.layer.lower() != "defpoints"  # which CAD programs do not plot


def _is_hidden(entity: DXFGraphic) -> bool:
    """Return whether an entity is invisible, or on a layer that is off or frozen."""
    document, name = entity.doc, entity.dxf.layer
    if entity.dxf.invisible or document is None or name not in document.layers:
        return bool(entity.dxf.invisible)
    layer = document.layers.get(name)
    return layer.is_off() or layer.is_frozen()


def _plane(points: Iterable[Vec3]) -> FloatArray:
    """Return x and y of points, shape (n, 2)."""
    return np.array([(each.x, each.y) for each in points], dtype=np.float64)


def _to_degrees(
    document: Drawing, unit_m: float, notes: list[str], points_m: FloatArray
) -> tuple[Callable[[FloatArray], FloatArray], bool]:
    """Return the conversion of places in metres to longitude and latitude, and whether the drawing states where it is.

    Args:
        document: The drawing.
        unit_m: Its unit.
        notes: Notes, to which one is added if the place cannot be read.
        points_m: All places, shape (n, 2).
    """
    data = document.modelspace().get_geodata()
    if data is not None:
        try:
            matrix, epsg = data.get_crs_transformation()
            to_earth = Transformer.from_crs(epsg, 4326, always_xy=True)

            def to_degrees(each_m: FloatArray) -> FloatArray:
                on_grid = _plane(matrix.transform_vertices(Vec3(*place) for place in each_m / unit_m))
                return np.column_stack(to_earth.transform(*on_grid.T))

            if (np.abs(to_degrees(points_m)) <= (180.0, 85.0)).all():
                return to_degrees, True
            notes.append("GEODATA: must be between 85 degrees south and north; the position on Earth is left out")
        except (InvalidGeoDataException, ProjError) as error:
            notes.append(f"GEODATA: is not understood; the position on Earth is left out: {error}".splitlines()[0])
    corner_m = points_m.min(axis=0)
    return lambda each_m: longitude_latitude(each_m - corner_m, NOWHERE), False
