"""Strengths of a pulse in sub-bands: what its gate holds of each part of the receiver's band."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic.pulses.strengths import strength_variance

FloatArray = NDArray[np.float64]

FEWEST_LINES = 4
"""Frequencies at which the spectrum of a gate is taken in each sub-band at least."""


class SubBands:
    r"""Energies of gates in parts of a band.

    .. math:: E_b = x^T K_b x = \frac{2}{f_s} \int_{f_b}^{f_{b+1}} \lvert X(f) \rvert^2 df

    with X(f) the spectrum of the gate's samples. Over all frequencies up to half the sampling rate they add up to the
    energy of the gate. Sub-bands narrower than the sampling rate over the gate's length share their noise.

    Args:
        edges_hz: Rising, shape (n_bands + 1,).
        sample_rate_hz: Samples per second.
        n_samples: Length of a gate.
        correlation: Of the noise over the lags from 0 on, shape (n_lags,), 1 at lag 0 and 0 beyond; None for white.

    Attributes:
        lines: Cosines and sines whose products with a gate, squared and added up, are the energies; shape (n_bands,
            n_lines, n_samples).
    """

    def __init__(
        self, edges_hz: ArrayLike, sample_rate_hz: float, n_samples: int, correlation: FloatArray | None = None
    ) -> None:
        self.edges_hz, self.sample_rate_hz = np.array(edges_hz, dtype=np.float64), sample_rate_hz
        width_hz = np.diff(self.edges_hz)
        n_lines = max(FEWEST_LINES, int(np.ceil(4 * n_samples * width_hz.max() / sample_rate_hz)))
        at = (np.arange(n_lines) + 0.5) / n_lines
        frequency_hz = self.edges_hz[:-1, np.newaxis] + width_hz[:, np.newaxis] * at
        turn = 2 * np.pi * frequency_hz[..., np.newaxis] / sample_rate_hz * np.arange(n_samples)
        scale = np.sqrt(2 * width_hz / (n_lines * sample_rate_hz))[:, np.newaxis, np.newaxis]
        self.lines = np.ascontiguousarray(scale * np.concatenate([np.cos(turn), np.sin(turn)], axis=1))
        lags = np.zeros(n_samples)
        lags[: 1 if correlation is None else min(correlation.size, n_samples)] = (
            1.0 if correlation is None else correlation[:n_samples]
        )
        self._noise = lags[np.abs(np.arange(n_samples)[:, np.newaxis] - np.arange(n_samples))]

    @property
    def n_bands(self) -> int:
        """How many there are."""
        return self.edges_hz.size - 1

    @cached_property
    def _form(self) -> FloatArray:
        return np.einsum("bli,blj->bij", self.lines, self.lines)

    @cached_property
    def noise_samples(self) -> FloatArray:
        """Energy of noise in each band, over the variance of one sample, shape (n_bands,)."""
        return np.einsum("bij,ji->b", self._form, self._noise)

    @cached_property
    def energy_spread(self) -> FloatArray:
        """As of `strength_variance`, of each band, shape (n_bands,)."""
        product = self._form @ self._noise
        return np.einsum("bij,bji->b", product, product)

    def noise_on(self, pulse: ArrayLike) -> FloatArray:
        """As of `strength_variance`, of each band, for a pulse (n_samples,) of the usual shape; shape (n_bands,)."""
        in_band = self._form @ np.asarray(pulse, dtype=np.float64)
        energy = in_band @ np.asarray(pulse, dtype=np.float64)
        return np.einsum("bi,ij,bj->b", in_band, self._noise, in_band) / energy

    def strengths(self, waveforms: ArrayLike, noise_variance: ArrayLike) -> FloatArray:
        """Roots of the energies above those of the noise.

        Args:
            waveforms: The gates, shape (..., n_elements, n_samples), volts.
            noise_variance: Variance of one noise sample, V^2; broadcasts to (..., n_elements).

        Returns:
            Shape (..., n_bands, n_elements), volts.
        """
        spectrum = np.einsum("blk,...ek->...ble", self.lines, np.asarray(waveforms, dtype=np.float64))
        noise = self.noise_samples[:, np.newaxis] * np.asarray(noise_variance, dtype=np.float64)[..., np.newaxis, :]
        return np.sqrt(np.maximum(np.square(spectrum).sum(axis=-2) - noise, 0.0))

    def variance(self, strengths: FloatArray, noise_variance: ArrayLike, noise_on_pulse: ArrayLike = 1.0) -> FloatArray:
        """Variance of strengths (..., n_bands, n_elements), V^2; see `strength_variance`."""
        noise, spread = np.asarray(noise_variance, dtype=np.float64), self.energy_spread.tolist()
        on_pulse = np.broadcast_to(np.asarray(noise_on_pulse, dtype=np.float64), (self.n_bands,)).tolist()
        of_bands = [
            strength_variance(strengths[..., b, :], noise, 1, energy_spread=spread[b], noise_on_pulse=on_pulse[b])
            for b in range(self.n_bands)
        ]
        return np.stack(of_bands, axis=-2)
