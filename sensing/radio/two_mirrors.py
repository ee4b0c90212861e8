"""Waves that two upright faces mirror, one after the other; in compiled loops."""

from __future__ import annotations

from typing import NamedTuple

from dirmusic.compiled import compiled
from pdpatrol.sensing.radio.lines import line
from pdpatrol.sensing.radio.mirrors import Meeting, by_rim, meet_face
from pdpatrol.sensing.radio.obstruction import left_of_line
from pdpatrol.sensing.radio.polarisation import Emitter, face_mirror, mirrored, radiated, received
from pdpatrol.sensing.radio.tables import GROUND, Face, Obstacles, normal_of, substance_of
from pdpatrol.sensing.radio.vectors import TINY, Vector, dot, just_off, length, minus, towards


class Twice(NamedTuple):
    """Where a ray meets two faces.

    Attributes:
        first: The face nearer to the source.
        second: The face nearer to the target; its image is that by both.
    """

    first: Meeting
    second: Meeting


@compiled
def is_upright(face: Face) -> bool:
    """Whether a face is a wall that mirrors."""
    return face.owner != GROUND and face.normal_z == 0.0 and face.flat_share > 0.0


@compiled
def meet_two(first: Face, second: Face, source: Vector, target: Vector) -> Twice:
    """Where both faces mirror; `rim_m` of one of them is negative if they do not."""
    nearer = meet_face(first, source, just_off(source, normal_of(first)))  # its image alone counts
    by_second = meet_face(second, nearer.image, target)
    if by_second.rim_m < 0.0:
        return Twice(nearer, by_second)
    return Twice(meet_face(first, source, by_second.at), by_second)


@compiled
def reflect_by_two(
    emitter: Emitter, target: Vector, first: Face, second: Face, met: Twice, obstacles: Obstacles, weakest: float
) -> complex:
    """What is received by two faces, over a straight path as long.

    Both fade towards their rims: nothing that is bent by one and mirrored by the other makes up for what ends there.

    Args:
        emitter: The source.
        target: Middle of the array.
        first: The face nearer to the source.
        second: The other.
        met: Where the ray meets them.
        obstacles: What stands about.
        weakest: Amplitude at the array, over that 1 m from the source, below which nothing counts.
    """
    arrives, between, leaves = (
        towards(emitter.at, met.first.at),
        towards(met.first.at, met.second.at),
        towards(met.second.at, target),
    )
    of_first, of_second = normal_of(first), normal_of(second)
    field = radiated(emitter.axis, arrives)
    mirror = face_mirror(abs(dot(arrives, of_first)), substance_of(first))
    field = mirrored(field, arrives, between, of_first, mirror)
    mirror = face_mirror(abs(dot(between, of_second)), substance_of(second))
    field = mirrored(field, between, leaves, of_second, mirror)
    coefficient = by_rim(met.first.rim_m) * by_rim(met.second.rim_m) * received(field, leaves)
    way_m = length(minus(target, met.second.image))
    least = weakest * way_m / max(abs(coefficient), TINY)
    if least > 1.0:
        return 0j
    off_first, off_second = just_off(met.first.at, of_first), just_off(met.second.at, of_second)
    left = left_of_line(line(emitter.at, off_first), obstacles, first.behind, least)
    if left > 0.0:
        left *= left_of_line(line(off_first, off_second), obstacles, first.behind, least / left)
    if left > 0.0:
        left *= left_of_line(line(off_second, target), obstacles, second.behind, least / left)
    return coefficient * left
