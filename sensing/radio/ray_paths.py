"""Direct, reflected and diffracted ray paths from sources to an array, found in one compiled call."""

import math
from typing import NamedTuple

import numpy as np

from dirmusic.arrays import FloatArray, IntArray
from dirmusic.compiled import compiled, compiled_inner
from pdpatrol.sensing.radio.diffraction import (
    box_edge,
    edge_faces,
    edge_frame,
    is_hidden,
    largest_level,
    received_from_edge,
    round_one,
    round_two,
)
from pdpatrol.sensing.radio.geometry import (
    TINY,
    UP,
    Vector,
    above_ground,
    distance,
    facing_box,
    mirror_in_ground,
    segment,
    to_frame,
    to_world,
    towards,
    vector_of,
)
from pdpatrol.sensing.radio.materials import Material
from pdpatrol.sensing.radio.polarisation import radiated, received
from pdpatrol.sensing.radio.reflection import (
    Mirror,
    face_mirror,
    face_point,
    plane_point,
    reflect_by_cylinder,
    reflect_by_two_faces,
    reflect_once,
    reflect_with_ground,
    two_face_points,
)
from pdpatrol.sensing.radio.surroundings import GROUND, Row, Rows, Surroundings, material_of, pieces_of, solid_of
from pdpatrol.sensing.radio.transmission import (
    RIM_M,
    SHADOW,
    RadioLink,
    bent_transmission,
    cast_shadows,
    direct_transmission,
    smooth_step,
)

FADE_DB, GROUND_FADE_DB, FADE_OVER_DB = 20.0, 40.0, 6.0
"""Level below the strongest path at which a path begins to fade out; the same for the path reflected by the ground
alone; and range of levels over which paths fade out. Assumed; they change strengths by less than a tenth, and levels by
0.1 dB."""

WEAKEST = 10.0 ** (-(FADE_DB + FADE_OVER_DB) / 20.0)
"""Amplitude relative to the strongest path below which a path is ignored."""

PATH = np.dtype(
    (
        np.record,
        [
            *((name, np.float64) for name in ("x", "y", "z", "extra_m", "level")),
            ("coefficient", np.complex128),
        ],
    )
)
"""Row of a path.

`x`, `y`, `z`: point that the path seems to come from, which is the source, its image or the last point of diffraction.
`extra_m`: length of the path from the source to a point of diffraction, otherwise 0. `level`: amplitude at the array
relative to the amplitude 1 m from the source. `coefficient`: signal of a circularly polarised antenna relative to that
of a direct path of the same length.
"""


class RayPaths(NamedTuple):
    """Paths to one array, grouped by source.

    Attributes:
        rows: Rows of `PATH`.
        first: First path of each source, and the number of all paths, shape (n_sources + 1,).
    """

    rows: Rows
    first: IntArray


@compiled_inner
def add_path(link: RadioLink, n: int, at: Vector, extra_m: float, coefficient: complex) -> int:
    """Write a path into row n, and return the number of paths."""
    path = link.paths[n]
    path.x, path.y, path.z = at
    path.extra_m, path.coefficient = extra_m, coefficient
    path.level = abs(coefficient) / (extra_m + distance(at, link.target))
    return n + 1


@compiled_inner
def is_upright(face: Row) -> bool:
    """Return whether a face is upright."""
    return face.normal[2] == 0.0


@compiled_inner
def add_faces(link: RadioLink, faces: Rows, least: float, n: int) -> int:
    """Add the paths reflected by a face, or by an upright face and the ground, and return the number of paths."""
    for f in range(faces.size):
        face = faces[f]
        for with_ground in (False, True):
            if with_ground and not is_upright(face):
                continue
            source = mirror_in_ground(link.source) if with_ground else link.source
            image, at, rim_m = face_point(face, source, link.target)
            if rim_m < 0.0:
                continue
            if with_ground:
                coefficient = reflect_with_ground(link, at, face, least)
            else:
                coefficient = reflect_once(link, face_mirror(face, at), face.solid, least)
            n = add_path(
                link, n, image, 0.0, coefficient if face.diffracts else coefficient * smooth_step(rim_m / RIM_M)
            )
    return n


