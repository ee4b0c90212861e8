"""Fresnel's integral, and what a knife edge and a wedge leave of a wave, in compiled functions.

Waves go as exp(j (omega t - k r)).
"""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

import numpy as np
from scipy.special import modfresnelm

from dirmusic.compiled import compiled

STEP, END = 0.02, 20.0
_AT = np.arange(0.0, END + 2 * STEP, STEP)
_TAIL = np.exp(1j * np.square(_AT)) * modfresnelm(_AT)[0]
_SLOPE = STEP * (2j * _AT * _TAIL - 1.0)


@compiled
def fresnel_tail(u: float) -> complex:
    r"""Fresnel's integral from u >= 0 on, with the phase of its start: :math:`e^{j u^2} \int_u^\infty e^{-j t^2} dt`.

    A cubic through a table, to 1e-8, and the first terms of its asymptotic series beyond.
    """
    if u >= END:
        square = u * u
        return (1.0 + 0.5j / square - 0.75 / (square * square)) / (2.0j * u)
    at = u / STEP
    i = int(at)
    share, start, end = at - i, _TAIL[i], _TAIL[i + 1]
    rise = end - start
    square = 3.0 * rise - 2.0 * _SLOPE[i] - _SLOPE[i + 1]
    cube = _SLOPE[i] + _SLOPE[i + 1] - 2.0 * rise
    return start + share * (_SLOPE[i] + share * (square + share * cube))


@compiled
def knife_edge(nu: float) -> complex:
    """What a knife edge leaves of a wave: over 1 in free space, at the direct path's phase.

    Args:
        nu: Diffraction parameter of ITU-R P.526, section 4.1: positive where the edge is in the way.
    """
    u = math.sqrt(0.5 * math.pi) * abs(nu)
    tail = (1.0 + 1.0j) / math.sqrt(2.0 * math.pi) * fresnel_tail(u) * cmath.exp(-1j * u * u)
    return tail if nu >= 0.0 else 1.0 - tail


@compiled
def edge_ray(nu: float) -> complex:
    """What an edge adds to a wave that it leaves, or to nothing behind it, at the phase of the way round the edge.

    Args:
        nu: As of `knife_edge`, which is this, at that phase, and 1 where it is negative.
    """
    tail = (1.0 + 1.0j) / math.sqrt(2.0 * math.pi) * fresnel_tail(math.sqrt(0.5 * math.pi) * abs(nu))
    return tail if nu >= 0.0 else -tail


class WedgeCoefficients(NamedTuple):
    """Diffraction coefficients of a wedge, in square roots of metres.

    Attributes:
        soft: Of the field along the edge.
        hard: Of the field across it.
    """

    soft: complex
    hard: complex


@compiled
def transition(x: float) -> complex:
    r"""Transition function of the uniform theory of diffraction for x >= 0.

    It is :math:`2 j \sqrt{x} e^{jx} \int_{\sqrt{x}}^\infty e^{-j t^2} dt` (Kouyoumjian and Pathak 1974, eq. (29)).
    """
    root = math.sqrt(x)
    return 2.0j * root * fresnel_tail(root)


class Mirror(NamedTuple):
    """Reflection coefficients of the field.

    Attributes:
        across: Of the component at right angles to the plane of incidence.
        within: Of the component in it.
    """

    across: complex
    within: complex


class WedgeFaces(NamedTuple):
    """What a wedge is made of; -1 across and 1 within for both faces, and nothing passes, if it conducts perfectly.

    Attributes:
        first: The face from which angles are counted.
        last: The other one.
        passes: Share of the amplitude that passes through.
    """

    first: Mirror
    last: Mirror
    passes: float


class WedgeAngle(NamedTuple):
    """Outer angle of a wedge, and what its coefficients take from it.

    Attributes:
        n: The angle over pi.
        cos_whole: Cosine of the angle.
        sin_whole: Its sine.
        cos_part: Cosine of pi over 2 n.
        sin_part: Its sine.
    """

    n: float
    cos_whole: float
    sin_whole: float
    cos_part: float
    sin_part: float


def wedge_angle(n: float) -> WedgeAngle:
    """The outer angle n pi: 3/2 for the edge of a box, 2 for a half-plane."""
    whole, part = n * math.pi, 0.5 * math.pi / n
    return WedgeAngle(n, math.cos(whole), math.sin(whole), math.cos(part), math.sin(part))


class Terms(NamedTuple):
    """Two cotangents with their transition functions.

    Attributes:
        plus: Of pi + beta.
        minus: Of pi - beta.
    """

    plus: complex
    minus: complex


@compiled
def _term(cosine: float, sine: float, half: float, k_length: float) -> complex:
    """One cotangent, cosine over sine, with the transition function of the angle of which `half` is half the cosine."""
    if abs(sine) < 1e-9:
        sine = math.copysign(1e-9, sine)
    return cosine / sine * transition(max(2.0 * k_length * half * half, 1e-18))


@compiled
def _terms(beta: float, of: WedgeAngle, k_length: float) -> Terms:
    """Both terms of an angle, in [-n pi, 2 n pi]; all angles as sums of half of it, of beta over 2 n, and constants."""
    cos_half, sin_half = math.cos(0.5 * beta), math.sin(0.5 * beta)
    cos, sin = math.cos(0.5 * beta / of.n), math.sin(0.5 * beta / of.n)
    turned_by_one = of.cos_whole * cos_half + of.sin_whole * sin_half
    turned_back = of.cos_whole * cos_half - of.sin_whole * sin_half
    plus = cos_half if beta < (of.n - 1.0) * math.pi else turned_by_one
    minus = turned_by_one if beta > (of.n + 1.0) * math.pi else cos_half
    if beta < (1.0 - of.n) * math.pi:
        minus = turned_back
    return Terms(
        _term(of.cos_part * cos - of.sin_part * sin, of.sin_part * cos + of.cos_part * sin, plus, k_length),
        _term(of.cos_part * cos + of.sin_part * sin, of.sin_part * cos - of.cos_part * sin, minus, k_length),
    )


@compiled
def wedge(
    incident_rad: float, leaving_rad: float, of: WedgeAngle, k_length: float, faces: WedgeFaces
) -> WedgeCoefficients:
    r"""Uniform diffraction coefficients of a wedge.

    They are times the square root of the wave number and the sine of the angle between ray and edge.

    Args:
        incident_rad: From the face of the wedge to where the wave comes from, across the edge, in [0, n pi].
        leaving_rad: From the same face to where it goes, in [0, n pi].
        of: Outer angle n pi of the wedge.
        k_length: Wave number times :math:`s s' \sin^2 \beta / (s + s')` of a spherical wave, with the ways before and
            after the edge and the angle between ray and edge.
        faces: What its faces mirror, and what it lets pass.

    References:
        Kouyoumjian and Pathak, A uniform geometrical theory of diffraction for an edge in a perfectly conducting
        surface, Proc. IEEE 62 (1974), eq. (25) to (29); with coefficients of reflection as of Luebbers, Finite
        conductivity uniform GTD versus knife edge diffraction, IEEE Trans. Antennas Propag. 32 (1984), eq. (3).
    """
    difference = _terms(leaving_rad - incident_rad, of, k_length)
    total = _terms(leaving_rad + incident_rad, of, k_length)
    factor = -(1.0 - 1.0j) / (4.0 * of.n * math.sqrt(math.pi))
    incident = (1.0 - faces.passes) * (difference.plus + difference.minus)
    return WedgeCoefficients(
        factor * (incident + faces.first.across * total.minus + faces.last.across * total.plus),
        factor * (incident + faces.first.within * total.minus + faces.last.within * total.plus),
    )
