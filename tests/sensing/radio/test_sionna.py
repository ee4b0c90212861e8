"""Paths in three yards of metal boxes on concrete, compared with Sionna RT: see `sionna/make_reference.py`."""

import math

import numpy as np
import pytest

from pdpatrol.sensing.radio.geometry import Vector
from pdpatrol.sensing.radio.ray_paths import find_ray_paths
from tests.sensing.radio.sionna.links import (
    bend_at,
    bends_of_luebbers,
    by_reflections,
    decibels,
    delay_ns,
    is_clear,
    links,
    matrix_of,
)


def test_direct_and_reflected_paths_match_sionna_rt() -> None:
    """Vertical polarisation. All strong paths by one face, or by one and the ground; others only past an edge."""
    n_past_edges, n_by_both, ratios = 0, 0, []
    for link in links():
        upright, source = np.array([[0.0, 0.0, 1.0]]), np.array([link.source])
        ours = find_ray_paths(source, upright, np.zeros(1), link.receiver, link.around)
        straight = ours.extra_m == 0.0
        length_m = np.linalg.norm(ours.from_m[straight] - np.array(link.receiver), axis=1)
        coefficient, unmatched = ours.coefficient[straight], np.ones(length_m.size, bool)
        by_both = [path for path in link.of_kind("reflection", 2) if "ground" in path[1]]
        strongest = max((np.abs(matrix_of(path[4])[:, 0]).max() for path in link.paths), default=0.0)
        for path in link.of_kind("direct", 0) + link.of_kind("reflection", 1) + by_both:
            row = np.abs(delay_ns(length_m) - path[3]).argmin()
            if len(path[1]) == 2:
                if np.abs(matrix_of(path[4])[:, 0]).max() < 0.2 * strongest:
                    continue
                n_by_both += 1
            assert delay_ns(length_m[row]) == pytest.approx(path[3], abs=0.1)
            theta, phi = -matrix_of(path[4])[:, 0]  # of an upright field, which is up
            ratios.append(coefficient[row] / length_m[row] / (phi - 1j * theta))  # as `received` has it
            unmatched[row] = False
        for row in np.flatnonzero(unmatched):
            if ours.from_m[straight][row][2] < 0.0:
                continue
            image, normal = ours.from_m[straight][row], ours.from_m[straight][row] - np.array(link.source)
            normal /= np.linalg.norm(normal)
            share = np.dot(0.5 * (np.array(link.source) + image) - image, normal)
            share /= np.dot(np.array(link.receiver) - image, normal)
            at = Vector(*(image + share * (np.array(link.receiver) - image) - 1e-6 * normal))
            assert not (is_clear(link, link.source, at) and is_clear(link, at, link.receiver))
            assert abs(coefficient[row]) < 0.5
            n_past_edges += 1
    level, phase = decibels(np.array(ratios)), np.degrees(np.abs(np.angle(ratios)))
    assert len(ratios) > 150
    assert n_past_edges < 50
    assert n_by_both > 15
    assert np.median(np.abs(level)) < 0.01
    assert np.percentile(np.abs(level), 95) < 3.0  # weaker where an edge is close to a path
    assert level.max() < 0.1
    assert phase.max() < 1.0


