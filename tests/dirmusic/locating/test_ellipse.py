"""The 95 % ellipse of a position."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from dirmusic.locating.finding import CHI2_95, ellipse95, is_inside95, outline95, reaches95


@given(st.floats(0.1, 3.0), st.floats(0.01, 0.09), st.floats(-1.5, 1.5))
def test_the_ellipse_has_the_axes_and_the_direction_of_its_covariance(major: float, minor: float, turn: float) -> None:
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    ellipse = ellipse95(rotation @ np.diag([major**2, minor**2]) @ rotation.T)
    assert ellipse.semi_major_m == pytest.approx(major * np.sqrt(CHI2_95))
    assert ellipse.semi_minor_m == pytest.approx(minor * np.sqrt(CHI2_95))
    assert abs(np.sin(ellipse.angle_rad - turn)) < 1e-6


def test_the_outline_is_closed_and_lies_at_the_quantile() -> None:
    covariance = np.array([[0.5, 0.2], [0.2, 0.3]])
    line = outline95(np.array([3.0, 4.0]), covariance, 49)
    off = line - [3.0, 4.0]
    np.testing.assert_allclose(np.einsum("ni,ij,nj->n", off, np.linalg.inv(covariance), off), CHI2_95)
    np.testing.assert_allclose(line[0], line[-1])


def test_the_outline_parts_inside_from_outside() -> None:
    covariance = np.array([[0.5, 0.2], [0.2, 0.3]])
    for off in outline95(np.zeros(2), covariance, 37):
        assert is_inside95(0.99 * off, covariance)
        assert not is_inside95(1.01 * off, covariance)


def test_the_quantile_is_that_of_chi_square_with_two_degrees_of_freedom() -> None:
    assert pytest.approx(chi2.ppf(0.95, 2), rel=1e-12) == CHI2_95


def test_95_of_100_normal_draws_lie_inside() -> None:
    rng = np.random.default_rng(0)
    covariance = np.array([[0.5, 0.2], [0.2, 0.3]])
    drawn = rng.multivariate_normal(np.zeros(2), covariance, 4000)
    assert 0.94 < np.mean([is_inside95(miss, covariance) for miss in drawn]) < 0.96  # three deviations are 0.010


def test_an_ellipse_reaches_a_rectangle_where_any_point_of_it_does() -> None:
    rng = np.random.default_rng(0)
    corner = np.array([30.0, 20.0])
    grid = np.stack(np.meshgrid(np.linspace(0.0, 30.0, 301), np.linspace(0.0, 20.0, 201)), axis=-1).reshape(-1, 2)
    n_reaching = 0
    for _ in range(200):
        turn, centre = rng.uniform(0.0, np.pi), rng.uniform(-40.0, 70.0, 2)
        axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        covariance = axes @ np.diag(np.square([rng.uniform(0.5, 20.0), rng.uniform(0.5, 3.0)])) @ axes.T
        off = grid - centre
        distance2 = np.einsum("ni,ij,nj->n", off, np.linalg.inv(covariance), off).min()
        if not 0.9 * CHI2_95 < distance2 < 1.1 * CHI2_95:  # the grid is too coarse to tell
            assert reaches95(centre, covariance, corner) == (distance2 < CHI2_95)
            n_reaching += distance2 < CHI2_95
    assert 30 < n_reaching < 170


def test_a_bearing_through_the_yard_reaches_it_however_long_and_thin_its_ellipse_is() -> None:
    along = np.array([1.0, 3.0]) / np.sqrt(10.0)
    covariance = 400.0**2 * np.outer(along, along) + 0.1**2 * np.eye(2)
    yard_m = np.array([30.0, 20.0])
    assert reaches95(np.array([30.0, 70.0]), covariance, yard_m)  # through (10, 10)
    assert not reaches95(np.array([60.0, 70.0]), covariance, yard_m)  # through (40, 10)
