"""Bearings from gains and delays together, for receivers with synchronous channels and a high sample rate."""

from __future__ import annotations

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
    n_padded = x.shape[-1] + int(np.ceil(2 * radius_m / SPEED_OF_LIGHT_MPS * sample_rate_hz))
    variance = np.broadcast_to(np.nan if noise_variance is None else noise_variance, x.shape[:-2]).ravel()
    rows = x.reshape(variance.size, *x.shape[-2:])
    answer = np.empty((3, variance.size))
    for first in range(0, variance.size, 64):  # in about 20 MB for 100 samples
        some = slice(first, first + 64)
        answer[:, some] = _locate_on_circle(
            rows[some], variance[some], manifold, place[:, :2] / SPEED_OF_LIGHT_MPS, sample_rate_hz, n_padded
        )
    azimuth, std, misfit = np.where(rows.any(axis=(-1, -2)), answer, np.nan).reshape(3, *x.shape[:-2])
    return Bearings(azimuth_rad=wrap(azimuth), std_rad=std, misfit=misfit)


def _locate_on_circle(
    rows: FloatArray,
    variance: FloatArray,
    manifold: GainManifold,
    places_s: FloatArray,
    sample_rate_hz: float,
    n_padded: int,
) -> FloatArray:
    """Estimate azimuth, deviation and misfit, shape (3, n_rows); the places are in seconds of travel."""
    angular = np.arange(1, n_padded // 2 + 1) * (2 * np.pi * sample_rate_hz / n_padded)
    data = np.fft.rfft(rows, n_padded)[..., 1:].transpose(1, 0, 2)  # no antenna receives the mean

    def steering(azimuth_rad: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Compute the response (n_elements, n_azimuths, n_frequencies) to a unit wave and its slope per radian."""
        gain, slope = manifold.gain_and_slope(azimuth_rad)
        cos, sin = np.cos(azimuth_rad), np.sin(azimuth_rad)
        delay, delay_slope = -(places_s @ np.stack([cos, sin])), -(places_s @ np.stack([-sin, cos]))
        turn: ComplexArray = np.exp(-1j * delay[..., np.newaxis] * angular)
        by_azimuth: ComplexArray = slope[..., np.newaxis] - 1j * angular * (gain * delay_slope)[..., np.newaxis]
        return gain[..., np.newaxis] * turn, by_azimuth * turn

    def linearise(azimuth_rad: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Compute the Gauss-Newton step, and energies: of the waveform, of its change per radian, of that of noise."""
        response, slope = steering(azimuth_rad)
        energy = _energy(response)
        waveform = (response.conj() * data).sum(axis=0) / energy
        along = (response.conj() * slope).sum(axis=0) / energy
        turning = (slope - response * along) * waveform
        turning_energy = _energy(turning).sum(axis=-1)
        step = (turning.conj() * data).real.sum(axis=(0, -1)) / np.maximum(turning_energy, TINY)
        turning_of_noise = ((_energy(slope) - energy * np.square(np.abs(along))) / energy).sum(axis=-1)
        return np.nan_to_num(step), np.square(np.abs(waveform)).sum(axis=-1), turning_energy, turning_of_noise

    response, _ = steering(SEARCH_AZIMUTHS_RAD)
    beam = np.conj(response / np.linalg.norm(manifold.search_gain, axis=0)[:, np.newaxis]).transpose(2, 1, 0)
    match = np.square(np.abs(beam @ data.transpose(2, 0, 1))).sum(axis=0)  # (n_azimuths, n_rows)
    azimuth_rad = start_rad = SEARCH_AZIMUTHS_RAD[match.argmax(axis=0)]
    for _ in range(5):
        step_rad, _, _, _ = linearise(azimuth_rad)
        azimuth_rad = np.clip(azimuth_rad + step_rad, start_rad - SEARCH_STEP_RAD, start_rad + SEARCH_STEP_RAD)
    _, signal, turning, turning_of_noise = linearise(azimuth_rad)
    # the estimated waveform contains noise, whose change with azimuth carries no information
    informative = np.maximum(turning - rows.shape[-1] * variance * turning_of_noise, LEAST_SHARE * turning)
    per_sample = 2.0 / n_padded  # from a sum over half the frequencies to one over samples, by Parseval
    std = np.sqrt(variance * turning / per_sample) / np.maximum(informative, TINY)
    explained = signal * np.square(manifold.gain(azimuth_rad)).sum(axis=0)
    received = np.maximum(_energy(data).sum(axis=-1), TINY)
    return np.stack([azimuth_rad, np.minimum(std, UNKNOWN_STD_RAD), np.clip(1 - explained / received, 0, 1)])


def _energy(of_elements: ComplexArray) -> FloatArray:
    """Sum the squared magnitudes over the elements, the first axis."""
    return np.square(np.abs(of_elements)).sum(axis=0)
