"""The edges of a box in its own axes, family by family: the upright ones, and those on top along each side."""

from __future__ import annotations

import math
from typing import NamedTuple

from dirmusic.compiled import compiled
from pdpatrol.sensing.radio.diffraction.edges import Corner, Point, distance, is_hidden
from pdpatrol.sensing.radio.tables import Shape
from pdpatrol.sensing.radio.vectors import Vector

UP = Vector(0.0, 0.0, 1.0)

ORDER = ((0, 1, 3, 2), (0, 1, 2, 3), (0, 1, 2, 3))
"""Edges of each family in the order in which they are gone through: the upright ones as they follow one another."""


class Frame(NamedTuple):
    """Axes across and along an edge, as world vectors, and where their origin is."""

    p: Vector
    q: Vector
    edge: Vector
    x: float
    y: float


@compiled
def in_frame(frame: Frame, at: Vector) -> Point:
    """A world point as seen along an edge."""
    dx, dy = at.x - frame.x, at.y - frame.y
    return Point(
        dx * frame.p.x + dy * frame.p.y + at.z * frame.p.z,
        dx * frame.q.x + dy * frame.q.y + at.z * frame.q.z,
        dx * frame.edge.x + dy * frame.edge.y + at.z * frame.edge.z,
    )


@compiled
def in_world(frame: Frame, p: float, q: float, along: float) -> Vector:
    """The reverse of `in_frame`."""
    return Vector(
        frame.x + p * frame.p.x + q * frame.q.x + along * frame.edge.x,
        frame.y + p * frame.p.y + q * frame.q.y + along * frame.edge.y,
        p * frame.p.z + q * frame.q.z + along * frame.edge.z,
    )


@compiled
def frame_of(box: Shape, family: int) -> Frame:
    """Frame of a family of edges of a box: 0 the upright ones, 1 and 2 those on top along its second and first side."""
    x, y = box.x, box.y
    first, second = Vector(box.cos, box.sin, 0.0), Vector(-box.sin, box.cos, 0.0)
    if family == 0:
        return Frame(first, second, UP, x, y)
    if family == 1:
        return Frame(first, UP, second, x, y)
    return Frame(second, UP, first, x, y)


@compiled
def lowest(box: Shape) -> float:
    """Where a box begins, which is one with its mirror image in the ground if it stands there."""
    return box.bottom_m if box.bottom_m > 0.0 else -box.top_m


@compiled
def corner_of(box: Shape, family: int, number: int) -> Corner:
    """Edge of a family, numbers 0 to 3; of those along a side, 2 and 3 are below, and box and image are one there."""
    half_x, half_y, top, bottom = box.half_x, box.half_y, box.top_m, lowest(box)
    out_p, out_q = 1.0 if number % 2 == 0 else -1.0, 1.0 if number < 2 else -1.0
    if family == 0:
        return Corner(out_p * half_x, out_q * half_y, out_p, out_q, bottom, top)
    half_p, half_along = (half_x, half_y) if family == 1 else (half_y, half_x)
    return Corner(out_p * half_p, top if number < 2 else bottom, out_p, out_q, -half_along, half_along)


class Seen(NamedTuple):
    """An edge as source and target see it.

    Attributes:
        before_m: Distance of the source across the edge, negative if the box hides the edge from it.
        behind_m: Likewise of the target.
        mirrored_p_m: What the loudest ray in the mirror across p would be long.
        mirrored_q_m: In that across q.
    """

    before_m: float
    behind_m: float
    mirrored_p_m: float
    mirrored_q_m: float


@compiled
def look_at(corner: Corner, source: Point, target: Point) -> Seen:
    """An edge as source and target see it."""
    rise, dp, dq = target.along - source.along, target.p - source.p, target.q - source.q
    in_p, in_q = target.p + source.p - 2.0 * corner.p, target.q + source.q - 2.0 * corner.q
    return Seen(
        -1.0 if is_hidden(corner, source) else distance(corner, source),
        -1.0 if is_hidden(corner, target) else distance(corner, target),
        math.sqrt(in_p * in_p + dq * dq + rise * rise),
        math.sqrt(dp * dp + in_q * in_q + rise * rise),
    )
