"""Rays that bend round opaque equipment, in compiled loops: all that leads from one source to one array."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from sensing.radio.edges import (
    BentRay,
    Corner,
    Point,
    diffraction_parameter,
    passing,
    round_one,
    round_two,
)
from sensing.radio.fresnel import WedgeCoefficients
from sensing.radio.polarisation import Field, Vector, bent, radiated, received
from sensing.radio.surroundings import Obstacles

FloatArray = NDArray[np.float64]

MOST_OF_ONE = 40
"""Room for rays round one box: eight edges alone, and two by two along five faces either way."""

FADES_FROM, FADES_TO = 4.0, 6.0
"""Diffraction parameters, above that of the strongest ray of a box, between which a ray fades out (assumed): what is left
out is 25 dB below."""


class Bends(NamedTuple):
    """Rays from one source to one array by the edges of one box, and then of others; a row is a ray.

    Attributes:
        from_m: Where each bends last, shape (n, 3).
        extra_m: Its length up to there, shape (n,).
        first_m: Where it bends first, shape (n, 3).
        coefficient: Of an antenna of circular polarisation, times length over spreading, complex, shape (n,).
    """

    from_m: FloatArray
    extra_m: FloatArray
    first_m: FloatArray
    coefficient: NDArray[np.complex128]


class Frame(NamedTuple):
    """Axes across and along an edge, as world vectors, and where their origin is."""

    p: Vector
    q: Vector
    edge: Vector
    x: float
    y: float
    z: float


@compiled
def in_frame(frame: Frame, x: float, y: float, z: float) -> Point:
    """A world point as seen along an edge."""
    dx, dy, dz = x - frame.x, y - frame.y, z - frame.z
    return Point(
        dx * frame.p.x + dy * frame.p.y + dz * frame.p.z,
        dx * frame.q.x + dy * frame.q.y + dz * frame.q.z,
        dx * frame.edge.x + dy * frame.edge.y + dz * frame.edge.z,
    )


@compiled
def in_world(frame: Frame, point: Point) -> Vector:
    """The reverse of `in_frame`."""
    return Vector(
        frame.x + point.p * frame.p.x + point.q * frame.q.x + point.along * frame.edge.x,
        frame.y + point.p * frame.p.y + point.q * frame.q.y + point.along * frame.edge.y,
        frame.z + point.p * frame.p.z + point.q * frame.q.z + point.along * frame.edge.z,
    )


@compiled
def frame_of(obstacles: Obstacles, k: int, family: int) -> Frame:
    """Frame of a family of edges of box k: 0 the upright ones, 1 and 2 those on top along its second and first side."""
    cos, sin = math.cos(obstacles.yaw_rad[k]), math.sin(obstacles.yaw_rad[k])
    x, y = obstacles.centre_m[k]
    first, second, up = Vector(cos, sin, 0.0), Vector(-sin, cos, 0.0), Vector(0.0, 0.0, 1.0)
    if family == 0:
        return Frame(first, second, up, x, y, 0.0)
    if family == 1:
        return Frame(first, up, second, x, y, 0.0)
    return Frame(second, up, first, x, y, 0.0)


@compiled
def corner_of(obstacles: Obstacles, k: int, family: int, number: int) -> Corner:
    """Edge of a family: four upright ones, two on top of each other family."""
    half_x, half_y = obstacles.half_size_m[k]
    out_p = 1.0 if number % 2 == 0 else -1.0
    if family == 0:
        out_q = 1.0 if number < 2 else -1.0
        return Corner(out_p * half_x, out_q * half_y, out_p, out_q, obstacles.bottom_m[k], obstacles.top_m[k])
    half_p, half_along = (half_x, half_y) if family == 1 else (half_y, half_x)
    return Corner(out_p * half_p, obstacles.top_m[k], out_p, 1.0, -half_along, half_along)
