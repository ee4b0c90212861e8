"""Simulated trials as in the paper, and the bearings that the methods estimate from them.

A record is one pulse in 10 000 samples of white noise. A covariance depends only on the energy of the pulse and the
number of samples, so covariances are drawn from their exact distribution, the noncentral Wishart distribution. Full
records are drawn only where the pulse has to be found first.
"""

from collections.abc import Callable
from dataclasses import dataclass
from threading import Event
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic import GainManifold, bearings_from_covariance, cut_windows, pulse_start, sample_covariance
from dirmusic.angles import difference
from dirmusic.arrays import FloatArray, IntArray
from pdpatrol.sensing.nature.pulses import damped_pulse

SAMPLE_RATE_HZ = 20e9
N_RECORD = 10_000
"""Samples of a record, 0.5 us at 20 GS/s. With this number the results agree with every simulated exhibit of the paper.
"""

FOUND_GATE_SAMPLES = 80
"""Samples of a gate that is found in the data, 4 ns. A pulse with a decay time of 1 ns has 99.7 % of its energy in 60
samples; the rest allows for a gate that starts early or late because of noise."""

GRID_DEG = np.arange(1, 361)
"""True directions and search grid of the paper."""


@dataclass(frozen=True)
class Trials:
    """Number and seed of the trials for each cell of an exhibit.

    Attributes:
        n: Number of trials for each cell, >= 1.
        seed: Seed. Each cell has a separate random generator, so that cells do not depend on each other.
        cancelled: Event that another thread sets to end the trials.
        advance: Called with the share of a cell of which trials are finished.
    """

    n: int
    seed: int
    cancelled: Event
    advance: Callable[[float], None]

    def rng(self, exhibit: int, cell: int) -> np.random.Generator:
        """Return the random generator of one cell."""
        return np.random.default_rng([self.seed, exhibit, cell])

    def collect(
        self, exhibit: int, cell: int, draw: Callable[[int, np.random.Generator], tuple[FloatArray, ...]]
    ) -> list[FloatArray]:
        """Call `draw` for chunks of trials with the generator of a cell, and concatenate each array that it returns.

        Raises:
            InterruptedError: If the trials are cancelled.
        """
        rng, parts, chunk = self.rng(exhibit, cell), list[tuple[FloatArray, ...]](), 200
        for first in range(0, self.n, chunk):  # chunks limit the memory; their size affects the draws
            if self.cancelled.is_set():
                raise InterruptedError
            n = min(chunk, self.n - first)
            parts.append(draw(n, rng))
            self.advance(n / self.n)
        return [np.concatenate(arrays) for arrays in zip(*parts, strict=True)]


def energy_to_noise(gain: FloatArray, snr_db: float, n_record: int = N_RECORD) -> FloatArray:
    """Return rho, the energy of the pulse in a unit-gain channel divided by the variance of a noise sample.

    In the paper's definition of SNR, all channels have the same noise level, which is relative to the mean square of
    the clean record. With six elements and full records, rho is 28 070 times 10^(SNR / 10) in all directions.

    Args:
        gain: True gains of all elements, shape (n_trials, n_elements).
        snr_db: SNR of the record.
        n_record: Number of samples of the record.

    Returns:
        Shape (n_trials,).
    """
    return gain.shape[-1] * n_record * 10.0 ** (snr_db / 10) / np.square(gain).sum(axis=-1)


def wishart(
    n_trials: int, n_elements: int, degrees: int, rng: np.random.Generator, *, is_complex: bool = False
) -> NDArray[Any]:
    """Draw X X^H of unit white noise X (n_elements, degrees), shape (n_trials, n_elements, n_elements).

    References:
        Bartlett's decomposition; Anderson, "An Introduction to Multivariate Statistical Analysis", section 7.2;
        Goodman 1963, Annals of Mathematical Statistics 34, for complex noise, whose real and imaginary parts have unit
        variance here.
    """
    lower = np.tril(_white((n_trials, n_elements, n_elements), rng, is_complex=is_complex), -1)
    diagonal = np.arange(n_elements)
    chi2 = rng.chisquare((1 + is_complex) * (degrees - diagonal), (n_trials, n_elements))
    lower[:, diagonal, diagonal] = np.sqrt(chi2)
    return lower @ np.conj(np.swapaxes(lower, -1, -2))


