"""Compiled functions for rays diffracted by the edges of upright boxes.

A box has twelve edges, of which the four upright ones and the four on top diffract waves towards a robot. A ray is
diffracted by one edge, or by two edges with a path along the face between them. Seen along its direction, an edge is a
corner of a rectangle: in the frame of an edge, x and y are the coordinates across the edge, and z is that along it.

Diffraction by one edge follows the uniform theory of diffraction (UTD), which distinguishes polarisations and faces,
and is continuous with the rays that the edge blocks. A second edge contributes a Fresnel integral, as in ITU-R P.526
for two edges, because the UTD of a wedge does not cover a wave that arrives along one of its faces. Waves polarised
along a metal edge vanish on its faces. Fields vary as exp(j (omega t - k r)).
"""

import cmath
import math
from typing import NamedTuple

import numpy as np
from scipy.special import modfresnelm

from dirmusic.array.pattern import cubic
from dirmusic.compiled import compiled, compiled_inner
from pdpatrol.sensing.radio.geometry import (
    UP,
    Frame,
    UprightSolid,
    Vector,
    distance,
    hypot,
    mirror_in_ground,
    towards,
)
from pdpatrol.sensing.radio.materials import WAVELENGTH_M, Material
from pdpatrol.sensing.radio.polarisation import (
    Reflection,
    diffracted,
    face_reflection,
    radiated,
    received,
    reflected,
)
from pdpatrol.sensing.radio.reflection import OWN_FACE_M
from pdpatrol.sensing.radio.transmission import RadioLink, diffraction_parameter, smooth_step

STEP, END = 0.02, 20.0
"""Step and end of the table of the Fresnel integral; cubic interpolation between its points is accurate to 1e-8."""

_AT = np.arange(0.0, END + 2 * STEP, STEP)
_TAIL = np.exp(1j * np.square(_AT)) * modfresnelm(_AT)[0]
_SLOPE = STEP * (2j * _AT * _TAIL - 1.0)


@compiled_inner
def fresnel_tail(u: float) -> complex:
    r"""Return :math:`e^{j u^2} \int_u^\infty e^{-j t^2} dt` for u >= 0.

    The value is interpolated in a table by a cubic and, beyond the table, computed from the first terms of the
    asymptotic series.
    """
    if u >= END:
        square = u * u
        return (1.0 + 0.5j / square - 0.75 / (square * square)) / (2.0j * u)
    i = int(u / STEP)
    return cubic(u / STEP - i, _TAIL[i], _TAIL[i + 1], _SLOPE[i], _SLOPE[i + 1])[0]


@compiled_inner
def edge_wave(parameter: float) -> complex:
    """Return the wave diffracted by a knife edge relative to the direct wave, with the phase of the path by the edge.

    Args:
        parameter: Diffraction parameter of ITU-R P.526, section 4.1, positive where the edge blocks the direct path. In
            the lit region, where it is negative, the direct wave has to be added.
    """
    tail = (1.0 + 1.0j) / math.sqrt(2.0 * math.pi) * fresnel_tail(math.sqrt(0.5 * math.pi) * abs(parameter))
    return tail if parameter >= 0.0 else -tail


@compiled
def knife_edge(parameter: float) -> complex:
    """Return the field behind a knife edge relative to that in free space, with the phase of the direct path."""
    behind = edge_wave(parameter) * cmath.exp(-0.5j * math.pi * parameter * parameter)
    return behind if parameter >= 0.0 else 1.0 + behind


class WedgeFaces(NamedTuple):
    """Reflection by the faces of a wedge, and transmission through it.

    A perfect conductor has the reflection coefficients -1 (perpendicular) and 1 (parallel) and no transmission.

    Attributes:
        first: Reflection coefficients of the face from which angles are measured.
        last: Reflection coefficients of the other face.
        transmission: Relative amplitude of a wave transmitted through the wedge.
    """

    first: Reflection
    last: Reflection
    transmission: float


