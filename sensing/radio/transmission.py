"""Transmission past and through obstacles: the amplitude behind them relative to that in free space.

Two rules apply throughout. First, among the solids of one piece of equipment, only the one that attenuates most counts,
and the factors of different pieces are multiplied. Second, a solid that diffracts blocks the direct path except for
the transmitted part, because rays around its edges are traced separately (`diffraction`); on every other segment it is
treated as a knife edge.
"""

import math
from typing import NamedTuple

import numpy as np

from dirmusic.arrays import FloatArray
from dirmusic.compiled import compiled, compiled_inner
from pdpatrol.sensing.radio.geometry import (
    CLEARANCE,
    Segment,
    UprightSolid,
    Vector,
    crosses,
    distance,
    facing_box,
    footprint_interval,
    is_near,
    length_inside,
    point_between,
    rises_to,
    segment,
    vector_of,
)
from pdpatrol.sensing.radio.materials import WAVELENGTH_M, Material
from pdpatrol.sensing.radio.surroundings import Row, Rows, Surroundings, pieces_of, solid_of

CLEAR = -0.78
"""Diffraction parameter below which an edge does not attenuate (ITU-R P.526)."""

RIM_M = 0.1
"""Length, from the rim inwards, over which the loss of a solid, or the reflection of a face without diffracting edges,
rises to its full value. Assumed."""

MIN_TRANSMISSION = 10 ** (-12.0 / 20.0)
"""Amplitude transmitted along the direct path at which a target still counts as in line of sight: through one insulator
or fence, not through two. Assumed."""

SHADOW = np.dtype((np.record, [("parameter", np.float64), ("transmission", np.float64)]))
"""Effect of a diffracting obstacle on the direct path: its `shadow_parameter` and `transmission_through`. They are -inf
and 1 for an obstacle that does not diffract."""


class RadioLink(NamedTuple):
    """One source and one array, with all that affects the waves between them.

    Attributes:
        source: Position of the source.
        axis: Direction of its linear polarisation, a unit vector.
        target: Middle of the array.
        ground: Material of the ground.
        obstacles: All obstacles.
        pieces: Pieces of equipment to which they belong, rows of `PIECE`.
        shadows: Effects of the obstacles on the direct path, rows of `SHADOW`.
        paths: Paths found so far, and room for more; rows of `ray_paths.PATH`.
    """

    source: Vector
    axis: Vector
    target: Vector
    ground: Material
    obstacles: Rows
    pieces: Rows
    shadows: Rows
    paths: Rows


