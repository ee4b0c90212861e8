"""Vectors of space in compiled functions."""

from __future__ import annotations

import math
from typing import NamedTuple

from dirmusic.compiled import compiled

TINY = 1e-9
"""A sine below which two directions are one."""


class Vector(NamedTuple):
    """Of space, world frame."""

    x: float
    y: float
    z: float


@compiled
def dot(first: Vector, second: Vector) -> float:
    """Scalar product."""
    return first.x * second.x + first.y * second.y + first.z * second.z


@compiled
def hypot(first: float, second: float) -> float:
    """Length over two axes; `math.hypot` takes thrice as long, for sizes that no yard has."""
    return math.sqrt(first * first + second * second)


@compiled
def length(vector: Vector) -> float:
    """Euclidean length."""
    return math.sqrt(dot(vector, vector))


@compiled
def minus(first: Vector, second: Vector) -> Vector:
    """The way from the second point to the first."""
    return Vector(first.x - second.x, first.y - second.y, first.z - second.z)


@compiled
def towards(start: Vector, end: Vector) -> Vector:
    """Unit vector from one point to another."""
    way = minus(end, start)
    way_m = max(length(way), TINY)
    return Vector(way.x / way_m, way.y / way_m, way.z / way_m)


@compiled
def between(start: Vector, end: Vector, share: float) -> Vector:
    """The point so far on the way from one to another."""
    way = minus(end, start)
    return Vector(start.x + share * way.x, start.y + share * way.y, start.z + share * way.z)


@compiled
def just_off(at: Vector, normal: Vector) -> Vector:
    """A point so near above a face that lines from it to the front do not cross what is behind."""
    return Vector(at.x + TINY * normal.x, at.y + TINY * normal.y, at.z + TINY * normal.z)


@compiled
def upside_down(vector: Vector) -> Vector:
    """Mirrored in the ground."""
    return Vector(vector.x, vector.y, -vector.z)


@compiled
def above_ground(vector: Vector) -> Vector:
    """The point itself, or the one of which it is the mirror image in the ground."""
    return Vector(vector.x, vector.y, abs(vector.z))


@compiled
def across(first: Vector, second: Vector) -> Vector:
    """Unit vector at right angles to two vectors; if they are parallel, to the first and as level as can be."""
    x = first.y * second.z - first.z * second.y
    y = first.z * second.x - first.x * second.z
    z = first.x * second.y - first.y * second.x
    way = math.sqrt(x * x + y * y + z * z)
    if way < TINY:
        x, y, z = -first.y, first.x, 0.0
        way = math.sqrt(x * x + y * y)
        if way < TINY:
            x, y, way = 1.0, 0.0, 1.0
    return Vector(x / way, y / way, z / way)
