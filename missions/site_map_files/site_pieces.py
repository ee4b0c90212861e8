"""Pieces of equipment from the features of a map: tags of OpenStreetMap, or properties that `write_site_map` wrote."""

import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence, Set
from itertools import combinations, pairwise
from typing import Any, NamedTuple

import numpy as np
from pydantic import TypeAdapter, ValidationError
from scipy.spatial import KDTree

from dirmusic.arrays import FloatArray
from pdpatrol.envs.scenario.base import as_tuples, error_lines
from pdpatrol.envs.scenario.map import GeoreferenceConfig
from pdpatrol.missions.site_map_files.features import OWN, MapFeature
from pdpatrol.missions.site_map_files.geodesy import places_in_yard
from pdpatrol.missions.site_map_files.site_frame import OUTLINES, oriented_box
from pdpatrol.robot_models.equipment.catalogue import CATALOGUE
from pdpatrol.robot_models.equipment.poles import APPARATUS
from pdpatrol.robot_models.equipment.voltages import VOLTAGES, Kv
from pdpatrol.robot_models.yard.pieces import Equipment
from pdpatrol.robot_models.yard.quantities import LEAST_STRETCHED_M, MOST_LETTERS
from pdpatrol.robot_models.yard.yard import FENCE_TOLERANCE_M, Yard
from pdpatrol.sensing.radio.materials import KIND_MATERIALS

ANY = "*"

RULES: tuple[tuple[Mapping[str, str], str], ...] = (
    ({"power": "transformer", "transformer": "current"}, "current_transformer"),
    ({"power": "transformer", "transformer": "potential"}, "voltage_transformer"),
    ({"power": "transformer", "transformer": "voltage"}, "voltage_transformer"),
    ({"power": "transformer"}, "power_transformer"),
    ({"power": "switch", "switch": "circuit_breaker"}, "circuit_breaker"),
    ({"power": "switch", "switch": "disconnector"}, "disconnector_centre_break"),
    ({"power": "compensator", "compensator": "shunt_reactor"}, "shunt_reactor"),
    ({"power": "surge_arrester"}, "surge_arrester"),
    ({"power": "insulator"}, "post_insulator"),
    ({"power": "terminal"}, "cable_sealing_end"),
    ({"power": "portal"}, "gantry"),
    ({"power": "busbar"}, "busbar"),
    ({"power": "line", "line": "busbar"}, "busbar"),
    ({"building": ANY}, "building"),
    ({"barrier": "fence"}, "fence"),
    ({"barrier": "wall"}, "wall"),
)
"""Tags and the kind that they mean; the first match counts."""

KV_OF_V: tuple[tuple[float, float, Kv], ...] = ((60e3, 150e3, 110), (150e3, 300e3, 220), (300e3, 550e3, 400))
"""Ranges of voltages, and the level whose equipment stands for them."""

FOOT_M = 0.3048

UNITS = {"": 1.0, "m": 1.0, "cm": 0.01, "v": 1.0, "kv": 1000.0, "ft": FOOT_M}
"""Units that may follow the number of a tag, in lower case, and their size."""

RINGS = ("fence", "kerb")
"""Kinds that stand on the sides of a closed line."""

WALLS, WIDEST_WALL_M = ("wall", "fire_wall", "cable_trench_cover"), 2.0
"""Kinds that stand on the sides of a closed line if it is wider than they are (assumed); else they are the area."""

ALONG_Y = ("gis_outdoor",)
"""Kinds whose length is along their y axis."""

SAME_DEG = 1.0
"""Difference up to which the long axis of a block is one of its axes (assumed), as of rounded directions."""

STOREY_M, WALL_M = 3.5, 0.3
"""Height of a storey, and thickness of a wall (assumed)."""

WALL_HEIGHT_M = 3.0
"""Height of a wall whose height is not given (assumed)."""

STRAIGHT_M = 0.3
"""Deviation of three poles from a straight line and from equal distances up to which they are one piece (assumed)."""


class Found(NamedTuple):
    """Keys of a piece of a map, where it comes from, and whether it is too small to be more than a single pole."""

    place: str
    keys: dict[str, Any]
    is_pole: bool = False


