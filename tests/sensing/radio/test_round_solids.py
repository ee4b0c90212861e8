"""Diffraction and reflection by upright cylinders, compared with the exact solution for a perfect conductor."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import h2vp, hankel2, jv, jvp

from dirmusic.arrays import FloatArray
from pdpatrol.sensing import Surroundings
from pdpatrol.sensing.radio.geometry import Vector
from pdpatrol.sensing.radio.materials import METAL, WAVELENGTH_M
from pdpatrol.sensing.radio.ray_paths import find_ray_paths
from pdpatrol.sensing.radio.surroundings import made_of
from tests.sensing.scenes import origins_m, solids_at

K = 2 * np.pi / WAVELENGTH_M
TOP_M = 50.0
PERFECT = METAL._replace(flat_share=1.0)
Place = tuple[float, float]


def exact(radius_m: float, source: Place, target: Place, is_soft: bool) -> complex:
    """Return the ratio of a line source's field near a cylinder at the origin to that in free space (Bessel series)."""
    n = np.arange(int(K * radius_m) + 60)
    turn = np.arctan2(target[1], target[0]) - np.arctan2(source[1], source[0])
    ratio = jv(n, K * radius_m) / hankel2(n, K * radius_m) if is_soft else jvp(n, K * radius_m) / h2vp(n, K * radius_m)
    terms = np.where(n == 0, 1, 2) * ratio * hankel2(n, K * np.hypot(*source)) * hankel2(n, K * np.hypot(*target))
    scattered = (terms * np.cos(n * turn))[np.isfinite(terms)].sum()
    return complex(1.0 - scattered / hankel2(0, K * np.hypot(target[0] - source[0], target[1] - source[1])))


def around(radius_m: float) -> Surroundings:
    return Surroundings(obstacles=made_of(solids_at((0.0, 0.0), radius_m=radius_m, top_m=TOP_M), [PERFECT]))


def rays(radius_m: float, source: Place, target: Place) -> tuple[NDArray[np.complex128], FloatArray]:
    """Return the fields of all paths relative to free space, at half height, and their origins (n, 2)."""
    source_m, z = np.array([[*source, 0.5 * TOP_M]]), 0.5 * TOP_M
    upright, none = np.array([[0.0, 0.0, 1.0]]), np.zeros(1)
    found = find_ray_paths(source_m, upright, none, Vector(*target, z), around(radius_m))
    straight_m = np.hypot(target[0] - source[0], target[1] - source[1])
    length_m = found.rows["extra_m"] + np.linalg.norm(origins_m(found) - [*target, z], axis=-1)
    phase = np.exp(-1j * K * (length_m - straight_m))
    return found.rows["coefficient"] * phase * straight_m / length_m, origins_m(found)[:, :2]


@pytest.mark.parametrize("radius_m", [0.3, 0.42, 0.8, 1.5])
def test_field_behind_cylinder_is_between_polarisations(radius_m: float) -> None:
    """Within 3 dB, or 8 dB where the two paths around it cancel; the box that represents it ignores polarisation."""
    off_db: list[float] = []
    for y in np.linspace(-1.2 * radius_m, 1.2 * radius_m, 41):
        source, target = (-8.0, 0.0), (6.0, float(y))
        both_db = [20 * np.log10(abs(exact(radius_m, source, target, is_soft))) for is_soft in (True, False)]
        ours_db = 20 * np.log10(abs(rays(radius_m, source, target)[0].sum()))
        off_db.append(max(min(both_db) - ours_db, ours_db - max(both_db), 0.0))
    assert np.percentile(off_db, 80) < 3.0
    assert np.max(off_db) < 8.0


@pytest.mark.parametrize("radius_m", [0.3, 0.42, 0.8, 1.5])
def test_field_past_cylinder_matches_exact_solution(radius_m: float) -> None:
    """Outside the shadow, direct, diffracted and reflected waves together are within 2 dB (vertical polarisation)."""
    for y in np.linspace(3.5 * radius_m, 3.5 * radius_m + 3.0, 25):
        source, target = (-8.0, 0.0), (6.0, float(y))
        expected_db = 20 * np.log10(abs(exact(radius_m, source, target, is_soft=True)))
        assert 20 * np.log10(abs(rays(radius_m, source, target)[0].sum())) == pytest.approx(expected_db, abs=2.0)


@pytest.mark.parametrize("radius_m", [0.42, 0.8, 1.5])
@pytest.mark.parametrize("degrees", [70.0, 90.0, 110.0])
def test_cylinder_reflection_matches_exact_solution(radius_m: float, degrees: float) -> None:
    """Both polarisations are within 2 dB, the accuracy of ray optics; a point source falls off faster than a line."""
    source = (-4.0, 0.0)
    target = (-4.0 * np.cos(np.radians(degrees)), -4.0 * np.sin(np.radians(degrees)))
    fields, from_m = rays(radius_m, source, target)
    straight_m, length_m = (float(np.linalg.norm(place - target)) for place in from_m[:2])
    echo = fields[1] / fields[0] * np.sqrt(length_m / straight_m)
    for is_soft, sign in ((True, 1.0), (False, -1.0)):
        expected = exact(radius_m, source, target, is_soft) - 1.0
        assert 20 * np.log10(abs(echo) / abs(expected)) == pytest.approx(0.0, abs=2.0)
        assert np.degrees(np.angle(sign * echo / expected)) == pytest.approx(0.0, abs=15.0)
