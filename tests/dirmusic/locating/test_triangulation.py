"""Position of a single source from bearings."""

import numpy as np
import pytest

from dirmusic import triangulate
from tests.dirmusic.scenes import around

SOURCE = np.array([12.0, 7.0])


def seen_from(positions: np.ndarray) -> np.ndarray:
    sight = SOURCE - positions
    return np.arctan2(sight[:, 1], sight[:, 0])


def on_an_arc(n: int) -> np.ndarray:
    return around(SOURCE, 6.0, 17.0, 132.0, n)


def test_triangulation_of_exact_bearings() -> None:
    fix = triangulate(on_an_arc(5), seen_from(on_an_arc(5)), np.full(5, 0.01))
    np.testing.assert_allclose(fix.position_m, SOURCE, atol=1e-6)
    assert fix.is_inlier.all()


def test_triangulation_covariance_equals_repeated_noise() -> None:
    rng = np.random.default_rng(0)
    positions, std = on_an_arc(12), np.full(12, np.radians(1.0))
    fixes = [triangulate(positions, seen_from(positions) + rng.normal(0, std), std) for _ in range(400)]
    spread = np.cov(np.array([fix.position_m for fix in fixes]).T)
    np.testing.assert_allclose(spread, np.mean([fix.covariance_m2 for fix in fixes], axis=0), rtol=0.25, atol=2e-4)


def test_triangulation_excludes_outliers() -> None:
    rng = np.random.default_rng(1)
    positions, std = on_an_arc(40), np.full(40, np.radians(1.0))
    bearings = seen_from(positions) + rng.normal(0, std)
    bearings[::7] += rng.uniform(0.5, 2.0, bearings[::7].size)
    fix = triangulate(positions, bearings, std)
    assert np.linalg.norm(fix.position_m - SOURCE) < 0.15
    assert not fix.is_inlier[::7].any()


def test_triangulation_of_one_line_is_unbounded() -> None:
    positions = np.column_stack([np.linspace(0.0, 5.0, 10), np.full(10, 7.0)])
    fix = triangulate(positions, np.zeros(10), np.full(10, 0.02))
    assert np.isinf(np.diag(fix.covariance_m2)).all()


def test_diverging_bearings_do_not_cross_behind() -> None:
    positions = np.array([[0.0, 0.0], [4.0, 0.0]])
    fix = triangulate(positions, np.array([2.0, 1.2]), np.full(2, 0.01))  # they part ahead and cross behind
    assert fix.position_m[1] > 0


@pytest.mark.parametrize(
    ("bearings", "std"), [([0.0], [1.0]), ([0.0, 0.0], [1.0] * 3), ([0.0, np.nan], [1.0] * 2), ([0.0, 0.0], [-1.0] * 2)]
)
def test_invalid_bearings_are_refused(bearings: list[float], std: list[float]) -> None:
    with pytest.raises(ValueError, match="bearings"):
        triangulate(np.zeros((len(bearings), 2)), bearings, std)
