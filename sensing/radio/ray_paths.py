"""Direct, reflected and diffracted ray paths from sources to an array, found in one compiled call."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.arrays import FloatArray, IntArray
from dirmusic.compiled import compiled, compiled_inner
from pdpatrol.sensing.radio.diffraction import (
    box_edge,
    edge_axes,
    edge_faces,
    is_hidden,
    largest_level,
    received_from_edge,
    round_one,
    round_two,
    to_edge,
    to_world,
)
from pdpatrol.sensing.radio.geometry import (
    TINY,
    Vector,
    above_ground,
    distance,
    facing_box,
    mirror_in_ground,
    segment,
    towards,
)
from pdpatrol.sensing.radio.materials import Material
from pdpatrol.sensing.radio.polarisation import Emitter, radiated, received
from pdpatrol.sensing.radio.reflection import (
    Mirror,
    Obstruction,
    face_point,
    reflect_by_cylinder,
    reflect_by_two_faces,
    reflect_once,
    reflect_with_ground,
    rim_factor,
)
from pdpatrol.sensing.radio.surroundings import (
    GROUND,
    NO_SOLID,
    Row,
    Rows,
    Surroundings,
    material_of,
    normal_of,
    solid_of,
)
from pdpatrol.sensing.radio.transmission import (
    SHADOW,
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
        first: First path of each source, shape (n_sources,).
        n_paths: Number of paths of each source, shape (n_sources,).
    """

    rows: Rows
    first: IntArray
    n_paths: IntArray

    @property
    def from_m(self) -> FloatArray:
        """Points that the paths seem to come from, shape (n_paths, 3); see `PATH`."""
        return np.column_stack([self.rows["x"], self.rows["y"], self.rows["z"]])

    @property
    def extra_m(self) -> FloatArray:
        """Lengths of the paths up to the last point of diffraction, shape (n_paths,); 0 without diffraction."""
        return self.rows["extra_m"]

    @property
    def coefficient(self) -> NDArray[np.complex128]:
        """Signal of a circularly polarised antenna relative to a direct path of the same length, shape (n_paths,)."""
        return self.rows["coefficient"]


@compiled_inner
def add_path(paths: Rows, n: int, at: Vector, extra_m: float, coefficient: complex, target: Vector) -> int:
    """Write a path into row n, and return the number of paths."""
    path = paths[n]
    path.x, path.y, path.z = at
    path.extra_m, path.coefficient = extra_m, coefficient
    path.level = abs(coefficient) / (extra_m + distance(at, target))
    return n + 1


@compiled_inner
def strongest_level(paths: Rows, n: int) -> float:
    """Return the largest level of the first n paths, or 0."""
    strongest = 0.0
    for i in range(n):
        strongest = max(strongest, paths[i].level)
    return strongest


@compiled_inner
def add_face(
    emitter: Emitter,
    target: Vector,
    face: Row,
    ground: Material,
    with_ground: bool,
    around: Obstruction,
    paths: Rows,
    n: int,
) -> int:
    """Add the path reflected by a face, or by an upright face and the ground, and return the number of paths."""
    source = mirror_in_ground(emitter.at) if with_ground else emitter.at
    image, at, rim_m = face_point(face, source, target)
    if rim_m < 0.0:
        return n
    around = Obstruction(around.obstacles, around.shadows, face.solid, around.least)
    if with_ground:
        coefficient = reflect_with_ground(emitter, target, at, face, ground, around)
    else:
        mirror = Mirror(at, normal_of(face), material_of(face))
        coefficient = reflect_once(emitter, target, mirror, face.owner == GROUND, around)
    return add_path(paths, n, image, 0.0, coefficient if face.diffracts else coefficient * rim_factor(rim_m), target)


@compiled_inner
def is_wall(face: Row) -> bool:
    """Return whether a face is upright and reflects."""
    return face.owner != GROUND and face.normal_z == 0.0 and face.flat_share > 0.0


