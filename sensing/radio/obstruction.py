"""What stands in the way of straight lines, in compiled loops, and what it leaves of a wave."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from pdpatrol.sensing.radio.diffraction.edges import diffraction_parameter
from pdpatrol.sensing.radio.lines import Line, crosses, facing, inside_m, is_near, line, on_plan
from pdpatrol.sensing.radio.materials import WAVELENGTH_M
from pdpatrol.sensing.radio.tables import NOBODY, Obstacle, Obstacles, Shape, shape_of
from pdpatrol.sensing.radio.vectors import Vector

FloatArray = NDArray[np.float64]

BESIDE = 2.4
"""Over `Line.near_m`: what is farther from a line has a diffraction parameter below `CLEAR` less 1."""

CLEAR = -0.78
"""Diffraction parameter below which an edge takes nothing away (ITU-R P.526)."""

RIM, RIM_M = 0.1, 0.1
"""Diffraction parameter, and length inside, from which on all of a line is behind what is lossy (assumed): some
centimetres inside."""


class Shadow(NamedTuple):
    """What a solid that bends waves does to the straight path.

    Attributes:
        nu: As of `shadow`.
        cut: As of `cut_by`.
    """

    nu: float
    cut: float


SHADOW = np.dtype((np.record, [(name, np.float64) for name in Shadow._fields]))


@compiled
def knife_edge_amplitude(nu: float) -> float:
    """Amplitude that a knife edge leaves, without ripples where it is not in the way: ITU-R P.526, eq. (31)."""
    if nu <= CLEAR:
        return 1.0
    return min(1.0, 10.0 ** (-6.9 / 20.0) / (math.sqrt((nu - 0.1) ** 2 + 1.0) + nu - 0.1))


@compiled
def _nu(way: Line, x: float, y: float, z: float) -> float:
    """Diffraction parameter, without its sign, of an edge beside a line."""
    start, end = way.start, way.end
    before_m = math.sqrt((x - start.x) ** 2 + (y - start.y) ** 2 + (z - start.z) ** 2)
    behind_m = math.sqrt((x - end.x) ** 2 + (y - end.y) ** 2 + (z - end.z) ** 2)
    return diffraction_parameter(before_m + behind_m - way.length_m, WAVELENGTH_M)


@compiled
def shadow(way: Line, solid: Shape, near_m: float) -> float:
    """Diffraction parameter of the way round a solid that takes least away.

    It is negative where a line passes the solid, minus infinity farther from it than `near_m`, and below a solid that
    stands on legs.
    """
    if not is_near(way, solid, near_m):
        return -np.inf
    start, radius_m = way.start, solid.radius_m
    left = right = 0.0
    nearest, rise = np.inf, way.end.z - start.z
    for i in range(2 if radius_m > 0.0 else 4):
        if radius_m > 0.0:
            side = radius_m if i == 0 else -radius_m
            at_x, at_y = solid.x - side * way.ahead_y, solid.y + side * way.ahead_x
        else:
            p, q = solid.half_x if i % 2 == 0 else -solid.half_x, solid.half_y if i < 2 else -solid.half_y
            at_x, at_y = solid.x + solid.cos * p - solid.sin * q, solid.y + solid.sin * p + solid.cos * q
        from_x, from_y = at_x - start.x, at_y - start.y
        share = min(max((from_x * way.ahead_x + from_y * way.ahead_y) / way.level_m, 0.0), 1.0)
        nu = _nu(way, at_x, at_y, min(max(start.z + share * rise, solid.bottom_m), solid.top_m))
        nearest = min(nearest, nu)
        if from_y * way.ahead_x - from_x * way.ahead_y > 0.0:
            left = max(left, nu)
        else:
            right = max(right, nu)
    plan = on_plan(way, solid)
    enters, leaves = max(plan.enters, 0.0), min(plan.leaves, 1.0)
    if enters >= leaves:
        return -nearest
    if max(start.z + enters * rise, start.z + leaves * rise) < solid.bottom_m:
        return -np.inf
    top_m, over, clear = solid.top_m, 0.0, np.inf
    for share in (enters, leaves):
        along_m = share * way.level_m
        nu = _nu(way, start.x + along_m * way.ahead_x, start.y + along_m * way.ahead_y, top_m)
        if start.z + share * rise < top_m:
            over, clear = max(over, nu), 0.0
        else:
            clear = min(clear, nu)
    return -clear if over == 0.0 else min(left, right, over)


@compiled
def left_by(way: Line, solid: Obstacle) -> float:
    """Amplitude that a solid leaves of a wave along a line.

    Behind what bends waves that is what passes it, and what comes round it as past a knife edge; behind anything else
    what passes alone, with a rim over which it takes away ever more.
    """
    shape = shape_of(solid)
    if not is_near(way, shape, way.near_m):
        return 1.0
    passes, nu = solid.passes, shadow(way, facing(way, shape) if solid.bends else shape, way.near_m)
    if nu <= CLEAR:
        return 1.0
    if solid.bends:
        return passes + (1.0 - passes) * knife_edge_amplitude(nu)
    deep = min(max(nu / RIM, 0.0), inside_m(way, shape) / RIM_M, 1.0)
    return 1.0 - (1.0 - passes) * deep * deep * (3.0 - 2.0 * deep)


@compiled
def cut_by(way: Line, solid: Obstacle) -> float:
    """Amplitude that a solid that bends waves leaves of a straight path: all, or what passes through."""
    return solid.passes if crosses(way, facing(way, shape_of(solid))) else 1.0


@compiled
def left_straight(way: Line, solid: Obstacle) -> float:
    """Amplitude that a solid leaves of a straight path: what bends waves cuts it off, the rest comes by bent rays."""
    return cut_by(way, solid) if solid.bends else left_by(way, solid)


@compiled
def passes_straight(start: Vector, end: Vector, obstacles: Obstacles) -> float:
    """Amplitude that is left of a straight path by all that is in the way.

    Of the solids of one piece of equipment, that counts which takes away most.
    """
    left, of_piece, way = 1.0, 1.0, line(start, end)
    for k in range(obstacles.size):
        if k > 0 and obstacles[k].owner != obstacles[k - 1].owner:
            left, of_piece = left * of_piece, 1.0
        of_piece = min(of_piece, left_straight(way, obstacles[k]))
        if of_piece == 0.0:
            return 0.0
    return left * of_piece


@compiled
def passes_by_ground(down: Line, up: Line, obstacles: Obstacles) -> float:
    """As `passes_straight`, of a path that the ground mirrors, which crosses what stands on the ground only once."""
    left, of_piece = 1.0, 1.0
    for k in range(obstacles.size):
        if k > 0 and obstacles[k].owner != obstacles[k - 1].owner:
            left, of_piece = left * of_piece, 1.0
        before, after = left_straight(down, obstacles[k]), left_straight(up, obstacles[k])
        of_piece = min(of_piece, before * after if obstacles[k].bottom_m > 0.0 else min(before, after))
        if of_piece == 0.0:
            return 0.0
    return left * of_piece


@compiled
def cast_shadows(way: Line, obstacles: Obstacles, shadows: NDArray[np.void]) -> None:
    """What all solids do to a straight path, into rows of `SHADOW`."""
    for k in range(obstacles.size):
        shadows[k].nu, shadows[k].cut = -np.inf, 1.0
        if obstacles[k].bends:
            shadows[k].nu = shadow(way, facing(way, shape_of(obstacles[k])), BESIDE * way.near_m)
            shadows[k].cut = cut_by(way, obstacles[k])


@compiled
def left_of_line(way: Line, obstacles: Obstacles, own: int, least: float) -> float:
    """Amplitude that is left of a wave along a line that is no straight path: behind what bends, as past a knife edge.

    Args:
        way: The line.
        obstacles: What stands about.
        own: Solid that does not count; `NOBODY` if all do.
        least: What is less is told as 0.
    """
    left, of_piece = 1.0, 1.0
    for k in range(obstacles.size):
        if k > 0 and obstacles[k].owner != obstacles[k - 1].owner:
            left, of_piece = left * of_piece, 1.0
        if k != own:
            of_piece = min(of_piece, left_by(way, obstacles[k]))
            if left * of_piece < least:
                return 0.0
    return left * of_piece


@compiled
def counts_cut(of_ray: float, of_other: float) -> float:
    """How far what a solid bends is cut off by another as the straight path is, instead of bent once more.

    Where two solids are in the way, what is left by one and the other is a product, and one of its terms is what both
    bend. That is to count once: what the deeper shadow's solid bends is bent by the other as well, and what the other
    bends is cut off by the first, or not. So the field has no jump where either cuts the straight path off.

    Args:
        of_ray: Diffraction parameter on the straight path of the solid that bends the ray.
        of_other: Of the other.
    """
    if of_ray <= CLEAR - 1.0 or of_other <= CLEAR - 1.0:
        return 0.0
    both = min(of_ray - CLEAR + 1.0, 1.0) * min(of_other - CLEAR + 1.0, 1.0)
    return both * min(max(0.5 - 0.5 * (of_ray - of_other), 0.0), 1.0)


@compiled
def left_of_bent(
    first: Line, last: Line, obstacles: Obstacles, own: int, shadows: NDArray[np.void], least: float
) -> float:
    """Amplitude that is left of a bent or mirrored ray by all solids but its own.

    Args:
        first: From the source to the solid that bends or mirrors it.
        last: From there to the target.
        obstacles: What stands about.
        own: That solid; if it is `NOBODY`, or bends nothing, all is bent anew.
        shadows: Rows of `SHADOW`, one for each obstacle.
        least: What is less is told as 0.
    """
    left, of_piece = 1.0, 1.0
    for k in range(obstacles.size):
        if k > 0 and obstacles[k].owner != obstacles[k - 1].owner:
            left, of_piece = left * of_piece, 1.0
        if k == own:
            continue
        left_by_this = left_by(first, obstacles[k]) * left_by(last, obstacles[k])
        cut = 0.0 if own == NOBODY else counts_cut(shadows[own].nu, shadows[k].nu)
        if cut > 0.0:
            left_by_this += cut * (shadows[k].cut - left_by_this)
        of_piece = min(of_piece, left_by_this)
        if left * of_piece < least:
            return 0.0
    return left * of_piece
