"""The trigger: its level, and by which of its ray paths a pulse crosses it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from sensing.radio.incoming import Incoming

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


def threshold_over_noise(false_alarm_rate_hz: float, samples_hz: float, correlation: float) -> float:
    r"""Trigger level, over the standard deviation of the noise, that noise alone crosses at a given rate.

    A Gaussian sequence with correlation :math:`\rho` from sample to sample rises through T, and falls through -T,
    with the probability :math:`2 \, T_O(T / \sigma, \sqrt{(1 - \rho) / (1 + \rho)})` each per sample, by Owen's
    function :math:`T_O`. Crossings that follow one another within a gate count each.

    Args:
        false_alarm_rate_hz: Crossings per second in all channels together, > 0.
        samples_hz: Samples per second of all channels together.
        correlation: Of the noise from one sample to the next, in (-1, 1).
    """
    from scipy.optimize import brentq  # here, so that a command line help need not wait for it
    from scipy.special import owens_t

    slope = float(np.sqrt((1.0 - correlation) / (1.0 + correlation)))
    crossings = 4 * samples_hz

    def too_often(sigmas: float) -> float:
        rate_hz = crossings * float(owens_t(sigmas, slope))
        return float(np.log(max(rate_hz, 1e-300) / false_alarm_rate_hz))

    return float(brentq(too_often, 0.0, 30.0))  # pyright: ignore[reportArgumentType]


class Triggers(NamedTuple):
    """How pulses meet the trigger, without noise.

    Attributes:
        path: Ray path by which each pulse triggers: the first that is loud enough in its loudest channel, or where none
            is the loudest, shape (n_pulses,).
        voltage_v: Greatest voltage of each pulse, shape (n_pulses,).
    """

    path: IntArray
    voltage_v: FloatArray


@compiled
def find_triggers(incoming: Incoming, pulse_peak: float, threshold_v: float) -> Triggers:
    """By which ray path each pulse triggers, and its greatest voltage.

    Args:
        incoming: The pulses.
        pulse_peak: Largest magnitude of a filtered pulse of 1 V.
        threshold_v: Trigger level.
    """
    n_pulses, loudest, loudest_s = incoming.first.size, incoming.arrivals.loudest, incoming.arrivals.loudest_s
    triggers = Triggers(np.empty(n_pulses, np.intp), np.empty(n_pulses))
    for k in range(n_pulses):
        first = incoming.first[k]
        paths = range(first, first + incoming.n_paths[k])
        scale_v = abs(incoming.peak_v[k]) * pulse_peak
        highest_v = 0.0
        for p in paths:
            highest_v = max(highest_v, scale_v * loudest[p])
        earliest_s, triggers.path[k] = np.inf, first
        for p in paths:
            if scale_v * loudest[p] >= min(threshold_v, highest_v) and loudest_s[p] < earliest_s:
                earliest_s, triggers.path[k] = loudest_s[p], p
        triggers.voltage_v[k] = highest_v
    return triggers
