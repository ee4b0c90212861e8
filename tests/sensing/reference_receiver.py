"""Independent receiver in NumPy and SciPy that samples a whole emission, starting long before its first arrival.

It shares no code with the product: waveform, filter, trigger level, gate and burst test are written out here again.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.signal import butter, sosfilt
from scipy.stats import norm

from dirmusic.arrays import FloatArray

RATE_HZ, BAND_HZ, NOISE_V, FULL_SCALE_V, BITS = 20e9, (1.4e9, 2.2e9), 1e-3, 0.5, 12
BEFORE, GATE = 20, 90
"""Default receiver."""

SETTLING = 400
"""Samples after which the initial state of the filter has no effect."""

SECTIONS = butter(6, BAND_HZ, btype="bandpass", fs=RATE_HZ, output="sos")


class Sampled(NamedTuple):
    """Gates after the ADC, shape (n, n_elements, n_gate), and number of emissions rejected as bursts."""

    gates_v: FloatArray
    n_bursts: int


def wave(time_s: FloatArray) -> NDArray[np.complex128]:
    """Return the pulse of eq. (2) of the Dir-MUSIC paper as the real part of a rotating phasor."""
    envelope = np.exp(-time_s / 1e-9) - np.exp(-time_s / 0.2e-9)
    return -1j * envelope * np.exp(2j * np.pi * 1.75e9 * time_s)


PEAK = np.abs(wave(np.arange(0, 5e-9, 1e-13)).real).max()


def damped_sine(time_s: FloatArray) -> NDArray[np.complex128]:
    """Return the pulse with a largest real part of 1; beyond 40 ns it is below 1e-17."""
    pulse = np.zeros(time_s.shape, dtype=np.complex128)
    is_within = (time_s > 0) & (time_s < 40e-9)
    pulse[is_within] = wave(time_s[is_within]) / PEAK
    return pulse


@cache
def filtered_noise() -> tuple[float, float]:
    """Return standard deviation and lag-one correlation of the noise after the filter."""
    h = np.asarray(sosfilt(SECTIONS, np.eye(1, 20_000)[0]))
    return NOISE_V * float(np.sqrt(h @ h)), float(h[1:] @ h[:-1] / (h @ h))


@cache
def threshold_v(false_alarm_rate_hz: float, n_elements: int = 6) -> float:
    """Return the level that noise crosses at a rate, by integrating over the sample above the level."""
    std_v, correlation = filtered_noise()

    def log_excess(level: float) -> float:
        def crossing(x: float) -> float:
            return float(norm.pdf(x) * norm.cdf((level - correlation * x) / np.sqrt(1 - correlation**2)))

        per_sample = 2 * quad(crossing, level, level + 8.0, epsabs=0.0)[0]
        return float(np.log(per_sample * n_elements * RATE_HZ / false_alarm_rate_hz))

    return std_v * float(brentq(log_excess, 2.0, 12.0))  # pyright: ignore[reportArgumentType]


def step_v() -> float:
    """Return the voltage of one count of the ADC."""
    return FULL_SCALE_V / (2 ** (BITS - 1) - 1)


def noise_variance_v2() -> float:
    """Return the variance of a sample after the ADC without a pulse."""
    return filtered_noise()[0] ** 2 + step_v() ** 2 / 12


def signal(delay_s: FloatArray, amplitude: NDArray[np.complex128], peak_v: float, time_s: FloatArray) -> FloatArray:
    """Return the sum of all paths at the elements, before the filter, shape (n_elements, n_samples)."""
    pulse = damped_sine(time_s - delay_s[:, :, np.newaxis])
    return peak_v * (amplitude[:, :, np.newaxis] * pulse).sum(axis=0).real


def sample(
    delay_s: FloatArray,
    amplitude: NDArray[np.complex128],
    peak_v: float,
    aperture_m: float,
    false_alarm_rate_hz: float,
    n: int,
    rng: np.random.Generator,
) -> Sampled:
    """Sample an emission n times.

    Args:
        delay_s: Travel times, shape (n_paths, n_elements).
        amplitude: Complex amplitudes for a pulse of 1 V at 1 m, same shape.
        peak_v: Peak of the emission at 1 m.
        aperture_m: Extent of the array.
        false_alarm_rate_hz: Setting of the trigger.
        n: Number of emissions.
        rng: Generator.
    """
    level_v, decay, echo = threshold_v(false_alarm_rate_hz), 40, 1200
    aperture = round(aperture_m / 299_792_458 * RATE_HZ)
    pulse = np.abs(np.asarray(sosfilt(SECTIONS, damped_sine(np.arange(1000) / RATE_HZ).real)))
    rise = round(float(np.argmax(pulse >= 0.5 * pulse.max()))) + decay
    strongest_s = np.take_along_axis(delay_s, np.abs(amplitude).argmax(axis=1)[:, np.newaxis], axis=1)[:, 0]
    first_s = delay_s.min() - (SETTLING + aperture + BEFORE) / RATE_HZ
    n_samples = int(np.ptp(delay_s) * RATE_HZ) + SETTLING + 4 * echo + 1000
    gates, n_bursts = list[FloatArray](), 0
    for _ in range(n):
        start_s = first_s + rng.random() / RATE_HZ
        clean = signal(delay_s, amplitude, peak_v, start_s + np.arange(n_samples) / RATE_HZ)
        volts = np.asarray(sosfilt(SECTIONS, clean + NOISE_V * rng.standard_normal(clean.shape)))
        searched = np.zeros(n_samples, dtype=np.bool_)
        for arrival_s in strongest_s:
            at = round((arrival_s - start_s) * RATE_HZ)
            searched[at - aperture : at + aperture + rise] = True
        above = searched & (np.abs(volts) > level_v).any(axis=0)
        if not above.any():
            continue
        crossing = int(above.argmax())
        level = np.abs(volts[:, crossing : crossing + aperture + decay])
        strongest = int(level.max(axis=1).argmax())
        back = crossing - BEFORE
        start = back + int((np.abs(volts[strongest, back:]) >= 0.5 * level.max()).argmax()) - BEFORE
        gate, background = volts[:, start : start + GATE], noise_variance_v2()
        least = 0.15 * (np.square(gate[strongest]).mean() - background) + background
        after = [start + echo + w * ((2 * echo - GATE) // 3) for w in range(4)]
        if min(np.square(volts[strongest, at : at + GATE // 2]).mean() for at in after) > least:
            n_bursts += 1
            continue
        highest = 2 ** (BITS - 1) - 1
        gates.append(np.clip(np.round(gate / step_v()), -highest, highest) * step_v())
    return Sampled(np.array(gates).reshape(-1, delay_s.shape[1], GATE), n_bursts)
