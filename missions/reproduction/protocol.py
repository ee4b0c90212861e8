"""How the published simulations were made: one pulse in 10 000 samples of white noise, and what that is worth.

Only the energy of the pulse and the number of samples matter to a covariance, so covariances of whole records are
drawn from their exact law, the noncentral Wishart distribution. Whole records are drawn where the pulse has to be found
first.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic import GainManifold
from pdpatrol.sensing.nature.pulse_shape import damped_pulse, unit_pulse_energy
from pdpatrol.sensing.radio.surroundings import SPEED_OF_LIGHT_MPS

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

SAMPLE_RATE_HZ = 20e9
N_RECORD = 10_000
"""0.5 us at 20 GS/s: with this many samples the protocol meets every simulated exhibit of the paper."""

UNIT_ENERGY_TO_NOISE = 28_070.0
"""rho at 0 dB: energy of the pulse in a unit-gain channel over the variance of a noise sample, six elements."""

REAL_GATE_SAMPLES = 120
"""6 ns: a gate that holds the pulse and its travel across 0.4 m."""

GRID_DEG = np.arange(1, 361)
"""The paper's true directions and its search grid."""


def energy_to_noise(snr_db: ArrayLike) -> FloatArray:
    """Rho of the paper's SNR for six elements, whatever the length of the record."""
    return UNIT_ENERGY_TO_NOISE * 10.0 ** (np.asarray(snr_db, dtype=np.float64) / 10)


def energy_to_noise_of(gain: FloatArray, snr_db: float, n_record: int = N_RECORD) -> FloatArray:
    """Rho under the paper's definition of SNR: one noise level, set by the mean square of the whole clean record.

    Args:
        gain: True gains of all elements that the noise is set by, shape (n_trials, n_elements).
        snr_db: The SNR.
        n_record: Samples of the record.

    Returns:
        Shape (n_trials,).
    """
    return gain.shape[-1] * n_record * 10.0 ** (snr_db / 10) / np.square(gain).sum(axis=-1)


def wishart(n_trials: int, n_elements: int, degrees: int, rng: np.random.Generator) -> FloatArray:
    """X X^T of unit white noise X (n_elements, degrees), shape (n_trials, n_elements, n_elements).

    References:
        Bartlett's decomposition; Anderson, "An Introduction to Multivariate Statistical Analysis", section 7.2.
    """
    lower = np.tril(rng.standard_normal((n_trials, n_elements, n_elements)), -1)
    diagonal = np.arange(n_elements)
    lower[:, diagonal, diagonal] = np.sqrt(rng.chisquare(degrees - diagonal, (n_trials, n_elements)))
    return lower @ np.swapaxes(lower, -1, -2)


def draw_covariances(signals: FloatArray, n_record: int, rng: np.random.Generator) -> FloatArray:
    r"""Sample covariances of records with some pulses at different times, in unit white noise.

    .. math:: n R = \sum_k y_k y_k^T + W, \quad y_k = s_k + n_k, \quad W \sim \text{Wishart}(n - n_\text{pulses})

    Args:
        signals: Gains times the root of each pulse's energy, shape (n_trials, n_elements, n_pulses).
        n_record: Samples of the record.
        rng: All randomness.

    Returns:
        Shape (n_trials, n_elements, n_elements).
    """
    n_trials, n_elements, n_pulses = signals.shape
    heard = signals + rng.standard_normal(signals.shape)
    noise = wishart(n_trials, n_elements, n_record - n_pulses, rng)
    return (heard @ np.swapaxes(heard, -1, -2) + noise) / n_record


