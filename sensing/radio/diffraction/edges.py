"""Rays round the edges of upright boxes, in compiled loops: where they bend, how long they are, what is left of them.

A box has twelve edges, of which the four upright ones and the four on top bend waves to a robot. Seen along its
direction, an edge is a corner of a rectangle: everything here is said in two coordinates p and q across the edge and a
third along it.

What is left is that of the uniform theory of diffraction, which tells polarisations and faces apart and joins smoothly
to the rays that an edge cuts off. From one edge along a face to the next and on, it is that of the first times
Fresnel's integral at the second, as ITU-R P.526 has it for two edges: the theory of a wedge says nothing of a wave that
comes along its own face. Waves that are polarised along an edge of metal leave nothing along its face.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from dirmusic.compiled import compiled
from pdpatrol.sensing.radio.diffraction.fresnel import WedgeFaces, edge_ray, knife_edge, wedge, wedge_angle
from pdpatrol.sensing.radio.vectors import hypot

OUTER_ANGLE = wedge_angle(1.5)
"""Of an edge of a box."""

ON_FACE_M = 1e-6
"""So deep within a box, a point is still on its surface."""

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
        first: Where it bends first, along the edge.
        last: Where it bends last, along that edge.
        before_m: Length up to the first bend.
        between_m: From the first to the last; 0 with one edge.
        behind_m: From the last bend on.
        soft: Amplitude of a field along the first edge, over that of a straight ray as long.
        hard: Of a field across it.
    """

    first: float
    last: float
    before_m: float
    between_m: float
    behind_m: float
    soft: complex
    hard: complex


@compiled
def outer_angle(corner: Corner, point: Point) -> float:
    """Angle of a point outside the box about an edge, from the face across p on, in [0, 3/2 pi]."""
    angle = math.atan2((point.p - corner.p) * corner.out_p, -(point.q - corner.q) * corner.out_q)
    if angle > -0.25 * math.pi:
        return max(angle, 0.0)
    return min(angle + 2.0 * math.pi, OUTER_ANGLE.n * math.pi)


@compiled
def is_hidden(corner: Corner, point: Point) -> bool:
    """Whether its own box hides an edge from a point."""
    return (point.p - corner.p) * corner.out_p < -ON_FACE_M and (point.q - corner.q) * corner.out_q < -ON_FACE_M


@compiled
def distance(corner: Corner, point: Point) -> float:
    """Of a point from an edge, at right angles to it."""
    return max(hypot(point.p - corner.p, point.q - corner.q), LEAST_M)


@compiled
def diffraction_parameter(detour_m: float, wavelength_m: float) -> float:
    """Of an edge by which a ray is so much longer: ITU-R P.526, eq. (26)."""
    return 2.0 * math.sqrt(max(detour_m, 0.0) / wavelength_m)


class Place(NamedTuple):
    """Where along an edge a ray bends, and what an edge that ends there leaves of it."""

    along: float
    left: complex


@compiled
def place(corner: Corner, at: float, before: float, behind: float, rise: float, wavelength_m: float) -> Place:
    """The place on an edge for a ray that would bend at `at`, if the edge went on for ever.

    Where an edge ends another begins, and behind such a corner the field is a product of what both leave; of the term
    that both bend, each ray has half.

    Args:
        corner: The edge.
        at: Along it.
        before: Way up to it, across.
        behind: Way from it on, across.
        rise: Of source over target, along the edge.
        wavelength_m: Of the wave.
    """
    share, length_m, along = before / (before + behind), hypot(before + behind, rise), at
    left = 1.0 + 0.0j
    for end, side in ((corner.low, -1.0), (corner.high, 1.0)):
        beyond, shift = (at - end) * side, end - at
        detour_m = hypot(before, share * rise + shift) + hypot(behind, (1.0 - share) * rise - shift) - length_m
        nu = diffraction_parameter(detour_m, wavelength_m)
        if beyond > 0.0:
            along = end
            left *= 0.5 * edge_ray(nu)
        else:
            left *= 0.5 * (1.0 + knife_edge(-nu))
    return Place(along, left)


@compiled
def round_one(corner: Corner, source: Point, target: Point, faces: WedgeFaces, wavelength_m: float) -> BentRay:
    """The ray from a source round one edge to a target; both are to see it."""
    before, behind = distance(corner, source), distance(corner, target)
    rise = target.along - source.along
    at = place(corner, source.along + rise * before / (before + behind), before, behind, rise, wavelength_m)
    before_m, behind_m = hypot(before, at.along - source.along), hypot(behind, target.along - at.along)
    stretch = hypot(before + behind, rise) / (before + behind)
    k_length = 2.0 * math.pi / wavelength_m * before * behind / ((before + behind) * stretch)
    wedges = wedge(outer_angle(corner, source), outer_angle(corner, target), OUTER_ANGLE, k_length, faces)
    left = at.left / math.sqrt(k_length)
    return BentRay(at.along, at.along, before_m, 0.0, behind_m, left * wedges.soft, left * wedges.hard)


@compiled
def round_two(
    first: Corner, last: Corner, beyond: Corner, source: Point, target: Point, faces: WedgeFaces, wavelength_m: float
) -> BentRay:
    """The ray along the face between two edges; the source is to see the first, and the target the last.

    It fades out where it would have to pass the edge `beyond` the last one: what comes round three is left out.
    """
    before, behind = distance(first, source), distance(last, target)
    face = hypot(last.p - first.p, last.q - first.q)
    rise = target.along - source.along
    whole = before + face + behind
    slope = rise / whole
    at_first = place(first, source.along + slope * before, before, face + behind, rise, wavelength_m)
    at_last = place(last, target.along - slope * behind, before + face, behind, rise, wavelength_m)
    before_m, behind_m = (
        hypot(before, at_first.along - source.along),
        hypot(behind, target.along - at_last.along),
    )
    between_m = hypot(face, at_last.along - at_first.along)
    stretch = math.sqrt(1.0 + slope * slope)
    k_length = 2.0 * math.pi / wavelength_m * before * (face + behind) / (whole * stretch)
    leaves_rad = 0.0 if last.p == first.p else OUTER_ANGLE.n * math.pi
    wedges = wedge(outer_angle(first, source), leaves_rad, OUTER_ANGLE, k_length, faces)
    straight_m = hypot(distance(first, target), slope * (face + behind))
    nu = diffraction_parameter((face + behind) * stretch - straight_m, wavelength_m)
    left = at_first.left * at_last.left * edge_ray(nu if is_hidden(first, target) else -nu) / math.sqrt(k_length)
    detour_m = hypot(beyond.p - last.p, beyond.q - last.q) + distance(beyond, target) - behind
    fades = min(diffraction_parameter(detour_m, wavelength_m), 1.0)
    left *= fades * fades * (3.0 - 2.0 * fades)
    return BentRay(at_first.along, at_last.along, before_m, between_m, behind_m, left * wedges.soft, left * wedges.hard)
