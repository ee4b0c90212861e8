r"""Test of a track for two sources close to each other.

The residuals of one source scatter about zero. Those of two sources at :math:`\delta_1, \delta_2` from the estimated
position scatter about :math:`S_g \delta_1` and :math:`S_g \delta_2`, with the derivative :math:`S_g` of the whitened
strengths by the position. Both hypotheses are fitted to the groups g of the track by expectation maximisation, each
with the level of unexplained errors that suits it best. The evidence for two is the gain of log likelihood

.. math:: \max_{\delta, \pi, u} \sum_g w_g \ln \Bigl(\pi_0 d_0 + \sum_j \pi_j t(z_g - S_g \delta_j)\Bigr)
          - \max_{\delta, \pi, u} \sum_g w_g \ln \bigl(\pi_0 d_0 + \pi_1 t(z_g - S_g \delta)\bigr)

with the residuals z, the t distribution of the fit, which depends on the unexplained errors u, the density :math:`d_0`
of groups of neither source, and a normal prior of each offset. Groups of a window share errors: the weight of a group
is the probability that it belongs to the track over the root of their number. Errors of the pose turn both sources
alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from scipy.special import gammaln

from dirmusic.arrays import FloatArray, IntArray
from dirmusic.locating.association import log_flat_density, pooled
from dirmusic.locating.measurement import (
    N_PLACE,
    T_FREEDOM,
    Noise,
    NominalArray,
    PooledPulses,
    t_cost,
    t_weight,
    whiten_residuals,
)
from dirmusic.locating.protocol import PoseError
from dirmusic.locating.pulse_pool import Groups

UNEXPLAINED = (0.02, 0.04, 0.08, 0.16)
"""Levels of unexplained errors that are tried."""

START_M, START_AXES = 0.3, np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.7, 0.7, 0.0], [0.7, -0.7, 0.0]])
"""Distance of both sources from the estimate, and directions, at the start of the iteration (assumed)."""

FIRST_ROUNDS, N_ROUNDS, N_LINEARISED, MIN_SHARE = 8, 10, 4, 1e-3
"""Number of rounds of expectation maximisation before and after residuals are computed about the positions found,
number of times that they are, and least share of a source in the iteration (assumed)."""

PROMISING = 5.0
"""Evidence of the first rounds from which the others follow (assumed)."""

APART_PRIOR_M = 3.0
"""Prior standard deviation of each source about the estimate (assumed): sources farther apart are separate tracks."""

POSSIBLE, CERTAIN, CERTAIN_OF_CANDIDATE = 25.0, 50.0, 100.0
"""Evidence above which a track is possibly two sources, above which a confirmed one is split into two tracks, and above
which a candidate is, which may be a moving interferer. Measured: on a circle of 4 m, two sources 0.5 m apart reach 25
to 40, and those 1 m apart 75 to 140; most single sources stay below 2, but high ones in a hall with strong reflections
reach 90."""

USUAL_GROUPS = 20.0
"""Number of independent groups below which these thresholds are in proportion to it, as is the evidence by reflections
(assumed). Measured in surveys of 5 to 24 poses among equipment: single sources reach 1.3 per group."""

USUAL_UNEXPLAINED, LEAST_APART_RAD = 0.04, 0.2
"""Level of unexplained errors from which these thresholds grow in proportion to it, and least angle between two
sources, seen from nearby, for a split (assumed): reflections look like a second source at a smaller angle."""

LEAST_APART_M, MOST_APART_M, LEAST_SHARE = 0.25, 8.0, 0.2
"""Limits of the distance of two sources and of their shares (assumed): nearer, errors of the array look like two
sources; farther apart or rarer, the other pulses are reflections, or those of another track."""

OTHERS_SHARE = 0.1
"""Share of groups that come from neither source at the start of the iteration (assumed)."""

NEAR_QUANTILE = 0.1
"""Quantile of the ranges of the groups that is taken as near (assumed)."""


class TwoSources(NamedTuple):
    """Hypothesis that a track is two sources.

    Attributes:
        evidence: Gain of log likelihood against one source.
        offsets_m: Offsets of both from the estimated position, shape (2, 3).
        shares: Share of each in the groups of the track, shape (2,).
        unexplained: Level of unexplained errors that suits two sources best.
        near_m: Distance of the nearest groups from the track; infinite if it does not matter.
        least_apart_m: Distance below which they look like one.
        n_independent: Number of independent groups; infinite if it does not matter.
        may_be_reflection: True if one of both may be a reflection: then they are possible, but never certain.
    """

    evidence: float
    offsets_m: FloatArray
    shares: FloatArray
    unexplained: float = 0.0
    near_m: float = np.inf
    least_apart_m: float = LEAST_APART_M
    n_independent: float = np.inf
    may_be_reflection: bool = False

    @property
    def apart_m(self) -> float:
        """Distance of both sources."""
        return float(np.linalg.norm(self.offsets_m[1] - self.offsets_m[0]))

    @property
    def is_possible(self) -> bool:
        """True if two sources explain the groups so much better than one that both are likely."""
        is_between = self.least_apart_m < self.apart_m < MOST_APART_M
        return self._exceeds(POSSIBLE) and is_between and float(self.shares.min()) > LEAST_SHARE

    @property
    def is_certain(self) -> bool:
        """True if a confirmed track is to be split."""
        return self.is_possible and self._is_seen and self._exceeds(CERTAIN)

    @property
    def is_certain_of_candidate(self) -> bool:
        """True if a candidate is to be split: errors of one between two sources may prevent its confirmation."""
        return self.is_possible and self._is_seen and self._exceeds(CERTAIN_OF_CANDIDATE)

    @property
    def _is_seen(self) -> bool:
        return self.apart_m > LEAST_APART_RAD * self.near_m and not self.may_be_reflection

    def _exceeds(self, least: float) -> bool:
        few = min(self.n_independent / USUAL_GROUPS, 1.0)
        return self.evidence > least * few * max(self.unexplained / USUAL_UNEXPLAINED, 1.0)

    @property
    def scatter_m2(self) -> FloatArray:
        """Covariance of the position of either source about the estimate, shape (3, 3)."""
        return (self.shares * self.offsets_m.T) @ self.offsets_m


ONE_SOURCE = TwoSources(-np.inf, np.zeros((2, N_PLACE)), np.array([1.0, 0.0]))


def compare_with_two(
    groups: Groups,
    probability: FloatArray,
    window: IntArray,
    place_m: FloatArray,
    array_state: FloatArray,
    array: NominalArray,
    pose_error: PoseError,
    earlier: TwoSources = ONE_SOURCE,
) -> TwoSources:
    """Test whether the groups of a track come from two sources.

    Args:
        groups: Groups of the track, or of sources near it too.
        probability: Probability that each belongs to these, shape (n,).
        window: Number of the window of each group, shape (n,).
        place_m: Estimated position of the track, shape (3,).
        array_state: States of the array.
        array: The array as in its data sheet.
        pose_error: Error of the poses.
        earlier: Earlier result for the track, from which the iteration starts too if it was possible.
    """
    pulses, (_, number) = pooled(groups), np.unique(window, return_inverse=True)
    weight = probability / np.sqrt(np.maximum(np.bincount(number, probability)[number], 1.0))
    sight_m = groups.pose[:, :2] - place_m[:2]
    ranges_m = np.hypot(np.linalg.norm(sight_m, axis=-1), place_m[2] - array.positions_m[:, 2].mean())
    near_m = float(np.quantile(ranges_m, NEAR_QUANTILE))

    def about(off_m: FloatArray, unexplained: float) -> Scatter:
        """Compute the residuals about an offset, with a level of unexplained errors."""
        noise = Noise(pose_error.position_m, pose_error.heading_rad, unexplained)
        return Scatter.about(place_m, off_m, array_state, pulses, array, noise)

    ones = list[TwoSources]()
    scatters = [about(np.zeros(N_PLACE), unexplained) for unexplained in UNEXPLAINED]
    for scatter in scatters:
        ones.append(fit([scatter], weight, np.zeros((1, N_PLACE)), np.ones(1), FIRST_ROUNDS))
    k = max(range(len(ones)), key=lambda k: ones[k].evidence)
    starts = [ones[k].offsets_m + START_M * np.array([axis, -axis]) for axis in START_AXES]
    starts += [earlier.offsets_m] if earlier.is_possible else []
    trials = [fit([scatters[k]] * 2, weight, start, np.full(2, 0.5), FIRST_ROUNDS) for start in starts]
    first = max(trials, key=lambda trial: trial.evidence)
    twos = [first._replace(unexplained=UNEXPLAINED[k])]
    if first.evidence > ones[k].evidence + PROMISING:
        for unexplained in UNEXPLAINED:
            two = first
            for _ in range(N_LINEARISED):
                offsets_m = np.clip(two.offsets_m, -MOST_APART_M, MOST_APART_M)
                rivals = [about(off_m, unexplained) for off_m in offsets_m]
                two = fit(rivals, weight, offsets_m, two.shares, N_ROUNDS)
            twos.append(two._replace(unexplained=unexplained))
    best = max(twos, key=lambda two: two.evidence)
    return best._replace(evidence=best.evidence - ones[k].evidence, near_m=near_m, n_independent=float(weight.sum()))


class Scatter(NamedTuple):
    """Quadratic forms of the whitened residuals of n groups about one position.

    Attributes:
        off_m: Offset of that position from the track, shape (3,).
        square: Squares of the residuals, shape (n,).
        along: Residuals times their derivatives by the position, shape (n, 3).
        information: Products of the derivatives, shape (n, 3, 3).
        log_peak: Log density of a residual of zero, relative to the flat density of any strengths, shape (n,).
        n_dimensions: Number of dimensions of the residual, shape (n,).
    """

    off_m: FloatArray
    square: FloatArray
    along: FloatArray
    information: FloatArray
    log_peak: FloatArray
    n_dimensions: FloatArray

    @classmethod
    def about(
        cls,
        place_m: FloatArray,
        off_m: FloatArray,
        array_state: FloatArray,
        pulses: PooledPulses,
        array: NominalArray,
        noise: Noise,
    ) -> Self:
        """Compute the residuals of pulses about a position with an offset (3,) from the track's position (3,)."""
        n, n_elements = pulses.strengths.shape
        residual, slope, log_det = np.empty((n, n_elements)), np.empty((n, n_elements, N_PLACE)), np.empty(n)
        whiten_residuals(place_m + off_m, array_state, pulses, array, noise, residual, slope, log_det)
        d: FloatArray = pulses.is_usable.sum(axis=-1) - 1.0
        log_peak = gammaln(0.5 * (T_FREEDOM + d)) - gammaln(0.5 * T_FREEDOM) - 0.5 * d * np.log(T_FREEDOM * np.pi)
        return cls(
            off_m,
            np.square(residual).sum(axis=-1),
            np.einsum("nei,ne->ni", slope, residual),
            np.einsum("nei,nej->nij", slope, slope),
            log_peak - 0.5 * log_det - log_flat_density(d + 1.0),
            d,
        )


