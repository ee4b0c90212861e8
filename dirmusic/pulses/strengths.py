"""Triggers, gates, strengths and covariances of recorded pulses."""

from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.compiled import compiled, compiled_inner, elementwise

_Sample = TypeVar("_Sample", np.float32, np.float64)

TINY = float(np.finfo(np.float64).tiny)


@compiled
def dot(first: FloatArray, second: FloatArray) -> float:
    """Compute the scalar product of two vectors (n,), adding the terms in order."""
    total = 0.0
    for e in range(first.size):
        total += first[e] * second[e]
    return total


@elementwise
def strength_of(energy_v2: float, noise_energy_v2: float) -> float:
    """Compute the strength of a pulse from the energy of its gate and the expected energy of the noise."""
    return np.sqrt(max(energy_v2 - noise_energy_v2, 0.0))


@elementwise
def variance_of_strength(strength_v: float, noise_v2: float, energy_spread: float, noise_on_pulse: float) -> float:
    """Compute the variance of a strength; see `strength_variance`."""
    energy = max(strength_v * strength_v, np.sqrt(0.5 * energy_spread) * noise_v2, TINY)
    return noise_on_pulse * noise_v2 + 0.5 * energy_spread * noise_v2 * noise_v2 / energy


def pulse_start(records: ArrayLike, n_samples: int) -> IntArray:
    """Find the start of the gate of `n_samples` with the most energy summed over all channels.

    All channels share one gate: a separate gate for each channel would collect more noise where the pulse is weak.

    Args:
        records: Shape (..., n_elements, n_record), n_record >= n_samples.
        n_samples: Length of the gate. It must cover the pulse and its travel time across the array.

    Returns:
        First sample, shape (...).
    """
    x = np.asarray(records)
    power = np.einsum("...ik,...ik->...k", x, x)
    total = np.cumsum(power, axis=-1, dtype=np.float64)
    energy = total[..., n_samples - 1 :].copy()
    energy[..., 1:] -= total[..., :-n_samples]
    return energy.argmax(axis=-1)


@compiled_inner
def count_crossings(volts: FloatArray, first: int, end: int, limit_v: FloatArray, level_v: float) -> tuple[int, int]:
    """Search the samples from `first` up to `end` for those beyond the level.

    Returns:
        Index of the first such sample, or -1, and number of such samples in all channels.
    """
    crossing, n = -1, 0
    for e in range(limit_v.size):
        if limit_v[e] > level_v:
            channel_v = volts[e, first:end]
            for t in range(channel_v.size):
                if abs(channel_v[t]) > level_v:
                    n += 1
                    if crossing < 0 or first + t < crossing:
                        crossing = first + t
    return crossing, n


@compiled_inner
def gate_start(volts: FloatArray, crossing: int, n_peak: int, n_before: int, limit_v: FloatArray) -> tuple[int, int]:
    """Find the start of the gate: `n_before` samples ahead of where the strongest channel reaches half its peak.

    The trigger itself is not a suitable reference, because stronger pulses cross the level earlier.

    Args:
        volts: Samples, shape (n_elements, n_samples).
        crossing: Sample that triggered.
        n_peak: Number of samples from the trigger until after the peaks in all channels.
        n_before: Number of samples of the gate before the half peak.
        limit_v: Voltage at which each channel saturates, shape (n_elements,).

    Returns:
        The strongest channel, and the first sample of the gate.
    """
    strongest, peak_v = limit_v.size - 1, 0.0
    for t in range(crossing, crossing + n_peak):
        for e in range(limit_v.size):
            clipped_v = min(abs(volts[e, t]), limit_v[e])
            if clipped_v > peak_v:
                strongest, peak_v = e, clipped_v
    limit, half = limit_v[strongest], max(n_before, crossing - n_before)
    while min(abs(volts[strongest, half]), limit) < 0.5 * peak_v:
        half += 1
    return strongest, half - n_before