@compiled_inner
def add_box(link: RadioLink, own: int, by_ground: bool, least: float, strongest: float, n: int) -> tuple[int, float]:
    """Add the paths diffracted around the edges of a box, attenuated by all other obstacles.

    Args:
        link: Source, target and obstacles.
        own: Index of the box, or of a cylinder whose inscribed box diffracts in its place.
        by_ground: True for the paths that are also reflected by the ground.
        least: Amplitude at the array, relative to that 1 m from the source, below which a path is ignored.
        strongest: Largest level of any path so far; the level of a diffracted path counts twice, because an edge halves
            the wave that it blocks.
        n: Number of paths so far.

    Returns:
        Number of paths, and the largest level including the new paths.
    """
    obstacle = link.obstacles[own]
    material = material_of(obstacle)
    if obstacle.radius_m > 0.0:  # the reflection by a cylinder is a separate path
        material = Material(material.permittivity, material.conductivity_spm, material.transmission, 0.0)
    start = mirror_in_ground(link.source) if by_ground else link.source
    box = facing_box(segment(start, link.target), solid_of(obstacle))
    for family in range(3):
        frame = edge_frame(box, family)
        source, target = to_frame(frame, start), to_frame(frame, link.target)
        n_edges = 4 if family == 0 or by_ground else 2
        for i in range(n_edges):
            first = box_edge(box, family, i)
            if is_hidden(first, source):
                continue
            for step in (0, 1, 3):  # this edge alone, then this edge and either neighbour
                j = (i + step) % 4
                if j >= n_edges or (family > 0 and (i < 2) != (j < 2)):  # only across the upper or the lower face
                    continue
                last, weakest = box_edge(box, family, j), max(WEAKEST * strongest, least)
                if is_hidden(last, target) or largest_level(first, last, source, target) < weakest:
                    continue
                faces = edge_faces(first, source, target, material)
                if step == 0:
                    ray = round_one(first, source, target, faces)
                else:
                    ray = round_two(first, last, box_edge(box, family, (j + step) % 4), source, target, faces)
                length_m = ray.before_m + ray.behind_m
                if math.sqrt(2.0) * max(abs(ray.soft), abs(ray.hard)) < weakest * length_m:
                    continue
                bends_first = to_world(frame, Vector(first.x, first.y, ray.first))
                bends_last = to_world(frame, Vector(last.x, last.y, ray.last))
                coefficient = received_from_edge(link, start, bends_first, bends_last, frame.z, ray)
                weakest *= length_m / max(abs(coefficient), TINY)
                if weakest > 1.0:
                    continue
                to_first = segment(link.source, above_ground(bends_first))
                from_last = segment(above_ground(bends_last), link.target)
                coefficient *= bent_transmission(to_first, from_last, link, own, weakest)
                n = add_path(link, n, bends_last, ray.before_m, coefficient)
                strongest = max(strongest, 2.0 * abs(coefficient) / length_m)
    return n, strongest


@compiled_inner
def add_edges(link: RadioLink, least: float, strongest: float, n: int) -> tuple[int, float]:
    """Add the paths around the edges of all boxes; arguments and results as in `add_box`.

    Paths reflected by the ground are longer and weaker than the others. Assumed: if no path around an obstacle is
    strong enough without the ground, even in the absence of other obstacles, none is with it. The obstacle with the
    deepest shadow is first, because paths around it are strong, so that more of the other paths can be skipped.
    """
    n_obstacles, deepest = link.obstacles.size, 0
    for k in range(n_obstacles):
        if link.shadows[k].parameter > link.shadows[deepest].parameter:
            deepest = k
    for i in range(n_obstacles):
        k = (deepest + i) % n_obstacles
        if link.obstacles[k].diffracts:
            n_before = n
            n, strongest = add_box(link, k, False, least, strongest, n)
            if n > n_before:
                n, strongest = add_box(link, k, True, least, strongest, n)
    return n, strongest


