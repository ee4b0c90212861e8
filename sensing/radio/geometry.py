"""Vectors, frames, segments and upright solids for compiled functions."""

import math
from typing import NamedTuple

import numpy as np

from dirmusic.arrays import FloatArray
from dirmusic.compiled import compiled, compiled_inner
from pdpatrol.sensing.radio.materials import WAVELENGTH_M

TINY = 1e-9
"""Length in metres, or sine of an angle, below which a direction is undefined. Also the fraction of a segment, at
either end, in which crossings of a surface are ignored."""

CLEARANCE = 0.3
"""Distance from a segment, divided by the square root of wavelength times length, beyond which an obstacle does not
attenuate a wave: its diffraction parameter is below -0.78 even at the middle of the segment (ITU-R P.526)."""

FACING_WIDTH = 0.95
"""Width of the box that replaces a cylinder in diffraction, divided by the cylinder's diameter. Assumed; with this
value, the field behind a conducting cylinder is within 3 dB of the exact solutions."""


class Vector(NamedTuple):
    """Vector or point, in the world frame unless stated otherwise."""

    x: float
    y: float
    z: float


UP = Vector(0.0, 0.0, 1.0)


@compiled_inner
def vector_of(array: FloatArray) -> Vector:
    """Convert an array whose first three elements are the components of a vector."""
    return Vector(array[0], array[1], array[2])


@compiled
def dot(first: Vector, second: Vector) -> float:
    """Return the scalar product."""
    return first.x * second.x + first.y * second.y + first.z * second.z


@compiled_inner
def hypot(first: float, second: float) -> float:
    """Return sqrt(first^2 + second^2), three times as fast as `math.hypot` but without protection from overflow."""
    return math.sqrt(first * first + second * second)


@compiled_inner
def length(vector: Vector) -> float:
    """Return the Euclidean length."""
    return math.sqrt(dot(vector, vector))


@compiled_inner
def unit(vector: Vector) -> Vector:
    """Return the unit vector along a vector."""
    size = max(length(vector), TINY)
    return Vector(vector.x / size, vector.y / size, vector.z / size)


@compiled_inner
def minus(first: Vector, second: Vector) -> Vector:
    """Return the vector from the second point to the first."""
    return Vector(first.x - second.x, first.y - second.y, first.z - second.z)


@compiled_inner
def distance(first: Vector, second: Vector) -> float:
    """Return the distance between two points."""
    return length(minus(first, second))


@compiled_inner
def shift(point: Vector, direction: Vector, by: float) -> Vector:
    """Return a point moved along a vector by a multiple of the vector's length."""
    return Vector(point.x + by * direction.x, point.y + by * direction.y, point.z + by * direction.z)


@compiled_inner
def point_between(start: Vector, end: Vector, share: float) -> Vector:
    """Return the point at a given fraction of the distance from one point to another."""
    return shift(start, minus(end, start), share)


@compiled
def towards(start: Vector, end: Vector) -> Vector:
    """Return the unit vector from one point to another."""
    return unit(minus(end, start))


@compiled_inner
def mirror_in_ground(vector: Vector) -> Vector:
    """Return the mirror image of a point or vector in the ground."""
    return Vector(vector.x, vector.y, -vector.z)


@compiled_inner
def above_ground(point: Vector) -> Vector:
    """Return a point or, if it is below ground, its mirror image above ground."""
    return Vector(point.x, point.y, abs(point.z))


@compiled
def normal_to(first: Vector, second: Vector) -> Vector:
    """Return the unit vector along the cross product; for parallel vectors, a horizontal one normal to the first."""
    normal = Vector(
        first.y * second.z - first.z * second.y,
        first.z * second.x - first.x * second.z,
        first.x * second.y - first.y * second.x,
    )
    if length(normal) < TINY:
        normal = Vector(-first.y, first.x, 0.0)
        if length(normal) < TINY:
            normal = Vector(1.0, 0.0, 0.0)
    return unit(normal)


