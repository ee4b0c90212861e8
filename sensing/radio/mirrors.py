"""Mirrors: flat faces, and round solids, whose echoes diverge; in compiled loops."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from sensing.radio.bends import GROUND, Emitter
from sensing.radio.materials import Materials, Substance, substance_of
from sensing.radio.obstruction import RIM_M, left_of_bent, left_of_line, line, passes_by_ground
from sensing.radio.polarisation import face_mirror, mirrored, radiated, received
from sensing.radio.surroundings import (
    NOBODY,
    OWN_FACE_M,
    Faces,
    Obstacles,
    Shape,
    Surroundings,
    shape_of,
    substance_of_solid,
)
from sensing.radio.vectors import TINY, Vector, above_ground, between, dot, hypot, just_off, minus, towards, upside_down

STEPS = 14
"""Halvings of the arc on which a round solid mirrors: to a ten-thousandth of it, and its length to far less."""


class Face(NamedTuple):
    """One flat face, as compiled loops hand it on: as of `Faces`."""

    owner: int
    normal: Vector
    centre: Vector


@compiled
def face_of(faces: Faces, f: int) -> Face:
    """Face f."""
    return Face(
        faces.owner[f],
        Vector(faces.normal[f, 0], faces.normal[f, 1], faces.normal[f, 2]),
        Vector(faces.centre_m[f, 0], faces.centre_m[f, 1], faces.centre_m[f, 2]),
    )


class Reflection(NamedTuple):
    """Where a face mirrors a ray.

    Attributes:
        image: Of the source.
        at: On the face.
    """

    image: Vector
    at: Vector


class Echo(NamedTuple):
    """What is mirrored.

    Attributes:
        coefficient: What is received, over a straight path as long as that from the image; 0 for nothing.
        image: Of the source in all mirrors, or in the plane that touches a round solid where it mirrors.
    """

    coefficient: complex
    image: Vector


@compiled
def reflection(face: Face, source: Vector, depth_m: float, target: Vector, height_m: float) -> Reflection:
    """In the plane of a face, above which source and target are so high."""
    normal, share = face.normal, depth_m / (depth_m + height_m)
    image = Vector(
        source.x - 2.0 * depth_m * normal.x,
        source.y - 2.0 * depth_m * normal.y,
        source.z - 2.0 * depth_m * normal.z,
    )
    return Reflection(image, between(image, target, share))


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
def reflect(emitter: Emitter, target: Vector, face: Face, at: Vector, material: Substance, by: Standing) -> complex:
    """What is received by a mirror."""
    arrives, leaves = towards(emitter.at, at), towards(at, target)
    mirror = face_mirror(abs(dot(leaves, face.normal)), material)
    coefficient = received(mirrored(radiated(emitter.axis, arrives), arrives, leaves, face.normal, mirror), leaves)
    off = just_off(at, face.normal)
    first, last = line(emitter.at, off), line(off, target)
    least = by.weakest * (first.length_m + last.length_m) / max(abs(coefficient), TINY)
    if least > 1.0:
        return 0j
    if face.owner == GROUND:  # what is cut off here comes round edges
        return coefficient * passes_by_ground(first, last, by.obstacles)
    return coefficient * left_of_bent(first, last, by.obstacles, by.own, by.shadows, least)


@compiled
def reflect_by_ground(
    emitter: Emitter, target: Vector, face: Face, at: Vector, materials: Materials, by: Standing
) -> complex:
    """What is received by an upright face and by the ground, before it or after.

    Args:
        emitter: The source.
        target: Middle of the array.
        face: As of `reflect`.
        at: Where the ray from the source's image in the ground meets the face, or the face's own image there: then the
            ground comes after.
        materials: Of all.
        by: What stands about.
    """
    start, normal = upside_down(emitter.at), face.normal
    arrives, leaves = towards(start, at), towards(at, target)
    arrives_down, leaves_down = upside_down(arrives), upside_down(leaves)
    mirror = face_mirror(abs(dot(leaves, normal)), substance_of(materials, face.owner))
    ground, up = substance_of(materials, GROUND), Vector(0.0, 0.0, 1.0)
    off = just_off(above_ground(at), normal)
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
    emitter: Emitter, target: Vector, surroundings: Surroundings, by: Standing, f: int, by_ground: bool
) -> Echo:
    """The echo of face f, or that of face and ground, for which it is to be upright; `by` says nobody mirrors yet."""
    faces, materials, obstacles, behind = surroundings
    face, start = face_of(faces, f), upside_down(emitter.at) if by_ground else emitter.at
    none = Echo(0j, start)
    depth_m, height_m = dot(minus(start, face.centre), face.normal), dot(minus(target, face.centre), face.normal)
    if depth_m <= OWN_FACE_M or height_m <= 0.0 or materials.flat_share[face.owner] == 0.0:
        return none
    image, at = reflection(face, start, depth_m, target, height_m)
    off = minus(above_ground(at) if by_ground else at, face.centre)
    rim_m = np.inf
    for axis in range(2):
        aside_m = off.x * faces.axes[f, axis, 0] + off.y * faces.axes[f, axis, 1] + off.z * faces.axes[f, axis, 2]
        rim_m = min(rim_m, faces.half_size_m[f, axis] - abs(aside_m))
    if rim_m < 0.0:
        return none
    left = 1.0 if behind[f] != NOBODY and obstacles[behind[f]].bends else by_rim(rim_m)
    by = Standing(obstacles, by.shadows, behind[f], by.weakest)
    if by_ground:
        return Echo(left * reflect_by_ground(emitter, target, face, at, materials, by), image)
    return Echo(left * reflect(emitter, target, face, at, substance_of(materials, face.owner), by), image)


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
def reflect_round(emitter: Emitter, target: Vector, k: int, by: Standing) -> Echo:
    """The echo of an upright cylinder, its waves spread as by geometric optics.

    Args:
        emitter: The source.
        target: Middle of the array.
        k: The cylinder.
        by: What stands about; nobody mirrors yet.

    References:
        McNamara, Pistorius and Malherbe, Introduction to the Uniform Geometrical Theory of Diffraction (1990), section
        3.4: the caustic distance behind a curved mirror, here in the plane across the cylinder.
    """
    of, source = by.obstacles[k], emitter.at
    solid, material = shape_of(of), substance_of_solid(of)
    none = Echo(0j, source)
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
    at = Vector(x, y, z)
    depth_m, height_m = dot(minus(source, at), normal), dot(minus(target, at), normal)
    rim_m = min(z - solid.bottom_m, solid.top_m - z)
    if depth_m <= 0.0 or height_m <= 0.0 or rim_m <= 0.0:
        return none
    face = Face(of.owner, normal, at)
    image, where = reflection(face, source, depth_m, target, height_m)
    caustic_m = 1.0 / (1.0 / before_m + 2.0 / (solid.radius_m * depth_m / before_m))
    spread = math.sqrt(caustic_m * (before_m + behind_m) / (before_m * (caustic_m + behind_m)))
    own = Standing(by.obstacles, by.shadows, k, by.weakest)
    return Echo(by_rim(rim_m) * spread * reflect(emitter, target, face, where, material, own), image)
