"""Frame of a yard on a map: the smallest rectangle around the outline of the substation."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from dirmusic import InputFileError
from dirmusic.arrays import FloatArray
from pdpatrol.envs.scenario.map import GeoreferenceConfig
from pdpatrol.missions.site_map_files.features import MapFeature
from pdpatrol.missions.site_map_files.geodesy import longitude_latitude, places_in_yard
from pdpatrol.robot_models.yard.quantities import MOST_YARD_M

MARGIN_M = 5.0
"""Free ground around the features if the map has no outline (assumed)."""

OUTLINES = ("substation", "plant")
"""Values of the tag `power` of outlines."""

FULL = 0.95
"""Share of its rectangle that an outline must fill so that nothing is said about the rest."""


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


def site_frame(path: Any, features: Sequence[MapFeature]) -> tuple[GeoreferenceConfig, FloatArray, list[str]]:  # noqa: ANN401
    """Find the frame of the yard.

    Args:
        path: Name of the file, for messages.
        features: Features of the map.

    Returns:
        Position on Earth, size of the yard (2,), and notes.

    Raises:
        InputFileError: If the yard is too large, or the map has several outlines.
    """
    outlines = [each for each in features if each.shape == "Polygon" and each.tags.get("power") in OUTLINES]
    if len(outlines) > 1:
        places = ", ".join(each.place for each in outlines)
        raise InputFileError([f"{path}: must have one outline of a substation, got {len(outlines)}: {places}"])
    notes: list[str] = []
    chosen = outlines or features
    points_deg = np.concatenate([each.points_deg for each in chosen])
    rough = GeoreferenceConfig(longitude_deg=float(points_deg[0, 0]), latitude_deg=float(points_deg[0, 1]))
    points_m = places_in_yard(points_deg, rough)
    stated_deg = outlines[0].tags.get("heading_deg") if outlines else 0.0
    if isinstance(stated_deg, int | float):
        heading_deg = float(stated_deg)
    else:
        yaw_deg = np.degrees(oriented_box(points_m).yaw_rad)
        heading_deg = -((yaw_deg + 45.0) % 90.0 - 45.0)
    box = oriented_box(points_m, -np.radians(heading_deg))
    size_m = box.size_m
    if not outlines:
        size_m = size_m + 2.0 * MARGIN_M
        notes.append(
            f"{path}: has no outline (power=substation, or a closed fence); "
            f"the yard extends {MARGIN_M:g} m beyond the features"
        )
    elif (share := ring_area(points_m) / float(np.prod(size_m))) < FULL:
        notes.append(f"{outlines[0].place}: fills {share:.0%} of its rectangle; the yard is the whole rectangle")
    if size_m.max() > MOST_YARD_M:
        given = f"{size_m[0]:.0f} x {size_m[1]:.0f} m"
        raise InputFileError([f"{path}: the yard must be at most {MOST_YARD_M:g} m long, got {given}"])
    turn = np.array([[np.cos(box.yaw_rad), np.sin(box.yaw_rad)], [-np.sin(box.yaw_rad), np.cos(box.yaw_rad)]])
    corner_m = box.centre_m - 0.5 * size_m @ turn
    longitude_deg, latitude_deg = longitude_latitude(corner_m, rough).tolist()
    reference = GeoreferenceConfig(
        latitude_deg=latitude_deg, longitude_deg=longitude_deg, heading_deg=round(heading_deg, 4)
    )
    return reference, size_m, notes


def ring_area(ring_m: FloatArray) -> float:
    """Return the area of a polygon (n, 2)."""
    x, y = ring_m.T
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
