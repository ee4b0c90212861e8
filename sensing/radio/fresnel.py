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
    r""":math:`e^{j u^2} \int_u^\infty e^{-j t^2} dt` for u >= 0: a cubic through a table, to 1e-8, and the first terms of
    its asymptotic series beyond."""
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
    r"""Transition function of the uniform theory of diffraction, :math:`2 j \sqrt{x} e^{jx} \int_{\sqrt{x}}^\infty
    e^{-j t^2} dt` for x >= 0 (Kouyoumjian and Pathak 1974, eq. (29))."""
    root = math.sqrt(x)
    return 2.0j * root * fresnel_tail(root)


@compiled
def _term(sign: float, beta: float, n: float, k_length: float) -> complex:
    """One cotangent with its transition function."""
    turns = np.round((beta + sign * math.pi) / (2.0 * math.pi * n))
    half = 0.5 * (2.0 * math.pi * n * turns - beta)
    a = 2.0 * math.cos(half) ** 2
    angle = (math.pi + sign * beta) / (2.0 * n)
    sine = math.sin(angle)
    if abs(sine) < 1e-9:
        sine = math.copysign(1e-9, sine)
    return math.cos(angle) / sine * transition(max(k_length * a, 1e-18))


@compiled
def wedge(
    incident_rad: float, leaving_rad: float, n: float, k: float, length_m: float, sin_edge: float
) -> WedgeCoefficients:
    r"""Uniform diffraction coefficients of a perfectly conducting wedge.

    Args:
        incident_rad: From the face of the wedge to where the wave comes from, across the edge, in [0, n pi].
        leaving_rad: From the same face to where it goes, in [0, n pi].
        n: Outer angle of the wedge over pi: 3/2 for the edge of a box.
        k: Wave number, 1/m.
        length_m: :math:`s s' \sin^2 \beta / (s + s')` of a spherical wave, with the ways before and after the edge.
        sin_edge: Sine of the angle between the ray and the edge.

    References:
        Kouyoumjian and Pathak, A uniform geometrical theory of diffraction for an edge in a perfectly conducting
        surface, Proc. IEEE 62 (1974), eq. (25) to (29).
    """
    difference, total, k_length = leaving_rad - incident_rad, leaving_rad + incident_rad, k * length_m
    of_incident = _term(1.0, difference, n, k_length) + _term(-1.0, difference, n, k_length)
    of_mirrored = _term(1.0, total, n, k_length) + _term(-1.0, total, n, k_length)
    factor = -cmath.exp(-0.25j * math.pi) / (2.0 * n * math.sqrt(2.0 * math.pi * k) * sin_edge)
    return WedgeCoefficients(factor * (of_incident - of_mirrored), factor * (of_incident + of_mirrored))
