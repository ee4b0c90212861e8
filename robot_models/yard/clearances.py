"""Check of the clearances in air of a yard against IEC 61936-1.

Kinds with a size for each voltage level state which of their parts are live and which insulate; everything else counts
as earthed. Clearances within one piece follow from its type test, except between its phases. Conductors between pieces
are not modelled, and not checked.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dirmusic.arrays import BoolArray, FloatArray, IntArray
from pdpatrol.robot_models.equipment.voltages import INSULATION_HEIGHT_M, VOLTAGES, Kv
from pdpatrol.robot_models.yard.solids import YardSolids
from pdpatrol.robot_models.yard.yard import Yard

TOUCH_M = 0.01
"""Distance within which live parts are one conductor."""

ROUNDING_M = 1e-6
"""Shortfall that is not reported."""

OIL_FILLED = ("power_transformer", "shunt_reactor")
"""Kinds that need a fire wall or a distance to each other."""

BUILDINGS = ("building", "control_building")


class _Parts(NamedTuple):
    """Parts of a yard: their names, and masks of those that are live and of those that insulate."""

    names: list[str]
    is_live: BoolArray
    is_insulator: BoolArray


def clearance_errors(yard: Yard, kv: Kv) -> list[str]:
    """List the parts of a yard that are nearer to one another, to the ground or to the fence than IEC 61936-1 allows.

    Args:
        yard: Yard whose equipment is of one voltage level.
        kv: That voltage level.

    Returns:
        One line per pair or part: names, distance and required distance.
    """
    if not yard.equipment:
        return []
    parts = _parts_of(yard)
    errors = [*_height_errors(yard, kv, parts), *_fence_errors(yard, kv, parts), *_fire_errors(yard, kv)]
    return [*errors, *_distance_errors(yard, kv, parts)] if parts.is_live.any() else errors


def _parts_of(yard: Yard) -> _Parts:
    assemblies = [item.assembly for item in yard.equipment]
    pairs = [
        (item.name, part, built) for item, built in zip(yard.equipment, assemblies, strict=True) for part in built.parts
    ]
    return _Parts(
        [f"{name}/{part}" for name, part, _ in pairs],
        np.array([part in built.live for _, part, built in pairs]),
        np.array([part in built.insulators for _, part, built in pairs]),
    )


def _height_errors(yard: Yard, kv: Kv, parts: _Parts) -> Iterator[str]:
    """Check the height of live parts and insulators above the ground."""
    bottom_m = yard.solids.bottom_m
    for is_part, least_m, what in (
        (parts.is_live, VOLTAGES[kv].live_height_m, "live parts"),
        (parts.is_insulator, INSULATION_HEIGHT_M, "insulators"),
    ):
        for k in np.flatnonzero(is_part & (bottom_m < least_m - ROUNDING_M)).tolist():
            yield f"{parts.names[k]}: is {bottom_m[k]:.2f} m above ground, {what} need {least_m:.2f} m"


def _fence_errors(yard: Yard, kv: Kv, parts: _Parts) -> Iterator[str]:
    """Check the distance of live parts from the fence."""
    least_m = VOLTAGES[kv].to_fence_m
    off_m = yard.to_fence(yard.solids)
    for k in np.flatnonzero(parts.is_live).tolist():
        if off_m[k] < least_m - ROUNDING_M:
            yield f"{parts.names[k]}: is {off_m[k]:.2f} m from the fence, live parts need {least_m:.2f} m"


def _distance_errors(yard: Yard, kv: Kv, parts: _Parts) -> Iterator[str]:
    """Check the distances between live parts, and between live and earthed parts of different pieces."""
    level = VOLTAGES[kv]
    live, other, distance_m = _near_pairs(yard.solids, parts.is_live, max(level.to_earth_m, level.to_phase_m))
    touches = parts.is_live[other] & (distance_m <= TOUCH_M)
    n_parts = len(parts.names)
    graph = coo_array((np.ones(int(touches.sum())), (live[touches], other[touches])), shape=(n_parts, n_parts))
    _, conductor = connected_components(graph, directed=False)
    is_other_phase = parts.is_live[other] & (live < other) & (conductor[live] != conductor[other])
    is_earthed = ~parts.is_live[other] & ~parts.is_insulator[other] & (yard.owner[live] != yard.owner[other])
    for is_pair, least_m, what in (
        (is_other_phase, level.to_phase_m, "two phases"),
        (is_earthed, level.to_earth_m, "phase and earth"),
    ):
        for k in np.flatnonzero(is_pair & (distance_m < least_m - ROUNDING_M)).tolist():
            names = f"{parts.names[live[k]]}, {parts.names[other[k]]}"
            yield f"{names}: are {distance_m[k]:.2f} m apart, {what} need {least_m:.2f} m"


def _near_pairs(solids: YardSolids, is_live: BoolArray, within_m: float) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the pairs of a live and another solid within a distance, and the distances, each of shape (n_pairs,)."""
    reach_m, live = np.hypot(*solids.half_size_m.T) + solids.radius_m, np.flatnonzero(is_live)
    apart_m = np.linalg.norm(solids.centre_m[live][:, np.newaxis] - solids.centre_m, axis=-1)
    rows, other = np.nonzero(apart_m <= reach_m[live][:, np.newaxis] + reach_m + within_m)
    distance_m = pair_distances(solids.take(live[rows]), solids.take(other))
    is_near = distance_m <= within_m
    return live[rows][is_near], other[is_near], distance_m[is_near]


