"""Rays that bend round opaque boxes, in compiled loops: all that leads from one source to one array."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from pdpatrol.sensing.radio.diffraction.box_edges import (
    ORDER,
    UP,
    Seen,
    corner_of,
    frame_of,
    in_frame,
    in_world,
    look_at,
)
from pdpatrol.sensing.radio.diffraction.edges import (
    BentRay,
    Corner,
    Point,
    diffraction_parameter,
    distance,
    round_one,
    round_two,
)
from pdpatrol.sensing.radio.diffraction.fresnel import Mirror, WedgeCoefficients, WedgeFaces
from pdpatrol.sensing.radio.lines import facing, line
from pdpatrol.sensing.radio.materials import WAVELENGTH_M, Substance
from pdpatrol.sensing.radio.obstruction import left_of_bent
from pdpatrol.sensing.radio.polarisation import Emitter, bent, face_mirror, mirrored, radiated, received
from pdpatrol.sensing.radio.surroundings import OWN_FACE_M
from pdpatrol.sensing.radio.tables import Obstacles, shape_of
from pdpatrol.sensing.radio.vectors import Vector, above_ground, hypot, towards, upside_down

FloatArray = NDArray[np.float64]


FADES_DB, FADES_OVER_DB = 20.0, 6.0
"""How far below the loudest path one that bends fades, and over how much more (assumed): it changes strengths by less
than a tenth."""

WEAKEST = 10.0 ** (-(FADES_DB + FADES_OVER_DB) / 20.0)

MOST_RAYS = 24
"""Round one box: by each of four edges alone and by two either way, upright, and half of that over each side."""


BENT_RAY = np.dtype(
    (
        np.record,
        [
            *((name, np.float64) for name in ("x", "y", "z", "first_x", "first_y", "first_z", "extra_m", "way_m")),
            ("coefficient", np.complex128),
            ("box", np.intp),
            ("is_shaded", np.bool_),
        ],
    )
)
"""A ray: where it bends last, or the mirror image of that place if the ground mirrors it afterwards; where it bends
first; its length up to the last bend, and in all; what a circular antenna receives of it, over a straight ray as long;
the box that bends it; and whether what other solids take away is taken off already."""


SEEN_EDGE = np.dtype(
    (np.record, [(name, np.float64) for name in ("before_m", "behind_m", "mirrored_p_m", "mirrored_q_m", "passed_m")])
)
"""An edge as of `Seen`, and the distance of the target from it even if it is hidden."""


class BentRays(NamedTuple):
    """Rays, of which the first so many are there.

    Attributes:
        rows: A row of `BENT_RAY` each.
        edges: Room for the edges of one family, four rows of `SEEN_EDGE`.
        shadows: What solids do to the straight path, rows of `SHADOW`.
        loudest: Largest amplitude at the array of any ray so far, over that 1 m from the source, straight ones included
            and bent ones twice, for an edge halves what it cuts off; shape (1,).
    """

    rows: NDArray[np.void]
    edges: NDArray[np.void]
    shadows: NDArray[np.void]
    loudest: FloatArray


@compiled
def faces_of(corner: Corner, source: Point, target: Point, material: Substance) -> WedgeFaces:
    """What the faces at an edge mirror of a ray; the angles that count are those of Luebbers.

    A face that the source is on mirrors nothing: its mirror image is a part of the source. How far a face goes is not
    known here; the source is taken to be on it wherever it lies on its side of the edge.
    """
    first = min(abs(source.p - corner.p) / distance(corner, source), 1.0)
    last = min(abs(target.q - corner.q) / distance(corner, target), 1.0)
    of_first, of_last = face_mirror(first, material), face_mirror(last, material)
    if abs(source.p - corner.p) <= OWN_FACE_M and (source.q - corner.q) * corner.out_q <= 0.0:
        of_first = Mirror(0j, 0j)
    if abs(source.q - corner.q) <= OWN_FACE_M and (source.p - corner.p) * corner.out_p <= 0.0:
        of_last = Mirror(0j, 0j)
    return WedgeFaces(of_first, of_last, material.passes)


class Way(NamedTuple):
    """A ray in space, from a source or its mirror image in the ground, on to an array.

    Attributes:
        start: Source or image.
        first: Where it bends first.
        last: Where it bends last.
        target: The array.
        edge: Unit vector along the edges.
    """

    start: Vector
    first: Vector
    last: Vector
    target: Vector
    edge: Vector


@compiled
def receive_bent(way: Way, wedges: WedgeCoefficients, axis: Vector, ground: Substance, by_ground: bool) -> complex:
    """What a circular antenna receives; the ground mirrors a ray before its edge, or after if it bends in the image."""
    arrives, leaves = towards(way.start, way.first), towards(way.last, way.target)
    if not by_ground:
        return received(bent(radiated(axis, arrives), arrives, leaves, way.edge, wedges), leaves)
    down = upside_down(arrives)
    field = radiated(axis, down)
    if way.last.z >= 0.0:
        field = mirrored(field, down, arrives, UP, face_mirror(max(arrives.z, 0.0), ground))
        return received(bent(field, arrives, leaves, way.edge, wedges), leaves)
    leaves_down = upside_down(leaves)
    field = bent(field, down, leaves_down, upside_down(way.edge), wedges)
    mirror = face_mirror(max(leaves.z, 0.0), ground)
    return received(mirrored(field, leaves_down, leaves, UP, mirror), leaves)


@compiled
def most_received(ray: BentRay) -> float:
    """What a circular antenna receives at most of a field that has been of length 1, whatever its polarisation."""
    soft, hard = ray.soft, ray.hard
    return math.sqrt(2.0 * max(soft.real**2 + soft.imag**2, hard.real**2 + hard.imag**2))


@compiled
def tail(detour_m: float) -> float:
    """The largest amplitude of an edge by which a ray is so much longer."""
    nu = diffraction_parameter(detour_m, WAVELENGTH_M)
    return 0.5 if nu < 0.45 else 0.225 / nu


@compiled
def past_end(corner: Corner, seen: Seen, face_m: float, source_along: float, rise: float) -> float:
    """The largest amplitude that the end of an edge leaves of a ray that would bend beyond it; 1 if it does not."""
    behind_m = face_m + seen.behind_m
    share = seen.before_m / (seen.before_m + behind_m)
    at = source_along + share * rise
    shift = min(max(at, corner.low), corner.high) - at
    if shift == 0.0:
        return 1.0
    return tail(
        hypot(seen.before_m, share * rise + shift)
        + hypot(behind_m, (1.0 - share) * rise - shift)
        - hypot(seen.before_m + behind_m, rise)
    )


@compiled
def loudest_possible(seen: Seen, face_m: float, passed_m: float, straight_m: float, rise: float) -> float:
    """About the largest amplitude that a ray round one edge, or two, may have, over that 1 m from the source.

    That is what Fresnel's integrals leave far from the shadow of the edge, and from those in the mirrors beside.

    Args:
        seen: By source and target, the distance of the target that from the last edge.
        face_m: Between the edges; 0 for one.
        passed_m: Distance of the target from the first edge.
        straight_m: From source to target.
        rise: Of the target over the source, along the edge.
    """
    across_m = seen.before_m + face_m + seen.behind_m
    way_m = math.sqrt(across_m * across_m + rise * rise)
    round_last_m = face_m + seen.behind_m - passed_m
    first_m = way_m - round_last_m
    amplitude = (
        tail(first_m - straight_m) + tail(first_m - seen.mirrored_p_m) + tail(first_m - seen.mirrored_q_m)
    ) / way_m
    return amplitude if face_m == 0.0 else amplitude * tail(round_last_m)


class Bending(NamedTuple):
    """What bends round a box.

    Attributes:
        emitter: The source.
        target: Middle of the array.
        by_ground: Whether the ground mirrors rays on their way, before or after.
        material: Of the box.
        ground: Of the ground.
        faintest: Amplitude at the array, over that 1 m from the source, below which no ray counts.
    """

    emitter: Emitter
    target: Vector
    by_ground: bool
    material: Substance
    ground: Substance
    faintest: float


@compiled
def shade(rays: BentRays, i: int, source: Vector, target: Vector, obstacles: Obstacles, weakest: float) -> None:
    """Take off what all solids but its own box take away from bent ray i; all, if less than `weakest` is left."""
    ray, bends_last = rays.rows[i], above_ground(Vector(rays.rows[i].x, rays.rows[i].y, rays.rows[i].z))
    first, last = line(source, Vector(ray.first_x, ray.first_y, ray.first_z)), line(bends_last, target)
    least = weakest * ray.way_m / abs(ray.coefficient)
    left = left_of_bent(first, last, obstacles, ray.box, rays.shadows, least)
    ray.coefficient *= left
    ray.is_shaded = True


@compiled
def bend(bending: Bending, obstacles: Obstacles, k: int, rays: BentRays, n: int) -> int:
    """Add the rays round the edges of box k, but for those that are sure to be too weak to count.

    Args:
        bending: What bends.
        obstacles: All solids.
        k: Number of the box.
        rays: Filled in from row n on.
        n: How many there are.

    Returns:
        How many there are now.
    """
    emitter, target, by_ground, material, ground, _ = bending
    start = upside_down(emitter.at) if by_ground else emitter.at
    box = facing(line(start, target), shape_of(obstacles[k]))
    edges = rays.edges
    for family in range(3):
        frame = frame_of(box, family)
        source, goal = in_frame(frame, start), in_frame(frame, target)
        rise, n_edges = goal.along - source.along, 4 if family == 0 or by_ground else 2
        straight_m = math.sqrt((goal.p - source.p) ** 2 + (goal.q - source.q) ** 2 + rise * rise)
        for i in range(n_edges):
            corner = corner_of(box, family, ORDER[family][i])
            seen = look_at(corner, source, goal)
            edges[i].before_m, edges[i].behind_m = seen.before_m, seen.behind_m
            edges[i].mirrored_p_m, edges[i].mirrored_q_m = seen.mirrored_p_m, seen.mirrored_q_m
            edges[i].passed_m = distance(corner, goal)
        for i in range(n_edges):
            weakest = max(WEAKEST * rays.loudest[0], bending.faintest)
            if edges[i].before_m < 0.0:
                continue
            first = corner_of(box, family, ORDER[family][i])
            for step in (0, 1, 3):
                j = (i + step) % 4 if family == 0 else (i if step == 0 else i ^ 1)
                if edges[j].behind_m < 0.0 or (family > 0 and step == 3):
                    continue
                last = corner_of(box, family, ORDER[family][j])
                face_m = hypot(last.p - first.p, last.q - first.q)
                seen = Seen(edges[i].before_m, edges[j].behind_m, edges[i].mirrored_p_m, edges[i].mirrored_q_m)
                most = loudest_possible(seen, face_m, edges[i].passed_m, straight_m, rise)
                if most < weakest or most * past_end(first, seen, face_m, source.along, rise) < weakest:
                    continue
                faces = faces_of(first, source, goal, material)
                if step == 0:
                    ray = round_one(first, source, goal, faces, WAVELENGTH_M)
                else:
                    after = (i + 2 * step) % 4 if family == 0 else j ^ 2
                    beyond = corner_of(box, family, ORDER[family][after])
                    ray = round_two(first, last, beyond, source, goal, faces, WAVELENGTH_M)
                way_m = ray.before_m + ray.between_m + ray.behind_m
                if most_received(ray) < weakest * way_m:
                    continue
                way = Way(
                    start,
                    in_world(frame, first.p, first.q, ray.first),
                    in_world(frame, last.p, last.q, ray.last),
                    target,
                    frame.edge,
                )
                wedges = WedgeCoefficients(ray.soft, ray.hard)
                coefficient = receive_bent(way, wedges, emitter.axis, ground, by_ground)
                if abs(coefficient) < weakest * way_m:
                    continue
                found = rays.rows[n]
                found.x, found.y, found.z = way.last
                found.first_x, found.first_y, found.first_z = above_ground(way.first)
                found.extra_m, found.way_m = ray.before_m + ray.between_m, way_m
                found.coefficient, found.box, found.is_shaded = coefficient, k, False
                if 2.0 * abs(found.coefficient) > rays.loudest[0] * way_m:
                    shade(rays, n, emitter.at, target, obstacles, weakest)
                    rays.loudest[0] = max(rays.loudest[0], 2.0 * abs(found.coefficient) / way_m)
                n += 1
    return n
