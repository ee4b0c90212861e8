"""Simulated trials as in the paper, and the bearings that the methods find in them.

A record is one pulse in 10 000 samples of white noise. Only the energy of the pulse and the number of samples matter to
a covariance, so covariances are drawn from their exact law, the noncentral Wishart distribution. Whole records are
drawn only where the pulse has to be found first.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic import (
    Bearings,
    GainManifold,
    bearings_from_covariance,
    cut_windows,
    pulse_start,
    sample_covariance,
)
from dirmusic.angles import difference
from dirmusic.array.element_errors import ManifoldPrior
from dirmusic.bearing.gain_delay import SPEED_OF_LIGHT_MPS
from pdpatrol.sensing.nature.pulses import damped_pulse, unit_pulse_energy

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

SAMPLE_RATE_HZ = 20e9
N_RECORD = 10_000
"""0.5 us at 20 GS/s: with this many samples the protocol agrees with every simulated exhibit of the paper."""

UNIT_ENERGY_TO_NOISE = 28_070.0
"""rho at 0 dB: energy of the pulse in a channel of unit gain over the variance of a noise sample, six elements."""

GATE_SAMPLES = 60
"""3 ns: a pulse of 1 ns decay has 99.7 % of its energy in them."""

FOUND_GATE_SAMPLES = 80
"""A gate that is found in noisy data is a little longer, because it starts some samples early or late."""

GRID_DEG = np.arange(1, 361)
"""The paper's true directions and its search grid."""

SUCCESS_DEG = 2
"""Success is an error of at most this, on the grid. The paper writes "less than"; its numbers mean "at most"."""


def energy_to_noise(snr_db: ArrayLike) -> FloatArray:
    """Return rho for an SNR of the paper, six elements and records of any length."""
    return UNIT_ENERGY_TO_NOISE * 10.0 ** (np.asarray(snr_db, dtype=np.float64) / 10)


def energy_to_noise_of(gain: FloatArray, snr_db: float, n_record: int = N_RECORD) -> FloatArray:
    """Return rho by the paper's definition of SNR: one noise level, set by the mean square of the clean record.

    Args:
        gain: True gains of all elements, shape (n_trials, n_elements).
        snr_db: SNR of the record.
        n_record: Samples of the record.

    Returns:
        Shape (n_trials,).
    """
    return gain.shape[-1] * n_record * 10.0 ** (snr_db / 10) / np.square(gain).sum(axis=-1)


def draw_directions(n: int, rng: np.random.Generator) -> FloatArray:
    """Draw integer directions on the paper's grid, degrees."""
    return rng.integers(GRID_DEG[0], GRID_DEG[-1] + 1, n).astype(np.float64)


def wishart(n_trials: int, n_elements: int, degrees: int, rng: np.random.Generator) -> FloatArray:
    """Draw X X^T of unit white noise X (n_elements, degrees), shape (n_trials, n_elements, n_elements).

    References:
        Bartlett's decomposition; Anderson, "An Introduction to Multivariate Statistical Analysis", section 7.2.
    """
    lower = np.tril(rng.standard_normal((n_trials, n_elements, n_elements)), -1)
    diagonal = np.arange(n_elements)
    lower[:, diagonal, diagonal] = np.sqrt(rng.chisquare(degrees - diagonal, (n_trials, n_elements)))
    return lower @ np.swapaxes(lower, -1, -2)


def draw_covariances(signals: FloatArray, n_record: int, rng: np.random.Generator) -> FloatArray:
    r"""Draw sample covariances of records with some pulses at different times, in unit white noise.

    .. math:: n R = \sum_k y_k y_k^T + W, \quad y_k = s_k + n_k, \quad W \sim \text{Wishart}(n - n_\text{pulses})

    Args:
        signals: Gains times the root of each pulse's energy, shape (n_trials, n_elements, n_pulses).
        n_record: Samples of the record.
        rng: Source of randomness.

    Returns:
        Shape (n_trials, n_elements, n_elements).
    """
    n_trials, n_elements, n_pulses = signals.shape
    received = signals + rng.standard_normal(signals.shape)
    noise = wishart(n_trials, n_elements, n_record - n_pulses, rng)
    return (received @ np.swapaxes(received, -1, -2) + noise) / n_record


def draw_phase_covariances(steering: ComplexArray, rho: float, n_record: int, rng: np.random.Generator) -> ComplexArray:
    """Draw covariances of the analytic signals of an array whose elements differ in phase, not in gain.

    An analytic signal of n real samples has n / 2 independent complex ones.

    Args:
        steering: Response of each element, shape (n_trials, n_elements).
        rho: Energy of the pulse over the noise variance.
        n_record: Real samples of the record.
        rng: Source of randomness.

    Returns:
        Shape (n_trials, n_elements, n_elements), up to a factor.
    """
    n_trials, n_elements = steering.shape
    degrees = n_record // 2 - 1

    def complex_normal(*shape: int) -> ComplexArray:
        return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)

    received = np.sqrt(rho) * steering + complex_normal(n_trials, n_elements)
    lower = np.tril(complex_normal(n_trials, n_elements, n_elements), -1)
    diagonal = np.arange(n_elements)
    lower[:, diagonal, diagonal] = np.sqrt(rng.chisquare(2 * (degrees - diagonal), (n_trials, n_elements)))
    both = np.concatenate([received[..., np.newaxis], lower], axis=-1)
    return both @ np.conj(np.swapaxes(both, -1, -2))