def site_pieces(
    features: Sequence[MapFeature], reference: GeoreferenceConfig, fence: Yard
) -> tuple[list[Equipment], list[str]]:
    """Make pieces of equipment from features.

    Args:
        features: Features of the map.
        reference: Frame of the yard.
        fence: Yard without equipment.

    Returns:
        The pieces, with unique names, and a note on each feature that was left out or changed.
    """
    notes: list[str] = []
    found: list[Found] = []
    usual = max((_voltage(each.tags) or 0.0 for each in features if each.tags.get("power") in OUTLINES), default=0.0)
    for feature in features:
        if feature.tags.get("power") not in OUTLINES or feature.shape != "Polygon":
            own = list(_found(feature, places_in_yard(feature.points_deg, reference), usual))
            found += [each for each in own if isinstance(each, Found)]
            notes += [each for each in own if isinstance(each, str)]
    found, merged = _with_poles_joined(found)
    notes += merged
    pieces: list[Equipment] = []
    adapter = TypeAdapter[Equipment](Equipment)
    taken = {str(each.keys["name"]) for each in found if "name" in each.keys}
    names = set[str]()
    parts = Counter[tuple[str, str]]()
    for place, keys, _ in found:
        name = str(keys.get("name") or _name(keys, taken))
        parts[place, name] += 1  # the second part of a feature is NAME_2
        name = name if parts[place, name] == 1 else f"{name[: MOST_LETTERS - 5]}_{parts[place, name]}"
        own_name = _free_name(name, taken | names) if name in names else name
        try:
            piece = adapter.validate_python(as_tuples({**keys, "name": own_name}))
        except ValidationError as error:
            notes += [f"{place}: {line}; left out" for line in error_lines(error, Yard)]
            continue
        if piece.kind not in KIND_MATERIALS:
            notes.append(f"{place}: no kind `{piece.kind}`; left out")
        elif (across_m := fence.across_fence(piece)) > FENCE_TOLERANCE_M:
            notes.append(f"{place}: a {piece.kind} there extends {across_m:.2f} m beyond the fence; left out")
        else:
            pieces.append(piece)
            names.add(own_name)
            if own_name != name:
                notes.append(f"{place}: has the name `{name}` of an earlier piece; named `{own_name}`")
    return pieces, notes


def _found(feature: MapFeature, points_m: FloatArray, usual_v: float) -> Iterator[Found | str]:
    """Yield the pieces of a feature, or a note if it is left out."""
    own = feature.tags.get(OWN)
    if isinstance(own, str) and own:  # as GDAL saves tables
        try:
            own = json.loads(own)
        except ValueError as error:
            yield f"{feature.place}: {OWN}: is not valid JSON: {error}; left out"
            return
    if isinstance(own, Mapping):
        if isinstance(own.get("kind"), str):
            yield Found(feature.place, {**own, "position_m": points_m[0].round(4).tolist()})
        else:
            yield f"{feature.place}: {OWN}: kind must be text, got {own.get('kind')!r:.60}; left out"
        return
    kind = feature.kind or next((kind for tags, kind in RULES if _has(feature.tags, tags)), None)
    if kind is None:
        shown = ", ".join(f"{key}={value}" for key, value in feature.tags.items() if not key.startswith("@"))
        yield f"{feature.place}: no equipment is known for {shown or 'a feature without tags'}; left out"
        return
    keys: dict[str, Any] = {"kind": kind} | _name_key(feature.tags)
    shape = CATALOGUE.get(kind)
    if shape is not None and shape.build_for is not None:
        volts = _voltage(feature.tags)
        if volts is None and (stated := _stated_voltage(feature.tags)):
            yield f"{feature.place}: voltage: must be numbers of volts such as 110000;20000, got {stated:.60}; ignored"
        volts = volts or usual_v
        level = [kv for low, high, kv in KV_OF_V if low <= volts < high]
        if not level:
            given = f"{volts / 1e3:g} kV" if volts else "no voltage"
            yield f"{feature.place}: {kind} needs a voltage from 60 to 550 kV, got {given}; left out"
            return
        keys["kv"] = level[0]
    if shape is None or shape.stretches:
        yield from _long_pieces(feature, points_m, keys)
        return
    box = oriented_box(points_m)
    if feature.is_turned:
        keys["yaw_deg"] = _direction_deg(points_m[1] - points_m[0]) + feature.tags["yaw_deg"]
    elif feature.shape != "Point":
        keys["yaw_deg"] = _folded(np.degrees(box.yaw_rad))
    is_pole = (
        kind in APPARATUS and APPARATUS[kind].n_poles == 3 and box.size_m[0] < 2.0 * VOLTAGES[keys["kv"]].spacing_m
    )
    keys["position_m"] = box.centre_m.round(3).tolist()
    yield Found(feature.place, keys, is_pole)