def draw_phase_covariances(steering: ComplexArray, rho: float, n_record: int, rng: np.random.Generator) -> ComplexArray:
    """The same for the analytic signals of an array that differs in phase, not in gain.

    An analytic signal of n real samples has n / 2 independent complex ones.

    Args:
        steering: Response of each element, shape (n_trials, n_elements).
        rho: Energy of the pulse over the noise variance.
        n_record: Real samples of the record.
        rng: All randomness.

    Returns:
        Shape (n_trials, n_elements, n_elements), up to a factor.
    """
    n_trials, n_elements = steering.shape
    degrees = n_record // 2 - 1

    def complex_normal(*shape: int) -> ComplexArray:
        return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)

    heard = np.sqrt(rho) * steering + complex_normal(n_trials, n_elements)
    lower = np.tril(complex_normal(n_trials, n_elements, n_elements), -1)
    diagonal = np.arange(n_elements)
    lower[:, diagonal, diagonal] = np.sqrt(rng.chisquare(2 * (degrees - diagonal), (n_trials, n_elements)))
    both = np.concatenate([heard[..., np.newaxis], lower], axis=-1)
    return both @ np.conj(np.swapaxes(both, -1, -2))


def draw_records(gain: FloatArray, rho: FloatArray, rng: np.random.Generator) -> NDArray[np.float32]:
    """Whole records in unit white noise with one pulse each, somewhere, heard by all elements at one time.

    Args:
        gain: True gains, shape (n_trials, n_elements).
        rho: Energy of the pulse over the noise variance, shape (n_trials,).
        rng: All randomness.

    Returns:
        Shape (n_trials, n_elements, N_RECORD), in single precision: rounding is a ten-millionth of the noise.
    """
    n_trials, n_elements = gain.shape
    record = rng.standard_normal((n_trials, n_elements, N_RECORD), dtype=np.float32)
    n_pulse = 400  # 20 ns, in which a pulse of 1 ns decay is over
    start = rng.integers(0, N_RECORD - n_pulse, n_trials)
    time_s = (np.arange(n_pulse) - rng.random((n_trials, 1))) / SAMPLE_RATE_HZ
    pulse = damped_pulse(time_s)
    pulse *= np.sqrt(rho / np.square(pulse).sum(axis=-1))[:, np.newaxis]
    index = start[:, np.newaxis] + np.arange(n_pulse)
    trial = np.arange(n_trials)[:, np.newaxis]
    for element in range(n_elements):
        record[trial, element, index] += (gain[:, element, np.newaxis] * pulse).astype(np.float32)
    return record


def draw_gates(
    manifold: GainManifold,
    positions_m: FloatArray,
    azimuth_rad: FloatArray,
    rho: ArrayLike,
    n_samples: int,
    rng: np.random.Generator,
    *,
    lead: int = 2,
) -> FloatArray:
    """Gates of plane waves on an array with size, in unit white noise.

    Args:
        manifold: True gains.
        positions_m: Where the elements are, shape (n_elements, 2); all zero for the paper's point.
        azimuth_rad: Directions of arrival, shape (n_trials,).
        rho: Energy over noise variance, broadcasts to (n_trials,).
        n_samples: Length of the gate.
        rng: All randomness.
        lead: Samples before the first element hears the pulse.

    Returns:
        Shape (n_trials, n_elements, n_samples).
    """
    ahead_m = positions_m @ np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad)])
    late_s = (ahead_m.max(axis=0) - ahead_m).T / SPEED_OF_LIGHT_MPS
    jitter = rng.random((azimuth_rad.size, 1, 1))
    time_s = (np.arange(n_samples) - lead - jitter) / SAMPLE_RATE_HZ - late_s[..., np.newaxis]
    amplitude = np.sqrt(np.broadcast_to(rho, azimuth_rad.shape) / unit_pulse_energy(SAMPLE_RATE_HZ))
    clean = manifold.gain(azimuth_rad).T[..., np.newaxis] * damped_pulse(time_s)
    noise = rng.standard_normal((azimuth_rad.size, manifold.n_elements, n_samples))
    return amplitude[:, np.newaxis, np.newaxis] * clean + noise


def ring_positions(radius_m: float) -> FloatArray:
    """Where the six elements of a ring are, shape (6, 2)."""
    boresights = GainManifold.ring(6).boresights_rad
    return radius_m * np.stack([np.cos(boresights), np.sin(boresights)], axis=-1)
