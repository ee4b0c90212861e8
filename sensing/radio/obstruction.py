"""What stands in the way of straight lines, in compiled loops, and what it leaves of a wave."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from sensing.radio.edges import diffraction_parameter
from sensing.radio.materials import WAVELENGTH_M, Materials
from sensing.radio.surroundings import Obstacles
from sensing.radio.vectors import Vector, length, minus

FloatArray = NDArray[np.float64]

BARELY = 1e-9
"""Share of a line at its ends within which a surface does not count."""

NEAR = 0.3
"""Over the root of wavelength times length: what is farther from a line takes nothing from a wave along it, for its
diffraction parameter is below `CLEAR`, in the middle as well."""

CLEAR = -0.78
"""Diffraction parameter below which an edge takes nothing away (ITU-R P.526)."""

NOBODY = -1


class Inside(NamedTuple):
    """From which share of a line to which it lies inside of something; if it leaves before it enters, nowhere."""

    enters: float
    leaves: float


@compiled
def _between(low: float, high: float, start: float, change: float) -> Inside:
    """Where a coordinate that changes evenly along a line, from `start` by `change`, lies between two bounds."""
    if change == 0.0:
        return Inside(-np.inf, np.inf) if low < start < high else Inside(np.inf, -np.inf)
    first, second = (low - start) / change, (high - start) / change
    return Inside(min(first, second), max(first, second))


@compiled
def on_plan(start: Vector, end: Vector, obstacles: Obstacles, k: int) -> Inside:
    """Which part of the endless line through two points lies above or below the footprint of a solid, or within."""
    x, y = start.x - obstacles.centre_m[k, 0], start.y - obstacles.centre_m[k, 1]
    dx, dy, radius_m = end.x - start.x, end.y - start.y, obstacles.radius_m[k]
    if radius_m > 0.0:
        along, speed = x * dx + y * dy, dx * dx + dy * dy
        root = along * along - speed * (x * x + y * y - radius_m * radius_m)
        if speed == 0.0:
            return _between(0.0, radius_m * radius_m, x * x + y * y, 0.0)
        if root <= 0.0:
            return Inside(np.inf, -np.inf)
        return Inside((-along - math.sqrt(root)) / speed, (-along + math.sqrt(root)) / speed)
    cos, sin = math.cos(obstacles.yaw_rad[k]), math.sin(obstacles.yaw_rad[k])
    half_x, half_y = obstacles.half_size_m[k]
    first = _between(-half_x, half_x, cos * x + sin * y, cos * dx + sin * dy)
    second = _between(-half_y, half_y, cos * y - sin * x, cos * dy - sin * dx)
    return Inside(max(first.enters, second.enters), min(first.leaves, second.leaves))


@compiled
def crosses(start: Vector, end: Vector, obstacles: Obstacles, k: int) -> bool:
    """Whether a line crosses a solid; one that ends on its surface does not."""
    if length(minus(end, start)) == 0.0:
        return False
    plan, upright = (
        on_plan(start, end, obstacles, k),
        _between(obstacles.bottom_m[k], obstacles.top_m[k], start.z, end.z - start.z),
    )
    enters, leaves = max(plan.enters, upright.enters), min(plan.leaves, upright.leaves)
    return max(enters, 0.0) < min(leaves, 1.0) and enters < 1.0 - BARELY and leaves > BARELY


@compiled
def knife_edge_amplitude(nu: float) -> float:
    """Amplitude that a knife edge leaves, without ripples where it is not in the way: ITU-R P.526, eq. (31)."""
    if nu <= CLEAR:
        return 1.0
    return min(1.0, 10.0 ** (-6.9 / 20.0) / (math.sqrt((nu - 0.1) ** 2 + 1.0) + nu - 0.1))


@compiled
def _nu(start: Vector, edge: Vector, end: Vector, way_m: float) -> float:
    """Diffraction parameter, without its sign, of an edge beside a line of some length."""
    detour_m = length(minus(edge, start)) + length(minus(end, edge)) - way_m
    return diffraction_parameter(detour_m, WAVELENGTH_M)


@compiled
def shadow(start: Vector, end: Vector, obstacles: Obstacles, k: int) -> float:
    """Diffraction parameter of the way round a solid that takes least away; negative where a line passes it, minus infinity
    far from it.

    A line below a solid that stands on legs passes it.
    """
    way_m = length(minus(end, start))
    x, y = obstacles.centre_m[k]
    dx, dy = end.x - start.x, end.y - start.y
    level_m = max(math.hypot(dx, dy), 1e-9)
    across_x, across_y = -dy / level_m, dx / level_m
    radius_m = obstacles.radius_m[k]
    half_x, half_y = obstacles.half_size_m[k]
    reach_m = radius_m if radius_m > 0.0 else math.hypot(half_x, half_y)
    aside_m = (x - start.x) * across_x + (y - start.y) * across_y
    ahead_m = (x - start.x) * across_y - (y - start.y) * across_x
    if abs(aside_m) > reach_m + NEAR * math.sqrt(WAVELENGTH_M * way_m) or not -reach_m < ahead_m < level_m + reach_m:
        return -np.inf
    cos, sin = math.cos(obstacles.yaw_rad[k]), math.sin(obstacles.yaw_rad[k])
    left = right = 0.0
    nearest = np.inf
    for i in range(2 if radius_m > 0.0 else 4):
        if radius_m > 0.0:
            side = 1.0 if i == 0 else -1.0
            at_x, at_y = x + side * radius_m * across_x, y + side * radius_m * across_y
        else:
            p, q = half_x if i % 2 == 0 else -half_x, half_y if i < 2 else -half_y
            at_x, at_y = x + cos * p - sin * q, y + sin * p + cos * q
        share = min(max(((at_x - start.x) * dx + (at_y - start.y) * dy) / (level_m * level_m), 0.0), 1.0)
        nu = _nu(start, Vector(at_x, at_y, start.z + share * (end.z - start.z)), end, way_m)
        nearest = min(nearest, nu)
        if (at_x - start.x) * across_x + (at_y - start.y) * across_y > 0.0:
            left = max(left, nu)
        else:
            right = max(right, nu)
    plan = on_plan(start, end, obstacles, k)
    enters, leaves = max(plan.enters, 0.0), min(plan.leaves, 1.0)
    if enters >= leaves:
        return -nearest
    top_m, bottom_m, over, clear = obstacles.top_m[k], obstacles.bottom_m[k], 0.0, np.inf
    if max(start.z + enters * (end.z - start.z), start.z + leaves * (end.z - start.z)) < bottom_m:
        return -np.inf
    for share in (enters, leaves):
        nu = _nu(start, Vector(start.x + share * dx, start.y + share * dy, top_m), end, way_m)
        if start.z + share * (end.z - start.z) < top_m:
            over, clear = max(over, nu), 0.0
        else:
            clear = min(clear, nu)
    return -clear if over == 0.0 else min(left, right, over)


@compiled
def left_of_line(start: Vector, end: Vector, obstacles: Obstacles, materials: Materials, own: int) -> float:
    """Amplitude that what stands in the way leaves of a wave along a line: of what is opaque, the shadow of its edge.

    Args:
        start: Of the line.
        end: Of the line.
        obstacles: What stands about.
        materials: Of its pieces.
        own: Solid that does not count; `NOBODY` if all do.
    """
    left, counted = 1.0, -1
    for k in range(obstacles.owner.size):
        piece = obstacles.owner[k]
        if k == own:
            continue
        if materials.log_loss[piece] == -np.inf:
            left *= knife_edge_amplitude(shadow(start, end, obstacles, k))
        elif piece != counted and crosses(start, end, obstacles, k):
            left *= math.exp(materials.log_loss[piece])
            counted = piece
    return left
