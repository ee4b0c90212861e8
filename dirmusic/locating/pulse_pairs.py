r"""Test of a track for two sources by pairs of pulses that were detected at one pose.

Errors of pose, array, multipath and ground are the same for all pulses of one source at one pose, so the difference of
two pulses contains noise only. If the track is two sources, some differences contain also the change of the strengths
from one source to the other, :math:`S_g \delta` with the distance :math:`\delta` of the sources and the derivative
:math:`S_g` of the strengths by the position. With whitened differences :math:`\Delta_i`, the evidence for two is the
gain of log likelihood

.. math:: \max_{\delta, \pi, s} \sum_i \ln \bigl(\pi_0 N(\Delta_i; 0, s) + \pi_1 N(\Delta_i; S_g \delta, s)
          + \pi_1 N(\Delta_i; -S_g \delta, s) + \pi_2 N(\Delta_i; 0, 100 s)\bigr)
          - \max_{\pi, s} \sum_i \ln \bigl(\pi_0 N(\Delta_i; 0, s) + \pi_2 N(\Delta_i; 0, 100 s)\bigr),

fitted by expectation maximisation. The last component holds pulses that overlap with others.

Pairs that show one source contradict two that were found by residuals: a reflection may cause these, but it is the same
for both pulses.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from dirmusic.arrays import FloatArray
from dirmusic.locating.association import pooled
from dirmusic.locating.measurement import N_PLACE, NominalArray, position_slopes
from dirmusic.locating.pulse_pool import PAIR_RAD, Groups, PulsePairs, choose_evenly
from dirmusic.locating.two_sources import APART_PRIOR_M, START_AXES, START_M, TwoSources

LEAST_PAIRS, MOST_PAIRS = 20, 1000
"""Least and largest number of pairs that are compared (assumed)."""

FIRST_ROUNDS, N_ROUNDS, WIDE = 5, 20, 10.0
"""Number of rounds of expectation maximisation from each start, and from the best of these results; and standard
deviation of pulses that overlap with others, relative to that by noise (assumed)."""

LEAST_CONTRADICTING = 50
"""Least number of pairs that contradict two sources, from so far that pulses of both would form pairs (assumed)."""

LEAST_APART_M = 0.15
"""Least distance of two sources (assumed): noise of a single one reaches half of it."""

AXES = np.vstack([START_AXES, [0.0, 0.0, 1.0]])
"""Directions from one source to the other at the start of the iteration (assumed)."""


class WhitenedPairs(NamedTuple):
    """Quadratic forms of the differences of n pairs of pulses, whitened by their noise.

    Attributes:
        square: Squares of the differences, shape (n,).
        along: Differences times their derivatives by the distance of two sources, shape (n, 3).
        information: Products of the derivatives, shape (n, 3, 3).
        n_dimensions: Number of dimensions in which a difference scatters.
    """

    square: FloatArray
    along: FloatArray
    information: FloatArray
    n_dimensions: int


class Mixture(NamedTuple):
    """Mixture of differences.

    Attributes:
        apart_m: Distance of two sources, shape (3,).
        shares: Shares of equal pulses, of either order of two sources, and of pulses that overlap others, shape (4,).
        variance: Variance of the noise.
    """

    apart_m: FloatArray
    shares: FloatArray
    variance: float

    def log_densities(self, data: WhitenedPairs) -> tuple[FloatArray, FloatArray]:
        """Return the log density of each component, and the squares about it, both of shape (4, n)."""
        along, spread = data.along @ self.apart_m, data.information @ self.apart_m @ self.apart_m
        about = data.square + spread
        squares = np.stack([data.square, about - 2.0 * along, about + 2.0 * along, data.square / WIDE**2])
        each = -0.5 * squares / self.variance - 0.5 * data.n_dimensions * np.log(self.variance)
        each[3] -= data.n_dimensions * np.log(WIDE)
        with np.errstate(divide="ignore"):  # one source has no share of two
            return each + np.log(self.shares)[:, np.newaxis], squares

    def log_likelihood(self, data: WhitenedPairs) -> float:
        """Return the log likelihood with the prior of the distance."""
        return float(logsumexp(self.log_densities(data)[0], axis=0).sum()) - 0.5 * float(
            np.square(self.apart_m / APART_PRIOR_M).sum()
        )


def compare_pairs(
    pairs: PulsePairs,
    groups: Groups,
    is_own: FloatArray,
    place_m: FloatArray,
    array_state: FloatArray,
    array: NominalArray,
    by_residuals: TwoSources,
) -> TwoSources:
    """Combine the test of a track for two sources by residuals with that by pairs of pulses.

    Args:
        pairs: All pairs.
        groups: All groups.
        is_own: Probability that each group belongs to the track, shape (n_groups,).
        place_m: Estimated position of the track, shape (3,).
        array_state: States of the array.
        array: The array as in its data sheet.
        by_residuals: Result of `compare_with_two`.

    Returns:
        Two equally frequent sources on both sides of the estimate, or the result by residuals if that is possible, or
        if the track has too few pairs. If many pairs contradict it, it is not certain any more, but still possible,
        because two sources may be active at different times.
    """
    rows = choose_evenly(np.flatnonzero((is_own[pairs.group] > 0.5).all(axis=-1)), MOST_PAIRS)
    if rows.size < LEAST_PAIRS:
        return by_residuals
    data = whiten_pairs(pairs.take(rows), groups, place_m, array_state, array)
    variance = float(np.median(data.square)) / data.n_dimensions
    one = fit_mixture(data, Mixture(np.zeros(N_PLACE), np.array([0.98, 0.0, 0.0, 0.02]), variance), N_ROUNDS)
    starts = (Mixture(START_M * axis, np.array([0.5, 0.24, 0.24, 0.02]), variance) for axis in AXES)
    firsts = (fit_mixture(data, start, FIRST_ROUNDS) for start in starts)
    two = fit_mixture(data, max(firsts, key=lambda found: found.log_likelihood(data)), N_ROUNDS)
    offsets_m = 0.5 * np.array([two.apart_m, -two.apart_m])
    evidence = two.log_likelihood(data) - one.log_likelihood(data)
    found = TwoSources(evidence, offsets_m, np.full(2, 0.5), least_apart_m=LEAST_APART_M)
    if not by_residuals.is_possible:
        return found if found.is_possible else by_residuals
    range_m = np.linalg.norm(groups.pose[pairs.group[rows, 0], :2] - place_m[:2], axis=-1)
    n_joint = np.count_nonzero(by_residuals.apart_m < 0.5 * PAIR_RAD * range_m)
    is_contradicted = n_joint >= LEAST_CONTRADICTING and not found.is_possible
    return by_residuals._replace(may_be_reflection=True) if is_contradicted else by_residuals


def whiten_pairs(
    pairs: PulsePairs, groups: Groups, place_m: FloatArray, array_state: FloatArray, array: NominalArray
) -> WhitenedPairs:
    """Whiten differences by their noise, and remove the part along the strengths, which the amplitudes change."""
    chosen, at = np.unique(pairs.group[:, 0], return_inverse=True)
    own = groups.take(chosen)
    slope = np.empty((*own.strengths.shape, N_PLACE))
    position_slopes(place_m, array_state, pooled(own), array, slope)
    usable = own.is_usable[at]
    root = np.where(usable, 1.0 / np.sqrt(np.where(usable, pairs.variance, 1.0)), 0.0)
    along = root * own.strengths[at]
    along /= np.linalg.norm(along, axis=-1, keepdims=True)

    def across(whitened: FloatArray) -> FloatArray:
        return whitened - along[..., np.newaxis] * np.einsum("ne,nek->nk", along, whitened)[:, np.newaxis]

    difference, slope = (
        across((root * pairs.difference)[..., np.newaxis])[..., 0],
        across(root[..., np.newaxis] * slope[at]),
    )
    return WhitenedPairs(
        np.square(difference).sum(axis=-1),
        np.einsum("nei,ne->ni", slope, difference),
        np.einsum("nei,nej->nij", slope, slope),
        int(usable.sum(axis=-1).min()) - 1,
    )


def fit_mixture(data: WhitenedPairs, start: Mixture, n_rounds: int) -> Mixture:
    """Fit a mixture by expectation maximisation; shares that are 0 at the start stay 0."""
    found, prior = start, np.eye(N_PLACE) / APART_PRIOR_M**2
    for _ in range(n_rounds):
        each, squares = found.log_densities(data)
        own: FloatArray = np.exp(each - logsumexp(each, axis=0))
        shares = own.mean(axis=1)
        shares[1:3] = shares[1:3].mean()
        information: FloatArray = np.tensordot(own[1] + own[2], data.information, 1) / found.variance + prior
        pull: FloatArray = (own[1] - own[2]) @ data.along / found.variance
        apart_m = np.linalg.solve(information, pull).astype(np.float64)
        found = Mixture(apart_m, shares, float((own * squares).sum()) / (data.n_dimensions * data.square.size))
    return found
