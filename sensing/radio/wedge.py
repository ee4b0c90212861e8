"""Diffraction by one edge in compiled functions: Fresnel's integral, knife edge and wedge.

Waves vary as exp(j (omega t - k r)).
"""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

import numpy as np
from scipy.special import modfresnelm

from dirmusic.compiled import compiled
from pdpatrol.sensing.radio.polarisation import Reflection

STEP, END = 0.02, 20.0
"""Step and end of the table of Fresnel's integral: a cubic in between is exact to 1e-8."""

_AT = np.arange(0.0, END + 2 * STEP, STEP)
_TAIL = np.exp(1j * np.square(_AT)) * modfresnelm(_AT)[0]
_SLOPE = STEP * (2j * _AT * _TAIL - 1.0)


@compiled
def fresnel_tail(u: float) -> complex:
    r"""Return :math:`e^{j u^2} \int_u^\infty e^{-j t^2} dt` for u >= 0.

    By a cubic through a table, and beyond it by the first terms of the asymptotic series.
    """
    if u >= END:
        square = u * u
        return (1.0 + 0.5j / square - 0.75 / (square * square)) / (2.0j * u)
    i = int(u / STEP)
    share, start, rise = u / STEP - i, _TAIL[i], _TAIL[i + 1] - _TAIL[i]
    quadratic = 3.0 * rise - 2.0 * _SLOPE[i] - _SLOPE[i + 1]
    cubic = _SLOPE[i] + _SLOPE[i + 1] - 2.0 * rise
    return start + share * (_SLOPE[i] + share * (quadratic + share * cubic))


@compiled
def edge_wave(parameter: float) -> complex:
    """Return the wave from a knife edge over the direct one, with the phase of the path by way of the edge.

    Args:
        parameter: Diffraction parameter of ITU-R P.526, section 4.1: positive where the edge blocks the direct path.
            In the light, where it is negative, the direct wave comes in addition.
    """
    tail = (1.0 + 1.0j) / math.sqrt(2.0 * math.pi) * fresnel_tail(math.sqrt(0.5 * math.pi) * abs(parameter))
    return tail if parameter >= 0.0 else -tail


@compiled
def knife_edge(parameter: float) -> complex:
    """Return the field behind a knife edge over that in free space, with the phase of the direct path."""
    behind = edge_wave(parameter) * cmath.exp(-0.5j * math.pi * parameter * parameter)
    return behind if parameter >= 0.0 else 1.0 + behind


class WedgeFaces(NamedTuple):
    """Faces of a wedge.

    A perfect conductor has coefficients -1 (perpendicular) and 1 (parallel) and no transmission.

    Attributes:
        first: Reflection by the face from which angles are counted.
        last: Reflection by the other face.
        transmission: Amplitude of a wave through the wedge.
    """

    first: Reflection
    last: Reflection
    transmission: float


@compiled
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
    r"""Return the uniform diffraction coefficients of a wedge for the field along the edge and across it.

    They are multiplied by the square root of the wave number and the sine of the angle between ray and edge.

    Args:
        incident_rad: Angle from the first face to the source, across the edge, in [0, n pi].
        leaving_rad: Angle from the first face to the target, in [0, n pi].
        n: Outer angle of the wedge over pi: 3/2 for the edge of a box, 2 for a half-plane.
        k_length: Wave number times :math:`s s' \sin^2 \beta / (s + s')` of a spherical wave, with the distances s'
            before and s behind the edge and the angle between ray and edge.
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
