"""Findings: valid values, equality, and the 95 % ellipse of their position."""

import itertools
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dirmusic.locating.finding import (
    SQUARE_95,
    draw_positions,
    ellipse95,
    is_inside95,
    log_density,
    outline95,
    reaches95,
    square_within,
)
from tests.dirmusic.scenes import make_finding, rotation


@pytest.mark.parametrize(
    ("values", "fault"),
    [
        ({"position_m": np.array([np.nan, 0.0, 0.0])}, "position_m"),
        ({"position_m": np.zeros(2)}, "position_m"),
        ({"covariance_m2": np.diag([1.0, 1.0, np.inf])}, "covariance_m2"),
        ({"covariance_m2": np.ones(2)}, "covariance_m2"),
        ({"covariance_m2": np.diag([1.0, 1.0, -1.0])}, "covariance_m2.*positive"),
        ({"id": 0}, "id` must be at least 1, got 0"),
        ({"existence": 1.1}, "existence` must be a probability, got 1.1"),
    ],
)
def test_invalid_finding_is_refused(values: dict[str, Any], fault: str) -> None:
    with pytest.raises(ValueError, match=f"`{fault}"):
        make_finding(**values)


def test_findings_are_equal_if_all_values_are() -> None:
    assert make_finding(level_db=np.nan) == make_finding(level_db=np.nan)
    changes = {"n_bearings": 1, "confirmed_s": 2.0, "position_m": np.ones(3), "state": "outside", "existence": 1.0}
    for name, value in changes.items():
        assert make_finding(**{name: value}) != make_finding()


@given(st.floats(0.1, 3.0), st.floats(0.01, 0.09), st.floats(-1.5, 1.5))
def test_ellipse_axes_are_those_of_the_covariance(major: float, minor: float, turn: float) -> None:
    axes = rotation(turn)
    ellipse = ellipse95(axes @ np.diag([major**2, minor**2]) @ axes.T)
    assert ellipse.semi_major_m == pytest.approx(major * np.sqrt(SQUARE_95))
    assert ellipse.semi_minor_m == pytest.approx(minor * np.sqrt(SQUARE_95))
    assert abs(np.sin(ellipse.angle_rad - turn)) < 1e-6


def test_outline_is_closed_and_lies_at_the_quantile() -> None:
    covariance = np.array([[0.5, 0.2], [0.2, 0.3]])
    line = outline95(np.array([3.0, 4.0]), covariance, 49)
    off = line - [3.0, 4.0]
    np.testing.assert_allclose((off @ np.linalg.inv(covariance) * off).sum(axis=1), SQUARE_95)
    np.testing.assert_allclose(line[0], line[-1])
    assert all(is_inside95(0.99 * each, covariance) and not is_inside95(1.01 * each, covariance) for each in off)


def test_stated_shares_of_positions_lie_within_the_stated_distances() -> None:
    """Density, drawn positions and quantiles describe one distribution with the stated covariance."""
    root = np.array([[0.2, 0.0, 0.0], [0.1, 0.3, 0.0], [-0.1, 0.2, 0.5]])
    mean_m, covariance_m2 = np.array([3.0, 4.0, 1.0]), root @ root.T
    drawn_m = draw_positions(mean_m, covariance_m2, 16)
    off = np.linalg.solve(root, (drawn_m - mean_m).T).T
    for n, share in itertools.product((1, 2, 3), (0.5, 0.68, 0.9, 0.95, 0.999)):
        assert np.mean(np.square(off[:, :n]).sum(axis=1) <= square_within(share, n)) == pytest.approx(share, abs=2e-3)
    assert square_within(0.95, 2) == SQUARE_95
    np.testing.assert_allclose(off.T @ off / off.shape[0], np.eye(3), atol=0.05)
    box = 0.1 * (np.random.default_rng(0).random((400, 3)) - 0.5) + mean_m
    inside = np.all(np.abs(drawn_m - mean_m) <= 0.05, axis=1).mean()
    assert np.exp(log_density(box, mean_m, covariance_m2)).mean() * 1e-3 == pytest.approx(inside, rel=0.1)


def test_ellipse_reaches_a_rectangle_it_overlaps() -> None:
    rng = np.random.default_rng(0)
    corner = np.array([30.0, 20.0])
    grid = np.stack(np.meshgrid(np.linspace(0.0, 30.0, 301), np.linspace(0.0, 20.0, 201)), axis=-1).reshape(-1, 2)
    n_reaching = 0
    for _ in range(200):
        axes, centre = rotation(rng.uniform(0.0, np.pi)), rng.uniform(-40.0, 70.0, 2)
        covariance = axes @ np.diag(np.square([rng.uniform(0.5, 20.0), rng.uniform(0.5, 3.0)])) @ axes.T
        distance2 = ((grid - centre) @ np.linalg.inv(covariance) * (grid - centre)).sum(axis=1).min()
        if not 0.9 * SQUARE_95 < distance2 < 1.1 * SQUARE_95:  # the grid is too coarse to decide
            assert reaches95(centre, covariance, corner) == (distance2 < SQUARE_95)
            n_reaching += distance2 < SQUARE_95
    assert 30 < n_reaching < 170


def test_long_thin_ellipse_reaches_the_yard_it_crosses() -> None:
    along = np.array([1.0, 3.0]) / np.sqrt(10.0)
    covariance = 400.0**2 * np.outer(along, along) + 0.1**2 * np.eye(2)
    yard_m = np.array([30.0, 20.0])
    assert reaches95(np.array([30.0, 70.0]), covariance, yard_m)  # through (10, 10)
    assert not reaches95(np.array([60.0, 70.0]), covariance, yard_m)  # through (40, 10)
