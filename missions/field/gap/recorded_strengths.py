"""Strengths of a recording averaged over the pulses of one finding at one pose, and the noise that they show."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dirmusic.arrays import FloatArray, IntArray
from dirmusic.locating.pulse_pool import choose_evenly
from pdpatrol.sensing import ReceiverConfig
from pdpatrol.sensing.receiver.receiver import Receiver

MAX_GROUPS = 120
"""Largest number of groups that are compared; more take minutes and hardly narrow the intervals (assumed)."""

STRONG = 8.0
"""Strength, in standard deviations of the noise, from which on its scatter does not depend on it (assumed)."""

LEAST_SCATTER_PULSES = 3
"""Least number of pulses of a group whose scatter is used."""

CENSORED_STD, CENSORED_DB = 2.0, 6.0
"""Margin of a mean level above the weakest pulse, in standard deviations of the level, up to which weaker pulses may
have been missed; and standard deviation of such a level (assumed)."""


class PulseGroups(NamedTuple):
    """Pulses of one finding at one pose, n groups.

    Attributes:
        step: Pose, shape (n,).
        source: Number of the finding among those compared, shape (n,).
        n_pulses: Number of pulses, shape (n,).
        unit: Mean strengths scaled to unit norm, shape (n, n_elements).
        log_level: Mean logarithm of the norm of the strengths, volts, shape (n,).
        level_variance: Variance of this mean, shape (n,).
    """

    step: IntArray
    source: IntArray
    n_pulses: IntArray
    unit: FloatArray
    log_level: FloatArray
    level_variance: FloatArray


def group_pulses(strengths_v: FloatArray, step: IntArray, source: IntArray) -> tuple[PulseGroups, IntArray]:
    """Average the pulses of each source at each pose.

    Levels near that of the weakest pulse are hardly used, because weaker pulses were not detected.

    Args:
        strengths_v: Strengths of the pulses, shape (n_pulses, n_elements).
        step: Pose of each pulse, shape (n_pulses,).
        source: Source of each pulse, from 0, shape (n_pulses,).

    Returns:
        At most `MAX_GROUPS` groups, evenly spread, and the group of each pulse, -1 for none.
    """
    both, group, n_pulses = np.unique(np.stack([step, source]), axis=1, return_inverse=True, return_counts=True)
    level = np.log(np.linalg.norm(strengths_v, axis=1))
    energy = np.zeros((n_pulses.size, strengths_v.shape[1]))
    np.add.at(energy, group, np.square(strengths_v))
    mean = np.bincount(group, level) / n_pulses
    n_free = np.bincount(both[1], n_pulses - 1)
    spread2 = np.bincount(source, np.square(level - mean[group])) / np.maximum(n_free, 1)
    variance = spread2[both[1]] / n_pulses
    margin = CENSORED_STD * np.sqrt(spread2[both[1]])
    variance[mean - level.min() < margin] += (CENSORED_DB * np.log(10.0) / 20.0) ** 2
    kept = choose_evenly(np.arange(n_pulses.size), MAX_GROUPS)
    number = np.full(n_pulses.size, -1)
    number[kept] = np.arange(kept.size)
    unit = np.sqrt(energy[kept])
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    groups = PulseGroups(both[0, kept], both[1, kept], n_pulses[kept], unit, mean[kept], variance[kept])
    return groups, number[group]


class NoiseEstimate(NamedTuple):
    """Noise of the receiver, relative to that of the scenario.

    Attributes:
        db: Level of the noise before the band-pass, decibels.
        std_db: Its standard deviation.
        variance_v2: Variance of a strength well above the noise, volts squared.
    """

    db: float
    std_db: float
    variance_v2: float


def estimate_noise(strengths_v: FloatArray, group: IntArray, receiver: ReceiverConfig) -> NoiseEstimate | None:
    r"""Estimate the noise from the scatter of the strength ratios of pulses of one source at one pose.

    Levels scatter because discharges do. Across the mean direction of m channels that are well above the noise, the
    strengths of n pulses have :math:`(n - 1) (m - 1)` degrees of freedom.

    Returns:
        The estimate; None with fewer than two groups of `LEAST_SCATTER_PULSES` pulses.
    """
    model = Receiver(receiver, strengths_v.shape[1])
    per_noise = model.front_end.noise_on_pulse
    nominal_v2 = per_noise * model.noise_variance_v2
    is_strong_v = STRONG * np.sqrt(nominal_v2)
    scatter, freedom = [], []
    for number in range(int(group.max()) + 1):
        own = strengths_v[group == number]
        own = own[:, own.min(axis=0, initial=np.inf) > is_strong_v]
        if len(own) < LEAST_SCATTER_PULSES or own.shape[1] < 2:
            continue
        mean = np.linalg.norm(own, axis=1) @ own
        mean /= np.linalg.norm(mean)
        across = own - np.outer(own @ mean, mean)
        scatter.append(np.square(across).sum())
        freedom.append((len(own) - 1) * (own.shape[1] - 1))
    if len(scatter) < 2:
        return None
    total, each = np.sum(freedom), np.array(scatter)
    variance_v2 = float(each.sum() / total)
    relative = float(np.sqrt(np.square(each - variance_v2 * np.array(freedom)).sum()) / each.sum())
    quantised_v2 = model.step_v**2 / 12
    noise_v2 = max(variance_v2 / per_noise - quantised_v2, 1e-3 * model.filtered_noise_v**2)
    std_db = 10.0 / np.log(10.0) * relative * variance_v2 / per_noise / noise_v2
    return NoiseEstimate(10.0 * float(np.log10(noise_v2 / model.filtered_noise_v**2)), float(std_db), variance_v2)
