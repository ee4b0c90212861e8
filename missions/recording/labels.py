"""Labels of equipment and waypoints on the plan, as many as fit."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dirmusic.arrays import FloatArray
from pdpatrol.missions.designations import bay_of, without_phase

PLAN_HEIGHT_PX, CHARACTER_PX, LABEL_HEIGHT_PX, MARGIN_PX = 380.0, 7.5, 26.0, 12.0
"""Height of the plan in a window of 1600 by 1000, and the size of its labels. Assumed; in smaller windows they may
overlap."""

AROUND_PX = ((0.0, 0.0), (0.0, 40.0), (-24.0, 18.0), (24.0, 18.0))
"""Shifts of the label of a point on the plan: below, above, left and right of it, in order of preference (assumed)."""

PLAN_SHARE = 1.1
"""Height of the plan over that of the yard, which is seen with a margin."""


def pixel_m(bounds_m: ArrayLike) -> float:
    """Return the size of a pixel of the plan, metres, for a yard from its south-west to its north-east corner."""
    width_m, height_m = np.ptp(np.asarray(bounds_m), axis=0).tolist()
    return PLAN_SHARE * max(width_m / 1.25, height_m) / PLAN_HEIGHT_PX


def equipment_labels(
    solids: Iterable[Mapping[str, Any]], pixel_size_m: float, with_sites: Collection[str] = ()
) -> dict[str, list[float]]:
    """Return the places of labels, x m, y m, z m, north of each bay or piece.

    Args:
        solids: Solids of all equipment.
        pixel_size_m: Size of a pixel, metres.
        with_sites: Names of the pieces on which a discharge can occur. They come first, then the largest.
    """
    corners_m: dict[str, list[FloatArray]] = {}
    volume_m3: dict[str, float] = {}
    bays_with_sites = {_bay(name) for name in with_sites}
    for solid in solids:
        name = solid["name"].split("/")[1]
        bay = _bay(name)
        size_m, place_m = np.array(solid["size_m"]), np.array(solid["position_m"])
        reach_m = np.hypot(*size_m[:2]) if solid["shape"] == "box" else size_m[0]
        corners_m.setdefault(bay, []).extend([place_m[:2] - reach_m, place_m[:2] + reach_m])
        volume_m3[bay] = volume_m3.get(bay, 0.0) + float(np.prod(np.maximum(size_m, 0.1)))
    places: dict[str, list[float]] = {}
    for bay in sorted(corners_m, key=lambda name: (name not in bays_with_sites, -volume_m3[name])):
        low_m, high_m = np.min(corners_m[bay], axis=0), np.max(corners_m[bay], axis=0)
        places[bay] = [0.5 * float(low_m[0] + high_m[0]), float(high_m[1]) + LABEL_HEIGHT_PX * pixel_size_m, 0.05]
    return places


def _bay(name: str) -> str:
    return bay_of(name) or without_phase(name)


def fitting(
    places: Mapping[str, Sequence[float]],
    pixel_size_m: float,
    taken: list[FloatArray],
    shifts_px: Sequence[tuple[float, float]] = ((0.0, 0.0),),
) -> dict[str, list[float]]:
    """Return the places of the labels that overlap none before them, in order, and add their boxes to those taken.

    Args:
        places: Places x m, y m, z m, each in the middle of the upper edge of its label.
        pixel_size_m: Size of a pixel, metres.
        taken: Boxes that are taken: x from, y from, x to, y to, metres.
        shifts_px: Shifts right and up that are tried in order, pixels.
    """
    kept: dict[str, list[float]] = {}
    for name, place in places.items():
        half_m, height_m = 0.5 * (CHARACTER_PX * len(name) + MARGIN_PX) * pixel_size_m, LABEL_HEIGHT_PX * pixel_size_m
        for right_px, up_px in shifts_px:
            x, y = place[0] + right_px * pixel_size_m, place[1] + up_px * pixel_size_m
            box = np.array([x - half_m, y - height_m, x + half_m, y])
            if not any((box[:2] < other[2:]).all() and (other[:2] < box[2:]).all() for other in taken):
                taken.append(box)
                kept[name] = [x, y, place[2]]
                break
    return kept
