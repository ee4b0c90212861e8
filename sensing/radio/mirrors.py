"""Mirrors: flat faces, and round solids, whose echoes diverge; in compiled loops."""

from __future__ import annotations

import math
from typing import NamedTuple

from dirmusic.compiled import compiled
from sensing.radio.bends import GROUND, Emitter
from sensing.radio.materials import Substance
from sensing.radio.obstruction import left_of_line, passes_straight
from sensing.radio.polarisation import face_mirror, mirrored, radiated, received
from sensing.radio.surroundings import OWN_FACE_M, Faces, Obstacles, Shape, shape_of, substance_of_solid
from sensing.radio.vectors import Vector, dot, hypot, minus, towards

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


@compiled
def reflection(face: Face, source: Vector, depth_m: float, target: Vector, height_m: float) -> Reflection:
    """In the plane of a face, above which source and target are so high."""
    normal, share = face.normal, depth_m / (depth_m + height_m)
    image = Vector(
        source.x - 2.0 * depth_m * normal.x,
        source.y - 2.0 * depth_m * normal.y,
        source.z - 2.0 * depth_m * normal.z,
    )
    way = minus(target, image)
    return Reflection(image, Vector(image.x + share * way.x, image.y + share * way.y, image.z + share * way.z))


@compiled
def reflect(
    emitter: Emitter, target: Vector, face: Face, by: Reflection, material: Substance, obstacles: Obstacles, own: int
) -> complex:
    """What is received by a mirror, which is solid `own` or, if it stands on none of its own, `NOBODY`."""
    normal, at = face.normal, by.at
    arrives, leaves = towards(emitter.at, at), towards(at, target)
    mirror = face_mirror(abs(dot(leaves, normal)), material)
    field = mirrored(radiated(emitter.axis, arrives), arrives, leaves, normal, mirror)
    off = Vector(at.x + 1e-9 * normal.x, at.y + 1e-9 * normal.y, at.z + 1e-9 * normal.z)
    if face.owner == GROUND:  # what is cut off here comes round edges
        left = passes_straight(emitter.at, off, obstacles) * passes_straight(off, target, obstacles)
    else:
        left = left_of_line(emitter.at, off, obstacles, own, 0.0)
        left *= left_of_line(off, target, obstacles, own, 0.0)
    return received(field, leaves) * left


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


class RoundEcho(NamedTuple):
    """What a round solid mirrors.

    Attributes:
        coefficient: What is received, over a straight path as long as that from the image; 0 for nothing.
        image: Of the source in the plane that touches the solid where it mirrors.
    """

    coefficient: complex
    image: Vector


@compiled
def reflect_round(emitter: Emitter, target: Vector, obstacles: Obstacles, k: int, weakest: float) -> RoundEcho:
    """The echo of an upright cylinder, its waves spread as by geometric optics.

    Args:
        emitter: The source.
        target: Middle of the array.
        obstacles: What stands about.
        k: The cylinder.
        weakest: Amplitude at the array, over that 1 m from the source, below which no echo is looked for.

    References:
        McNamara, Pistorius and Malherbe, Introduction to the Uniform Geometrical Theory of Diffraction (1990), section
        3.4: the caustic distance behind a curved mirror, here in the plane across the cylinder.
    """
    solid, material, source = shape_of(obstacles[k]), substance_of_solid(obstacles[k]), emitter.at
    none = RoundEcho(0j, source)
    before_m = hypot(source.x - solid.x, source.y - solid.y) - solid.radius_m
    behind_m = hypot(target.x - solid.x, target.y - solid.y) - solid.radius_m
    if before_m <= OWN_FACE_M or behind_m <= 0.0:
        return none
    most = obstacles[k].mirrors * math.sqrt(0.5 * solid.radius_m / (before_m * behind_m * (before_m + behind_m)))
    if most <= weakest:
        return none
    azimuth = normal_of_round(solid, source, target)
    normal = Vector(math.cos(azimuth), math.sin(azimuth), 0.0)
    x, y = solid.x + solid.radius_m * normal.x, solid.y + solid.radius_m * normal.y
    before_m, behind_m = hypot(source.x - x, source.y - y), hypot(target.x - x, target.y - y)
    z = source.z + before_m / (before_m + behind_m) * (target.z - source.z)
    at = Vector(x, y, z)
    depth_m, height_m = dot(minus(source, at), normal), dot(minus(target, at), normal)
    if depth_m <= 0.0 or height_m <= 0.0 or not solid.bottom_m < z < solid.top_m:
        return none
    face = Face(obstacles[k].owner, normal, at)
    by = reflection(face, source, depth_m, target, height_m)
    caustic_m = 1.0 / (1.0 / before_m + 2.0 / (solid.radius_m * depth_m / before_m))
    spread = math.sqrt(caustic_m * (before_m + behind_m) / (before_m * (caustic_m + behind_m)))
    return RoundEcho(spread * reflect(emitter, target, face, by, material, obstacles, k), by.image)
