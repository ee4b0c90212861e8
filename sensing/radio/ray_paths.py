"""Ray paths from sources to arrays, straight, by one mirror or round the edges of a box, found in a compiled loop."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from pdpatrol.sensing.radio.diffraction.bends import (
    BENT_RAY,
    FADES_DB,
    FADES_OVER_DB,
    MOST_RAYS,
    SEEN_EDGE,
    WEAKEST,
    Bending,
    BentRays,
    bend,
    shade,
)
from pdpatrol.sensing.radio.lines import line
from pdpatrol.sensing.radio.materials import Substance
from pdpatrol.sensing.radio.mirrors import Standing, by_rim, meet_face, reflect_flat, reflect_round
from pdpatrol.sensing.radio.obstruction import SHADOW, cast_shadows, passes_straight
from pdpatrol.sensing.radio.polarisation import Emitter, radiated, received
from pdpatrol.sensing.radio.surroundings import Surroundings
from pdpatrol.sensing.radio.tables import GROUND, Obstacles, substance_of
from pdpatrol.sensing.radio.two_mirrors import is_upright, meet_two, reflect_by_two
from pdpatrol.sensing.radio.vectors import TINY, Vector, length, minus, towards, upside_down

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

FADES_BY_GROUND_DB = 40.0
"""How far below the loudest path that by the ground alone fades (assumed): it changes levels by 0.1 dB."""

WEAKEST_BY_GROUND = 10.0 ** (-(FADES_BY_GROUND_DB + FADES_OVER_DB) / 20.0)


class RayPaths(NamedTuple):
    """Paths to one array; a row is a path, those of one source follow one another.

    Attributes:
        source: Number of the source, shape (n_paths,).
        from_m: Whence it comes: source, its mirror image, or where it bends last, shape (n_paths, 3).
        extra_m: Its length up to there, shape (n_paths,).
        coefficient: What an antenna of circular polarisation receives of it, over a straight path as long in free
            space, complex, shape (n_paths,).
        first: The first path of each source, shape (n_sources,).
        n_paths: Number of paths of each source, shape (n_sources,).
    """

    source: IntArray
    from_m: FloatArray
    extra_m: FloatArray
    coefficient: NDArray[np.complex128]
    first: IntArray
    n_paths: IntArray


@compiled
def bend_round_all(
    emitter: Emitter,
    target: Vector,
    obstacles: Obstacles,
    ground: Substance,
    faintest: float,
    rays: BentRays,
) -> int:
    """Rays round the edges of all boxes, with what all others leave of them; returns how many there are.

    By the ground as well, those are longer, and weaker by its coefficient: where none is loud enough without it, none
    is looked for (assumed).
    """
    first, n, shadows = 0, 0, rays.shadows
    for k in range(shadows.size):
        if shadows[k].nu > shadows[first].nu:
            first = k
    for i in range(shadows.size):
        k = (first + i) % shadows.size  # what comes round the deepest shadow is loud: more can be left out after it
        if not obstacles[k].bends:
            continue
        material = substance_of(obstacles[k])
        if obstacles[k].radius_m > 0.0:  # as P.526 has it: what is round mirrors on its own
            material = Substance(material.permittivity, material.conductivity_spm, material.passes, 0.0)
        n_before = n
        n = bend(Bending(emitter, target, False, material, ground, faintest), obstacles, k, rays, n)
        if n > n_before and ground.flat_share > 0.0:
            n = bend(Bending(emitter, target, True, material, ground, faintest), obstacles, k, rays, n)
    return n


@compiled
def count_bends(obstacles: Obstacles) -> int:
    """How many solids waves bend round."""
    n = 0
    for k in range(obstacles.size):
        n += obstacles[k].bends
    return n


@compiled
def fading(amplitude: float, loudest: float, from_db: float) -> float:
    """Share that is left of a path so far weaker than the loudest: all up to `from_db`, none `FADES_OVER_DB` on."""
    below_db = 20.0 * math.log10(max(loudest / max(amplitude, TINY * loudest), 1.0))
    fades = min(max((below_db - from_db) / FADES_OVER_DB, 0.0), 1.0)
    return 1.0 - fades * fades * (3.0 - 2.0 * fades)


PATH = np.dtype(
    (np.record, [*((name, np.float64) for name in ("x", "y", "z", "extra_m", "level")), ("coefficient", np.complex128)])
)
"""A path as of `RayPaths`, and its amplitude at the array, over that 1 m from the source."""


@compiled
def add(paths: NDArray[np.void], n: int, at: Vector, extra_m: float, coefficient: complex, target: Vector) -> int:
    """Add a path unless nothing comes by it; returns how many there are."""
    if coefficient == 0.0:
        return n
    path = paths[n]
    path.x, path.y, path.z = at
    path.extra_m, path.coefficient = extra_m, coefficient
    path.level = abs(coefficient) / (extra_m + length(minus(target, at)))
    return n + 1


@compiled
def loudest_of(paths: NDArray[np.void], n: int) -> float:
    """Level of the loudest of the first n paths; 0 without any."""
    loudest = 0.0
    for i in range(n):
        loudest = max(loudest, paths[i].level)
    return loudest


@compiled
def mirror_twice(
    emitter: Emitter, target: Vector, surroundings: Surroundings, weakest: float, paths: NDArray[np.void], n: int
) -> int:
    """Add the paths by two upright faces, one after the other; returns how many paths there are."""
    faces = surroundings.faces
    for f in range(faces.size):
        first = faces[f]
        if not is_upright(first):
            continue
        for g in range(faces.size):
            second = faces[g]
            if f == g or not is_upright(second):
                continue
            met = meet_two(first, second, emitter.at, target)
            if met.first.rim_m >= 0.0 and met.second.rim_m >= 0.0:
                coefficient = reflect_by_two(emitter, target, first, second, met, surroundings.obstacles, weakest)
                n = add(paths, n, met.second.image, 0.0, coefficient, target)
    return n


@compiled
def trace(
    emitter: Emitter,
    target: Vector,
    faintest: float,
    surroundings: Surroundings,
    rays: BentRays,
    paths: NDArray[np.void],
) -> int:
    """All paths of one source, into rows of `PATH`; returns how many there are."""
    faces, ground, obstacles, by_two_walls = surroundings
    shadows = rays.shadows
    cast_shadows(line(emitter.at, target), obstacles, shadows)
    straight = towards(emitter.at, target)
    left = passes_straight(emitter.at, target, obstacles)
    n = add(paths, 0, emitter.at, 0.0, left * received(radiated(emitter.axis, straight), straight), target)
    n_strong = 0
    for is_wall in (False, True):
        rays.loudest[0] = loudest_of(paths, n)
        weakest = max((WEAKEST if is_wall else WEAKEST_BY_GROUND) * rays.loudest[0], faintest)
        for f in range(faces.size):
            face = faces[f]
            if (face.owner == GROUND) == is_wall or face.flat_share == 0.0:
                continue
            for by_ground in (False, True):
                if by_ground and (not is_wall or face.normal_z != 0.0 or ground.flat_share == 0.0):
                    continue
                image, at, rim_m = meet_face(face, upside_down(emitter.at) if by_ground else emitter.at, target)
                if rim_m >= 0.0:
                    by = Standing(obstacles, shadows, face.behind, weakest)
                    coefficient = reflect_flat(emitter, target, face, at, ground, by_ground, by)
                    coefficient *= 1.0 if face.bends else by_rim(rim_m)
                    n = add(paths, n, image, 0.0, coefficient, target)
        if not is_wall:
            n_strong = n
    rays.loudest[0] = loudest_of(paths, n)
    if by_two_walls:
        n = mirror_twice(emitter, target, surroundings, max(WEAKEST * rays.loudest[0], faintest), paths, n)
    for k in range(obstacles.size):
        if obstacles[k].radius_m > 0.0:
            by = Standing(obstacles, shadows, k, max(WEAKEST * rays.loudest[0], faintest))
            echo = reflect_round(emitter, target, by)
            n = add(paths, n, echo.image, 0.0, echo.coefficient, target)
    n_bent = bend_round_all(emitter, target, obstacles, ground, faintest, rays) if rays.rows.size > 0 else 0
    weakest = max(WEAKEST * rays.loudest[0], faintest)
    for i in range(n_bent):
        bent = rays.rows[i]
        if abs(bent.coefficient) >= weakest * bent.way_m:
            if not bent.is_shaded:
                shade(rays, i, emitter.at, target, obstacles, weakest)
            n = add(paths, n, Vector(bent.x, bent.y, bent.z), bent.extra_m, bent.coefficient, target)
    for i in range(n):
        fades_db = FADES_BY_GROUND_DB if i < n_strong else FADES_DB
        paths[i].coefficient *= fading(paths[i].level, rays.loudest[0], fades_db) if paths[i].level >= faintest else 0.0
    return n


@compiled
def find_ray_paths(
    sources_m: FloatArray, axes: FloatArray, faintest: FloatArray, target: Vector, surroundings: Surroundings
) -> RayPaths:
    """All paths from the sources that emit to the centre of an array.

    Args:
        sources_m: Shape (n_sources, 3), world frame.
        axes: Linear polarisations of the sources, unit vectors of the same shape.
        faintest: Amplitude at the array, over that 1 m from the source, below which no path of a source counts, shape
            (n_sources,); infinite for sources that do not emit.
        target: Middle of the array.
        surroundings: What stands about.
    """
    obstacles, n_sources, n_faces = surroundings.obstacles, faintest.size, surroundings.faces.size
    n_rays = 2 * MOST_RAYS * count_bends(obstacles)
    rays = BentRays(np.empty(n_rays, BENT_RAY), np.empty(4, SEEN_EDGE), np.empty(obstacles.size, SHADOW), np.zeros(1))
    n_by_two = n_faces * (n_faces - 1) if surroundings.by_two_walls else 0
    paths = np.empty(1 + 2 * n_faces + n_by_two + obstacles.size + n_rays, PATH)
    n_most = (faintest < np.inf).sum() * paths.size
    source, from_m, extra_m = np.empty(n_most, np.intp), np.empty((n_most, 3)), np.empty(n_most)
    coefficient = np.empty(n_most, np.complex128)
    first, n_paths = np.zeros(n_sources, np.intp), np.zeros(n_sources, np.intp)
    n = 0
    for s in range(n_sources):
        if faintest[s] == np.inf:
            continue
        emitter = Emitter(
            Vector(sources_m[s, 0], sources_m[s, 1], sources_m[s, 2]), Vector(axes[s, 0], axes[s, 1], axes[s, 2])
        )
        first[s] = n
        for i in range(trace(emitter, target, faintest[s], surroundings, rays, paths)):
            if paths[i].coefficient != 0.0:
                from_m[n, 0], from_m[n, 1], from_m[n, 2] = paths[i].x, paths[i].y, paths[i].z
                source[n], extra_m[n], coefficient[n] = s, paths[i].extra_m, paths[i].coefficient
                n += 1
        n_paths[s] = n - first[s]
    return RayPaths(source[:n], from_m[:n], extra_m[:n], coefficient[:n], first, n_paths)