@compiled
def find_gates(volts: FloatArray, level_v: float, n_before: int, n_peak: int, n_gate: int) -> IntArray:
    """Find the gates of all pulses of a record.

    After a pulse, the next one can trigger once all channels have stayed below the level for the length of a gate, so
    that a decaying pulse is found once. A pulse whose gate the end of the record cuts off is not found.

    Args:
        volts: Samples, shape (n_elements, n_samples); the first `n_before` must not contain a pulse.
        level_v: Level that a sample must exceed.
        n_before: Number of samples of the gate before the half peak of the strongest channel.
        n_peak: Number of samples from the trigger until after the peaks in all channels.
        n_gate: Length of the gate.

    Returns:
        First samples of the gates, shape (n_pulses,).
    """
    n_elements, n_samples = volts.shape
    starts, n_pulses = np.empty(n_samples // n_gate + 1, np.intp), 0
    limit_v, at, is_quiet = np.full(n_elements, np.inf), 0, True
    while at < n_samples:
        end = min(at + n_gate, n_samples)
        crossing, _ = count_crossings(volts, at, end, limit_v, level_v)
        if crossing < 0:
            at, is_quiet = end, True
        elif not is_quiet:
            at = crossing + 1
        else:
            _, start = gate_start(volts, crossing, min(n_peak, n_samples - crossing), n_before, limit_v)
            shift = max(0, start + n_gate - n_samples)
            if shift <= min(n_before, start):
                starts[n_pulses] = start - shift
                n_pulses += 1
            at, is_quiet = max(start + n_gate, crossing + 1), False
    return starts[:n_pulses]


def cut_windows(records: NDArray[_Sample], start: IntArray, n_samples: int) -> NDArray[_Sample]:
    """Cut windows of `n_samples`, starting at `start` (...), out of records (..., n_elements, n_record)."""
    index = start[..., np.newaxis, np.newaxis] + np.arange(n_samples)
    return np.take_along_axis(records, np.broadcast_to(index, (*records.shape[:-1], n_samples)), axis=-1)


def sample_covariance(snapshots: ArrayLike) -> FloatArray:
    r"""Compute the average outer product of the snapshots.

    .. math:: R = X X^T / n

    Args:
        snapshots: Samples of the array, shape (..., n_elements, n_snapshots), volts.

    Returns:
        Strength covariance, shape (..., n_elements, n_elements), V^2.

    Raises:
        ValueError: If snapshots are missing or not finite.

    References:
        Dir-MUSIC, eq. (5).
    """
    x = np.asarray(snapshots, dtype=np.float64)
    if x.ndim < 2 or x.shape[-1] == 0:
        raise ValueError(f"`snapshots` must have shape (..., n_elements, n_snapshots >= 1), got {x.shape}")
    if not np.isfinite(x).all():
        raise ValueError("`snapshots` must be finite; drop the broken record or channel first")
    return x @ np.swapaxes(x, -1, -2) / x.shape[-1]


def pulse_strengths(waveforms: ArrayLike, noise_variance: ArrayLike) -> FloatArray:
    r"""Compute the strength of each gated pulse in each channel: the square root of its energy minus the noise energy.

    The strength does not depend on the delay of the pulse from element to element, as long as the gate covers it.

    .. math:: a_i = \sqrt{\max(\sum_k x_{ik}^2 - n \sigma_i^2, 0)}

    Args:
        waveforms: Samples of the gate, shape (..., n_elements, n_samples), volts.
        noise_variance: Variance of one noise sample, V^2, >= 0; broadcasts to (..., n_elements).

    Returns:
        Strengths, shape (..., n_elements), volts (root of a sum over samples, not a peak). NaN marks a dead channel:
        all its samples are zero although its noise variance is not, and other channels have a signal.

    Raises:
        ValueError: If a sample is not finite or a variance is negative.
    """
    x = np.asarray(waveforms, dtype=np.float64)
    variance = np.asarray(noise_variance, dtype=np.float64)
    if x.ndim < 2:
        raise ValueError(f"`waveforms` must have shape (..., n_elements, n_samples), got {x.shape}")
    if not np.all(variance >= 0):
        raise ValueError(f"`noise_variance` must be >= 0 V^2, got {noise_variance!r}")
    energy = np.einsum("...k,...k->...", x, x)
    if broken := broken_channels(np.isfinite(energy)):
        raise ValueError(
            f"`waveforms` must be finite, got NaN or infinity in channels {broken}; drop the broken records or "
            "channels first"
        )
    return strengths_of_energies(energy, x.shape[-1], variance)


def broken_channels(is_valid: BoolArray) -> str:
    """List the numbers, from 1, of the channels that have an invalid value; channels are on the last axis."""
    is_broken = ~is_valid.reshape(-1, is_valid.shape[-1]).all(axis=0)
    return ", ".join(map(str, np.flatnonzero(is_broken) + 1))


def strengths_of_energies(energy: FloatArray, n_samples: int, noise_variance: FloatArray) -> FloatArray:
    """Compute the strengths of `pulse_strengths` from the energies of the gates (sums of squared samples), V^2."""
    strengths = strength_of(energy, n_samples * noise_variance)
    silent = energy == 0.0
    if silent.any():  # a channel with noise has samples other than zero, however weak the pulse
        dead = silent & (noise_variance > 0) & ~silent.all(axis=-1, keepdims=True)
        strengths = np.where(dead, np.nan, strengths)
    return strengths


def strength_variance(
    strengths: ArrayLike,
    noise_variance: ArrayLike,
    n_samples: int,
    *,
    energy_spread: float | None = None,
    noise_on_pulse: float = 1.0,
) -> FloatArray:
    r"""Compute the variance of the strengths of `pulse_strengths`.

    If the noise has the correlation matrix :math:`C` over the gate, with eigenvalues :math:`\mu_k`, the energy of the
    gate has the variance :math:`2 \sigma^4 \sum_k \mu_k^2 + 4 \sigma^2 \kappa a^2`, where
    :math:`\kappa = d^T C d / d^T d` for the pulse d. Taking the square root divides this by :math:`4 a^2`. For white
    noise the sum is n and :math:`\kappa` is 1. Where the noise energy exceeds that of the pulse, the square root is not
    linear, and the variance approaches its value at :math:`a^2 = \sigma^2 \sqrt{\sum_k \mu_k^2 / 2}`.

    Args:
        strengths: Shape (..., n_elements), volts, >= 0.
        noise_variance: Variance of one noise sample, V^2; broadcasts to (..., n_elements).
        n_samples: Samples in the gate, >= 1.
        energy_spread: Sum of the squared eigenvalues; None for white noise.
        noise_on_pulse: The factor kappa.

    Returns:
        Variance, shape (..., n_elements), V^2.
    """
    spread = float(n_samples if energy_spread is None else energy_spread)
    strength, noise = (np.asarray(x, dtype=np.float64) for x in (strengths, noise_variance))
    return variance_of_strength(strength, noise, spread, noise_on_pulse)
