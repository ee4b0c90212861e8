"""Paths in three yards of metal boxes on concrete, compared with Sionna RT: see `sionna/make_reference.py`."""

import math

import numpy as np
import pytest

from dirmusic.arrays import FloatArray
from pdpatrol.sensing.radio.geometry import Vector
from pdpatrol.sensing.radio.ray_paths import RayPaths, find_ray_paths
from tests.sensing.radio.sionna.links import Link, bend_at, decibels, delay_ns, links
from tests.sensing.scenes import origins_m

AXES = pytest.mark.parametrize("axis", [Vector(0.0, 0.0, 1.0), Vector(0.6, 0.8, 0.0)], ids=["upright", "level"])


def straight_paths(link: Link, axis: Vector, *, second_order: bool) -> tuple[RayPaths, FloatArray]:
    """Return our paths without diffraction and their lengths."""
    around = link.around._replace(second_order=second_order)
    found = find_ray_paths(np.array([link.source]), np.array([axis]), np.zeros(1), link.receiver, around)
    found = found._replace(rows=found.rows[found.rows["extra_m"] == 0.0])
    return found, np.linalg.norm(origins_m(found) - np.array(link.receiver), axis=1)


def check_ratios(ratios: list[complex]) -> FloatArray:
    """Check phases and levels of our paths relative to Sionna's, and return the levels."""
    level, phase = decibels(np.array(ratios)), np.degrees(np.abs(np.angle(ratios)))
    assert np.median(np.abs(level)) < 0.01
    assert level.max() < 0.1
    assert phase.max() < 1.0
    return np.abs(level)


@AXES
def test_direct_and_reflected_paths_match_sionna_rt(axis: Vector) -> None:
    """All strong paths by one face, or by one face and the ground, match; we have others only past edges."""
    n_past_edges, n_by_both, ratios = 0, 0, list[complex]()
    for link in links():
        ours, length_m = straight_paths(link, axis, second_order=False)
        unmatched = np.ones(length_m.size, bool)
        by_both = [path for path in link.of_kind("reflection", 2) if "ground" in path.owners]
        strongest = max((abs(link.received(path, axis)) for path in link.paths), default=0.0)
        for path in link.of_kind("direct", 0) + link.of_kind("reflection", 1) + by_both:
            row, received = np.abs(delay_ns(length_m) - path.delay_ns).argmin(), link.received(path, axis)
            if len(path.owners) == 2:
                if abs(received) < 0.2 * strongest:
                    continue
                n_by_both += 1
            assert delay_ns(length_m[row]) == pytest.approx(path.delay_ns, abs=0.1)
            ratios.append(complex(ours.rows["coefficient"][row] / length_m[row] / received))
            unmatched[row] = False
        for row in np.flatnonzero(unmatched & (ours.rows["z"] >= 0.0)):
            image, source = origins_m(ours)[row], np.array(link.source)
            normal = (image - source) / np.linalg.norm(image - source)
            share = np.dot(0.5 * (source + image) - image, normal) / np.dot(np.array(link.receiver) - image, normal)
            at = Vector(*(image + share * (np.array(link.receiver) - image) - 1e-6 * normal))
            assert not (link.is_clear(link.source, at) and link.is_clear(at, link.receiver))
            assert abs(ours.rows["coefficient"][row]) < 0.5
            n_past_edges += 1
    assert len(ratios) > 150
    assert n_past_edges < 50
    assert n_by_both > 15
    assert np.percentile(check_ratios(ratios), 95) < 3.0  # weaker where an edge is close to a path


@AXES
def test_second_order_reflections_match_sionna_rt(axis: Vector) -> None:
    ratios = list[complex]()
    for link in links():
        ours, length_m = straight_paths(link, axis, second_order=True)
        assert length_m.size >= straight_paths(link, axis, second_order=False)[1].size
        strongest = max((abs(link.received(path, axis)) for path in link.paths), default=0.0)
        for path in link.of_kind("reflection", 2):
            received = link.received(path, axis)
            if "ground" in path.owners or abs(received) < 0.2 * strongest:
                continue
            row = np.abs(delay_ns(length_m) - path.delay_ns).argmin()
            assert delay_ns(length_m[row]) == pytest.approx(path.delay_ns, abs=1e-3)
            ratios.append(complex(ours.rows["coefficient"][row] / length_m[row] / received))
    assert len(ratios) > 20
    assert np.mean(check_ratios(ratios) > 1.0) < 0.1  # weaker where a rim or an edge is close


def test_edges_at_all_angles_match_sionna_rt() -> None:
    """Points, delays, and the component along the edge, which Sionna RT calls that across: see `make_reference.py`.

    Upright edges and those on top, in light and shadow, at angles down to 8 degrees between ray and edge.
    """
    ratios, sines = list[complex](), list[float]()
    for link in links():
        for path in link.of_kind("edge", 1):
            bend = bend_at(link, path.points[0])
            assert delay_ns(bend.length_m) == pytest.approx(path.delay_ns, abs=0.1)
            ratios.append(bend.soft / bend.in_edge_coordinates(path.polarisation)[1, 1])
            sines.append(bend.sine)
    level, phase = np.abs(decibels(np.array(ratios))), np.degrees(np.abs(np.angle(ratios)))
    assert len(ratios) > 400
    assert min(sines) < math.sin(math.radians(10.0))
    assert np.percentile(level, 95) < 0.3
    assert np.percentile(phase, 95) < 2.0