def _fire_errors(yard: Yard, kv: Kv) -> Iterator[str]:
    """Check the distance of oil-filled equipment from one another, unless a fire wall separates them, and buildings."""
    least_m = VOLTAGES[kv].fire_m
    oil = [item for item in yard.equipment if item.kind in OIL_FILLED]
    walls_m = [item.solids.extent_m for item in yard.equipment if item.kind == "fire_wall"]
    others = [item for item in yard.equipment if item.kind in BUILDINGS]
    for number, item in enumerate(oil):
        for other in (*oil[number + 1 :], *others):
            (low_m, high_m), (other_low_m, other_high_m) = item.solids.extent_m, other.solids.extent_m
            gap_m = np.maximum(np.maximum(low_m - other_high_m, other_low_m - high_m), 0.0)
            apart_m = float(np.hypot(*gap_m))
            middle_m = 0.5 * (np.minimum(high_m, other_high_m) + np.maximum(low_m, other_low_m))
            is_walled = any(
                (wall_low_m <= middle_m + 0.5 * gap_m).all() and (wall_high_m >= middle_m - 0.5 * gap_m).all()
                for wall_low_m, wall_high_m in walls_m
            )
            if apart_m < least_m - ROUNDING_M and not is_walled:
                yield f"{item.name}, {other.name}: are {apart_m:.2f} m apart, need {least_m:.2f} m or a fire wall"


def pair_distances(some: YardSolids, others: YardSolids) -> FloatArray:
    """Return the distance between the solids of each pair, shape (n_pairs,); 0 where they touch or overlap."""
    sideways = np.minimum(_from_corners(some, others), _from_corners(others, some))
    sideways = np.where(_boxes_overlap(some, others), 0.0, np.maximum(sideways, 0.0))
    upward = np.maximum(some.bottom_m - others.top_m, others.bottom_m - some.top_m)
    return np.hypot(sideways, np.maximum(upward, 0.0))


def _from_corners(some: YardSolids, others: YardSolids) -> FloatArray:
    """Return the least distance from the corners of a box, or from a circle, to the other footprint, (n_pairs,)."""
    least_m = np.full(some.yaw_rad.size, np.inf)
    for x_sign, y_sign in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)):
        corner_m = some.centre_m + _turned(some.half_size_m * (x_sign, y_sign), some.yaw_rad)
        beyond_m = np.abs(_turned(corner_m - others.centre_m, -others.yaw_rad)) - others.half_size_m
        least_m = np.minimum(least_m, np.hypot(*np.maximum(beyond_m, 0.0).T) + np.minimum(beyond_m.max(axis=1), 0.0))
    return least_m - some.radius_m - others.radius_m


def _boxes_overlap(some: YardSolids, others: YardSolids) -> BoolArray:
    """Return whether no line separates two boxes, shape (n_pairs,); false for circles.

    Lines along the sides of both boxes suffice. For circles, `_from_corners` finds overlap.
    """
    apart_m, most_m = some.centre_m - others.centre_m, np.full(some.yaw_rad.size, -np.inf)
    for yaw_rad in (some.yaw_rad, others.yaw_rad):
        reach_m = [
            np.abs(_turned(boxes.half_size_m * (1.0, sign), boxes.yaw_rad - yaw_rad))
            for boxes in (some, others)
            for sign in (1.0, -1.0)
        ]
        both_m = np.maximum(reach_m[0], reach_m[1]) + np.maximum(reach_m[2], reach_m[3])
        most_m = np.maximum(most_m, (np.abs(_turned(apart_m, -yaw_rad)) - both_m).max(axis=1))
    return (some.radius_m == 0.0) & (others.radius_m == 0.0) & (most_m <= 0.0)


def _turned(vectors_m: FloatArray, yaw_rad: FloatArray) -> FloatArray:
    """Turn vectors (n, 2) counter-clockwise by angles (n,)."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    x, y = vectors_m.T
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
