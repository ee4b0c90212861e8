"""The trigger: its level, and how probably a sample exceeds it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

STEP = 0.02
"""Of the table of probabilities, over the standard deviation of the noise."""

HIGHEST = 0.5
"""Probability at which the table ends."""


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


def probabilities(level: float) -> FloatArray:
    """That signal and Gaussian noise exceed a level in magnitude, for signals in steps of `STEP` from 0 on.

    Args:
        level: Over the standard deviation of the noise.

    Returns:
        Shape (n_steps,), ascending; the last is the first above `HIGHEST`.
    """
    from scipy.special import ndtr

    signal = STEP * np.arange(int(np.ceil(level / STEP)) + 1)
    return np.asarray(ndtr(signal - level) + ndtr(-signal - level), dtype=np.float64)