@compiled_inner
def wedge_term(beta: float, sign: float, n: float, k_length: float) -> complex:
    r"""Return one term of the diffraction coefficient: :math:`\cot((\pi \pm \beta) / 2n) \, F(k L a^\pm(\beta))`.

    :math:`F(x) = 2 j \sqrt{x} e^{jx} \int_{\sqrt{x}}^\infty e^{-j t^2} dt` is the transition function, and
    :math:`a^\pm(\beta) = 2 \cos^2(n \pi N^\pm - \beta / 2)` with the integer N nearest to
    :math:`(\beta \pm \pi) / 2 \pi n`.
    """
    nearest = math.floor((beta + sign * math.pi) / (2.0 * math.pi * n) + 0.5)
    root = max(math.sqrt(2.0 * k_length) * abs(math.cos(math.pi * n * nearest - 0.5 * beta)), 1e-9)
    tangent = math.tan(0.5 * (math.pi + sign * beta) / n)
    if abs(tangent) < 1e-9:
        tangent = math.copysign(1e-9, tangent)
    return 2.0j * root * fresnel_tail(root) / tangent


@compiled
def wedge_coefficients(
    incident_rad: float, leaving_rad: float, n: float, k_length: float, faces: WedgeFaces
) -> tuple[complex, complex]:
    r"""Return the UTD diffraction coefficients of a wedge for the field components along and across the edge.

    The coefficients are multiplied by the square root of the wave number and by the sine of the angle between ray and
    edge.

    Args:
        incident_rad: Angle from the first face to the source, in the plane across the edge, in [0, n pi].
        leaving_rad: Angle from the first face to the target, in the same plane, in [0, n pi].
        n: Exterior angle of the wedge divided by pi: 3/2 for the edge of a box, 2 for a half-plane.
        k_length: Wave number times :math:`s s' \sin^2 \beta / (s + s')` for a spherical wave, where s' and s are the
            distances from the source to the edge and from the edge to the target, and :math:`\beta` is the angle
            between ray and edge.
        faces: Faces of the wedge.

    References:
        Kouyoumjian and Pathak, A uniform geometrical theory of diffraction for an edge in a perfectly conducting
        surface, Proc. IEEE 62 (1974), eq. (25) to (29); with reflection coefficients as in Luebbers, Finite
        conductivity uniform GTD versus knife edge diffraction, IEEE Trans. Antennas Propag. 32 (1984), eq. (3).
    """
    difference, total = leaving_rad - incident_rad, leaving_rad + incident_rad
    direct = wedge_term(difference, 1.0, n, k_length) + wedge_term(difference, -1.0, n, k_length)
    direct *= 1.0 - faces.transmission
    by_first, by_last = wedge_term(total, -1.0, n, k_length), wedge_term(total, 1.0, n, k_length)
    factor = -(1.0 - 1.0j) / (4.0 * n * math.sqrt(math.pi))
    soft = direct + faces.first.perpendicular * by_first + faces.last.perpendicular * by_last
    hard = direct + faces.first.parallel * by_first + faces.last.parallel * by_last
    return factor * soft, factor * hard


OUTER_ANGLE = 1.5
"""Exterior angle at the edge of a box, divided by pi."""


class BoxEdge(NamedTuple):
    """Edge of a box, in the frame of the edge.

    Attributes:
        x: First coordinate across the edge.
        y: Second coordinate across the edge.
        out_x: Sign of the outward normal of the face perpendicular to x, 1 or -1.
        out_y: Sign of the outward normal of the face perpendicular to y, 1 or -1.
        low: Coordinate along the edge where it begins.
        high: Coordinate along the edge where it ends.
    """

    x: float
    y: float
    out_x: float
    out_y: float
    low: float
    high: float