def draw_records(gain: FloatArray, rho: FloatArray, rng: np.random.Generator) -> NDArray[np.float32]:
    """Draw whole records in unit white noise with one pulse each, which reaches all elements at one time.

    Args:
        gain: True gains, shape (n_trials, n_elements).
        rho: Energy of the pulse over the noise variance, shape (n_trials,).
        rng: Source of randomness.

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
    """Draw gates of plane waves on an array of real size, in unit white noise.

    Args:
        manifold: True gains.
        positions_m: Positions of the elements, shape (n_elements, 2); all zero for the paper's point.
        azimuth_rad: Directions of arrival, shape (n_trials,).
        rho: Energy over noise variance, broadcasts to (n_trials,).
        n_samples: Length of the gate.
        rng: Source of randomness.
        lead: Samples before the pulse reaches the first element.

    Returns:
        Shape (n_trials, n_elements, n_samples).
    """
    ahead_m = positions_m @ np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad)])
    delay_s = (ahead_m.max(axis=0) - ahead_m).T / SPEED_OF_LIGHT_MPS
    jitter = rng.random((azimuth_rad.size, 1, 1))
    time_s = (np.arange(n_samples) - lead - jitter) / SAMPLE_RATE_HZ - delay_s[..., np.newaxis]
    amplitude = np.sqrt(np.broadcast_to(rho, azimuth_rad.shape) / unit_pulse_energy(SAMPLE_RATE_HZ))
    clean = manifold.gain(azimuth_rad).T[..., np.newaxis] * damped_pulse(time_s)
    noise = rng.standard_normal((azimuth_rad.size, manifold.n_elements, n_samples))
    return amplitude[:, np.newaxis, np.newaxis] * clean + noise


def by_paper(covariance: FloatArray, gain: FloatArray) -> FloatArray:
    r"""Search eq. (15) as printed on the 1 degree grid; degrees, shape (n_trials,).

    With one source, the part of a gain in the noise subspace is its remainder after the eigenvector of the signal:
    :math:`\lVert E_n^T g \rVert^2 = \lVert g \rVert^2 - (e_s^T g)^2`, several times faster than `pseudo_spectrum`.

    Args:
        covariance: Shape (n_trials, n_elements, n_elements).
        gain: The clean manifold on the grid, shape (n_elements, 360). With one element no noise subspace is left, the
            spectrum is constant, and the first grid angle wins.
    """
    if gain.shape[0] == 1:
        return np.full(covariance.shape[0], GRID_DEG[0], dtype=np.float64)
    _, vectors = np.linalg.eigh(covariance)
    null = np.square(gain).sum(axis=0) - np.square(vectors[..., -1] @ gain)
    return GRID_DEG[null.argmin(axis=-1)].astype(np.float64)


def by_phase(covariance: ComplexArray, steering: ComplexArray) -> FloatArray:
    """Search MUSIC on the phase manifold `steering` (360, n_elements) on the grid; degrees, shape (n_trials,)."""
    _, vectors = np.linalg.eigh(covariance)
    projection = steering.conj() @ vectors[..., :-1]
    return GRID_DEG[np.square(np.abs(projection)).sum(axis=-1).argmin(axis=-1)].astype(np.float64)


def by_gate(records: NDArray[np.float32], manifold: GainManifold) -> FloatArray:
    """Find the gate in the data, then the maximum of the likelihood off the grid; degrees, shape (n_trials,)."""
    gate = cut_windows(records, pulse_start(records, FOUND_GATE_SAMPLES), FOUND_GATE_SAMPLES)
    return np.degrees(bearings_from_covariance(sample_covariance(gate), manifold).azimuth_rad)


def by_gated_covariance(covariance: FloatArray, manifold: GainManifold, prior: ManifoldPrior | None = None) -> Bearings:
    """Estimate by maximum likelihood, or by Bayes over the manifold, from covariances of gates in unit noise."""
    return bearings_from_covariance(covariance, manifold, n_snapshots=GATE_SAMPLES, noise_variance=1.0, prior=prior)


def error_deg(estimate_deg: FloatArray, true_deg: FloatArray) -> FloatArray:
    """Return the error in the shorter direction, degrees."""
    return np.degrees(difference(np.radians(estimate_deg), np.radians(true_deg)))


def is_success(errors_deg: FloatArray) -> NDArray[np.bool_]:
    """Score as the paper does: errors of estimates rounded to the grid, at most 2 degrees."""
    return np.abs(np.round(errors_deg)) <= SUCCESS_DEG
