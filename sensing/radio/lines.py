"""Straight lines beside and through solids, in compiled functions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dirmusic.compiled import compiled
from pdpatrol.sensing.radio.materials import WAVELENGTH_M
from pdpatrol.sensing.radio.tables import Shape
from pdpatrol.sensing.radio.vectors import Vector

BARELY = 1e-9
"""Share of a line at its ends within which a surface does not count."""

NEAR = 0.3
"""Distance over the root of wavelength times length, from `Line.near_m` on."""

BREADTH = 0.95
"""Of the box that stands for a round solid, across the line that it faces, over that of the solid."""


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


class Line(NamedTuple):
    """From one point straight to another.

    Attributes:
        start: As said.
        end: As said.
        length_m: Between them.
        level_m: On plan, > 0.
        ahead_x: Unit vector along it, on plan.
        ahead_y: As `ahead_x`.
        near_m: What is farther from it takes nothing from a wave along it, for its diffraction parameter is below
            `CLEAR`, in the middle as well.
    """

    start: Vector
    end: Vector
    length_m: float
    level_m: float
    ahead_x: float
    ahead_y: float
    near_m: float


@compiled
def line(start: Vector, end: Vector) -> Line:
    """From one point to another."""
    dx, dy, dz = end.x - start.x, end.y - start.y, end.z - start.z
    level_m = max(math.sqrt(dx * dx + dy * dy), 1e-9)
    length_m = math.sqrt(dx * dx + dy * dy + dz * dz)
    return Line(start, end, length_m, level_m, dx / level_m, dy / level_m, NEAR * math.sqrt(WAVELENGTH_M * length_m))


@compiled
def is_near(way: Line, solid: Shape, margin_m: float) -> bool:
    """Whether a circle about the footprint of a solid comes close to a line, on plan."""
    x, y, reach_m = solid.x - way.start.x, solid.y - way.start.y, solid.reach_m + margin_m
    ahead_m = x * way.ahead_x + y * way.ahead_y
    return abs(y * way.ahead_x - x * way.ahead_y) <= reach_m and -reach_m < ahead_m < way.level_m + reach_m


@compiled
def on_plan(way: Line, solid: Shape) -> Inside:
    """Which part of the endless line through two points lies above or below the footprint of a solid, or within."""
    x, y, dx, dy = way.start.x - solid.x, way.start.y - solid.y, way.end.x - way.start.x, way.end.y - way.start.y
    if solid.radius_m > 0.0:
        along, speed = x * dx + y * dy, dx * dx + dy * dy
        root = along * along - speed * (x * x + y * y - solid.radius_m * solid.radius_m)
        if speed == 0.0:
            return _between(-1.0, solid.radius_m * solid.radius_m, x * x + y * y, 0.0)
        if root <= 0.0:
            return Inside(np.inf, -np.inf)
        return Inside((-along - math.sqrt(root)) / speed, (-along + math.sqrt(root)) / speed)
    cos, sin = solid.cos, solid.sin
    first = _between(-solid.half_x, solid.half_x, cos * x + sin * y, cos * dx + sin * dy)
    second = _between(-solid.half_y, solid.half_y, cos * y - sin * x, cos * dy - sin * dx)
    return Inside(max(first.enters, second.enters), min(first.leaves, second.leaves))


@compiled
def inside(way: Line, solid: Shape) -> Inside:
    """Which part of the endless line through two points lies inside a solid."""
    plan = on_plan(way, solid)
    upright = _between(solid.bottom_m, solid.top_m, way.start.z, way.end.z - way.start.z)
    return Inside(max(plan.enters, upright.enters), min(plan.leaves, upright.leaves))


@compiled
def inside_m(way: Line, solid: Shape) -> float:
    """How much of a line lies inside a solid."""
    part = inside(way, solid)
    return max(min(part.leaves, 1.0) - max(part.enters, 0.0), 0.0) * way.length_m


@compiled
def crosses(way: Line, solid: Shape) -> bool:
    """Whether a line crosses a solid; one that ends on its surface does not."""
    if way.length_m == 0.0 or not is_near(way, solid, 0.0):
        return False
    enters, leaves = inside(way, solid)
    return max(enters, 0.0) < min(leaves, 1.0) and enters < 1.0 - BARELY and leaves > BARELY


@compiled
def facing(way: Line, solid: Shape) -> Shape:
    """What bends waves along a line: a round solid as the box within it that faces the line, a box as it is."""
    if solid.radius_m == 0.0:
        return solid
    return Shape(
        solid.x,
        solid.y,
        way.ahead_x,
        way.ahead_y,
        math.sqrt(1.0 - BREADTH * BREADTH) * solid.radius_m,
        BREADTH * solid.radius_m,
        0.0,
        solid.radius_m,
        solid.bottom_m,
        solid.top_m,
    )
