"""Check of the clearances in air of a yard against IEC 61936-1.

Kinds with a size for each voltage level state which of their parts are live and which insulate; everything else counts
as earthed. Clearances within one piece are those of its type test, except between its phases. Conductors between pieces
are not modelled, and not checked.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.sparse.csgraph import connected_components

from dirmusic.arrays import BoolArray, FloatArray
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
        One line per pair or part: what is too near, how near it is, and what is required.
    """
    if not yard.equipment:
        return []
    parts = _parts_of(yard)
    return [
        *_height_errors(yard, kv, parts),
        *_fence_errors(yard, kv, parts),
        *_distance_errors(yard, kv, parts),
        *_fire_errors(yard, kv),
    ]


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
    for k in np.flatnonzero(parts.is_live).tolist():
        low_m, high_m = yard.solids.take(np.arange(len(parts.names)) == k).extent_m
        off_m = float(np.minimum(low_m, yard.size_m - high_m).min())
        if off_m < least_m - ROUNDING_M:
            yield f"{parts.names[k]}: is {off_m:.2f} m from the fence, live parts need {least_m:.2f} m"


def _distance_errors(yard: Yard, kv: Kv, parts: _Parts) -> Iterator[str]:
    """Check the distances between live parts, and between live and earthed parts of different pieces."""
    level, live = VOLTAGES[kv], np.flatnonzero(parts.is_live)
    apart_m = solid_distances(yard.solids.take(parts.is_live), yard.solids)
    between_live_m = apart_m[:, live]
    _, conductor = connected_components(between_live_m <= TOUCH_M, directed=False)
    is_other_phase = conductor[:, np.newaxis] < conductor
    is_earthed = ~parts.is_live & ~parts.is_insulator & (yard.owner != yard.owner[live][:, np.newaxis])
    for is_pair, others, distance_m, least_m, what in (
        (is_other_phase, live, between_live_m, level.to_phase_m, "two phases"),
        (is_earthed, np.arange(len(parts.names)), apart_m, level.to_earth_m, "phase and earth"),
    ):
        for i, j in np.argwhere(is_pair & (distance_m < least_m - ROUNDING_M)).tolist():
            yield (
                f"{parts.names[live[i]]}, {parts.names[others[j]]}: are {distance_m[i, j]:.2f} m apart, {what} need "
                f"{least_m:.2f} m"
            )


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


def solid_distances(some: YardSolids, all_solids: YardSolids) -> FloatArray:
    """Return the distances between solids, shape (n_some, n_all); 0 where they touch or overlap."""
    sideways = np.minimum(_from_corners(some, all_solids), _from_corners(all_solids, some).T)
    sideways = np.where(_footprints_overlap(some, all_solids), 0.0, np.maximum(sideways, 0.0))
    upward = np.maximum(
        some.bottom_m[:, np.newaxis] - all_solids.top_m, all_solids.bottom_m - some.top_m[:, np.newaxis]
    )
    return np.hypot(sideways, np.maximum(upward, 0.0))


def _from_corners(some: YardSolids, others: YardSolids) -> FloatArray:
    """Return the least distance from the corners or circles of some footprints to others, shape (n_some, n_others)."""
    signs = np.array([(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)])
    own_m = signs[:, np.newaxis] * some.half_size_m  # (4, n_some, 2)
    cos, sin = np.cos(some.yaw_rad), np.sin(some.yaw_rad)
    turned_m = np.stack([cos * own_m[..., 0] - sin * own_m[..., 1], sin * own_m[..., 0] + cos * own_m[..., 1]], axis=-1)
    distance_m = others.horizontal_distance(some.centre_m + turned_m).min(axis=0)
    return distance_m - some.radius_m[:, np.newaxis]


def _footprints_overlap(some: YardSolids, others: YardSolids) -> BoolArray:
    """Return whether no line separates two boxes, shape (n_some, n_others); false for circles.

    Lines along the sides of both boxes suffice. For circles, `_from_corners` finds overlap.
    """
    apart_m = some.centre_m[:, np.newaxis] - others.centre_m
    is_box = (some.radius_m == 0.0)[:, np.newaxis] & (others.radius_m == 0.0)
    most_m = np.full(apart_m.shape[:2], -np.inf)
    for yaw_rad in (some.yaw_rad[:, np.newaxis] + 0.0 * others.yaw_rad, others.yaw_rad + 0.0 * some.yaw_rad[:, None]):
        for quarter in (0.0, 0.5 * np.pi):
            axis = np.stack([np.cos(yaw_rad + quarter), np.sin(yaw_rad + quarter)], axis=-1)
            reach_m = _reach(some.yaw_rad[:, np.newaxis], some.half_size_m[:, np.newaxis], axis)
            reach_m += _reach(others.yaw_rad, others.half_size_m, axis)
            most_m = np.maximum(most_m, np.abs((apart_m * axis).sum(axis=-1)) - reach_m)
    return is_box & (most_m <= 0.0)


def _reach(yaw_rad: FloatArray, half_size_m: FloatArray, axis: FloatArray) -> FloatArray:
    """Return half the length of boxes along unit vectors (..., 2)."""
    along = np.abs(np.cos(yaw_rad) * axis[..., 0] + np.sin(yaw_rad) * axis[..., 1])
    across = np.abs(np.cos(yaw_rad) * axis[..., 1] - np.sin(yaw_rad) * axis[..., 0])
    return half_size_m[..., 0] * along + half_size_m[..., 1] * across