@compiled_inner
def add_box(
    emitter: Emitter,
    target: Vector,
    by_ground: bool,
    ground: Material,
    around: Obstruction,
    strongest: float,
    paths: Rows,
    n: int,
) -> tuple[int, float]:
    """Add the paths diffracted around the edges of a box, attenuated by all other obstacles.

    Args:
        emitter: Source.
        target: Middle of the array.
        by_ground: True for the paths that are also reflected by the ground.
        ground: Material of the ground.
        around: Obstacles; `around.own` is the box, or a cylinder whose inscribed box diffracts in its place.
        strongest: Largest level of any path so far; the level of a diffracted path counts twice, because an edge halves
            the wave that it blocks.
        paths: Filled in from row n on.
        n: Number of paths so far.

    Returns:
        Number of paths, and the largest level including the new paths.
    """
    obstacle = around.obstacles[around.own]
    material = material_of(obstacle)
    if obstacle.radius_m > 0.0:  # the reflection by a cylinder is a separate path
        material = Material(material.permittivity, material.conductivity_spm, material.transmission, 0.0)
    start = mirror_in_ground(emitter.at) if by_ground else emitter.at
    box = facing_box(segment(start, target), solid_of(obstacle))
    for family in range(3):
        axes = edge_axes(box, family)
        source, goal = to_edge(axes, start), to_edge(axes, target)
        n_edges = 4 if family == 0 or by_ground else 2
        for i in range(n_edges):
            first = box_edge(box, family, i)
            if is_hidden(first, source):
                continue
            for step in (0, 1, 3):  # this edge alone, then this edge and either neighbour
                j = (i + step) % 4
                if j >= n_edges or (family > 0 and (i < 2) != (j < 2)):  # only across the upper or the lower face
                    continue
                last, least = box_edge(box, family, j), max(WEAKEST * strongest, around.least)
                if is_hidden(last, goal) or largest_level(first, last, source, goal) < least:
                    continue
                faces = edge_faces(first, source, goal, material)
                if step == 0:
                    ray = round_one(first, source, goal, faces)
                else:
                    ray = round_two(first, last, box_edge(box, family, (j + step) % 4), source, goal, faces)
                length_m = ray.before_m + ray.between_m + ray.behind_m
                if math.sqrt(2.0) * max(abs(ray.soft), abs(ray.hard)) < least * length_m:
                    continue
                bends_first = to_world(axes, first.p, first.q, ray.first)
                bends_last = to_world(axes, last.p, last.q, ray.last)
                coefficient = received_from_edge(
                    emitter.axis, start, bends_first, bends_last, target, axes.edge, ray, ground
                )
                least *= length_m / max(abs(coefficient), TINY)
                if least > 1.0:
                    continue
                to_first = segment(emitter.at, above_ground(bends_first))
                from_last = segment(above_ground(bends_last), target)
                coefficient *= bent_transmission(
                    to_first, from_last, around.obstacles, around.own, around.shadows, least
                )
                n = add_path(paths, n, bends_last, ray.before_m + ray.between_m, coefficient, target)
                strongest = max(strongest, 2.0 * abs(coefficient) / length_m)
    return n, strongest


@compiled_inner
def add_edges(
    emitter: Emitter, target: Vector, ground: Material, around: Obstruction, strongest: float, paths: Rows, n: int
) -> tuple[int, float]:
    """Add the paths around the edges of all boxes; arguments and results as in `add_box`.

    Paths reflected by the ground are longer and weaker than the others. Assumed: if no path around an obstacle is
    strong enough without the ground, even in the absence of other obstacles, none is with it. The obstacle with the
    deepest shadow is first, because paths around it are strong, so that more of the other paths can be skipped.
    """
    obstacles, shadows, deepest = around.obstacles, around.shadows, 0
    for k in range(obstacles.size):
        if shadows[k].parameter > shadows[deepest].parameter:
            deepest = k
    for i in range(obstacles.size):
        k = (deepest + i) % obstacles.size
        if not obstacles[k].diffracts:
            continue
        own, n_before = Obstruction(obstacles, shadows, k, around.least), n
        for by_ground in (False, True):
            if not by_ground or (n > n_before and ground.flat_share > 0.0):
                n, strongest = add_box(emitter, target, by_ground, ground, own, strongest, paths, n)
    return n, strongest


