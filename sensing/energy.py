"""The exact law of a gate's energy in filtered noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def draw_energies(
    signals: FloatArray,
    signal: NDArray[np.intp],
    peak_v: FloatArray,
    noise_v: float,
    modes: tuple[FloatArray, FloatArray] | None,
    rng: np.random.Generator,
) -> FloatArray:
    r"""Energies of gates that hold a pulse and Gaussian noise, without drawing a sample.

    .. math:: E = \sigma^2 \sum_k \mu_k (z_k + d_k)^2, \quad z_k \sim N(0, 1)

    with the eigenvalues :math:`\mu_k` of the noise's correlation over the gate, and :math:`d_k` the pulse along the
    eigenvectors in units of their noise. In white noise all :math:`\mu_k` are 1, and that is a noncentral
    chi-square law. Modes left out hold next to no noise: they add its mean, and what the pulse has in them.

    Args:
        signals: Noise-free gates for a peak of 1 V, shape (n_signals, n_elements, n_samples); overlapping paths are one
            waveform.
        signal: Which of them each pulse is, shape (n_pulses,).
        peak_v: Peaks of the pulses, shape (n_pulses,), volts.
        noise_v: Standard deviation of one noise sample.
        modes: Eigenvalues, shape (n_modes,), that with those left out sum to n_samples, and eigenvectors of unit norm,
            shape (n_samples, n_modes); None for white noise.
        rng: All randomness.

    Returns:
        Sums of squares over the gate, shape (n_pulses, n_elements), V^2.
    """
    if modes is None:
        to_noise: FloatArray = np.square(signals).sum(axis=-1)[signal] * np.square(peak_v / noise_v)[:, np.newaxis]
        return noise_v**2 * rng.noncentral_chisquare(float(signals.shape[-1]), to_noise)
    eigenvalues, eigenvectors = modes
    along = np.einsum("set,tk->sek", signals, eigenvectors)
    rest = np.square(signals).sum(axis=-1) - np.square(along).sum(axis=-1)
    noise = rng.standard_normal((signal.size, *along.shape[1:]))
    noise *= noise_v * np.sqrt(eigenvalues)
    noise += peak_v[:, np.newaxis, np.newaxis] * along[signal]
    energy = np.einsum("nek,nek->ne", noise, noise)
    noise_left = noise_v**2 * (signals.shape[-1] - eigenvalues.sum())
    return energy + np.square(peak_v)[:, np.newaxis] * np.maximum(rest, 0.0)[signal] + noise_left
