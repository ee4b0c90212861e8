r"""Test of a track for two sources close to each other.

The residuals of one source scatter about zero. Those of two sources at :math:`\delta_1, \delta_2` from the estimated
position scatter about :math:`S_g \delta_1` and :math:`S_g \delta_2`, with the derivative :math:`S_g` of the whitened
strengths by the position. Both hypotheses are fitted to the groups g of the track by expectation maximisation, each
with the level of unexplained errors that suits it best. The evidence for two is the gain of log likelihood

.. math:: \max_{\delta, \pi, u} \sum_g w_g \ln \sum_j \pi_j e^{-\rho(|r_g - S_g \delta_j|^2) - \frac12 \ln |C_g|}
          - \max_{\delta, u} \sum_g w_g \left(-\rho(|r_g - S_g \delta|^2) - \tfrac12 \ln |C_g|\right)

where C depends on the unexplained errors u. Groups of a window share errors: the weight of a group is the probability
that it belongs to the track over the root of their number. Errors of the pose turn both sources alike.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from dirmusic.arrays import FloatArray, IntArray
from dirmusic.locating.association import pooled
from dirmusic.locating.joint_fit import ROBUST_SCALE
from dirmusic.locating.measurement import N_PLACE, Noise, NominalArray, whiten_residuals
from dirmusic.locating.protocol import PoseError
from dirmusic.locating.pulse_pool import Groups

UNEXPLAINED = (0.02, 0.04, 0.08, 0.16)
"""Levels of unexplained errors that are tried."""

START_M, START_AXES = 0.3, np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.7, 0.7, 0.0], [0.7, -0.7, 0.0]])
"""Distance of both sources from the estimate, and directions, at the start of the iteration (assumed)."""

N_ROUNDS, FIRST_ROUNDS, MIN_SHARE = 25, 8, 1e-3
"""Number of rounds of expectation maximisation, number before all but the best start are left, and least share of a
source in the iteration (assumed)."""

APART_PRIOR_M = 1.0
"""Prior standard deviation of each source about the estimate (assumed): sources farther apart are separate tracks."""


POSSIBLE, CERTAIN = 20.0, 50.0
"""Evidence above which a track is possibly two sources, and above which it is split into two tracks. Measured on
recorded missions: two sources 0.6 m apart reach the second, half of those 0.3 to 0.5 m apart come near the first; of 60
single sources, three exceed the first, two of them in a hall with strong reflections, which also exceed the second."""

MOST_UNEXPLAINED = 0.04
"""Level of unexplained errors beyond which a track is not split (assumed): reflections look like a second source."""

LEAST_APART_M, MOST_APART_M, LEAST_SHARE = 0.25, 1.5, 0.2
"""Limits of the distance of two sources and of their shares (assumed): nearer, errors of the array look like two
sources; farther apart or rarer, the other pulses are reflections, or those of another track."""


class TwoSources(NamedTuple):
    """Hypothesis that a track is two sources.

    Attributes:
        evidence: Gain of log likelihood against one source.
        offsets_m: Offsets of both from the estimated position, shape (2, 3).
        shares: Share of each in the groups of the track, shape (2,).
        unexplained: Level of unexplained errors that suits two sources best.
    """

    evidence: float
    offsets_m: FloatArray
    shares: FloatArray
    unexplained: float = 0.0

    @property
    def is_possible(self) -> bool:
        """True if two sources explain the groups so much better than one that both are likely."""
        apart_m = float(np.linalg.norm(self.offsets_m[1] - self.offsets_m[0]))
        is_between = LEAST_APART_M < apart_m < MOST_APART_M
        return self.evidence > POSSIBLE and is_between and float(self.shares.min()) > LEAST_SHARE

    @property
    def is_certain(self) -> bool:
        """True if the track is to be split."""
        return self.is_possible and self.evidence > CERTAIN and self.unexplained <= MOST_UNEXPLAINED

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
) -> TwoSources:
    """Test whether the groups of a track come from two sources.

    Args:
        groups: Groups of the track.
        probability: Probability that each belongs to it, shape (n,).
        window: Number of the window of each group, shape (n,).
        place_m: Estimated position of the track, shape (3,).
        array_state: States of the array.
        array: The array as in its data sheet.
        pose_error: Error of the poses.
    """
    n, n_elements = groups.strengths.shape
    residual, slope, log_det = np.empty((n, n_elements)), np.empty((n, n_elements, N_PLACE)), np.empty(n)
    _, number = np.unique(window, return_inverse=True)
    weight = probability / np.sqrt(np.maximum(np.bincount(number, probability)[number], 1.0))
    best_one, best = -np.inf, TwoSources(-np.inf, np.zeros((2, N_PLACE)), np.ones(2))
    for unexplained in UNEXPLAINED:
        noise = Noise(pose_error.position_m, pose_error.heading_rad, unexplained)
        whiten_residuals(place_m, array_state, pooled(groups), array, noise, residual, slope, log_det)
        scatter, halves = Scatter(residual, slope, weight), np.full(2, 0.5)
        by_scale = 0.5 * float(weight @ log_det)
        one = scatter.fit(np.zeros((1, N_PLACE)), np.ones(1), FIRST_ROUNDS)
        best_one = max(best_one, one.evidence - by_scale)
        starts = [one.offsets_m + START_M * np.array([axis, -axis]) for axis in START_AXES]
        two = max((scatter.fit(start, halves, FIRST_ROUNDS) for start in starts), key=lambda found: found.evidence)
        two = scatter.fit(two.offsets_m, two.shares, N_ROUNDS)
        if two.evidence - by_scale > best.evidence:
            best = two._replace(evidence=two.evidence - by_scale, unexplained=unexplained)
    return best._replace(evidence=best.evidence - best_one)


class Scatter:
    """Whitened residuals of groups, and the fit of offsets of one or two sources to them.

    Args:
        residual: Whitened residuals, shape (n, n_elements).
        slope: Derivatives of the whitened strengths by the position, shape (n, n_elements, 3).
        weight: Weight of each group, shape (n,).
    """

    def __init__(self, residual: FloatArray, slope: FloatArray, weight: FloatArray) -> None:
        self._square = np.square(residual).sum(axis=-1)
        self._along = np.einsum("nei,ne->ni", slope, residual)
        self._information = np.einsum("nei,nej->nij", slope, slope)
        self._weight = weight

    def fit(self, offsets_m: FloatArray, shares: FloatArray, n_rounds: int) -> TwoSources:
        """Fit offsets, from a start (k, 3) with shares (k,), by expectation maximisation.

        The evidence of the result is the log likelihood.
        """
        prior = np.eye(N_PLACE) / APART_PRIOR_M**2
        for _ in range(n_rounds):
            each, root = self._log_likelihoods(offsets_m, shares)
            own = np.exp(each - logsumexp(each, axis=0)) * self._weight
            shares = np.maximum(own.sum(axis=1) / self._weight.sum(), MIN_SHARE)
            shares /= shares.sum()
            own /= root
            information = np.einsum("kn,nij->kij", own, self._information) + prior
            pull = (own @ self._along)[..., np.newaxis]
            offsets_m = np.asarray(np.linalg.solve(information, pull)[..., 0], dtype=np.float64)
        each, _ = self._log_likelihoods(offsets_m, shares)
        prior_cost = 0.5 * float(np.square(offsets_m / APART_PRIOR_M).sum())
        return TwoSources(float(self._weight @ logsumexp(each, axis=0)) - prior_cost, offsets_m, shares)

    def _log_likelihoods(self, offsets_m: FloatArray, shares: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the log likelihood of each group and offset, and the root in the pseudo-Huber loss, shape (k, n)."""
        curved = np.einsum("nij,ki,kj->kn", self._information, offsets_m, offsets_m)
        chi2 = np.maximum(self._square - 2.0 * offsets_m @ self._along.T + curved, 0.0)
        root = np.sqrt(1.0 + chi2 / ROBUST_SCALE**2)
        return np.log(shares)[:, np.newaxis] - ROBUST_SCALE**2 * (root - 1.0), root
