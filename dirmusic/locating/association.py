r"""Association of pulses with sources: the E step of expectation maximisation.

A group of pulses came from source k on its direct path, from source k on another path, or from none. With the density
:math:`d_k` of its strengths, the normal density of its level, and the probability :math:`v_k` that the direct path is
the strongest one,

.. math:: r_k \propto \pi_k v_k \, d_k \, N(L; L_k, \sigma_k), \quad
          m_k \propto \pi_k (1 - v_k) \, d_0 / M, \quad r_0 \propto \pi_0 \, d_0 / R

where :math:`\pi` are the shares of the sources in the window of the group, :math:`d_0` is the density of strengths of
any ratio, on the positive part of the unit sphere, R is a range of levels, and M the range of levels below that of the
direct path. Interference and simultaneous waves belong to no source.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import expit, gammaln, logit, ndtr, ndtri
from scipy.stats import norm

from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.locating.measurement import FAR_OFF, Noise, NominalArray, PooledPulses, compare
from dirmusic.locating.pulse_pool import Groups

LEVEL_RANGE_DB, MULTIPATH_RANGE_DB = 50.0, 30.0
"""Range over which the levels of pulses of no source, and of multipath below the direct path, are uniformly distributed
(assumed)."""

INTERFERENCE_DB = 3.0
"""Typical rise of a level by interference between several paths (assumed)."""

LEVEL_ERROR_DB = 2.0
"""Standard deviation of a mean level due to reflections and to equipment on the path (assumed)."""

EXCEEDED = float(ndtr(-2.0))
"""Probability with which a pulse is stronger than a source is expected to cause, interference apart (assumed)."""

MAP_ERROR_SHARE = 0.5
"""Standard deviation of the attenuation by equipment on the map, as a share of its decibels (assumed)."""

EQUAL_LOSS_DB, LOSS_SCALE_DB = 6.0, 1.5
"""Attenuation at which the direct path is the strongest one in half of the cases, and scale of the logistic function of
that probability (assumed): 0.98 in free sight, 0.02 behind two insulators or metal."""

LEAST_TRANSMISSION = 10 ** (-20.0 / 20.0)
"""Least transmission that levels are corrected for (assumed): beyond it, other paths are stronger."""

SIGHT_ROUNDS = 20
"""Number of rounds in which the share of waves in free sight is estimated (assumed)."""

LEAST_SHARE, EXTRA_NONE = 1e-3, 0.3
"""Number of pulses that every source is given in each window, so that none is excluded, and number added to those of no
source (assumed)."""


class Comparison(NamedTuple):
    """Comparison of groups of pulses with one source; every array has shape (n,).

    Attributes:
        log_density: Log density of the strengths.
        level_db: Level 1 m from the source, corrected for the attenuation on the map, dB relative to 1 V.
        level_error_db: Standard deviation of this level.
        loss_db: That attenuation, dB.
        bearing_std_rad: Standard deviation of the bearing.
        bearing_offset: Offset of the bearing in standard deviations.
        direct: Probability that the direct path is the strongest one, if the pulse came from the source.
        range_m: Distance.
    """

    log_density: FloatArray
    level_db: FloatArray
    level_error_db: FloatArray
    loss_db: FloatArray
    bearing_std_rad: FloatArray
    bearing_offset: FloatArray
    direct: FloatArray
    range_m: FloatArray

    @property
    def near(self) -> IntArray:
        """Rows of the groups from the direction of the source; the others did certainly not come from it."""
        return np.flatnonzero(self.log_density > FAR_OFF[0])

    def take(self, rows: IntArray | slice) -> Comparison:
        """Select groups."""
        return Comparison(*(column[rows] for column in self))

    def followed_by(self, later: Comparison) -> Comparison:
        """Append that of later groups."""
        return Comparison(*(np.concatenate(pair) for pair in zip(self, later, strict=True)))


NO_COMPARISON = Comparison(*(np.empty(0) for _ in Comparison._fields))


class Level(NamedTuple):
    """Level of a source 1 m away, dB relative to 1 V, and standard deviation of the levels of its pulses, dB."""

    mean_db: float
    spread_db: float

    def limit_db(self, range_m: FloatArray, n_pulses: FloatArray | float = 1.0) -> FloatArray:
        """Return the level at the array that pulses on any path exceed with the probability `EXCEEDED`.

        Args:
            range_m: Distance, shape (n,).
            n_pulses: Number of pulses of which none may exceed it, 1 or more, shape (n,).
        """
        off_db = -ndtri(EXCEEDED / n_pulses) * self.spread_db
        return self.mean_db + off_db + INTERFERENCE_DB - 20.0 * np.log10(range_m)


class Association(NamedTuple):
    """Probable origin of each group.

    Attributes:
        direct: Probability that the group came from each source on the direct path, shape (n_sources, n).
        multipath: Probability that it came from each source on another path, shape (n_sources, n).
        share: Prior share of each source, and of none at the end, shape (n_sources + 1, n).
    """

    direct: FloatArray
    multipath: FloatArray
    share: FloatArray


def pooled(groups: Groups, weakening: FloatArray | None = None) -> PooledPulses:
    """Return the columns of groups that compiled functions use; see `PooledPulses`, without weakening by default."""
    weakening = np.ones(groups.time_s.size) if weakening is None else weakening
    return PooledPulses(groups.pose, groups.strengths, groups.variance, groups.is_usable, weakening)


def direct_probability(transmission: FloatArray) -> FloatArray:
    """Return the probability that the direct path is the strongest one, by its transmission, same shape."""
    loss_db = -20.0 * np.log10(np.maximum(transmission, 1e-3))
    return expit((EQUAL_LOSS_DB - loss_db) / LOSS_SCALE_DB)


def compare_groups(
    groups: Groups,
    position_m: FloatArray,
    array_state: FloatArray,
    uncertainty: FloatArray,
    array: NominalArray,
    noise: Noise,
    transmission: FloatArray,
) -> Comparison:
    """Compare groups with a source.

    Args:
        groups: The groups.
        position_m: Position of the source, shape (3,).
        array_state: States of the array.
        uncertainty: Covariance of the position and these states.
        array: The array as in its data sheet.
        noise: Standard deviations of errors that are not states.
        transmission: Transmission of the direct path at likely heights of the source, shape (n_heights, n); the second
            row is for the estimated height.
    """
    n = groups.time_s.size
    result = np.empty((n, 4))
    compare(
        np.arange(n), position_m, array_state, uncertainty, pooled(groups), array, noise, groups.azimuth_rad, result
    )
    at_heights_db = -20.0 * np.log10(np.maximum(transmission, LEAST_TRANSMISSION))
    loss_db = at_heights_db[len(at_heights_db) // 3]
    return Comparison(
        log_density=result[:, 0],
        level_db=20.0 * np.log10(np.maximum(result[:, 1], 1e-12)) + groups.level_db + loss_db,
        level_error_db=np.sqrt(
            LEVEL_ERROR_DB**2 + np.square(MAP_ERROR_SHARE * loss_db) + np.square(0.5 * np.ptp(at_heights_db, axis=0))
        ),
        loss_db=loss_db,
        bearing_std_rad=result[:, 2],
        bearing_offset=result[:, 3],
        direct=direct_probability(transmission).mean(axis=0),
        range_m=np.maximum(np.linalg.norm(groups.pose[:, :2] - position_m[:2], axis=-1), 0.3),
    )


def log_flat_density(n_channels: FloatArray) -> FloatArray:
    """Return the log density of strengths of any ratio: 1 over the area of the positive part of the unit sphere."""
    return n_channels * np.log(2.0) - np.log(2.0) - 0.5 * n_channels * np.log(np.pi) + gammaln(0.5 * n_channels)


def level_std(compared: Comparison, level: Level, n_pulses: FloatArray) -> FloatArray:
    """Return the standard deviation of the mean levels of groups of the source, dB, shape (n,)."""
    return np.sqrt(np.square(compared.level_error_db) + level.spread_db**2 / n_pulses)


def likelihoods(
    groups: Groups, compared: list[Comparison], levels: list[Level], is_located: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compute the densities of each group under every origin.

    Args:
        groups: The groups.
        compared: Comparison with each source.
        levels: Level of each source.
        is_located: True for sources whose multipath is considered, shape (n_sources,).

    Returns:
        Density under the direct path of each source, shape (n_sources, n), under its multipath, same shape, and under
        none, shape (n,).
    """
    flat = np.exp(log_flat_density(groups.is_usable.sum(axis=-1).astype(np.float64)))
    direct, multipath = np.zeros((2, len(compared), flat.size))
    for k, (of_source, level) in enumerate(zip(compared, levels, strict=True)):
        rows = of_source.near
        own = of_source.take(rows)
        std_db = level_std(own, level, groups.n_pulses[rows])
        off = (own.level_db - level.mean_db) / std_db
        density = np.exp(own.log_density - 0.5 * np.square(off)) / (np.sqrt(2.0 * np.pi) * std_db)
        direct[k, rows] = density * own.direct
        if is_located[k]:
            limit_db = level.limit_db(of_source.range_m)
            is_weaker = (groups.level_db < limit_db) & (groups.level_db > limit_db - MULTIPATH_RANGE_DB)
            multipath[k] = flat * is_weaker * (1.0 - of_source.direct) / MULTIPATH_RANGE_DB
    return direct, multipath, flat / LEVEL_RANGE_DB


