"""Mirrors: flat faces, and round solids, whose echoes diverge; in compiled loops."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from pdpatrol.sensing.radio.lines import line
from pdpatrol.sensing.radio.materials import Substance
from pdpatrol.sensing.radio.obstruction import RIM_M, left_of_bent, left_of_line, passes_by_ground
from pdpatrol.sensing.radio.polarisation import Emitter, face_mirror, mirrored, radiated, received
from pdpatrol.sensing.radio.surroundings import OWN_FACE_M
from pdpatrol.sensing.radio.tables import (
    GROUND,
    Face,
    Obstacles,
    Shape,
    middle_of,
    normal_of,
    shape_of,
    substance_of,
    to_rim,
)
from pdpatrol.sensing.radio.vectors import (
    TINY,
    Vector,
    above_ground,
    between,
    dot,
    hypot,
    just_off,
    length,
    minus,
    towards,
    upside_down,
)

STEPS = 14
"""Halvings of the arc on which a round solid mirrors: to a ten-thousandth of it, and its length to far less."""


class Plane(NamedTuple):
    """A plane that mirrors: where a point of it is, and its normal."""

    at: Vector
    normal: Vector


class Meeting(NamedTuple):
    """Where a ray meets a mirror.

    Attributes:
        image: Of the source.
        at: On the mirror.
        rim_m: Distance from there to the rim, inside; negative if the ray does not meet the mirror.
    """

    image: Vector
    at: Vector
    rim_m: float


class Echo(NamedTuple):
    """What a round solid mirrors.

    Attributes:
        coefficient: What is received, over a straight path as long as that from the image; 0 for nothing.
        image: Of the source in the plane that touches the solid where it mirrors.
    """

    coefficient: complex
    image: Vector


@compiled
def meet_plane(plane: Plane, source: Vector, target: Vector) -> Meeting:
    """Where a plane mirrors, whose normal points to the side of both."""
    normal = plane.normal
    depth_m, height_m = dot(minus(source, plane.at), normal), dot(minus(target, plane.at), normal)
    if depth_m <= OWN_FACE_M or height_m <= 0.0:
        return Meeting(source, source, -1.0)
    image = Vector(
        source.x - 2.0 * depth_m * normal.x,
        source.y - 2.0 * depth_m * normal.y,
        source.z - 2.0 * depth_m * normal.z,
    )
    return Meeting(image, between(image, target, depth_m / (depth_m + height_m)), np.inf)


@compiled
def meet_face(face: Face, source: Vector, target: Vector) -> Meeting:
    """Where a face mirrors; the source may be an image in the ground, and then the face is one with its own."""
    image, at, rim_m = meet_plane(Plane(middle_of(face), normal_of(face)), source, target)
    if rim_m < 0.0:
        return Meeting(image, at, rim_m)
    on_face = above_ground(at) if source.z < 0.0 else at
    return Meeting(image, at, to_rim(face, minus(on_face, middle_of(face))))


class Standing(NamedTuple):
    """What stands about a mirror.

    Attributes:
        obstacles: All solids.
        shadows: What they do to the straight path, rows of `SHADOW`.
        own: The solid that mirrors, or `NOBODY`.
        weakest: Amplitude at the array, over that 1 m from the source, below which nothing counts.
    """

    obstacles: Obstacles
    shadows: NDArray[np.void]
    own: int
    weakest: float


@compiled
def reflect(emitter: Emitter, target: Vector, plane: Plane, of: Substance, is_ground: bool, by: Standing) -> complex:
    """What is received by a mirror: where it is met, `plane.at`, and what it is made of."""
    at, normal = plane
    arrives, leaves = towards(emitter.at, at), towards(at, target)
    mirror = face_mirror(abs(dot(leaves, normal)), of)
    coefficient = received(mirrored(radiated(emitter.axis, arrives), arrives, leaves, normal, mirror), leaves)
    off = just_off(at, normal)
    first, last = line(emitter.at, off), line(off, target)
    least = by.weakest * (first.length_m + last.length_m) / max(abs(coefficient), TINY)
    if least > 1.0:
        return 0j
    if is_ground:  # what is cut off here comes round edges
        return coefficient * passes_by_ground(first, last, by.obstacles)
    return coefficient * left_of_bent(first, last, by.obstacles, by.own, by.shadows, least)


@compiled
def reflect_by_ground(
    emitter: Emitter, target: Vector, plane: Plane, of: Substance, ground: Substance, by: Standing
) -> complex:
    """What is received by an upright face and by the ground, before it or after.

    Args:
        emitter: The source.
        target: Middle of the array.
        plane: The face, and where the ray from the source's image in the ground meets it, or the face's own image
            there: then the ground comes after.
        of: What the face is made of.
        ground: What the ground is made of.
        by: What stands about.
    """
    at, normal = plane
    start, up = upside_down(emitter.at), Vector(0.0, 0.0, 1.0)
    arrives, leaves = towards(start, at), towards(at, target)
    arrives_down, leaves_down = upside_down(arrives), upside_down(leaves)
    mirror, off = face_mirror(abs(dot(leaves, normal)), of), just_off(above_ground(at), normal)
    field = radiated(emitter.axis, arrives_down)
    if at.z >= 0.0:
        field = mirrored(field, arrives_down, arrives, up, face_mirror(max(arrives.z, 0.0), ground))
        field = mirrored(field, arrives, leaves, normal, mirror)
        bounce = between(start, at, start.z / (start.z - at.z))
        first, second, last = line(emitter.at, bounce), line(bounce, off), line(off, target)
    else:
        field = mirrored(field, arrives_down, leaves_down, normal, mirror)
        field = mirrored(field, leaves_down, leaves, up, face_mirror(max(leaves.z, 0.0), ground))
        bounce = between(at, target, at.z / (at.z - target.z))
        first, second, last = line(emitter.at, off), line(off, bounce), line(bounce, target)
    coefficient = received(field, leaves)
    least = by.weakest * (first.length_m + second.length_m + last.length_m) / max(abs(coefficient), TINY)
    if least > 1.0:
        return 0j
    left = left_of_line(second, by.obstacles, by.own, least)
    if left > 0.0:
        left *= left_of_bent(first, last, by.obstacles, by.own, by.shadows, least / left)
    return coefficient * left


@compiled
def by_rim(rim_m: float) -> float:
    """Share that is left of what a mirror whose edges bend nothing mirrors so near its rim."""
    share = min(rim_m / RIM_M, 1.0)
    return share * share * (3.0 - 2.0 * share)


@compiled
def reflect_flat(
    emitter: Emitter, target: Vector, face: Face, at: Vector, ground: Substance, by_ground: bool, by: Standing
) -> complex:
    """What is received by a face that is met there, or by face and ground."""
    plane, of = Plane(at, normal_of(face)), substance_of(face)
    if by_ground:
        return reflect_by_ground(emitter, target, plane, of, ground, by)
    return reflect(emitter, target, plane, of, face.owner == GROUND, by)


@compiled
def angle_between(x: float, y: float, other_x: float, other_y: float) -> float:
    """From one direction on plan to another, in [-pi, pi]."""
    return math.atan2(x * other_y - y * other_x, x * other_x + y * other_y)


@compiled
def normal_of_round(solid: Shape, source: Vector, target: Vector) -> float:
    """Azimuth of the normal at which an upright cylinder mirrors a source to a target: both make one angle with it.

    It lies between the directions in which both lie, where the tangential parts of both rays cancel.
    """
    low = math.atan2(source.y - solid.y, source.x - solid.x)
    turn = angle_between(math.cos(low), math.sin(low), target.x - solid.x, target.y - solid.y)
    near, far = 0.0, 1.0
    for _ in range(STEPS):
        share = 0.5 * (near + far)
        cos, sin = math.cos(low + share * turn), math.sin(low + share * turn)
        x, y = solid.x + solid.radius_m * cos, solid.y + solid.radius_m * sin
        to_source = hypot(source.x - x, source.y - y)
        to_target = hypot(target.x - x, target.y - y)
        aside = (cos * (source.y - y) - sin * (source.x - x)) / to_source
        aside += (cos * (target.y - y) - sin * (target.x - x)) / to_target
        if aside * turn > 0.0:
            near = share
        else:
            far = share
    return low + 0.5 * (near + far) * turn


@compiled
def reflect_round(emitter: Emitter, target: Vector, by: Standing) -> Echo:
    """The echo of an upright cylinder, its waves spread as by geometric optics.

    Args:
        emitter: The source.
        target: Middle of the array.
        by: What stands about; the cylinder is what mirrors.

    References:
        McNamara, Pistorius and Malherbe, Introduction to the Uniform Geometrical Theory of Diffraction (1990), section
        3.4: the caustic distance behind a curved mirror, here in the plane across the cylinder.
    """
    of, source = by.obstacles[by.own], emitter.at
    solid, none = shape_of(of), Echo(0j, emitter.at)
    before_m = hypot(source.x - solid.x, source.y - solid.y) - solid.radius_m
    behind_m = hypot(target.x - solid.x, target.y - solid.y) - solid.radius_m
    if before_m <= OWN_FACE_M or behind_m <= 0.0:
        return none
    most = of.mirrors * math.sqrt(0.5 * solid.radius_m / (before_m * behind_m * (before_m + behind_m)))
    if most <= by.weakest:
        return none
    azimuth = normal_of_round(solid, source, target)
    normal = Vector(math.cos(azimuth), math.sin(azimuth), 0.0)
    x, y = solid.x + solid.radius_m * normal.x, solid.y + solid.radius_m * normal.y
    before_m, behind_m = hypot(source.x - x, source.y - y), hypot(target.x - x, target.y - y)
    z = source.z + before_m / (before_m + behind_m) * (target.z - source.z)
    image, at, met = meet_plane(Plane(Vector(x, y, z), normal), source, target)
    rim_m = min(z - solid.bottom_m, solid.top_m - z)
    if met < 0.0 or rim_m <= 0.0:
        return none
    depth_m = 0.5 * length(minus(source, image))
    caustic_m = 1.0 / (1.0 / before_m + 2.0 / (solid.radius_m * depth_m / before_m))
    spread = math.sqrt(caustic_m * (before_m + behind_m) / (before_m * (caustic_m + behind_m)))
    return Echo(
        by_rim(rim_m) * spread * reflect(emitter, target, Plane(at, normal), substance_of(of), False, by), image
    )