@compiled_inner
def trace(link: RadioLink, faces: Rows, second_order: bool, least: float) -> int:
    """Find all paths of one source.

    Args:
        link: Source, target and obstacles; `shadows` and `paths` are filled in.
        faces: Flat reflecting faces, rows of `FACE`.
        second_order: Whether rays reflected by two upright faces are included.
        least: Amplitude at the array, relative to that 1 m from the source, below which a path is ignored.

    Returns:
        Number of paths.
    """
    source, target, paths = link.source, link.target, link.paths
    cast_shadows(link)
    ray = towards(source, target)
    direct = direct_transmission(source, target, 0.0, link.obstacles, link.pieces) * received(
        radiated(link.axis, ray), ray
    )
    n = add_path(link, 0, source, 0.0, direct)
    image, at, rim_m = plane_point(Vector(0.0, 0.0, 0.0), UP, source, target)
    if rim_m > 0.0:
        weakest = max(10.0 ** (-(GROUND_FADE_DB + FADE_OVER_DB) / 20.0) * paths[0].level, least)
        n = add_path(link, n, image, 0.0, reflect_once(link, Mirror(at, UP, link.ground), GROUND, weakest))
    n_direct_and_ground, weakest = n, max(WEAKEST * paths["level"][:n].max(), least)
    n = add_faces(link, faces, weakest, n)

    strongest = paths["level"][:n].max()
    weakest = max(WEAKEST * strongest, least)
    if second_order:
        for f in range(faces.size):
            for g in range(faces.size):
                if f != g and is_upright(faces[f]) and is_upright(faces[g]):
                    at_first, at_second = two_face_points(faces[f], faces[g], source, target)
                    if min(at_first.rim_m, at_second.rim_m) >= 0.0:
                        coefficient = reflect_by_two_faces(link, faces[f], faces[g], at_first, at_second, weakest)
                        n = add_path(link, n, at_second.image, 0.0, coefficient)
    for k in range(link.obstacles.size):
        if link.obstacles[k].radius_m > 0.0:
            coefficient, image = reflect_by_cylinder(link, k, weakest)
            n = add_path(link, n, image, 0.0, coefficient)
    n, strongest = add_edges(link, least, strongest, n)

    n_kept = 0
    for i in range(n):
        if paths[i].coefficient != 0.0 and paths[i].level >= least:
            from_db = GROUND_FADE_DB if i < n_direct_and_ground else FADE_DB
            below_db = 20.0 * math.log10(max(strongest / paths[i].level, 1.0))
            paths[i].coefficient *= 1.0 - smooth_step((below_db - from_db) / FADE_OVER_DB)
            if paths[i].coefficient != 0.0:
                paths[n_kept] = paths[i]
                n_kept += 1
    return n_kept


@compiled
def find_ray_paths(
    sources_m: FloatArray, axes: FloatArray, least: FloatArray, target: Vector, surroundings: Surroundings
) -> RayPaths:
    """Find all paths from the emitting sources to the middle of an array.

    Args:
        sources_m: Positions of the sources, shape (n_sources, 3), world frame.
        axes: Linear polarisations of the sources, unit vectors, shape (n_sources, 3).
        least: Amplitude at the array, relative to that 1 m from the source, below which a path of each source is
            ignored, shape (n_sources,); infinite for sources that do not emit.
        target: Middle of the array.
        surroundings: Faces and solids.
    """
    faces, ground, obstacles, second_order = surroundings
    n_most = 2 + 2 * faces.size + second_order * faces.size**2 + obstacles.size
    n_most += 48 * obstacles["diffracts"].sum()  # 12 upright and 8 horizontal; 12 and 16 with ground reflection
    paths, shadows = np.empty(n_most * (least < np.inf).sum(), PATH), np.empty(obstacles.size, SHADOW)
    pieces, first, n = pieces_of(obstacles), np.zeros(least.size + 1, np.intp), 0
    for s in range(least.size):
        if least[s] < np.inf:
            source, axis = vector_of(sources_m[s]), vector_of(axes[s])
            link = RadioLink(source, axis, target, ground, obstacles, pieces, shadows, paths[n:])
            n += trace(link, faces, second_order, least[s])
        first[s + 1] = n
    return RayPaths(paths[:n], first)