class Frame(NamedTuple):
    """Axes of a frame, unit vectors in the world frame, and its origin."""

    x: Vector
    y: Vector
    z: Vector
    origin: Vector


@compiled_inner
def frame_of(world_from_frame: FloatArray) -> Frame:
    """Convert the transform from a frame to the world frame, shape (4, 4)."""
    w = world_from_frame
    return Frame(vector_of(w[:, 0]), vector_of(w[:, 1]), vector_of(w[:, 2]), vector_of(w[:, 3]))


@compiled
def to_frame(frame: Frame, point: Vector) -> Vector:
    """Convert a point from the world frame to another frame."""
    off = minus(point, frame.origin)
    return Vector(dot(off, frame.x), dot(off, frame.y), dot(off, frame.z))


@compiled
def to_world(frame: Frame, point: Vector) -> Vector:
    """Convert a point from another frame to the world frame."""
    return shift(shift(shift(frame.origin, frame.x, point.x), frame.y, point.y), frame.z, point.z)


class Segment(NamedTuple):
    """Straight segment of a ray.

    Attributes:
        start: First end.
        end: Second end.
        length_m: Length.
        horizontal_m: Length of its projection on the ground, > 0.
        ahead_x: Unit vector of that projection, x.
        ahead_y: Unit vector of that projection, y.
        clearance_m: Distance beyond which an obstacle does not attenuate a wave along the segment.
    """

    start: Vector
    end: Vector
    length_m: float
    horizontal_m: float
    ahead_x: float
    ahead_y: float
    clearance_m: float


@compiled
def segment(start: Vector, end: Vector) -> Segment:
    """Create the segment from one point to another."""
    dx, dy, _ = minus(end, start)
    horizontal_m, length_m = max(hypot(dx, dy), TINY), distance(start, end)
    clearance_m = CLEARANCE * math.sqrt(WAVELENGTH_M * length_m)
    return Segment(start, end, length_m, horizontal_m, dx / horizontal_m, dy / horizontal_m, clearance_m)


class UprightSolid(NamedTuple):
    """An upright box or cylinder.

    Attributes:
        x: Centre of the footprint, x.
        y: Centre of the footprint, y.
        cos: Cosine of the yaw.
        sin: Sine of the yaw.
        half_x: Half of the first side; 0 for a cylinder.
        half_y: Half of the second side; 0 for a cylinder.
        radius_m: Radius of a cylinder; 0 for a box.
        bottom_m: Height of the bottom above ground.
        top_m: Height of the top above ground.
    """

    x: float
    y: float
    cos: float
    sin: float
    half_x: float
    half_y: float
    radius_m: float
    bottom_m: float
    top_m: float


@compiled_inner
def rises_to(path: Segment, bottom_m: float, top_m: float) -> bool:
    """Return whether a segment reaches any height between two."""
    return min(path.start.z, path.end.z) <= top_m and max(path.start.z, path.end.z) >= bottom_m


@compiled_inner
def half_size(solid: UprightSolid, ahead_x: float, ahead_y: float) -> tuple[float, float]:
    """Return half the extent of a solid's footprint along and across the horizontal unit vector (ahead_x, ahead_y)."""
    cos = abs(solid.cos * ahead_x + solid.sin * ahead_y)
    sin = abs(solid.cos * ahead_y - solid.sin * ahead_x)
    half_x, half_y, radius_m = solid.half_x, solid.half_y, solid.radius_m
    return cos * half_x + sin * half_y + radius_m, sin * half_x + cos * half_y + radius_m


