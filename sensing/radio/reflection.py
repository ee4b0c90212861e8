"""Compiled functions for reflection by flat faces and cylinders."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dirmusic.compiled import compiled_inner
from pdpatrol.sensing.radio.geometry import (
    TINY,
    UP,
    Segment,
    Vector,
    above_ground,
    distance,
    dot,
    hypot,
    minus,
    mirror_in_ground,
    point_between,
    segment,
    shift,
    towards,
)
from pdpatrol.sensing.radio.materials import Material
from pdpatrol.sensing.radio.polarisation import Emitter, face_reflection, radiated, received, reflected
from pdpatrol.sensing.radio.surroundings import (
    GROUND,
    Row,
    Rows,
    centre_of,
    material_of,
    normal_of,
    rim_distance,
    solid_of,
)
from pdpatrol.sensing.radio.transmission import (
    RIM_M,
    bent_transmission,
    ground_transmission,
    segment_transmission,
    smooth_step,
)

OWN_FACE_M = 0.05
"""Distance within which a source counts as mounted on a face. Assumed; the mirror image is then within two thirds of a
wavelength of the source, and the amplitude of the source is defined as that of both together."""


class Mirror(NamedTuple):
    """Plane mirror.

    Attributes:
        at: Point where the ray meets it.
        normal: Unit normal on the side of the ray.
        material: Material of the surface.
    """

    at: Vector
    normal: Vector
    material: Material


class SpecularPoint(NamedTuple):
    """Specular reflection point of a mirror.

    Attributes:
        image: Mirror image of the source.
        at: Point on the mirror.
        rim_m: Distance of that point from the rim of the mirror; negative without a reflection.
    """

    image: Vector
    at: Vector
    rim_m: float


class Obstruction(NamedTuple):
    """Obstacles that may attenuate a reflected or diffracted ray.

    Attributes:
        obstacles: All obstacles.
        shadows: Their effects on the direct path, rows of `SHADOW`.
        own: Index of the obstacle that reflects or diffracts the ray, or `NO_SOLID`.
        least: Amplitude at the array, relative to that 1 m from the source, below which rays are ignored.
    """

    obstacles: Rows
    shadows: Rows
    own: int
    least: float


@compiled_inner
def plane_point(at: Vector, normal: Vector, source: Vector, target: Vector) -> SpecularPoint:
    """Find the reflection point of a plane through a point; the normal points to the side of source and target."""
    depth_m, height_m = dot(minus(source, at), normal), dot(minus(target, at), normal)
    if depth_m <= OWN_FACE_M or height_m <= 0.0:
        return SpecularPoint(source, source, -1.0)
    image = shift(source, normal, -2.0 * depth_m)
    return SpecularPoint(image, point_between(image, target, depth_m / (depth_m + height_m)), np.inf)


@compiled_inner
def face_point(face: Row, source: Vector, target: Vector) -> SpecularPoint:
    """Find the reflection point of a face; if the source is an image in the ground, the face includes its own image."""
    point = plane_point(centre_of(face), normal_of(face), source, target)
    if point.rim_m < 0.0:
        return point
    on_face = above_ground(point.at) if source.z < 0.0 else point.at
    return SpecularPoint(point.image, point.at, rim_distance(face, on_face))


@compiled_inner
def rim_factor(rim_m: float) -> float:
    """Return the factor by which a reflection near the rim fades if the edges of the face do not diffract."""
    return smooth_step(rim_m / RIM_M)


@compiled_inner
def off_mirror(mirror: Mirror) -> Vector:
    """Return the reflection point moved 1 nm off the surface, so that a ray from it does not cross the solid behind."""
    return shift(mirror.at, mirror.normal, TINY)


@compiled_inner
def reflect_once(emitter: Emitter, target: Vector, mirror: Mirror, is_ground: bool, around: Obstruction) -> complex:
    """Return the coefficient of a ray reflected once: its signal relative to a direct ray of the same length."""
    arriving, leaving = towards(emitter.at, mirror.at), towards(mirror.at, target)
    reflection = face_reflection(abs(dot(leaving, mirror.normal)), mirror.material)
    field = reflected(radiated(emitter.axis, arriving), arriving, leaving, mirror.normal, reflection)
    coefficient = received(field, leaving)
    first, last = segment(emitter.at, off_mirror(mirror)), segment(off_mirror(mirror), target)
    least = around.least * (first.length_m + last.length_m) / max(abs(coefficient), TINY)
    if least > 1.0:
        return 0j
    if is_ground:  # edges that block this path add their own ground-reflected rays
        return coefficient * ground_transmission(first, last, around.obstacles)
    return coefficient * bent_transmission(first, last, around.obstacles, around.own, around.shadows, least)


@compiled_inner
def reflect_twice(
    emitter: Emitter, target: Vector, first: Mirror, second: Mirror
) -> tuple[complex, Segment, Segment, Segment]:
    """Return the coefficient of a ray reflected twice, as in `reflect_once` but without obstacles, and its segments."""
    arriving, between, leaving = (
        towards(emitter.at, first.at),
        towards(first.at, second.at),
        towards(second.at, target),
    )
    reflection = face_reflection(abs(dot(arriving, first.normal)), first.material)
    field = reflected(radiated(emitter.axis, arriving), arriving, between, first.normal, reflection)
    reflection = face_reflection(abs(dot(between, second.normal)), second.material)
    field = reflected(field, between, leaving, second.normal, reflection)
    at_first, at_second = off_mirror(first), off_mirror(second)
    first_segment, last_segment = segment(emitter.at, at_first), segment(at_second, target)
    return received(field, leaving), first_segment, segment(at_first, at_second), last_segment


@compiled_inner
def reflect_with_ground(
    emitter: Emitter, target: Vector, at: Vector, face: Row, ground: Material, around: Obstruction
) -> complex:
    """Return the coefficient of a ray reflected by an upright face and the ground.

    Args:
        emitter: Source.
        target: Middle of the array.
        at: Point where the ray from the source's image in the ground meets the face (above ground, if the ground
            reflects first) or the face's own image in the ground (below ground, if the ground reflects last).
        face: The face.
        ground: Material of the ground.
        around: Obstacles; `own` is the solid that the face bounds.
    """
    start, wall = mirror_in_ground(emitter.at), Mirror(above_ground(at), normal_of(face), material_of(face))
    if at.z >= 0.0:
        bounce = Mirror(point_between(start, at, start.z / (start.z - at.z)), UP, ground)
        coefficient, first, second, last = reflect_twice(emitter, target, bounce, wall)
    else:
        bounce = Mirror(point_between(at, target, at.z / (at.z - target.z)), UP, ground)
        coefficient, first, second, last = reflect_twice(emitter, target, wall, bounce)
    least = around.least * (first.length_m + second.length_m + last.length_m) / max(abs(coefficient), TINY)
    if least > 1.0:
        return 0j
    total = segment_transmission(second, around.obstacles, around.own, least)
    if total > 0.0:
        total *= bent_transmission(first, last, around.obstacles, around.own, around.shadows, least / total)
    return coefficient * total


@compiled_inner
def reflect_by_two_faces(
    emitter: Emitter, target: Vector, first: Row, second: Row, obstacles: Rows, least: float
) -> tuple[complex, Vector]:
    """Return the coefficient of a ray reflected by two upright faces in turn, and the image of the source in both.

    The reflection fades out towards the rims of both faces, because rays that are diffracted by one face and reflected
    by the other are not traced.
    """
    image = face_point(first, emitter.at, shift(emitter.at, normal_of(first), TINY)).image
    at_second = face_point(second, image, target)
    if at_second.rim_m < 0.0:
        return 0j, image
    at_first = face_point(first, emitter.at, at_second.at)
    if at_first.rim_m < 0.0:
        return 0j, image
    coefficient, before, between, behind = reflect_twice(
        emitter,
        target,
        Mirror(at_first.at, normal_of(first), material_of(first)),
        Mirror(at_second.at, normal_of(second), material_of(second)),
    )
    coefficient *= rim_factor(at_first.rim_m) * rim_factor(at_second.rim_m)
    least *= (before.length_m + between.length_m + behind.length_m) / max(abs(coefficient), TINY)
    if least > 1.0:
        return 0j, image
    coefficient *= segment_transmission(before, obstacles, first.solid, least)
    coefficient *= segment_transmission(between, obstacles, first.solid, least)
    return coefficient * segment_transmission(behind, obstacles, second.solid, least), at_second.image


@compiled_inner
def cylinder_normal(x: float, y: float, radius_m: float, source: Vector, target: Vector) -> Vector:
    """Find the surface normal at which an upright cylinder at (x, y) reflects a ray from a source to a target.

    The normal lies between the directions to source and target, where the tangential components of both rays cancel.
    Fourteen bisections give it to a ten-thousandth of the angle between these directions, and the length of the ray
    much more accurately.
    """
    azimuth = math.atan2(source.y - y, source.x - x)
    to_x, to_y, cos, sin = target.x - x, target.y - y, math.cos(azimuth), math.sin(azimuth)
    turn = math.atan2(cos * to_y - sin * to_x, cos * to_x + sin * to_y)
    near, far = 0.0, 1.0
    for _ in range(14):
        share = 0.5 * (near + far)
        cos, sin = math.cos(azimuth + share * turn), math.sin(azimuth + share * turn)
        at_x, at_y = x + radius_m * cos, y + radius_m * sin
        tangential = 0.0
        for end in (source, target):
            dx, dy = end.x - at_x, end.y - at_y
            tangential += (cos * dy - sin * dx) / hypot(dx, dy)
        if tangential * turn > 0.0:
            near = share
        else:
            far = share
    azimuth += 0.5 * (near + far) * turn
    return Vector(math.cos(azimuth), math.sin(azimuth), 0.0)


@compiled_inner
def reflect_by_cylinder(emitter: Emitter, target: Vector, around: Obstruction) -> tuple[complex, Vector]:
    """Return the coefficient of a ray reflected by an upright cylinder, and the source's image in the tangent plane.

    Args:
        emitter: Source.
        target: Middle of the array.
        around: Obstacles; `own` is the cylinder.

    References:
        McNamara, Pistorius and Malherbe, Introduction to the Uniform Geometrical Theory of Diffraction (1990), section
        3.4: caustic distance behind a curved mirror, here in the plane perpendicular to the cylinder's axis.
    """
    cylinder, source = around.obstacles[around.own], emitter.at
    solid, none = solid_of(cylinder), (0j, emitter.at)
    x, y, radius_m = solid.x, solid.y, solid.radius_m
    before_m, behind_m = hypot(source.x - x, source.y - y) - radius_m, hypot(target.x - x, target.y - y) - radius_m
    if before_m <= OWN_FACE_M or behind_m <= 0.0:
        return none
    most = cylinder.largest_reflection * math.sqrt(0.5 * radius_m / (before_m * behind_m * (before_m + behind_m)))
    if most <= around.least:
        return none
    normal = cylinder_normal(x, y, radius_m, source, target)
    x, y = x + radius_m * normal.x, y + radius_m * normal.y
    before_m, behind_m = hypot(source.x - x, source.y - y), hypot(target.x - x, target.y - y)
    z = source.z + before_m / (before_m + behind_m) * (target.z - source.z)
    point = plane_point(Vector(x, y, z), normal, source, target)
    rim_m = min(z - solid.bottom_m, solid.top_m - z)
    if point.rim_m < 0.0 or rim_m <= 0.0:
        return none
    cosine = 0.5 * distance(source, point.image) / before_m
    caustic_m = 1.0 / (1.0 / before_m + 2.0 / (radius_m * cosine))
    spread = math.sqrt(caustic_m * (before_m + behind_m) / (before_m * (caustic_m + behind_m)))
    mirror = Mirror(point.at, normal, material_of(cylinder))
    coefficient = reflect_once(emitter, target, mirror, cylinder.owner == GROUND, around)
    return rim_factor(rim_m) * spread * coefficient, point.image
