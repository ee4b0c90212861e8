"""Rays round the edges of upright boxes, in compiled loops: where they bend, how long they are, what is left of them.

A box has twelve edges, of which the four upright ones and the four on top bend waves to a robot. Seen along its
direction, an edge is a corner of a rectangle: everything here is said in two coordinates p and q across the edge and a
third along it. A ray that has to pass two edges runs along the face between them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from sensing.radio.fresnel import WedgeCoefficients, knife_edge, wedge

FloatArray = NDArray[np.float64]

OUTER_TURN = 1.5
"""Outer angle of an edge of a box over pi."""

LEAST_M = 1e-3
"""Shorter ways before and after an edge count as this one."""


class Corner(NamedTuple):
    """An edge, seen along it.

    Attributes:
        p: Of the corner.
        q: Of the corner.
        out_p: 1 or -1: to which side the face across p lies.
        out_q: Likewise across q.
        low: Where the edge begins, along it.
        high: Where it ends.
    """

    p: float
    q: float
    out_p: float
    out_q: float
    low: float
    high: float


class Point(NamedTuple):
    """A place, seen along an edge."""

    p: float
    q: float
    along: float


class BentRay(NamedTuple):
    """A ray round one or two edges.

    Attributes:
        is_there: Whether there is one.
        first: Where it bends first, along the edge.
        last: Where it bends last, along that edge.
        before_m: Length up to the first bend.
        between_m: From the first to the last; 0 with one edge.
        behind_m: From the last bend on.
        wedge: Coefficients of the first edge.
        left: Of the amplitude, behind the other edge or past those beside.
    """

    is_there: bool
    first: float
    last: float
    before_m: float
    between_m: float
    behind_m: float
    wedge: WedgeCoefficients
    left: complex


@compiled
def outer_angle(corner: Corner, point: Point) -> float:
    """Angle of a point about an edge from the face across p on, in [0, 2 pi): within the box beyond 3/2 pi."""
    angle = math.atan2((point.p - corner.p) * corner.out_p, -(point.q - corner.q) * corner.out_q)
    return angle if angle >= 0.0 else angle + 2.0 * math.pi


@compiled
def distance(corner: Corner, point: Point) -> float:
    """Of a point from an edge, at right angles to it."""
    return max(math.hypot(point.p - corner.p, point.q - corner.q), LEAST_M)


@compiled
def diffraction_parameter(detour_m: float, wavelength_m: float) -> float:
    """Of an edge by which a ray is so much longer: ITU-R P.526, eq. (26)."""
    return 2.0 * math.sqrt(max(detour_m, 0.0) / wavelength_m)


@compiled
def nothing() -> BentRay:
    """No ray."""
    return BentRay(False, 0.0, 0.0, 0.0, 0.0, 0.0, WedgeCoefficients(0j, 0j), 0j)


@compiled
def round_one(corner: Corner, source: Point, target: Point, wavelength_m: float) -> BentRay:
    """The ray from a source round one edge to a target that both see it."""
    from_rad, to_rad = outer_angle(corner, source), outer_angle(corner, target)
    if max(from_rad, to_rad) > OUTER_TURN * math.pi:
        return nothing()
    before, behind = distance(corner, source), distance(corner, target)
    at = (source.along * behind + target.along * before) / (before + behind)
    if not corner.low <= at <= corner.high:
        return nothing()
    before_m, behind_m = math.hypot(before, at - source.along), math.hypot(behind, target.along - at)
    sine, k = before / before_m, 2.0 * math.pi / wavelength_m
    length_m = before_m * behind_m * sine * sine / (before_m + behind_m)
    coefficients = wedge(from_rad, to_rad, OUTER_TURN, k, length_m, sine)
    return BentRay(True, at, at, before_m, 0.0, behind_m, coefficients, 1.0 + 0j)


@compiled
def round_two(first: Corner, last: Corner, source: Point, target: Point, wavelength_m: float) -> BentRay:
    """The ray along the face between two edges, of which the source sees the first alone and the target the last alone.

    The uniform theory gives the bend at the first edge; what the last one leaves is that of a knife edge, as in ITU-R
    P.526 for two edges: the theory of a wedge says nothing of a wave that comes along its own face.
    """
    most = OUTER_TURN * math.pi
    from_rad = outer_angle(first, source)
    if from_rad > most or outer_angle(last, target) > most:
        return nothing()
    if outer_angle(first, target) <= most or outer_angle(last, source) <= most:
        return nothing()
    before, behind = distance(first, source), distance(last, target)
    face = math.hypot(last.p - first.p, last.q - first.q)
    slope = (target.along - source.along) / (before + face + behind)
    at_first, at_last = source.along + slope * before, target.along - slope * behind
    if not (first.low <= at_first <= first.high and last.low <= at_last <= last.high):
        return nothing()
    stretch = math.sqrt(1.0 + slope * slope)
    before_m, between_m, behind_m = before * stretch, face * stretch, behind * stretch
    leaves_rad = 0.0 if last.p == first.p else most
    sine, after_m, k = 1.0 / stretch, between_m + behind_m, 2.0 * math.pi / wavelength_m
    length_m = before_m * after_m * sine * sine / (before_m + after_m)
    coefficients = wedge(from_rad, leaves_rad, OUTER_TURN, k, length_m, sine)
    straight_m = math.hypot(distance(first, target), target.along - at_first)
    left = knife_edge(diffraction_parameter(after_m - straight_m, wavelength_m))
    return BentRay(True, at_first, at_last, before_m, between_m, behind_m, coefficients, left)


@compiled
def passing(corner: Corner, beside: Corner, target: Point, ray: BentRay, wavelength_m: float) -> complex:
    """What an edge beside leaves of a ray that is bent at another and passes it in sight of the target."""
    face = math.hypot(beside.p - corner.p, beside.q - corner.q)
    behind = distance(beside, target)
    slope = (target.along - ray.last) / (face + behind)
    detour_m = (face + behind) * math.sqrt(1.0 + slope * slope) - ray.behind_m
    return knife_edge(-diffraction_parameter(detour_m, wavelength_m))
