"""Likelihood over the yard: its peaks are at the sources, from pulses alone."""

import numpy as np
import pytest

from dirmusic.locating.yard_likelihood import OUTLIER_SIGMAS, Grid, YardLikelihood
from tests.dirmusic.scenes import (
    ARRAY,
    NO_POSE_ERROR,
    RING,
    detected,
    drawn_errors,
    pulses_from,
    received,
    with_bearings,
)

GRID = Grid.over(np.array([-2.0, 0.0]), np.array([22.0, 15.0]))


def likelihood_of(sources_m: np.ndarray, seed: int, n_wild: int = 0) -> YardLikelihood:
    """Compute the likelihood after a drive past sources, with some pulses from random directions."""
    rng = np.random.default_rng(seed)
    manifold = drawn_errors(rng).correct(RING)
    likelihood = YardLikelihood(ARRAY, NO_POSE_ERROR, GRID)
    for x in np.linspace(2.0, 18.0, 33):
        pose = np.array([x, 1.0 + 0.2 * x, rng.uniform(-np.pi, np.pi)])
        anywhere_m = pose[:2] + rng.normal(0.0, 5.0, (n_wild, 2))
        strengths = received(pose, np.concatenate([sources_m, anywhere_m]), manifold, rng)[::2]
        likelihood.add(with_bearings(detected(strengths, 1e-3)), np.tile(pose, (len(strengths), 1)))
    return likelihood


def test_grid_covers_the_yard() -> None:
    assert GRID.shape == (32, 20)
    np.testing.assert_allclose(GRID.centres_m[[0, 1, -1]], [[-1.625, 0.375], [-1.625, 1.125], [21.625, 14.625]])
    huge = Grid.over(np.zeros(2), np.array([400.0, 300.0]))
    assert 9_000 < np.prod(huge.shape) < 11_000


@pytest.mark.parametrize("n_wild", [0, 1])
def test_likelihood_peaks_at_the_source(n_wild: int) -> None:
    for seed in range(6):
        source_m = np.random.default_rng([seed, 9]).uniform([2.0, 7.0], [18.0, 14.0])
        peak_m = GRID.centres_m[likelihood_of(source_m[np.newaxis], seed, n_wild).log_likelihood.argmax()]
        assert np.linalg.norm(peak_m - source_m) < 1.0


def test_pulse_adds_likelihood_only_where_it_points() -> None:
    likelihood = YardLikelihood(ARRAY, NO_POSE_ERROR, GRID)
    pulses = pulses_from(np.array([0.4]), 1.0)._replace(std_rad=np.array([1e-3]))
    likelihood.add(pulses, np.array([[5.0, 3.0, 0.0]]))
    off = GRID.centres_m - [5.0, 3.0]
    aside = np.abs(np.arctan2(off[:, 1], off[:, 0]) - 0.4)
    most = 0.5 * OUTLIER_SIGMAS**2
    assert likelihood.log_likelihood[aside < np.radians(0.5)].min() > 0.9 * most
    assert likelihood.log_likelihood[aside > np.radians(25.0)].max() < 0.01 * most


def test_likelihood_is_additive_over_batches() -> None:
    rng = np.random.default_rng(4)
    pulses = pulses_from(rng.uniform(-np.pi, np.pi, 30), 1.0)._replace(std_rad=np.full(30, 0.02))
    pose = np.arange(30.0)[:, np.newaxis] * [0.6, 0.0, 0.0] + [0.1, 3.0, 0.0]  # every pulse from another place
    at_once, in_parts = YardLikelihood(ARRAY, NO_POSE_ERROR, GRID), YardLikelihood(ARRAY, NO_POSE_ERROR, GRID)
    at_once.add(pulses, pose)
    for rows in (slice(0, 0), slice(0, 7), slice(7, 30)):
        in_parts.add(pulses.take(rows), pose[rows])
    np.testing.assert_allclose(in_parts.log_likelihood, at_once.log_likelihood, atol=1e-9)