class EdgeRay(NamedTuple):
    """Ray diffracted by one or two edges.

    Attributes:
        first: Coordinate of the first diffraction point along its edge.
        last: Coordinate of the last diffraction point along its edge.
        before_m: Length from the source to the last edge.
        behind_m: Length from the last edge to the target.
        soft: Amplitude of a field polarised along the first edge, relative to a direct ray of the same length.
        hard: Amplitude of a field polarised across the first edge, relative to the same.
    """

    first: float
    last: float
    before_m: float
    behind_m: float
    soft: complex
    hard: complex


@compiled
def edge_frame(box: UprightSolid, family: int) -> Frame:
    """Return the frame of a family of edges: upright (0), or horizontal along the second (1) or the first side (2).

    Its origin is on the ground under the middle of the box.
    """
    first, second, origin = Vector(box.cos, box.sin, 0.0), Vector(-box.sin, box.cos, 0.0), Vector(box.x, box.y, 0.0)
    if family == 0:
        return Frame(first, second, UP, origin)
    if family == 1:
        return Frame(first, UP, second, origin)
    return Frame(second, UP, first, origin)


@compiled
def box_edge(box: UprightSolid, family: int, number: int) -> BoxEdge:
    """Return one edge of a family. Numbers 0 to 3 go around the rectangle; horizontal edges 0 and 1 are on top.

    A box that stands on the ground is joined to its mirror image below ground, to which horizontal edges 2 and 3
    belong.
    """
    bottom_m = box.bottom_m if box.bottom_m > 0.0 else -box.top_m
    out_x, out_y = 1.0 if number == 0 or number == 3 else -1.0, 1.0 if number < 2 else -1.0
    if family == 0:
        return BoxEdge(out_x * box.half_x, out_y * box.half_y, out_x, out_y, bottom_m, box.top_m)
    half_x, half_z = (box.half_x, box.half_y) if family == 1 else (box.half_y, box.half_x)
    return BoxEdge(out_x * half_x, box.top_m if number < 2 else bottom_m, out_x, out_y, -half_z, half_z)


@compiled_inner
def outer_angle(edge: BoxEdge, point: Vector) -> float:
    """Return the angle of a point about an edge, measured from the face perpendicular to x, in [0, 3/2 pi]."""
    angle = math.atan2((point.x - edge.x) * edge.out_x, -(point.y - edge.y) * edge.out_y)
    if angle > -0.25 * math.pi:
        return max(angle, 0.0)
    return min(angle + 2.0 * math.pi, OUTER_ANGLE * math.pi)


@compiled
def is_hidden(edge: BoxEdge, point: Vector) -> bool:
    """Return whether the box itself hides an edge from a point, which then is more than 1 um behind both faces."""
    return (point.x - edge.x) * edge.out_x < -1e-6 and (point.y - edge.y) * edge.out_y < -1e-6


@compiled_inner
def distance_across(edge: BoxEdge, point: Vector) -> float:
    """Return the distance of a point from the line of an edge, at least 1 mm."""
    return max(hypot(point.x - edge.x, point.y - edge.y), 1e-3)


@compiled_inner
def face_width(first: BoxEdge, last: BoxEdge) -> float:
    """Return the distance between two edges of a family."""
    return hypot(last.x - first.x, last.y - first.y)