def fit(
    scatters: Sequence[Scatter], weight: FloatArray, offsets_m: FloatArray, shares: FloatArray, n_rounds: int
) -> TwoSources:
    """Fit the offsets of k sources by expectation maximisation; the evidence of the result is the log likelihood.

    Args:
        scatters: Residuals about k positions near the sources.
        weight: Weight of each group, shape (n,).
        offsets_m: Offsets at the start, shape (k, 3).
        shares: Shares of the sources at the start, shape (k,).
        n_rounds: Number of rounds.
    """
    prior, offsets_m = np.eye(N_PLACE) / APART_PRIOR_M**2, offsets_m.copy()
    shares = np.append((1.0 - OTHERS_SHARE) * shares, OTHERS_SHARE)
    for _ in range(n_rounds):
        each, pull_weight = log_likelihoods(scatters, offsets_m, shares)
        own = np.exp(each - np.logaddexp.reduce(each)) * weight
        shares = np.maximum(own.sum(axis=1) / weight.sum(), MIN_SHARE)
        shares /= shares.sum()
        for k, scatter in enumerate(scatters):
            information = np.tensordot(own[k] * pull_weight[k], scatter.information, 1)
            pull = (own[k] * pull_weight[k]) @ scatter.along + information @ scatter.off_m
            offsets_m[k] = np.linalg.solve(information + prior, pull)
    each, _ = log_likelihoods(scatters, offsets_m, shares)
    prior_cost = 0.5 * float(np.square(offsets_m / APART_PRIOR_M).sum())
    evidence = float(weight @ np.logaddexp.reduce(each)) - prior_cost
    return TwoSources(evidence, offsets_m, shares[:-1] / shares[:-1].sum())


def log_likelihoods(
    scatters: Sequence[Scatter], offsets_m: FloatArray, shares: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return log likelihoods of each group under k sources and none of them, and the weights of its residuals.

    Returns:
        Log likelihoods relative to that of none, shape (k + 1, n), and weights, shape (k, n).
    """
    each, weights = list[FloatArray](), list[FloatArray]()
    for scatter, offset_m in zip(scatters, offsets_m, strict=True):
        off_m, d = offset_m - scatter.off_m, scatter.n_dimensions
        chi2 = np.maximum(scatter.square - 2.0 * scatter.along @ off_m + scatter.information @ off_m @ off_m, 0.0)
        each.append(scatter.log_peak - t_cost(chi2, d, T_FREEDOM))
        weights.append(t_weight(chi2, d, T_FREEDOM))
    return np.log(shares)[:, np.newaxis] + np.array([*each, np.zeros(weights[0].size)]), np.array(weights)