def associate(likelihood: tuple[FloatArray, FloatArray, FloatArray], share: FloatArray) -> Association:
    """Compute the probable origin of each group.

    Args:
        likelihood: Result of `likelihoods`.
        share: Prior share of each source, and of none at the end, shape (n_sources + 1, n).
    """
    direct, multipath = share[:-1] * likelihood[0], share[:-1] * likelihood[1]
    total = direct.sum(axis=0) + multipath.sum(axis=0) + share[-1] * likelihood[2]
    return Association(direct / total, multipath / total, share)


def possible_origin(
    likelihood: tuple[FloatArray, FloatArray, FloatArray], association: Association, is_confirmed: BoolArray
) -> FloatArray:
    """Return the probability that a group came from each source, or would do so if no other candidate existed.

    A source can only gain what other candidates have. Before the comparison, it is as likely as the confirmed sources
    and none together.

    Args:
        likelihood: Result of `likelihoods`.
        association: Probable origin of each group.
        is_confirmed: True for sources that are not candidates, shape (n_sources,).

    Returns:
        Probability of the direct path, shape (n_sources, n).
    """
    direct, multipath, none = likelihood
    kept = np.append(is_confirmed, True)[:, np.newaxis] * association.share
    each = kept[:-1] * (direct + multipath)
    others = each.sum(axis=0) - each + kept[-1] * none
    alone = direct / (direct + others / np.maximum(kept.sum(axis=0) - kept[:-1], 1e-12))
    of_candidates = ~is_confirmed[:, np.newaxis] * (association.direct + association.multipath)
    gain = of_candidates.sum(axis=0) - of_candidates
    return np.clip(alone, association.direct, association.direct + gain)


