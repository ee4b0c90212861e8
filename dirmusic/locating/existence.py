r"""Existence of a source: the evidence of a fixed point against a wave that wanders.

Pulses that seem to come from one point may be multipath, or come from interference that moves. Their directions and
levels then change in any way, and so does their number. A group of pulses contributes the log ratio

.. math:: a = \ln\left(v \frac{N(\Delta\beta; \sigma_\beta)}{N(\Delta\beta; \sqrt{\sigma_\beta^2 + \Delta^2})}
            \frac{N(\Delta L; \sigma_L)}{N(\Delta L; \sqrt{\sigma_L^2 + \Lambda^2})} + 1 - v\right)

where a wandering wave changes its bearing by :math:`\Delta` and its level by :math:`\Lambda` from one window to the
next. A wave of a source comes on the direct path with the probability v, at least `WRONG_MAP`, and wanders otherwise; a
place behind equipment says little. A window counts once, because its errors are shared. See `pulse_evidence`,
`rate_evidence` and `image_evidence` for the three tests.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.locating.association import Association, Comparison, Level, level_std
from dirmusic.locating.joint_fit import LEVEL_PRIOR_DB


class Wander(NamedTuple):
    """Standard deviations of the change of bearing and level of a wave between independent observations."""

    bearing_rad: float
    level_db: float


WANDERING = Wander(np.radians(40.0), 12.0)
"""Change of multipath and of interference that moves (assumed)."""

DIFFUSE = Wander(np.radians(12.0), 10.0)
"""Change of the waves that reach the array around the equipment near a source, as from an extended image (assumed)."""

WRONG_MAP = 0.1
"""Probability that the map hides a source from a place that sees it (assumed)."""

OFF = 0.1
"""Share of windows in which a steady source may be off (assumed)."""

PAUSING, SWITCH = 0.01, 0.02
"""Prior probability that a source pauses for long, and probability that a pause begins or ends between two windows in
which it would be heard (assumed). Silence counts against a steady source in each window, and against one that pauses
little more than once."""

OCCAM = 10.0
"""Log of the factor by which fitting position and level raises the likelihood of chance coincidences (assumed)."""

RATE_SPREAD, WANDER_RATE = 0.6, 1.5
"""Standard deviation of the logarithm of the number of detections in a window, for a source and for other waves
(assumed)."""

LEAST_EXPECTED = 0.5
"""Expected number of detections in a window above which silence counts (assumed)."""

IMAGE_BOTH, IMAGE_SHARE, IMAGE_LIMIT = 0.15, 0.03, 3.0
"""Least probability that a source and its image are detected within one second from a place that sees the source,
probability of each pulse to be taken for one of the other, so that at high rates both are detected in any case, and
largest contribution of one second to the log odds (assumed)."""


def log_ratios(compared: Comparison, level: Level, n_pulses: FloatArray, wander: Wander = WANDERING) -> FloatArray:
    """Return the log ratio of the densities of each group under a source and under a wandering wave, shape (n,).

    It is minus infinity for groups from other directions.
    """
    ratios, rows = np.full(n_pulses.size, -np.inf), compared.near
    own = compared.take(rows)
    std_db, direct = level_std(own, level, n_pulses[rows]), np.maximum(own.direct, WRONG_MAP)
    of_bearing = _log_ratio(own.bearing_offset, own.bearing_std_rad, wander.bearing_rad)
    of_level = _log_ratio((own.level_db - level.mean_db) / std_db, std_db, wander.level_db)
    ratios[rows] = np.logaddexp(np.log(direct) + of_bearing + of_level, np.log1p(-direct))
    return ratios


def _log_ratio(offset: FloatArray, std: FloatArray, wander: float) -> FloatArray:
    """Return the log ratio of two normal densities of an offset: with its deviation, and with a wander more."""
    share = 1.0 / (1.0 + np.square(wander / std))
    return -0.5 * np.square(offset) * (1.0 - share) - 0.5 * np.log(share)


def pulse_evidence(ratios: FloatArray, association: Association, window: IntArray) -> FloatArray:
    r"""Return the log odds of each source by the pulses, shape (n_sources,).

    Without source k, its share :math:`\pi_k` goes to none, or to all others in proportion to what they explain,
    whichever explains the group better:

    .. math:: \ln \frac{o + \pi_k e^{a_k}}{\max(o + \pi_k, \; o / (1 - \pi_k))}
              + \frac{1 - s}{s} \ln(1 - s), \quad o = \sum_{j \ne k} \pi_j e^{a_j} + \pi_0, \quad
              s = \frac{\pi_k}{\pi_k + \pi_0}

    The last term is for the pulses of the window that the source does not explain. In each window, the mean over the
    groups of the source counts.

    Args:
        ratios: `log_ratios` of all sources, shape (n_sources, n).
        association: Probable origin of each group.
        window: Number of the window of each group, from 0 on, shape (n,).
    """
    none, evidence = association.share[-1], np.empty(len(ratios))
    each = association.share[:-1] * np.exp(ratios)
    together = each.sum(axis=0) + none
    for k, (of_source, own) in enumerate(zip(association.direct, association.share, strict=False)):
        share = np.minimum(own / (own + none), 1.0 - 1e-9)
        others = together - each[k]
        gain = np.log(together / np.maximum(others + own, others / (1.0 - np.minimum(own, 1.0 - 1e-12))))
        chosen = gain + (1.0 - share) / share * np.log1p(-share)
        total = np.bincount(window, of_source * chosen)
        evidence[k] = np.sum(total / np.maximum(np.bincount(window, of_source), 1.0))
    return evidence


def rate_evidence(expected: FloatArray, detected: FloatArray, possible: FloatArray) -> float:
    r"""Return the log odds by the numbers of detections in the windows in which a source was visible.

    A source has a nearly constant rate; a wandering wave or multipath has any. With n detections where E were expected,
    :math:`x = \ln \frac{n + 1/2}{E + 1/2}` has the variance :math:`s^2 + 1 / (E + 1/2)`, where s is `RATE_SPREAD` for a
    source and `WANDER_RATE` for others. A steady source may be off in a share `OFF` of the windows; one that pauses is
    on or off in a two-state Markov chain with the probability `SWITCH` of a change, and has the prior probability
    `PAUSING`. Few detections do not count against a source where other candidates have pulses that it may have emitted.

    Args:
        expected: Expected number of detections in each window, shape (n_windows,); windows below `LEAST_EXPECTED` do
            not count.
        detected: Number of detections in each window, shape (n_windows,).
        possible: Number of detections in each window without other candidates, shape (n_windows,).
    """
    is_visible = expected > LEAST_EXPECTED
    expected, detected, possible = expected[is_visible], detected[is_visible], possible[is_visible]
    by_count = 1.0 / (expected + 0.5)
    own, other = RATE_SPREAD**2 + by_count, WANDER_RATE**2 + by_count

    def ratio(n: FloatArray) -> FloatArray:
        offset = np.log((n + 0.5) / (expected + 0.5))
        return 0.5 * np.log(other / own) - 0.5 * np.square(offset) * (1.0 / own - 1.0 / other)

    by_detected = ratio(detected)
    most = np.clip(expected, detected, np.maximum(detected, possible))
    by_detected = np.where(by_detected < 0.0, np.minimum(ratio(most), 0.0), by_detected)
    ratios = np.exp(by_detected)
    steady, pausing, is_on = float(np.log((1.0 - OFF) * ratios + OFF).sum()), 0.0, 0.5
    for on in ratios.tolist():
        both = is_on * on + 1.0 - is_on
        pausing += math.log(both)
        is_on *= on / both
        is_on += SWITCH * (1.0 - 2.0 * is_on)
    return float(np.logaddexp(math.log(1.0 - PAUSING) + steady, math.log(PAUSING) + pausing))


def level_evidence(level: Level) -> float:
    """Return the log density of a level relative to the likeliest level."""
    mean_db, std_db = LEVEL_PRIOR_DB
    return -0.5 * ((level.mean_db - mean_db) / std_db) ** 2


def image_evidence(
    window: IntArray,
    count: FloatArray,
    senior: FloatArray,
    expected: FloatArray,
    rate_hz: float,
    is_too_strong: BoolArray,
) -> float:
    r"""Return the log odds of a separate source against an image of a senior one: each emission is received once.

    The senior source emits as usual while it is detected together with another source, but an image takes some of its
    detections. With n detections of the candidate in a window, m of the senior source, and x and s as in
    `rate_evidence` for the rate of the senior source, the likelihood ratio is

    .. math:: \exp \frac{x_{n + m}^2 - x_m^2}{2 s^2}

    where the senior source may also be off. Its mean is 1 if the candidate is an image. The senior source may be hidden
    all the time; therefore, the mean of the product over all windows with detections, and of 1, adds to the odds.

    Args:
        window: Window of each second, shape (n_seconds,).
        count: Number of detections of the source in each second.
        senior: Number of detections of the senior source in each second.
        expected: Expected number of these if it is on; 0 where it is not visible for certain.
        rate_hz: Rate of the detections of the senior source where it is visible; 0 if not known.
        is_too_strong: True where a detection is stronger than an image of the senior source can be.
    """
    missed = OFF + (1.0 - OFF) * np.exp(-expected)
    both = np.maximum(IMAGE_BOTH, 1.0 - (1.0 - IMAGE_SHARE) ** expected)
    each = np.where(senior > 0.5, np.log((1.0 - missed + 1e-3) / both), np.log(missed / (1.0 - IMAGE_BOTH)))
    each = np.where(is_too_strong, IMAGE_LIMIT, np.where(expected > 0.0, np.clip(each, -IMAGE_LIMIT, IMAGE_LIMIT), 0.0))
    rows = count > 0.5
    n = np.bincount(window[rows], minlength=window.max(initial=0) + 1)
    by_seconds = (np.bincount(window[rows], each[rows], minlength=n.size) / np.maximum(n, 1)).sum()
    if not rate_hz:
        return float(by_seconds)
    emitted = rate_hz * np.bincount(window)[n > 0]
    variance = RATE_SPREAD**2 + 1.0 / (emitted + 0.5)
    alone, together = (
        np.square(np.log((np.bincount(window, detected)[n > 0] + 0.5) / (emitted + 0.5)))
        for detected in (senior, senior + count)
    )
    by_rate = np.logaddexp(math.log(1.0 - OFF) + 0.5 * (together - alone) / variance, math.log(OFF)).sum()
    return float(by_seconds + np.logaddexp(0.0, by_rate) - math.log(2.0))