def draw_covariances(signals: NDArray[Any], n_record: int, rng: np.random.Generator) -> NDArray[Any]:
    r"""Draw sample covariances of records with one or more pulses at different times, in unit white noise.

    .. math:: n R = \sum_k y_k y_k^H + W, \quad y_k = s_k + n_k, \quad W \sim \text{Wishart}(n - n_\text{pulses})

    Args:
        signals: Gains times the square root of each pulse's energy, shape (n_trials, n_elements, n_pulses); complex for
            analytic signals.
        n_record: Number of independent samples of the record; an analytic signal has half as many as the record.
        rng: Random generator.

    Returns:
        Shape (n_trials, n_elements, n_elements).
    """
    n_trials, n_elements, n_pulses = signals.shape
    is_complex = np.iscomplexobj(signals)
    received = signals + _white(signals.shape, rng, is_complex=is_complex)
    noise = wishart(n_trials, n_elements, n_record - n_pulses, rng, is_complex=is_complex)
    return (received @ np.conj(np.swapaxes(received, -1, -2)) + noise) / n_record


def _white(shape: tuple[int, ...], rng: np.random.Generator, *, is_complex: bool) -> NDArray[Any]:
    """Draw white noise of unit variance in each real component."""
    return rng.standard_normal(shape) + (1j * rng.standard_normal(shape) if is_complex else 0.0)


def draw_records(gain: FloatArray, rho: FloatArray, rng: np.random.Generator) -> NDArray[np.float32]:
    """Draw full records of unit white noise with one pulse each, which reaches all elements at the same time.

    Args:
        gain: True gains, shape (n_trials, n_elements).
        rho: Energy of the pulse divided by the noise variance, shape (n_trials,).
        rng: Random generator.

    Returns:
        Shape (n_trials, n_elements, N_RECORD), in single precision: rounding errors are 1e-7 of the noise.
    """
    n_trials, n_elements = gain.shape
    record = rng.standard_normal((n_trials, n_elements, N_RECORD), dtype=np.float32)
    n_pulse = 400  # 20 ns, after which a pulse with a decay time of 1 ns has ended
    start = rng.integers(0, N_RECORD - n_pulse, n_trials)
    time_s = (np.arange(n_pulse) - rng.random((n_trials, 1))) / SAMPLE_RATE_HZ
    pulse = damped_pulse(time_s)
    pulse *= np.sqrt(rho / np.square(pulse).sum(axis=-1))[:, np.newaxis]
    index = start[:, np.newaxis] + np.arange(n_pulse)
    received = pulse[..., np.newaxis] * gain[:, np.newaxis, :]
    record[np.arange(n_trials)[:, np.newaxis], :, index] += received.astype(np.float32)
    return record


def by_paper(covariance: NDArray[Any], gain: NDArray[Any]) -> IntArray:
    r"""Find the peak of the paper's eq. (15), as printed, on the 1 degree grid; degrees, shape (n_trials,).

    With one source, the projection of a gain vector onto the noise subspace follows from the signal eigenvector:
    :math:`\lVert E_n^H g \rVert^2 = \lVert g \rVert^2 - |e_s^H g|^2`, which is several times faster to compute than
    `pseudo_spectrum`.

    Args:
        covariance: Shape (n_trials, n_elements, n_elements).
        gain: Ideal manifold on the grid, shape (n_elements, 360); complex for a manifold of phases. With one element
            the noise subspace is empty, so the spectrum is constant and the first grid angle is returned.
    """
    _, vectors = np.linalg.eigh(covariance)
    signal = np.square(np.abs(np.conj(vectors[..., -1]) @ gain))
    null = np.square(np.abs(gain)).sum(axis=0) - signal
    return GRID_DEG[null.argmin(axis=-1)]


def by_gate(records: NDArray[np.float32], manifold: GainManifold) -> FloatArray:
    """Find the gate in each record and maximise the likelihood without a grid; degrees, shape (n_trials,)."""
    gate = cut_windows(records, pulse_start(records, FOUND_GATE_SAMPLES), FOUND_GATE_SAMPLES)
    return np.degrees(bearings_from_covariance(sample_covariance(gate), manifold).azimuth_rad)


def error_deg(estimate_deg: ArrayLike, true_deg: ArrayLike) -> FloatArray:
    """Return the estimate minus the true direction, in (-180, 180] degrees."""
    return np.degrees(difference(np.radians(estimate_deg), np.radians(true_deg)))