@compiled_inner
def trace(
    emitter: Emitter, target: Vector, least: float, surroundings: Surroundings, shadows: Rows, paths: Rows
) -> int:
    """Find all paths of one source.

    Args:
        emitter: Source.
        target: Middle of the array.
        least: Amplitude at the array, relative to that 1 m from the source, below which a path is ignored.
        surroundings: Faces and solids.
        shadows: Scratch space, a row of `SHADOW` for each obstacle.
        paths: Filled in, rows of `PATH`.

    Returns:
        Number of paths.
    """
    faces, ground, obstacles, second_order = surroundings
    cast_shadows(segment(emitter.at, target), obstacles, shadows)
    ray = towards(emitter.at, target)
    direct = direct_transmission(emitter.at, target, 0.0, obstacles) * received(radiated(emitter.axis, ray), ray)
    n = add_path(paths, 0, emitter.at, 0.0, direct, target)

    n_direct_and_ground, around = n, Obstruction(obstacles, shadows, NO_SOLID, least)
    for is_ground in (True, False):
        faintest = 10.0 ** (-(GROUND_FADE_DB + FADE_OVER_DB) / 20.0) if is_ground else WEAKEST
        around = Obstruction(obstacles, shadows, NO_SOLID, max(faintest * strongest_level(paths, n), least))
        for f in range(faces.size):
            if (faces[f].owner == GROUND) == is_ground and faces[f].flat_share > 0.0:
                for with_ground in (False, True):
                    if not with_ground or (is_wall(faces[f]) and ground.flat_share > 0.0):
                        n = add_face(emitter, target, faces[f], ground, with_ground, around, paths, n)
        if is_ground:
            n_direct_and_ground = n

    strongest = strongest_level(paths, n)
    weakest = max(WEAKEST * strongest, least)
    if second_order:
        for f in range(faces.size):
            for g in range(faces.size):
                if f != g and is_wall(faces[f]) and is_wall(faces[g]):
                    coefficient, image = reflect_by_two_faces(emitter, target, faces[f], faces[g], obstacles, weakest)
                    n = add_path(paths, n, image, 0.0, coefficient, target)
    for k in range(obstacles.size):
        if obstacles[k].radius_m > 0.0:
            coefficient, image = reflect_by_cylinder(emitter, target, Obstruction(obstacles, shadows, k, weakest))
            n = add_path(paths, n, image, 0.0, coefficient, target)
    n, strongest = add_edges(emitter, target, ground, around, strongest, paths, n)

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
    faces, obstacles, n_sources = surroundings.faces, surroundings.obstacles, least.size
    n_most, shadows = 1 + 2 * faces.size, np.empty(obstacles.size, SHADOW)
    for k in range(obstacles.size):
        n_most += 1 + 48 * obstacles[k].diffracts  # 12 upright and 8 horizontal; 12 and 16 with ground reflection
    if surroundings.second_order:
        n_most += faces.size * (faces.size - 1)
    paths = np.empty(n_most * (least < np.inf).sum(), PATH)
    first, n_paths = np.zeros(n_sources, np.intp), np.zeros(n_sources, np.intp)
    n = 0
    for s in range(n_sources):
        if least[s] < np.inf:
            source = Vector(sources_m[s, 0], sources_m[s, 1], sources_m[s, 2])
            emitter = Emitter(source, Vector(axes[s, 0], axes[s, 1], axes[s, 2]))
            first[s], n_paths[s] = n, trace(emitter, target, least[s], surroundings, shadows, paths[n:])
            n += n_paths[s]
    return RayPaths(paths[:n], first, n_paths)
