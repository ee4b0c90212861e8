"""Frame of a yard on a map: the smallest rectangle around the outline of the substation, and its fence."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from pydantic import TypeAdapter, ValidationError
from scipy.spatial import ConvexHull, QhullError

from dirmusic import InputFileError
from dirmusic.arrays import FloatArray
from pdpatrol.envs.scenario.base import error_lines
from pdpatrol.envs.scenario.map import GeoreferenceConfig
from pdpatrol.missions.site_map_files.features import OWN, MapFeature
from pdpatrol.missions.site_map_files.geodesy import longitude_latitude, places_in_yard
from pdpatrol.robot_models.yard.polygon import LEAST_SIDE_M, Polygon, PolygonCorners
from pdpatrol.robot_models.yard.quantities import LEAST_YARD_M, MOST_YARD_M

MARGIN_M = 5.0
"""Free ground around the features if the map has no outline (assumed)."""

OUTLINES = ("substation", "plant")
"""Values of the tag `power` of outlines."""

N_FRAMES = 3
"""Number of times that the frame is computed, each about the last corner: then it moves by less than 1 mm."""

RECTANGLE_M = 0.01
"""Deviation from a rectangle up to which the fence is one (assumed), as of equipment from the fence."""


class SiteFrame(NamedTuple):
    """Frame of a yard on a map.

    Attributes:
        reference: Position on Earth.
        size_m: Size of the yard, shape (2,).
        fence_m: Corners of a fence that is not a rectangle, shape (n, 2), yard frame; None for a rectangle.
        notes: Notes on assumptions.
    """

    reference: GeoreferenceConfig
    size_m: FloatArray
    fence_m: FloatArray | None
    notes: list[str]


class OrientedBox(NamedTuple):
    """Rectangle in the plane.

    Attributes:
        centre_m: Middle, shape (2,).
        size_m: Length along x and y of the box, the longer one first, shape (2,).
        yaw_rad: Direction of its x axis, counter-clockwise from x, in [0, pi).
    """

    centre_m: FloatArray
    size_m: FloatArray
    yaw_rad: float


def oriented_box(points_m: FloatArray, yaw_rad: float | None = None) -> OrientedBox:
    """Return the smallest rectangle around points (n, 2), or the one with a given direction."""
    try:
        hull_m = points_m[ConvexHull(points_m).vertices]
    except (QhullError, ValueError):  # fewer than three points, or all on a line
        hull_m = points_m[np.lexsort(points_m.T)[[0, -1]]]
    sides_m = np.roll(hull_m, -1, axis=0) - hull_m
    best: OrientedBox | None = None
    for angle in np.arctan2(sides_m[:, 1], sides_m[:, 0]).tolist() if yaw_rad is None else [yaw_rad]:
        axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        low_m, high_m = (hull_m @ axes.T).min(axis=0), (hull_m @ axes.T).max(axis=0)
        box = OrientedBox(0.5 * (low_m + high_m) @ axes, high_m - low_m, angle)
        if best is None or np.prod(box.size_m) < np.prod(best.size_m) - 1e-9:
            best = box
    assert best is not None
    if yaw_rad is None and best.size_m[1] > best.size_m[0]:
        best = OrientedBox(best.centre_m, best.size_m[::-1], best.yaw_rad + 0.5 * np.pi)
    return best if yaw_rad is not None else best._replace(yaw_rad=best.yaw_rad % np.pi)


def with_outline(features: Sequence[MapFeature]) -> list[MapFeature]:
    """Mark the largest closed fence around most features as the outline, if the map has none.

    Closed lines become areas, as OpenStreetMap does not distinguish the two.
    """
    features = [_as_area(each) for each in features]
    rings = [each for each in features if each.shape == "Polygon" and each.tags.get("barrier") == "fence"]
    if not rings or any(each.tags.get("power") in OUTLINES for each in features):
        return features
    outline = max(rings, key=lambda each: ring_area(each.points_deg))
    others_deg = np.array([each.points_deg.mean(axis=0) for each in features if each is not outline]).reshape(-1, 2)
    is_around = Polygon(list(map(tuple, outline.points_deg.tolist()))).is_inside(others_deg)
    if not len(others_deg) or is_around.mean() <= 0.5:
        return features
    tags = {**outline.tags, "power": OUTLINES[0]}
    return [each._replace(tags=tags) if each is outline else each for each in features]


def _as_area(feature: MapFeature) -> MapFeature:
    """Return the area within a closed line, and any other feature unchanged."""
    points_deg = feature.points_deg
    is_closed = feature.shape == "LineString" and len(points_deg) > 3 and (points_deg[0] == points_deg[-1]).all()
    return feature._replace(shape="Polygon", points_deg=points_deg[:-1]) if is_closed else feature


def site_frame(path: Any, features: Sequence[MapFeature]) -> SiteFrame:  # noqa: ANN401
    """Find the frame of the yard.

    Args:
        path: Name of the file, for messages.
        features: Features of the map.

    Raises:
        InputFileError: If the yard is too large, the map has several outlines, or sides or heading of the outline are
            not valid.
    """
    outlines = [each for each in features if each.shape == "Polygon" and each.tags.get("power") in OUTLINES]
    if len(outlines) > 1:
        places = ", ".join(each.place for each in outlines)
        raise InputFileError([f"{path}: must have one outline of a substation, got {len(outlines)}: {places}"])
    notes: list[str] = []
    chosen = outlines or features
    points_deg = np.concatenate([each.points_deg for each in chosen])
    stated_deg = _stated_heading(path, outlines[0]) if outlines else 0.0
    corner = GeoreferenceConfig(longitude_deg=float(points_deg[0, 0]), latitude_deg=float(points_deg[0, 1]))
    for _ in range(N_FRAMES):  # headings are those of the meridian of the corner
        rough, points_m = corner, places_in_yard(points_deg, corner)
        heading_deg = stated_deg
        if heading_deg is None:
            yaw_deg = np.degrees(oriented_box(points_m).yaw_rad)
            heading_deg = -((yaw_deg + 45.0) % 90.0 - 45.0)
        box = oriented_box(points_m, -np.radians(heading_deg))
        size_m = box.size_m if outlines else box.size_m + 2.0 * MARGIN_M
        turn = np.array([[np.cos(box.yaw_rad), np.sin(box.yaw_rad)], [-np.sin(box.yaw_rad), np.cos(box.yaw_rad)]])
        corner_m = box.centre_m - 0.5 * size_m @ turn
        longitude_deg, latitude_deg = longitude_latitude(corner_m, rough).tolist()
        corner = GeoreferenceConfig(latitude_deg=latitude_deg, longitude_deg=longitude_deg)
    if not outlines and any(OWN in each.tags for each in features):
        notes.append(f"{path}: has no outline with heading_deg; yaw_deg of exported pieces may be wrong")
    if not outlines:
        notes.append(
            f"{path}: has no outline (power=substation, or a closed fence); "
            f"the yard extends {MARGIN_M:g} m beyond the features"
        )
    if size_m.round(2).max() > MOST_YARD_M:
        given = f"{size_m[0]:.0f} x {size_m[1]:.0f} m"
        raise InputFileError([f"{path}: the yard must be at most {MOST_YARD_M:g} m long, got {given}"])
    if size_m.min() < LEAST_YARD_M:
        given = f"{size_m[0]:.2g} x {size_m[1]:.2g} m"
        raise InputFileError([f"{path}: the yard must be at least {LEAST_YARD_M:g} m wide, got {given}"])
    reference = corner.model_copy(update={"heading_deg": round(heading_deg, 4)})
    fence_m = _fence(path, outlines[0].place, (points_m - corner_m) @ turn.T, size_m) if outlines else None
    return SiteFrame(reference, size_m if fence_m is None else fence_m.max(axis=0), fence_m, notes)


def _stated_heading(path: Any, outline: MapFeature) -> float | None:  # noqa: ANN401
    """Return the heading that an outline states, degrees; None without one.

    Raises:
        InputFileError: If it is not a number in its range.
    """
    stated = outline.tags.get("heading_deg")
    if stated is None or stated == "":
        return None
    try:
        heading_deg = float("nan" if isinstance(stated, bool) else stated)
    except (TypeError, ValueError):
        heading_deg = np.nan
    if not abs(heading_deg) <= 360.0:
        text = f"{outline.place}: heading_deg: must be from -360 to 360 degrees, got {stated}"
        raise InputFileError([f"{path}: {text}"])
    return heading_deg


def _fence(path: Any, place: str, ring_m: FloatArray, size_m: FloatArray) -> FloatArray | None:  # noqa: ANN401
    """Return the corners of an outline (n, 2), millimetres rounded, or None if it is the rectangle of a size (2,).

    Corners that are nearer than `LEAST_SIDE_M` to the one before are left out.

    Raises:
        InputFileError: If it is not a simple polygon.
    """
    kept_m = ring_m[np.linalg.norm(ring_m - np.roll(ring_m, 1, axis=0), axis=-1) >= LEAST_SIDE_M].round(3)
    kept_m = kept_m - kept_m.min(axis=0) if len(kept_m) else kept_m
    try:
        corners_m = TypeAdapter(PolygonCorners).validate_python(tuple(map(tuple, kept_m.tolist())))
    except ValidationError as error:
        lines = [f"{path}: {place}: outline: {line.lstrip(': ')}" for line in error_lines(error, GeoreferenceConfig)]
        raise InputFileError(lines) from None
    box_m = size_m * np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    box = Polygon(list(map(tuple, box_m.tolist())))
    off_m = np.abs([*box.signed_distance(kept_m), *Polygon(corners_m).signed_distance(box_m)])
    return None if off_m.max() <= RECTANGLE_M else kept_m


def ring_area(ring_m: FloatArray) -> float:
    """Return the area of a polygon (n, 2)."""
    x, y = ring_m.T
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