@compiled_inner
def smooth_step(share: float) -> float:
    """Rise smoothly from 0 at 0 and below to 1 at 1 and above."""
    share = min(max(share, 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)


@compiled_inner
def diffraction_parameter(detour_m: float) -> float:
    """Return the diffraction parameter of an edge from the excess length of the ray over it: ITU-R P.526, eq. (26)."""
    return 2.0 * math.sqrt(max(detour_m, 0.0) / WAVELENGTH_M)


@compiled
def knife_edge_amplitude(parameter: float) -> float:
    """Return the amplitude behind a knife edge, without ripples in the lit region: ITU-R P.526, eq. (31)."""
    if parameter <= CLEAR:
        return 1.0
    off = parameter - 0.1
    return min(1.0, 10.0 ** (-6.9 / 20.0) / (math.sqrt(off**2 + 1.0) + off))


@compiled_inner
def parameter_at(path: Segment, point: Vector) -> float:
    """Return the unsigned diffraction parameter of the detour from a segment via a point."""
    return diffraction_parameter(distance(path.start, point) + distance(point, path.end) - path.length_m)


@compiled_inner
def shadow_parameter(path: Segment, solid: UprightSolid, near_m: float) -> float:
    """Return the diffraction parameter of the strongest path around a solid: left, right or over the top.

    The parameter is positive if the solid blocks the segment and negative if the segment passes it. It is minus
    infinity if the segment is farther away than `near_m` or passes below a solid that stands on legs.
    """
    if not is_near(path, solid, near_m):
        return -np.inf
    start, radius_m = path.start, solid.radius_m
    left = right = 0.0
    nearest, rise = np.inf, path.end.z - start.z
    for i in range(2 if radius_m > 0.0 else 4):
        if radius_m > 0.0:
            side = radius_m if i == 0 else -radius_m
            x, y = solid.x - side * path.ahead_y, solid.y + side * path.ahead_x
        else:
            p, q = solid.half_x if i % 2 == 0 else -solid.half_x, solid.half_y if i < 2 else -solid.half_y
            x, y = solid.x + solid.cos * p - solid.sin * q, solid.y + solid.sin * p + solid.cos * q
        dx, dy = x - start.x, y - start.y
        share = min(max((dx * path.ahead_x + dy * path.ahead_y) / path.horizontal_m, 0.0), 1.0)
        z = min(max(start.z + share * rise, solid.bottom_m), solid.top_m)
        parameter = parameter_at(path, Vector(x, y, z))
        nearest = min(nearest, parameter)
        if dy * path.ahead_x - dx * path.ahead_y > 0.0:
            left = max(left, parameter)
        else:
            right = max(right, parameter)
    enters, leaves = footprint_interval(path, solid)
    enters, leaves = max(enters, 0.0), min(leaves, 1.0)
    if enters >= leaves:
        return -nearest
    if max(start.z + enters * rise, start.z + leaves * rise) < solid.bottom_m:
        return -np.inf
    over, clear = 0.0, np.inf
    for share in (enters, leaves):
        at = point_between(start, path.end, share)
        parameter = parameter_at(path, Vector(at.x, at.y, solid.top_m))
        if at.z < solid.top_m:
            over, clear = max(over, parameter), 0.0
        else:
            clear = min(clear, parameter)
    return -clear if over == 0.0 else min(left, right, over)


@compiled_inner
def transmission_past(path: Segment, obstacle: Row) -> float:
    """Return the amplitude past an obstacle on a segment that is not the direct path.

    A solid that diffracts transmits a fraction of the amplitude and acts as a knife edge for the rest. The loss of any
    other solid rises smoothly from its rim to a diffraction parameter of 0.1 (assumed) or a length of `RIM_M` inside.
    """
    solid = solid_of(obstacle)
    if not is_near(path, solid, path.clearance_m):
        return 1.0
    loss = 1.0 - obstacle.transmission
    parameter = shadow_parameter(path, facing_box(path, solid) if obstacle.diffracts else solid, path.clearance_m)
    if parameter <= CLEAR:
        return 1.0
    if obstacle.diffracts:
        return obstacle.transmission + loss * knife_edge_amplitude(parameter)
    return 1.0 - loss * smooth_step(min(parameter / 0.1, length_inside(path, solid) / RIM_M))


@compiled_inner
def transmission_through(path: Segment, obstacle: Row) -> float:
    """Return the amplitude behind an obstacle on the direct path, without the waves diffracted around it."""
    if not obstacle.diffracts:
        return transmission_past(path, obstacle)
    return obstacle.transmission if crosses(path, facing_box(path, solid_of(obstacle))) else 1.0


@compiled_inner
def is_near_piece(path: Segment, piece: Row, margin_m: float) -> bool:
    """Return whether the box around a piece of equipment, larger by a margin on all sides, may meet a segment.

    In plan view, the directions along and across the segment and along the world axes are tested for a gap.
    """
    half_x, half_y, (start, end) = piece.half_x + margin_m, piece.half_y + margin_m, (path.start, path.end)
    if min(start.x, end.x) > piece.x + half_x or max(start.x, end.x) < piece.x - half_x:
        return False
    if min(start.y, end.y) > piece.y + half_y or max(start.y, end.y) < piece.y - half_y:
        return False
    x, y = piece.x - start.x, piece.y - start.y
    if abs(y * path.ahead_x - x * path.ahead_y) > half_x * abs(path.ahead_y) + half_y * abs(path.ahead_x):
        return False
    return rises_to(path, piece.bottom_m - margin_m, piece.top_m + margin_m)


@compiled_inner
def direct_transmission(start: Vector, end: Vector, within_m: float, obstacles: Rows, pieces: Rows) -> float:
    """Return the transmission of the direct path; see `Sight` for `within_m`."""
    total, whole = 1.0, segment(start, end)
    for p in range(pieces.size):
        piece, of_piece = pieces[p], 1.0
        if not is_near_piece(whole, piece, whole.clearance_m):
            continue
        for k in range(piece.first, piece.end):
            path, obstacle = whole, obstacles[k]
            if within_m > 0.0 and whole.length_m > 0.0:
                depth_m = obstacle.radius_m if obstacle.radius_m > 0.0 else min(obstacle.half_x, obstacle.half_y)
                skipped = min(min(within_m, depth_m) / whole.length_m, 1.0)
                path = segment(start, point_between(start, end, 1.0 - skipped))
            of_piece = min(of_piece, transmission_through(path, obstacle))
        total *= of_piece
        if total == 0.0:
            return 0.0
    return total


@compiled_inner
def ground_transmission(down: Segment, up: Segment, obstacles: Rows, pieces: Rows) -> float:
    """Return the transmission of a ground-reflected path, in which solids that stand on the ground count only once."""
    total = 1.0
    for p in range(pieces.size):
        piece, of_piece = pieces[p], 1.0
        if not (is_near_piece(down, piece, down.clearance_m) or is_near_piece(up, piece, up.clearance_m)):
            continue
        for k in range(piece.first, piece.end):
            before, behind = transmission_through(down, obstacles[k]), transmission_through(up, obstacles[k])
            of_piece = min(of_piece, before * behind if obstacles[k].bottom_m > 0.0 else min(before, behind))
        total *= of_piece
        if total == 0.0:
            return 0.0
    return total


@compiled_inner
def segment_transmission(path: Segment, link: RadioLink, skipped: int, least: float) -> float:
    """Return the transmission of one segment between two reflections.

    Args:
        path: The segment.
        link: Obstacles.
        skipped: Index of the obstacle to ignore, the one that the reflecting face bounds.
        least: Results below are returned as 0.
    """
    obstacles, pieces, total = link.obstacles, link.pieces, 1.0
    for p in range(pieces.size):
        piece, of_piece = pieces[p], 1.0
        if not is_near_piece(path, piece, path.clearance_m):
            continue
        for k in range(piece.first, piece.end):
            if k != skipped:
                of_piece = min(of_piece, transmission_past(path, obstacles[k]))
        total *= of_piece
        if total < least:
            return 0.0
    return total


@compiled_inner
def cast_shadows(link: RadioLink) -> None:
    """Compute the effect of every obstacle on the direct path, and store it in `link.shadows` and `link.pieces`."""
    direct, pieces = segment(link.source, link.target), link.pieces
    near_m = 2.4 * direct.clearance_m  # beyond, the parameter is below CLEAR - 1
    for p in range(pieces.size):
        piece = pieces[p]
        is_near, piece.parameter = is_near_piece(direct, piece, near_m), -np.inf
        for k in range(piece.first, piece.end):
            obstacle, shadow = link.obstacles[k], link.shadows[k]
            shadow.parameter, shadow.transmission = -np.inf, 1.0
            if is_near and obstacle.diffracts:
                shadow.parameter = shadow_parameter(direct, facing_box(direct, solid_of(obstacle)), near_m)
                shadow.transmission = transmission_through(direct, obstacle)
                piece.parameter = max(piece.parameter, shadow.parameter)


@compiled_inner
def blocking_weight(of_ray: float, of_other: float) -> float:
    """Return the degree to which an obstacle blocks a ray that another one diffracts, as it blocks the direct path.

    Behind two obstacles, the field is the product of the fields of two knife edges, and one term of the product is
    diffracted by both. This term must be counted once: rays around the obstacle with the deeper shadow pass the other
    obstacle as a knife edge, whereas rays around the other obstacle are blocked by the first one where it blocks the
    direct path. The weight changes smoothly between the two cases, so that the field is continuous where either
    obstacle begins to block the direct path.

    Args:
        of_ray: `shadow_parameter`, for the direct path, of the obstacle that diffracts the ray.
        of_other: `shadow_parameter`, for the direct path, of the other obstacle.
    """
    if of_ray <= CLEAR - 1.0 or of_other <= CLEAR - 1.0:
        return 0.0
    both = min(of_ray - CLEAR + 1.0, 1.0) * min(of_other - CLEAR + 1.0, 1.0)
    return both * min(max(0.5 - 0.5 * (of_ray - of_other), 0.0), 1.0)


@compiled_inner
def bent_transmission(first: Segment, last: Segment, link: RadioLink, own: int, least: float) -> float:
    """Return the transmission of a diffracted or reflected ray past all obstacles except the one that turns it.

    Args:
        first: Segment from the source to the obstacle that diffracts or reflects.
        last: Segment from there to the target.
        link: Source, target and obstacles.
        own: Index of the obstacle that diffracts or reflects; negative for a face without a solid behind it.
        least: Results below are returned as 0.
    """
    obstacles, pieces, shadows, total = link.obstacles, link.pieces, link.shadows, 1.0
    of_own = shadows[own].parameter if own >= 0 else -np.inf
    for p in range(pieces.size):
        piece, of_piece = pieces[p], 1.0
        meets_first = is_near_piece(first, piece, first.clearance_m)
        meets_last = is_near_piece(last, piece, last.clearance_m)
        if not (meets_first or meets_last or blocking_weight(of_own, piece.parameter) > 0.0):
            continue
        for k in range(piece.first, piece.end):
            if k == own:
                continue
            past = transmission_past(first, obstacles[k]) if meets_first else 1.0
            if meets_last:
                past *= transmission_past(last, obstacles[k])
            blocked = blocking_weight(of_own, shadows[k].parameter)
            if blocked > 0.0:
                past += blocked * (shadows[k].transmission - past)
            of_piece = min(of_piece, past)
        total *= of_piece
        if total < least:
            return 0.0
    return total


class Sight(NamedTuple):
    """Transmission of the direct path in given surroundings.

    The simulation of waves and a robot that has a map use the same model.

    Attributes:
        surroundings: Faces and solids.
    """

    surroundings: Surroundings

    def __call__(self, places_m: FloatArray, target_m: FloatArray, within_m: float = 0.0) -> FloatArray:
        """Return the amplitude of direct waves relative to that in free space, in [0, 1]; 0 behind metal.

        Args:
            places_m: Positions of the antenna, shape (n, 3), world frame.
            target_m: Position of the source, shape (3,).
            within_m: Length of the end of the path, next to the target, in which equipment does not attenuate, but at
                most half the thickness of each piece. A target on a surface or slightly inside is then seen from
                outside.

        Returns:
            Relative amplitudes, shape (n,).
        """
        return direct_transmissions(places_m, target_m, within_m, self.surroundings.obstacles)


@compiled
def direct_transmissions(places_m: FloatArray, target_m: FloatArray, within_m: float, obstacles: Rows) -> FloatArray:
    """Return the `direct_transmission` from each position."""
    result, pieces, target, longest_m = np.empty(len(places_m)), pieces_of(obstacles), vector_of(target_m), 0.0
    for i in range(len(places_m)):
        longest_m = max(longest_m, distance(vector_of(places_m[i]), target))
    n_near, margin_m = 0, longest_m + CLEARANCE * math.sqrt(WAVELENGTH_M * longest_m)
    for p in range(pieces.size):
        off_x, off_y = abs(pieces[p].x - target.x), abs(pieces[p].y - target.y)
        if off_x <= pieces[p].half_x + margin_m and off_y <= pieces[p].half_y + margin_m:
            pieces[n_near] = pieces[p]
            n_near += 1
    for i in range(len(places_m)):
        result[i] = direct_transmission(vector_of(places_m[i]), target, within_m, obstacles, pieces[:n_near])
    return result