@compiled_inner
def bend_point(edge: BoxEdge, at: float, before_m: float, behind_m: float, rise_m: float) -> tuple[float, complex]:
    """Return the diffraction point along a finite edge, and the factor of the amplitude due to its ends.

    Where an edge ends, another one begins. Behind such a corner, the field is the product of the fields of both knife
    edges; the term that both edges diffract is divided equally between the two rays.

    Args:
        edge: The edge.
        at: Coordinate of the diffraction point if the edge were infinitely long.
        before_m: Distance from the source to the edge, across the edge.
        behind_m: Distance from the edge to the target, across the edge.
        rise_m: Coordinate of the target minus that of the source, along the edge.
    """
    across_m, along, factor = before_m + behind_m, at, 1.0 + 0.0j
    rise_before_m, length_m = rise_m * before_m / across_m, hypot(across_m, rise_m)
    for end, side in ((edge.low, -1.0), (edge.high, 1.0)):
        shift_m = end - at
        before_end_m, behind_end_m = rise_before_m + shift_m, rise_m - rise_before_m - shift_m
        parameter = diffraction_parameter(hypot(before_m, before_end_m) + hypot(behind_m, behind_end_m) - length_m)
        if (at - end) * side > 0.0:
            along = end
            factor *= 0.5 * edge_wave(parameter)
        else:
            factor *= 0.5 * (1.0 + knife_edge(-parameter))
    return along, factor


@compiled
def round_one(edge: BoxEdge, source: Vector, target: Vector, faces: WedgeFaces) -> EdgeRay:
    """Return the ray diffracted by one edge; the edge must be visible from both source and target."""
    before, behind = distance_across(edge, source), distance_across(edge, target)
    across, rise = before + behind, target.z - source.z
    at, factor = bend_point(edge, source.z + rise * before / across, before, behind, rise)
    before_m, behind_m = hypot(before, at - source.z), hypot(behind, target.z - at)
    k_length = 2.0 * math.pi / WAVELENGTH_M * before * behind / hypot(across, rise)
    soft, hard = wedge_coefficients(outer_angle(edge, source), outer_angle(edge, target), OUTER_ANGLE, k_length, faces)
    factor /= math.sqrt(k_length)
    return EdgeRay(at, at, before_m, behind_m, factor * soft, factor * hard)


@compiled
def round_two(
    first: BoxEdge, last: BoxEdge, beyond: BoxEdge, source: Vector, target: Vector, faces: WedgeFaces
) -> EdgeRay:
    """Return the ray diffracted by two edges, with a path along the face between them.

    The first edge must be visible from the source, the last one from the target. The ray fades out where it would also
    have to pass the edge `beyond` the last one, because rays around three edges are not modelled.
    """
    before, behind = distance_across(first, source), distance_across(last, target)
    face, rise = face_width(first, last), target.z - source.z
    across = before + face + behind
    slope = rise / across
    at_first, factor = bend_point(first, source.z + slope * before, before, face + behind, rise)
    at_last, factor_last = bend_point(last, target.z - slope * behind, before + face, behind, rise)
    before_m = hypot(before, at_first - source.z) + hypot(face, at_last - at_first)
    behind_m, stretch = hypot(behind, target.z - at_last), math.sqrt(1.0 + slope * slope)
    k_length = 2.0 * math.pi / WAVELENGTH_M * before * (face + behind) / (across * stretch)
    leaving_rad = 0.0 if last.x == first.x else OUTER_ANGLE * math.pi
    soft, hard = wedge_coefficients(outer_angle(first, source), leaving_rad, OUTER_ANGLE, k_length, faces)
    direct_m = hypot(distance_across(first, target), slope * (face + behind))
    parameter = diffraction_parameter((face + behind) * stretch - direct_m)
    factor *= factor_last * edge_wave(parameter if is_hidden(first, target) else -parameter) / math.sqrt(k_length)
    detour_m = face_width(last, beyond) + distance_across(beyond, target) - behind
    factor *= smooth_step(diffraction_parameter(detour_m))
    return EdgeRay(at_first, at_last, before_m, behind_m, factor * soft, factor * hard)


@compiled_inner
def largest_edge_wave(detour_m: float) -> float:
    """Return an upper bound of the magnitude of `edge_wave` for a detour; in deep shadow, this is its asymptote."""
    parameter = diffraction_parameter(detour_m)
    return 0.5 if parameter < 0.45 else 0.225 / parameter


