"""Waveform of a discharge at the antenna."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

DECAY_S = 1.0e-9
RISE_S = 0.2e-9
FREQUENCY_HZ = 1.75e9
"""Assumed, after the paper's measurements: about 2.5 ns long, energy mainly between 1.5 and 2 GHz (here 76 %)."""


def damped_pulse(time_s: ArrayLike, phase_rad: float = 0.0) -> FloatArray:
    r"""Double-exponential oscillation, zero before time zero, largest magnitude 1 without a phase.

    .. math:: s(t) = (e^{-t/\tau_d} - e^{-t/\tau_r}) \sin(2 \pi f t + \varphi) / \max_t |\cdot|_{\varphi = 0}

    Args:
        time_s: Time since the pulse arrived, any shape, seconds.
        phase_rad: Phase of the oscillation, as polarisation, mirrors and edges turn it.

    Returns:
        Waveform for a peak of 1 V, same shape.

    References:
        Dir-MUSIC, section 3.1 (form) and 4.2 (duration and band).
    """
    return _unscaled(np.asarray(time_s, dtype=np.float64), phase_rad) / _peak()


def _unscaled(time_s: FloatArray, phase_rad: float = 0.0) -> FloatArray:
    t = np.maximum(time_s, 0.0)
    return (np.exp(-t / DECAY_S) - np.exp(-t / RISE_S)) * np.sin(2 * np.pi * FREQUENCY_HZ * t + phase_rad)


@cache
def _peak() -> float:
    return float(np.abs(_unscaled(np.arange(0.0, 5 * DECAY_S, 1e-13))).max())


@cache
def unit_pulse_energy(sample_rate_hz: float) -> float:
    """Sum of squared samples of a pulse of 1 V peak, V^2: rho of a unit-gain channel is A^2 times this over sigma^2."""
    return float(np.square(damped_pulse(np.arange(0.0, 20 * DECAY_S, 1 / sample_rate_hz))).sum())
