"""Bearings from gains and delays together, for receivers with synchronous channels and a high sample rate."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic.angles import wrap
from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD, SEARCH_STEP_RAD, GainManifold
from dirmusic.pulses.batch import LEAST_SHARE, UNKNOWN_STD_RAD, Bearings

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

SPEED_OF_LIGHT_MPS = 299_792_458.0

MAX_RADIUS_M = 0.5
"""Largest radius: in a wider array, the phase at 3 GHz changes by more than 60 degrees per search step."""

TINY = np.finfo(np.float64).tiny

PULSES_AT_ONCE = 64
"""Pulses computed together, in about 20 MB for 100 samples."""


def bearings_from_delays(
    waveforms: ArrayLike,
    manifold: GainManifold,
    positions_m: ArrayLike,
    sample_rate_hz: float,
    *,
    noise_variance: ArrayLike | None = None,
) -> Bearings:
    r"""Estimate the direction of each pulse from its strengths and delays, by maximum likelihood.

    A plane wave of unknown waveform s gives element i the spectrum
    :math:`x_i(f) = g_i(\theta) e^{-2 \pi j f \tau_i(\theta)} s(f)` with
    :math:`\tau_i = -u(\theta)^T p_i / c`. The estimate explains most energy:

    .. math:: \hat\theta = \arg\max_\theta \sum_f
              \frac{|\sum_i g_i e^{2 \pi j f \tau_i} x_i(f)|^2}{\lVert g(\theta) \rVert^2}

    It needs channels sampled on one clock at more than twice the highest frequency, cables of equal delay, and
    positions of the elements known to a few millimetres; strengths alone need none of these. The wave must be plane:
    sources nearer than about ten radii cause a bias.

    Args:
        waveforms: Samples of the gate of each pulse, shape (..., n_elements, n_samples), volts; the gate must hold the
            pulse in every element.
        manifold: Nominal array.
        positions_m: Positions of the elements, array frame, shape (n_elements, >= 2), of which x and y are used;
            within `MAX_RADIUS_M` of the origin.
        sample_rate_hz: Sample rate of the waveforms.
        noise_variance: Variance of one noise sample, the same in all channels, V^2; broadcasts to (...).

    Returns:
        Bearings of the leading shape (...). The misfit includes the noise of the gate.

    Raises:
        ValueError: If shapes disagree, a sample is not finite, or the array is too wide.
    """
    x = np.asarray(waveforms, dtype=np.float64)
    place = np.asarray(positions_m, dtype=np.float64)
    n_elements = manifold.n_elements
    if x.ndim < 2 or x.shape[-2] != n_elements or place.ndim != 2 or place.shape[0] != n_elements or place.shape[1] < 2:
        raise ValueError(
            f"`waveforms` and `positions_m` must have shapes (..., {n_elements}, n_samples) and ({n_elements}, 2) to "
            f"match `manifold`, got {x.shape} and {place.shape}"
        )
    if not (np.isfinite(x).all() and np.isfinite(place).all()):
        raise ValueError("`waveforms` and `positions_m` must be finite; drop the broken record or channel first")
    radius_m = float(np.linalg.norm(place[:, :2], axis=-1).max())
    if radius_m > MAX_RADIUS_M:
        raise ValueError(f"`positions_m` must lie within {MAX_RADIUS_M} m of the array's origin, got {radius_m:.2f} m")
    if not sample_rate_hz > 0:
        raise ValueError(f"`sample_rate_hz` must be positive, got {sample_rate_hz!r}")
    shape = x.shape[:-2]
    rows = x.reshape(int(np.prod(shape)), *x.shape[-2:])
    array = _Array(manifold, place[:, :2], sample_rate_hz)
    n_padded = x.shape[-1] + int(np.ceil(2 * radius_m / SPEED_OF_LIGHT_MPS * sample_rate_hz))
    variance = np.nan if noise_variance is None else np.asarray(noise_variance, dtype=np.float64)
    variance = np.broadcast_to(variance, shape).reshape(-1)
    answer = np.empty((3, rows.shape[0]))
    for first in range(0, rows.shape[0], PULSES_AT_ONCE):
        some = slice(first, first + PULSES_AT_ONCE)
        answer[:, some] = _locate_on_circle(rows[some], array, n_padded, variance[some])
    has_signal = rows.any(axis=(-1, -2))
    azimuth, std, misfit = np.where(has_signal, answer, np.nan).reshape(3, *shape)
    return Bearings(azimuth_rad=wrap(azimuth), std_rad=std, misfit=misfit)


class _Array(NamedTuple):
    """Array with gains and delays."""

    manifold: GainManifold
    positions_m: FloatArray
    sample_rate_hz: float

    def steering(self, azimuth_rad: FloatArray, angular_frequency: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Compute the response (n_elements, n_azimuths, n_frequencies) to a unit wave and its slope per radian."""
        gain, slope = self.manifold.gain_and_slope(azimuth_rad)
        forward = np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad)])
        left = np.stack([-forward[1], forward[0]])
        delay, delay_slope = (-(self.positions_m @ way) / SPEED_OF_LIGHT_MPS for way in (forward, left))
        turn: ComplexArray = np.exp(-1j * delay[..., np.newaxis] * angular_frequency)
        by_delay = -1j * angular_frequency * (gain * delay_slope)[..., np.newaxis]
        by_azimuth: ComplexArray = slope[..., np.newaxis] + by_delay
        return gain[..., np.newaxis] * turn, by_azimuth * turn


