"""Compiled functions for reflection by flat faces and cylinders."""

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
    vector_of,
)
from pdpatrol.sensing.radio.materials import Material
from pdpatrol.sensing.radio.polarisation import radiated, received, reflected
from pdpatrol.sensing.radio.surroundings import GROUND, Row, material_of, rim_distance
from pdpatrol.sensing.radio.transmission import (
    RIM_M,
    RadioLink,
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
    point = plane_point(vector_of(face.centre_m), vector_of(face.normal), source, target)
    if point.rim_m < 0.0:
        return point
    on_face = above_ground(point.at) if source.z < 0.0 else point.at
    return SpecularPoint(point.image, point.at, rim_distance(face, on_face))


@compiled_inner
def face_mirror(face: Row, at: Vector) -> Mirror:
    """Return the mirror that a face forms at a point."""
    return Mirror(at, vector_of(face.normal), material_of(face))


@compiled_inner
def off_mirror(mirror: Mirror) -> Vector:
    """Return the reflection point moved 1 nm off the surface, so that a ray from it does not cross the solid behind."""
    return shift(mirror.at, mirror.normal, TINY)


@compiled_inner
def reflect_once(link: RadioLink, mirror: Mirror, own: int, least: float) -> complex:
    """Return the coefficient of a ray reflected once: its signal relative to a direct ray of the same length.

    Args:
        link: Source, target and obstacles.
        mirror: The mirror, at the reflection point.
        own: Index of the obstacle that reflects, or `GROUND`.
        least: Amplitude at the array, relative to that 1 m from the source, below which the ray is ignored.
    """
    arriving, leaving = towards(link.source, mirror.at), towards(mirror.at, link.target)
    field = reflected(radiated(link.axis, arriving), arriving, leaving, mirror.normal, mirror.material)
    coefficient = received(field, leaving)
    first, last = segment(link.source, off_mirror(mirror)), segment(off_mirror(mirror), link.target)
    least *= (first.length_m + last.length_m) / max(abs(coefficient), TINY)
    if least > 1.0:
        return 0j
    if own == GROUND:  # edges that block this path add their own ground-reflected rays
        return coefficient * ground_transmission(first, last, link.obstacles, link.pieces)
    return coefficient * bent_transmission(first, last, link, own, least)


@compiled_inner
def reflect_twice(link: RadioLink, first: Mirror, second: Mirror) -> tuple[complex, Segment, Segment, Segment]:
    """Return the coefficient of a ray reflected twice, as in `reflect_once` but without obstacles, and its segments."""
    arriving, leaving = towards(link.source, first.at), towards(second.at, link.target)
    between = towards(first.at, second.at)
    field = reflected(radiated(link.axis, arriving), arriving, between, first.normal, first.material)
    field = reflected(field, between, leaving, second.normal, second.material)
    at_first, at_second = off_mirror(first), off_mirror(second)
    first_segment, last_segment = segment(link.source, at_first), segment(at_second, link.target)
    return received(field, leaving), first_segment, segment(at_first, at_second), last_segment


@compiled_inner
def reflect_with_ground(link: RadioLink, at: Vector, face: Row, least: float) -> complex:
    """Return the coefficient of a ray reflected by an upright face and the ground.

    Args:
        link: Source, target and obstacles.
        at: Point where the ray from the source's image in the ground meets the face (above ground, if the ground
            reflects first) or the face's own image in the ground (below ground, if the ground reflects last).
        face: The face.
        least: As in `reflect_once`.
    """
    start, wall = mirror_in_ground(link.source), face_mirror(face, above_ground(at))
    if at.z >= 0.0:
        bounce = Mirror(point_between(start, at, start.z / (start.z - at.z)), UP, link.ground)
        coefficient, first, second, last = reflect_twice(link, bounce, wall)
    else:
        bounce = Mirror(point_between(at, link.target, at.z / (at.z - link.target.z)), UP, link.ground)
        coefficient, first, second, last = reflect_twice(link, wall, bounce)
    least *= (first.length_m + second.length_m + last.length_m) / max(abs(coefficient), TINY)
    if least > 1.0:
        return 0j
    total = segment_transmission(second, link, face.solid, least)
    if total > 0.0:
        total *= bent_transmission(first, last, link, face.solid, least / total)
    return coefficient * total


@compiled_inner
def two_face_points(first: Row, second: Row, source: Vector, target: Vector) -> tuple[SpecularPoint, SpecularPoint]:
    """Find the reflection points of two faces in turn; the image in the second point is that in both faces."""
    image = face_point(first, source, shift(source, vector_of(first.normal), TINY)).image
    at_second = face_point(second, image, target)
    return face_point(first, source, at_second.at), at_second


@compiled_inner
def reflect_by_two_faces(
    link: RadioLink, first: Row, second: Row, at_first: SpecularPoint, at_second: SpecularPoint, least: float
) -> complex:
    """Return the coefficient of a ray reflected by two upright faces in turn, at their `two_face_points`.

    The reflection fades out towards the rims of both faces, because rays that are diffracted by one face and reflected
    by the other are not traced. For `least`, see `reflect_once`.
    """
    coefficient, before, between, behind = reflect_twice(
        link, face_mirror(first, at_first.at), face_mirror(second, at_second.at)
    )
    coefficient *= smooth_step(at_first.rim_m / RIM_M) * smooth_step(at_second.rim_m / RIM_M)
    least *= (before.length_m + between.length_m + behind.length_m) / max(abs(coefficient), TINY)
    if least > 1.0:
        return 0j
    coefficient *= segment_transmission(before, link, first.solid, least)
    coefficient *= segment_transmission(between, link, first.solid, least)
    return coefficient * segment_transmission(behind, link, second.solid, least)


@compiled_inner
def cylinder_normal(x: float, y: float, radius_m: float, source: Vector, target: Vector) -> Vector:
    """Find the surface normal at which an upright cylinder at (x, y) reflects a ray from a source to a target.

    The normal lies between the directions to source and target, where the tangential components of both rays cancel.
    Fifteen bisections give it to a ten-thousandth of the angle between these directions, and the length of the ray
    much more accurately.
    """
    near, far = towards(Vector(x, y, source.z), source), towards(Vector(x, y, target.z), target)
    turn, normal = near.x * far.y - near.y * far.x, near
    for _ in range(15):
        between_x, between_y = near.x + far.x, near.y + far.y
        length = max(hypot(between_x, between_y), TINY)
        normal = Vector(between_x / length, between_y / length, 0.0)
        tangential = 0.0
        for end in (source, target):
            dx, dy = end.x - x - radius_m * normal.x, end.y - y - radius_m * normal.y
            tangential += (normal.x * dy - normal.y * dx) / hypot(dx, dy)
        if tangential * turn > 0.0:
            near = normal
        else:
            far = normal
    return normal


@compiled_inner
def reflect_by_cylinder(link: RadioLink, own: int, least: float) -> tuple[complex, Vector]:
    """Return the coefficient of a ray reflected by an upright cylinder, and the source's image in the tangent plane.

    Args:
        link: Source, target and obstacles.
        own: Index of the cylinder.
        least: As in `reflect_once`.

    References:
        McNamara, Pistorius and Malherbe, Introduction to the Uniform Geometrical Theory of Diffraction (1990), section
        3.4: caustic distance behind a curved mirror, here in the plane perpendicular to the cylinder's axis.
    """
    cylinder, source, target, none = link.obstacles[own], link.source, link.target, (0j, link.source)
    x, y, radius_m = cylinder.x, cylinder.y, cylinder.radius_m
    before_m, behind_m = hypot(source.x - x, source.y - y) - radius_m, hypot(target.x - x, target.y - y) - radius_m
    if before_m <= OWN_FACE_M or behind_m <= 0.0:
        return none
    most = cylinder.largest_reflection * math.sqrt(0.5 * radius_m / (before_m * behind_m * (before_m + behind_m)))
    if most <= least:
        return none
    normal = cylinder_normal(x, y, radius_m, source, target)
    x, y = x + radius_m * normal.x, y + radius_m * normal.y
    before_m, behind_m = hypot(source.x - x, source.y - y), hypot(target.x - x, target.y - y)
    z = source.z + before_m / (before_m + behind_m) * (target.z - source.z)
    point = plane_point(Vector(x, y, z), normal, source, target)
    rim_m = min(z - cylinder.bottom_m, cylinder.top_m - z)
    if point.rim_m < 0.0 or rim_m <= 0.0:
        return none
    cosine = 0.5 * distance(source, point.image) / before_m
    caustic_m = 1.0 / (1.0 / before_m + 2.0 / (radius_m * cosine))
    spread = math.sqrt(caustic_m * (before_m + behind_m) / (before_m * (caustic_m + behind_m)))
    coefficient = reflect_once(link, Mirror(point.at, normal, material_of(cylinder)), own, least)
    return smooth_step(rim_m / RIM_M) * spread * coefficient, point.image
