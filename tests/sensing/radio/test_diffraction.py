"""Diffraction by edges: compared with Fresnel integrals, an exact series and ITU-R P.526."""

import cmath
import math

import numpy as np
import pytest
from scipy.special import fresnel as fresnel_integrals
from scipy.special import jv

from pdpatrol.sensing.radio.diffraction import (
    BoxEdge,
    WedgeFaces,
    knife_edge,
    round_two,
    wedge_coefficients,
)
from pdpatrol.sensing.radio.geometry import Vector
from pdpatrol.sensing.radio.materials import WAVELENGTH_M
from pdpatrol.sensing.radio.polarisation import Reflection
from pdpatrol.sensing.radio.transmission import knife_edge_amplitude

METAL = WedgeFaces(Reflection(-1 + 0j, 1 + 0j), Reflection(-1 + 0j, 1 + 0j), 0.0)
K = 2 * np.pi / WAVELENGTH_M


@pytest.mark.parametrize("nu", [-30.0, -3.0, -0.78, -0.1, 0.0, 0.1, 1.0, 2.4, 10.0, 30.0])
def test_knife_edge_matches_fresnel_integrals(nu: float) -> None:
    sine, cosine = fresnel_integrals(nu)
    expected = (1 + 1j) / 2 * ((0.5 - cosine) - 1j * (0.5 - sine))
    assert abs(knife_edge(nu) - expected) < 1e-6


@pytest.mark.parametrize("nu", np.arange(-0.7, 8.0, 0.3))
def test_smooth_knife_edge_matches_p526(nu: float) -> None:
    assert 20 * np.log10(knife_edge_amplitude(nu)) == pytest.approx(20 * np.log10(abs(knife_edge(nu))), abs=1.3)


@pytest.mark.parametrize(
    ("n", "incident_deg"), [*((1.5, angle) for angle in (5.0, 40.0, 70.0, 120.0, 150.0, 179.0, 230.0)), (2.0, 30.0)]
)
@pytest.mark.parametrize("is_soft", [True, False])
def test_metal_edge_matches_exact_series(n: float, incident_deg: float, is_soft: bool) -> None:
    """Plane wave on a wedge of 90 degrees or, with n = 2, a half-plane, 3 m from its edge.

    References:
        Balanis, Advanced Engineering Electromagnetics (1989), section 13.4: series of Bessel functions.
    """
    k_rho, incident, sign = 3.0 * K, math.radians(incident_deg), -1.0 if is_soft else 1.0
    order = np.arange(400) / n
    terms = np.where(order == 0.0, 1.0, 2.0) * np.exp(0.5j * np.pi * order) * jv(order, k_rho)
    wave = np.sin if is_soft else np.cos
    for leaving in np.radians(np.arange(3.3, 180.0 * n - 2.0, 2.0)):
        exact = 2.0 / n * np.sum(terms * wave(order * incident) * wave(order * leaving))
        direct = cmath.exp(1j * k_rho * math.cos(leaving - incident)) * (abs(leaving - incident) < math.pi)
        of_mirrors = incident + leaving, 2.0 * n * math.pi - incident - leaving
        images = sum(cmath.exp(1j * k_rho * math.cos(angle)) * (angle < math.pi) for angle in of_mirrors)
        soft, hard = wedge_coefficients(incident, leaving, n, k_rho, METAL)
        diffracted = (soft if is_soft else hard) / math.sqrt(k_rho) * cmath.exp(-1j * k_rho)
        assert abs(direct + sign * images + diffracted - exact) < (2e-4 if n == 2.0 else 3e-4)


HALF_P, HALF_Q, TOP = 1.5, 1.0, 50.0
CORNERS = [BoxEdge(p * HALF_P, q * HALF_Q, p, q, -TOP, TOP) for p, q in ((1.0, 1.0), (-1, 1), (-1, -1), (1, -1))]


def test_two_edges_match_p526() -> None:
    """Two isolated edges, section 4.4.2: the product of both and its correction, 3 dB; waves across the edges."""
    for source_q, target_q in ((-1.0, -1.0), (-3.0, -2.0), (0.0, -2.5)):
        source, target = Vector(-8.0, source_q, 1.0), Vector(7.0, target_q, 1.0)
        ray = round_two(CORNERS[1], CORNERS[0], CORNERS[3], source, target, METAL)
        a, b, c = math.dist(source[:2], (-HALF_P, HALF_Q)), 2 * HALF_P, math.dist(target[:2], (HALF_P, HALF_Q))

        def nu(before: Vector, at: tuple[float, float], behind: tuple[float, float]) -> float:
            detour_m = math.dist(before[:2], at) + math.dist(at, behind) - math.dist(before[:2], behind)
            return 2 * math.sqrt(detour_m / WAVELENGTH_M)

        first = nu(source, (-HALF_P, HALF_Q), (HALF_P, HALF_Q))
        second = nu(target, (HALF_P, HALF_Q), (-HALF_P, HALF_Q))
        correction_db = 10 * np.log10((a + b) * (b + c) / (b * (a + b + c)))
        expected_db = 20 * np.log10(abs(knife_edge(first) * knife_edge(second))) - correction_db
        assert 20 * np.log10(0.5 * abs(ray.hard)) == pytest.approx(expected_db, abs=4.0)