@compiled_inner
def is_near(path: Segment, solid: UprightSolid, margin_m: float) -> bool:
    """Return whether the box around a solid with sides along a segment, larger by a margin, may meet the segment."""
    x, y = solid.x - path.start.x, solid.y - path.start.y
    half_ahead_m, half_across_m = half_size(solid, path.ahead_x, path.ahead_y)
    if abs(y * path.ahead_x - x * path.ahead_y) > half_across_m + margin_m:
        return False
    ahead_m, half_ahead_m = x * path.ahead_x + y * path.ahead_y, half_ahead_m + margin_m
    if not -half_ahead_m < ahead_m < path.horizontal_m + half_ahead_m:
        return False
    return rises_to(path, solid.bottom_m - margin_m, solid.top_m + margin_m)


@compiled_inner
def interval_within(low: float, high: float, start: float, change: float) -> tuple[float, float]:
    """Return the interval of t in which the coordinate `start + t * change` lies between two bounds."""
    if change == 0.0:
        return (-np.inf, np.inf) if low < start < high else (np.inf, -np.inf)
    first, second = (low - start) / change, (high - start) / change
    return min(first, second), max(first, second)


@compiled_inner
def footprint_interval(path: Segment, solid: UprightSolid) -> tuple[float, float]:
    """Return the interval of the line through a segment that lies above or below a solid's footprint, or inside it.

    The interval is in fractions of the segment from its start. If it is empty, the first value is larger than the
    second.
    """
    x, y = path.start.x - solid.x, path.start.y - solid.y
    dx, dy, _ = minus(path.end, path.start)
    if solid.radius_m > 0.0:
        along, speed = x * dx + y * dy, dx * dx + dy * dy
        outside = x * x + y * y - solid.radius_m * solid.radius_m
        if speed == 0.0:
            return (-np.inf, np.inf) if outside < 0.0 else (np.inf, -np.inf)
        root = along * along - speed * outside
        if root <= 0.0:
            return np.inf, -np.inf
        return (-along - math.sqrt(root)) / speed, (-along + math.sqrt(root)) / speed
    cos, sin = solid.cos, solid.sin
    first = interval_within(-solid.half_x, solid.half_x, cos * x + sin * y, cos * dx + sin * dy)
    second = interval_within(-solid.half_y, solid.half_y, cos * y - sin * x, cos * dy - sin * dx)
    return max(first[0], second[0]), min(first[1], second[1])


@compiled_inner
def solid_interval(path: Segment, solid: UprightSolid) -> tuple[float, float]:
    """Return the interval of the line through a segment that lies inside a solid, as in `footprint_interval`."""
    enters, leaves = footprint_interval(path, solid)
    above, below = interval_within(solid.bottom_m, solid.top_m, path.start.z, path.end.z - path.start.z)
    return max(enters, above), min(leaves, below)


@compiled_inner
def length_inside(path: Segment, solid: UprightSolid) -> float:
    """Return the length of a segment inside a solid."""
    enters, leaves = solid_interval(path, solid)
    return max(min(leaves, 1.0) - max(enters, 0.0), 0.0) * path.length_m


@compiled
def crosses(path: Segment, solid: UprightSolid) -> bool:
    """Return whether a segment crosses a solid; a segment that ends on the surface does not cross it."""
    if path.length_m == 0.0 or not is_near(path, solid, 0.0):
        return False
    enters, leaves = solid_interval(path, solid)
    return max(enters, 0.0) < min(leaves, 1.0) and enters < 1.0 - TINY and leaves > TINY


@compiled_inner
def facing_box(path: Segment, solid: UprightSolid) -> UprightSolid:
    """Return the box whose edges diffract waves along a segment; for a cylinder, an inner box that faces the path."""
    x, y, _, _, _, _, radius_m, bottom_m, top_m = solid
    if radius_m == 0.0:
        return solid
    half_x, half_y = math.sqrt(1.0 - FACING_WIDTH * FACING_WIDTH) * radius_m, FACING_WIDTH * radius_m
    return UprightSolid(x, y, path.ahead_x, path.ahead_y, half_x, half_y, 0.0, bottom_m, top_m)