def in_sight_probability(compared: Comparison, level: Level, n_pulses: FloatArray, is_near: BoolArray) -> FloatArray:
    """Return the probability that groups came in free sight from a source or from another one near it, shape (n,).

    Where the map hides the source, waves reach the array around an edge near it, with the attenuation on the map, or
    come from a source that is not hidden, without. The share of the latter is estimated by expectation maximisation
    from the levels, with equal levels of both sources.

    Args:
        compared: Comparison with the source.
        level: Level of the source.
        n_pulses: Number of pulses of each group, shape (n,).
        is_near: True for the groups whose line of sight passes near the source, shape (n,).
    """
    probability = compared.direct * is_near
    rows = np.flatnonzero(is_near & (compared.direct < 0.5))
    hidden, n = compared.take(rows), n_pulses[rows]
    bent, free = (
        norm.logpdf(hidden.level_db - loss_db, level.mean_db, np.hypot(error_db, level.spread_db / np.sqrt(n)))
        for loss_db, error_db in ((0.0, hidden.level_error_db), (hidden.loss_db, LEVEL_ERROR_DB))
    )
    share, own = 0.5, np.empty(0)
    for _ in range(SIGHT_ROUNDS if rows.size else 0):
        own = expit(logit(share) + free - bent)
        share = float(np.clip(own.mean(), 1e-6, 1.0 - 1e-6))
    probability[rows] += (1.0 - hidden.direct) * own
    return probability


def window_shares(probability: FloatArray, n_pulses: FloatArray, window: IntArray) -> FloatArray:
    """Estimate the share of each source, and of none, in the pulses of each window.

    Args:
        probability: Probability that each group came from each source, shape (n_sources, n).
        n_pulses: Number of pulses of each group, shape (n,).
        window: Number of the window of each group, from 0 on, shape (n,).

    Returns:
        Share at each group, shape (n_sources + 1, n).
    """
    none = np.maximum(1.0 - probability.sum(axis=0), 0.0)
    count = np.array([np.bincount(window, own * n_pulses) for own in (*probability, none)])
    count = np.maximum(count, LEAST_SHARE)
    count[-1] += EXTRA_NONE
    return (count / count.sum(axis=0))[:, window]