def test_second_order_reflections_match_sionna_rt() -> None:
    ratios = list[complex]()
    for link in links():
        upright, source = np.array([[0.0, 0.0, 1.0]]), np.array([link.source])
        without = find_ray_paths(source, upright, np.zeros(1), link.receiver, link.around)
        ours = find_ray_paths(source, upright, np.zeros(1), link.receiver, link.around._replace(second_order=True))
        assert ours.extra_m.size >= without.extra_m.size
        image = ours.extra_m == 0.0
        length_m = np.linalg.norm(ours.from_m[image] - np.array(link.receiver), axis=1)
        strongest = max((np.abs(matrix_of(path[4])[:, 0]).max() for path in link.paths), default=0.0)
        for _, owners, _, expected_ns, stored in link.of_kind("reflection", 2):
            theta, phi = -matrix_of(stored)[:, 0]
            if "ground" in owners or max(abs(theta), abs(phi)) < 0.2 * strongest:
                continue
            row = np.abs(delay_ns(length_m) - expected_ns).argmin()
            assert delay_ns(length_m[row]) == pytest.approx(expected_ns, abs=1e-3)
            ratios.append(complex(ours.coefficient[image][row] / length_m[row] / (phi - 1j * theta)))
    level, phase = decibels(np.array(ratios)), np.degrees(np.abs(np.angle(ratios)))
    assert len(ratios) > 20
    assert np.median(np.abs(level)) < 0.01
    assert np.mean(np.abs(level) > 1.0) < 0.1  # weaker where a rim or an edge is close
    assert level.max() < 0.1
    assert phase.max() < 1.0


@pytest.mark.parametrize(("kind", "order"), [("direct", 0), ("reflection", 1), ("reflection", 2)])
def test_reflection_matrices_match_sionna_rt(kind: str, order: int) -> None:
    """Metal and concrete, once and twice: to 0.3 % of the larger polarisation, phases included."""
    n = 0
    for link in links():
        for _, owners, points, expected_ns, stored in link.of_kind(kind, order):
            matrix, delay = by_reflections(link, owners, points)
            assert delay == pytest.approx(expected_ns, abs=1e-3)
            theirs = matrix_of(stored)
            assert np.abs(matrix - theirs).max() < 3e-3 * np.abs(theirs).max()
            n += 1
    assert n > 50


def test_diffraction_points_match_both_sionna_versions() -> None:
    """At the same points of the same edges, upright and on top, with delays equal to 0.1 ns."""
    n = 0
    for link in links():
        stored = [(path[2][0], path[3]) for path in link.of_kind("edge", 1)] + [tuple(edge[:2]) for edge in link.edges]
        for point, expected_ns in stored:
            bend = bend_at(link, point)
            assert delay_ns(bend.before_m + bend.behind_m) == pytest.approx(expected_ns, abs=0.1)
            n += 1
    assert n > 800


def test_upright_edges_match_sionna() -> None:
    """The coefficients of Luebbers, by the older Sionna.

    It assumes rays perpendicular to edges, as these nearly are. Weak components are left out: there it mixes
    polarisations.
    """
    ratios: list[list[complex]] = [[], []]
    for bend, (_, _, stored) in bends_of_luebbers():
        theirs = bend.in_edge_coordinates(matrix_of(stored))
        if bend.sine > math.sin(math.radians(80.0)):
            for i, ratio in enumerate(ratios):
                if abs(theirs[i, i]) > 0.2 * np.abs(theirs).max():
                    ratio.append(bend.ours[i] / theirs[i, i])
    for ratio in ratios:
        assert len(ratio) > 150
        level, phase = np.abs(decibels(np.array(ratio))), np.degrees(np.abs(np.angle(ratio)))
        assert np.median(level) < 0.1
        assert np.percentile(level, 95) < 1.0
        assert np.median(phase) < 0.1
        assert np.percentile(phase, 95) < 2.0


def test_edges_at_all_angles_match_sionna_rt() -> None:
    """Its component across an edge has the sign of that along it: see `make_reference.py`.

    Upright edges and those on top, in light and shadow, at angles down to 8 degrees between ray and edge.
    """
    ratio, sines = [], []
    for link in links():
        for path in link.of_kind("edge", 1):
            bend = bend_at(link, path[2][0])
            ratio.append(bend.ours[0] / bend.in_edge_coordinates(matrix_of(path[4]))[1, 1])
            sines.append(bend.sine)
    level, phase = np.abs(decibels(np.array(ratio))), np.degrees(np.abs(np.angle(ratio)))
    assert min(sines) < math.sin(math.radians(10.0))
    assert np.percentile(level, 95) < 0.3
    assert np.percentile(phase, 95) < 2.0