@compiled_inner
def largest_level(first: BoxEdge, last: BoxEdge, source: Vector, target: Vector) -> float:
    """Estimate the largest amplitude of a ray around two edges, relative to that 1 m from the source.

    For a ray around one edge, pass the same edge twice. The estimate is the sum of the Fresnel integrals at the shadow
    boundaries of the direct ray and both reflected rays, times that at the end of an edge if the diffraction point
    would lie beyond it. It avoids the computation of rays that are too weak to matter.
    """
    before_m, passed_m = distance_across(first, source), distance_across(first, target)
    face_m, rise = face_width(first, last), target.z - source.z
    behind_m = face_m + distance_across(last, target)
    in_x = Vector(2.0 * first.x - source.x, source.y, source.z)
    in_y = Vector(source.x, 2.0 * first.y - source.y, source.z)
    length_m = hypot(before_m + behind_m, rise)
    by_first_m = length_m - (behind_m - passed_m)
    level = largest_edge_wave(by_first_m - distance(source, target))
    level += largest_edge_wave(by_first_m - distance(in_x, target))
    level += largest_edge_wave(by_first_m - distance(in_y, target))
    if face_m > 0.0:
        level *= largest_edge_wave(behind_m - passed_m)
    rise_before_m = rise * before_m / (before_m + behind_m)
    at = source.z + rise_before_m
    shift_m = min(max(at, first.low), first.high) - at
    if shift_m != 0.0:
        by_end_m = hypot(before_m, rise_before_m + shift_m) + hypot(behind_m, rise - rise_before_m - shift_m)
        level *= largest_edge_wave(by_end_m - length_m)
    return level / length_m


@compiled_inner
def edge_faces(edge: BoxEdge, source: Vector, target: Vector, material: Material) -> WedgeFaces:
    """Return the faces at an edge, with the angles of incidence that Luebbers uses.

    A face does not reflect a source that is mounted on it, because the mirror image is then part of the source. The
    extent of the face is not known here, so a source anywhere in its plane, on its side of the edge, counts as mounted
    on it.
    """
    first = face_reflection(abs(source.x - edge.x) / distance_across(edge, source), material)
    last = face_reflection(abs(target.y - edge.y) / distance_across(edge, target), material)
    if abs(source.x - edge.x) <= OWN_FACE_M and (source.y - edge.y) * edge.out_y <= 0.0:
        first = Reflection(0j, 0j)
    if abs(source.y - edge.y) <= OWN_FACE_M and (source.x - edge.x) * edge.out_x <= 0.0:
        last = Reflection(0j, 0j)
    return WedgeFaces(first, last, material.transmission)


@compiled_inner
def received_from_edge(
    link: RadioLink, start: Vector, first: Vector, last: Vector, edge: Vector, ray: EdgeRay
) -> complex:
    """Return the signal of a circularly polarised antenna for a diffracted ray, relative to an equally long direct ray.

    Args:
        link: Source and target.
        start: Source, or its image in the ground if the ground reflects the ray. The reflection is then before the
            edges if these are above ground, and after them if they belong to the mirror image of the box.
        first: First diffraction point.
        last: Last diffraction point.
        edge: Unit vector along the edges.
        ray: The ray.
    """
    arriving, leaving = towards(start, first), towards(last, link.target)
    if start.z >= 0.0:
        field = diffracted(radiated(link.axis, arriving), arriving, leaving, edge, ray.soft, ray.hard)
        return received(field, leaving)
    arriving_down, leaving_down = mirror_in_ground(arriving), mirror_in_ground(leaving)
    field = radiated(link.axis, arriving_down)
    if last.z >= 0.0:
        field = reflected(field, arriving_down, arriving, UP, link.ground)
        return received(diffracted(field, arriving, leaving, edge, ray.soft, ray.hard), leaving)
    field = diffracted(field, arriving_down, leaving_down, mirror_in_ground(edge), ray.soft, ray.hard)
    return received(reflected(field, leaving_down, leaving, UP, link.ground), leaving)