def _locate_on_circle(rows: FloatArray, array: _Array, n_padded: int, variance: FloatArray) -> FloatArray:
    """Estimate azimuth, deviation and misfit, shape (3, n_rows)."""
    spectra = np.fft.rfft(rows, n_padded)[..., 1:]  # no antenna receives the mean
    angular = np.arange(1, n_padded // 2 + 1, dtype=np.float64) * (2 * np.pi * array.sample_rate_hz / n_padded)
    response, _ = array.steering(SEARCH_AZIMUTHS_RAD, angular)
    norm = np.linalg.norm(array.manifold.search_gain, axis=0)
    beam = np.conj(response / norm[:, np.newaxis]).transpose(2, 1, 0) @ spectra.transpose(2, 1, 0)
    match = np.square(np.abs(beam)).sum(axis=0)  # (n_azimuths, n_rows)
    azimuth_rad = start_rad = SEARCH_AZIMUTHS_RAD[match.argmax(axis=0)]
    data = spectra.transpose(1, 0, 2)
    for _ in range(5):  # Gauss-Newton steps
        azimuth_rad = azimuth_rad + np.nan_to_num(_linearise(azimuth_rad, data, array, angular)[0])
        azimuth_rad = np.clip(azimuth_rad, start_rad - SEARCH_STEP_RAD, start_rad + SEARCH_STEP_RAD)
    _, signal, turning = _linearise(azimuth_rad, data, array, angular)
    gain_energy = np.square(array.manifold.gain(azimuth_rad)).sum(axis=0)
    received = np.maximum(np.square(np.abs(data)).sum(axis=(0, -1)), TINY)
    # the estimated waveform contains noise, whose change with azimuth carries no information
    by_noise = rows.shape[-1] * variance * _turning_of_noise(azimuth_rad, array, angular)
    informative = np.maximum(turning - by_noise, LEAST_SHARE * turning)
    per_sample = 2.0 / n_padded  # from a sum over half the frequencies to one over samples, by Parseval
    std = np.sqrt(variance * turning / per_sample) / np.maximum(informative, TINY)
    return np.stack([azimuth_rad, np.minimum(std, UNKNOWN_STD_RAD), np.clip(1 - signal * gain_energy / received, 0, 1)])


def _linearise(
    azimuth_rad: FloatArray, data: ComplexArray, array: _Array, angular: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compute Gauss-Newton step, energy of the waveform, and energy of its change per radian; shapes (n_rows,)."""
    response, slope = array.steering(azimuth_rad, angular)
    energy = np.square(np.abs(response)).sum(axis=0)
    waveform = (response.conj() * data).sum(axis=0) / energy
    across = slope - response * ((response.conj() * slope).sum(axis=0) / energy)
    turning = across * waveform
    change = (turning.conj() * data).real.sum(axis=(0, -1))
    turning_energy = np.square(np.abs(turning)).sum(axis=(0, -1))
    step = change / np.maximum(turning_energy, TINY)
    return step, np.square(np.abs(waveform)).sum(axis=-1), turning_energy


def _turning_of_noise(azimuth_rad: FloatArray, array: _Array, angular: FloatArray) -> FloatArray:
    """Compute the energy of the change per radian of white noise of unit variance, shape (n_rows,)."""
    response, slope = array.steering(azimuth_rad, angular)
    energy = np.square(np.abs(response)).sum(axis=0)
    across = np.square(np.abs(slope)).sum(axis=0) - np.square(np.abs((response.conj() * slope).sum(axis=0))) / energy
    return (across / energy).sum(axis=-1)