def _long_pieces(feature: MapFeature, points_m: FloatArray, keys: dict[str, Any]) -> Iterator[Found | str]:
    """Yield a piece for each straight part of a line, or the box around an area."""
    kind, stated = keys["kind"], feature.tags.get("height")
    height_m = _number(stated)
    if stated not in (None, "") and height_m is None:
        yield f"{feature.place}: height: must be a number of metres, got {stated}; a usual height is taken"
    if feature.shape == "Point":
        yield f"{feature.place}: {kind} must be a line or an area, got a point; left out"
    elif kind != "wall" and (kind == "building" or kind not in CATALOGUE):
        levels = feature.tags.get("building:levels")
        if levels not in (None, "") and _number(levels) is None:
            yield f"{feature.place}: building:levels: must be a number, got {levels}; one is taken"
        height_m = height_m or STOREY_M * (_number(levels) or 1.0)
        box = oriented_box(points_m)
        footprint_m = box.size_m.round(3).tolist()
        solid = {
            "shape": "box",
            "footprint_m": footprint_m,
            "height_m": height_m,
            "yaw_deg": _folded(np.degrees(box.yaw_rad)),
        }
        yield Found(feature.place, {**keys, "position_m": box.centre_m.round(3).tolist(), **solid})
    else:
        ends_m = points_m if feature.shape == "LineString" else _axis(points_m)
        is_ring = kind in RINGS or (kind in WALLS and oriented_box(points_m).size_m[1] > WIDEST_WALL_M)
        if is_ring and feature.shape == "Polygon" and not feature.is_turned:
            ends_m = np.vstack([points_m, points_m[:1]])
        if not feature.is_turned:
            ends_m = _without_short_parts(ends_m)
        for start_m, end_m in pairwise(ends_m):
            length_m = round(float(np.linalg.norm(end_m - start_m)), 3)
            yaw_deg = _folded(_direction_deg(end_m - start_m) - (90.0 if kind in ALONG_Y else 0.0))
            if feature.is_turned:
                yaw_deg = _as_block(yaw_deg, _direction_deg(points_m[1] - points_m[0]) + feature.tags["yaw_deg"])
            part = {**keys, "position_m": (0.5 * (start_m + end_m)).round(3).tolist(), "yaw_deg": yaw_deg}
            if kind == "wall":
                height_m = height_m or WALL_HEIGHT_M
                yield Found(
                    feature.place, {**part, "shape": "box", "footprint_m": [length_m, WALL_M], "height_m": height_m}
                )
            else:
                yield Found(feature.place, {**part, "length_m": length_m})


def _without_short_parts(points_m: FloatArray) -> FloatArray:
    """Leave out inner points of a line (n, 2), as of a rounded corner, so that its parts are at least a piece long."""
    kept = [points_m[0]]
    for point_m in points_m[1:-1]:
        is_apart = np.linalg.norm([point_m - kept[-1], points_m[-1] - point_m], axis=-1) >= LEAST_STRETCHED_M
        kept += [point_m] if is_apart.all() else []
    return np.array([*kept, points_m[-1]])


def _axis(points_m: FloatArray) -> FloatArray:
    """Return the ends of the longer axis of an area, shape (2, 2)."""
    box = oriented_box(points_m)
    half_m = 0.5 * box.size_m[0] * np.array([np.cos(box.yaw_rad), np.sin(box.yaw_rad)])
    return np.stack([box.centre_m - half_m, box.centre_m + half_m])


def _with_poles_joined(found: list[Found]) -> tuple[list[Found], list[str]]:
    """Join three points in a row, a phase spacing apart, that are the poles of one piece of three poles."""
    joined, notes, used = list[Found](), list[str](), set[int]()
    three_pole = [k for k, each in enumerate(found) if each.is_pole]
    if not three_pole:
        return found, notes
    tree = KDTree([found[k].keys["position_m"] for k in three_pole])
    near = tree.query_ball_point(tree.data, max(3.0 * level.spacing_m for level in VOLTAGES.values()))
    pairs = ((k, pair) for k, others in enumerate(near) for pair in combinations(sorted(j for j in others if j > k), 2))
    for trio in ((three_pole[k], three_pole[i], three_pole[j]) for k, (i, j) in pairs):
        first, *others = (found[k] for k in trio)
        if used & set(trio) or any(
            first.keys.get(key) != each.keys.get(key) for each in others for key in ("kind", "kv", "name")
        ):
            continue
        places_m = np.array([found[k].keys["position_m"] for k in trio])
        apart_m = np.linalg.norm(places_m[:, np.newaxis] - places_m, axis=-1)
        places_m = places_m[np.roll([0, 1, 2], 1 - int(apart_m.sum(axis=0).argmin()))]  # the middle one second
        near_m = 1.5 * VOLTAGES[first.keys["kv"]].spacing_m
        is_straight = np.linalg.norm(places_m[[0, 2]].mean(axis=0) - places_m[1]) <= STRAIGHT_M
        if is_straight and np.linalg.norm(places_m[2] - places_m[0]) <= 2.0 * near_m:
            used |= set(trio)
            yaw_deg = _folded(_direction_deg(places_m[2] - places_m[0]))
            keys = {**first.keys, "position_m": places_m.mean(axis=0).round(3).tolist(), "yaw_deg": yaw_deg}
            joined.append(Found(first.place, keys))
            places = ", ".join(found[k].place for k in trio)
            notes.append(f"{places}: are taken as the poles of one {first.keys['kind']}")
    return [*(each for k, each in enumerate(found) if k not in used), *joined], notes


def _has(tags: Mapping[str, Any], needed: Mapping[str, str]) -> bool:
    return all(tags.get(key) not in (None, "", "no") and value in (ANY, tags[key]) for key, value in needed.items())


def _voltage(tags: Mapping[str, Any]) -> float | None:
    """Return the highest voltage of `voltage` such as `110000;20000`, or that of the primary winding."""
    volts = [_number(text) for text in re.split("[;,/]", _stated_voltage(tags))]
    return max((each for each in volts if each), default=None)


def _stated_voltage(tags: Mapping[str, Any]) -> str:
    return str(tags.get("voltage") or tags.get("voltage:primary") or "")


def _number(value: Any) -> float | None:  # noqa: ANN401 - a property may have any value
    """Return the positive number of a property such as `7.5`, `7,5 m`, `12 ft` or `16'3"`, in SI units, or None."""
    if feet := re.fullmatch(r"\s*(\d+)'\s*(?:(\d+)\")?\s*", str(value)):
        return FOOT_M * (int(feet[1]) + int(feet[2] or 0) / 12.0) or None
    found = re.fullmatch(r"\s*(\d*[.,]?\d+)\s*(\w*)\s*", str(value))
    unit = UNITS.get(found[2].lower()) if found else None
    return unit * float(found[1].replace(",", ".")) or None if found and unit else None


def _direction_deg(way_m: FloatArray) -> float:
    """Return the direction of a vector (2,), counter-clockwise from x, degrees."""
    return round(float(np.degrees(np.arctan2(way_m[1], way_m[0]))), 2)


def _folded(yaw_deg: float) -> float:
    """Return a yaw from -90 up to 90 degrees, for pieces that may as well stand the other way round."""
    return round((yaw_deg + 90.0) % 180.0 - 90.0, 2)


def _as_block(yaw_deg: float, block_deg: float) -> float:
    """Return the direction of a block instead of a yaw that may be opposite to it, from -180 up to 180 degrees."""
    is_along = abs((yaw_deg - block_deg + 90.0) % 180.0 - 90.0) < SAME_DEG
    return round((block_deg + 180.0) % 360.0 - 180.0, 2) if is_along else yaw_deg


def _name_key(tags: Mapping[str, Any]) -> dict[str, str]:
    """Return the name by the tags `ref` or `name`, in the letters that names may have."""
    text = re.sub(r"[^a-z0-9]+", "_", str(tags.get("ref") or tags.get("name") or "").lower()).strip("_")[:MOST_LETTERS]
    return {"name": text} if re.match("[a-z]", text) else {}


def _name(keys: Mapping[str, Any], taken: set[str]) -> str:
    """Return the name of a piece that has none: its kind and the first number that is free."""
    taken.add(name := _free_name(keys["kind"], taken, 1))
    return name


def _free_name(name: str, taken: Set[str], first: int = 2) -> str:
    """Return a name and the first number that is free, from a given one on."""
    number = first
    while (numbered := f"{name[: MOST_LETTERS - 5]}_{number}") in taken:
        number += 1
    return numbered
