"""Clipped pulses: rails of the ADC found from repeated extreme samples, and strengths from the samples between them."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from dirmusic.arrays import BoolArray, FloatArray, IntArray

NEAR = 0.02
"""Samples within this fraction of the span below an extreme value are near it. A damped oscillation has about as many
samples near its extreme value as at it; an oscillation that is clipped by 2 % has 2.4 times as many at it. Assumed;
between 0.01 and 0.03, weaker clipping is found or missed, which changes a strength by less than 2 %."""

LEAST_EQUAL = 4
"""Number of samples at an extreme value below which it is not a rail, unless it is full scale. Assumed; fewer change a
strength by a few percent, and the crests of three similar pulses may agree by chance."""

LEAST_REFERENCE = 10.0
"""Strength of the channel that gives the shape of a pulse, in standard deviations of a noise sample, below which the
other channels are not restored. Assumed."""

SHAPE_STD = 0.08
"""Relative standard deviation of a restored strength because pulses are sampled at other phases in other channels.
Simulated with damped oscillations of ten samples per period whose peak is five times the rail, where it is 0.07; less
clipping gives less."""


class Extremes(NamedTuple):
    """Extreme samples of a record, first the lowest and then the highest, each of shape (2, n_channels).

    Attributes:
        volts: Voltage of the extreme samples.
        n_equal: Number of samples that are equal to them.
        n_near: Number of other samples near them.
        is_full_scale: True where they are a limit of a binary number, such as -128 or 127.
        near_v: How far below an extreme value a sample is near it, shape (n_channels,).
        step_v: Resolution: smallest difference between samples, same shape.
        volts_per_count: Scale of the channels, same shape.
    """

    volts: FloatArray
    n_equal: FloatArray
    n_near: FloatArray
    is_full_scale: BoolArray
    near_v: FloatArray
    step_v: FloatArray
    volts_per_count: FloatArray

    @classmethod
    def of(cls, samples: NDArray[Any], volts_per_count: FloatArray) -> Self:
        """Find the extreme samples of a record (n_pulses, n_channels, n_samples)."""
        by_channel = np.moveaxis(samples, 1, 0).reshape(samples.shape[1], -1)
        ends = np.array([by_channel.min(axis=1), by_channel.max(axis=1)])
        steps = _steps(by_channel)
        near = np.maximum(NEAR * np.subtract(ends[1], ends[0], dtype=np.float64), 3.0 * steps)
        n_equal, n_near = np.zeros(ends.shape), np.zeros(ends.shape)
        for side, channel in np.ndindex(ends.shape):
            below = np.abs(np.subtract(by_channel[channel], ends[side, channel], dtype=np.float64))
            n_equal[side, channel] = np.count_nonzero(below == 0.0)
            n_near[side, channel] = np.count_nonzero(below <= near[channel]) - n_equal[side, channel]
        is_full_scale = np.zeros(ends.shape, dtype=np.bool_)
        if samples.dtype.kind in "iu":
            low, high = ends.astype(np.int64)
            powers = 2 ** np.arange(7, 16)  # ADCs of 8 to 16 bits
            if samples.dtype.kind == "i":
                is_full_scale = np.array([np.isin(-low, powers), np.isin(high + 1, powers)])
            else:
                is_full_scale = np.array([low == 0, np.isin(high + 1, 2 * powers)])
        of_channels = near * volts_per_count, steps * volts_per_count, volts_per_count
        return cls(ends * volts_per_count, n_equal, n_near, is_full_scale, *of_channels)

    @staticmethod
    def rails(of_records: Sequence["Extremes"]) -> list[BoolArray]:
        """Find which extreme values are rails of the ADC: those that many samples reach, and few approach.

        Records whose channel has the same scale are pooled, so that a rail that each pulse touches once is found; no
        record can exceed it.

        Returns:
            True for each extreme value that is a rail, shape (2, n_channels), for each record.
        """
        columns: list[NDArray[Any]] = [np.array(column) for column in zip(*of_records, strict=True)]
        volts, n_equal, n_near, is_rail, near_v, _, scale = columns
        is_rail |= (n_equal >= LEAST_EQUAL) & (n_equal >= 2 * n_near)
        for side, channel in np.ndindex(volts.shape[1:]):
            outward = np.array(volts[:, side, channel] * (-1.0, 1.0)[side], dtype=np.float64)
            for of_scale in np.unique(scale[:, channel]).tolist():
                alike: IntArray = np.flatnonzero(scale[:, channel] == of_scale)
                below = float(outward[alike].max()) - outward[alike]
                reach, approach = alike[below == 0], (below > 0) & (below <= near_v[alike, channel])
                equal, near = n_equal[reach, side, channel].sum(), n_near[reach, side, channel].sum() + approach.sum()
                is_rail[reach, side, channel] |= equal >= max(LEAST_EQUAL, 2 * near)
        return list(is_rail & (volts[:, :1] < volts[:, 1:]))


def _steps(by_channel: NDArray[Any]) -> FloatArray:
    """Return the smallest difference between the samples of each channel (n_channels, n), from at most 1e5 of them."""
    steps = np.zeros(len(by_channel))
    for channel, samples in enumerate(by_channel):
        values = np.unique(samples[:: samples.size // 100_000 + 1]).astype(np.float64)
        steps[channel] = np.diff(values).min(initial=np.ptp(values))
    return steps


def restored_strengths(
    gate_v: FloatArray, low_v: FloatArray, high_v: FloatArray, noise_v2: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """Estimate the strengths of a pulse that is clipped in some channels.

    The strongest channel that is not clipped gives the shape of the pulse, with its noise attenuated as by a Wiener
    filter. The energy of a clipped channel then grows with its strength in a known way, whatever its delay.

    Args:
        gate_v: Samples of the gate, shape (n_channels, n_samples).
        low_v: Lower rail of each channel, shape (n_channels,); -inf where the pulse does not reach it.
        high_v: Upper rail; inf where the pulse does not reach it.
        noise_v2: Variance of a noise sample, shape (n_channels,).

    Returns:
        Strengths and the variances that clipping adds to them, shape (n_channels,); None if no channel shows the shape,
        or a channel is clipped too far.
    """
    n, energy_v2 = gate_v.shape[1], np.square(gate_v).sum(axis=1)
    strengths_v = np.sqrt(np.maximum(energy_v2 - n * noise_v2, 0.0))
    is_clipped, added_v2 = np.isfinite(low_v) | np.isfinite(high_v), np.zeros(len(gate_v))
    over_noise = np.where(is_clipped, 0.0, strengths_v / np.sqrt(noise_v2))
    reference = int(over_noise.argmax())
    if over_noise[reference] < LEAST_REFERENCE:
        return None
    power_v2 = uniform_filter1d(np.square(gate_v[reference]), max(3, n // 10), mode="constant")
    shape = gate_v[reference] * np.maximum(1.0 - noise_v2[reference] / np.maximum(power_v2, 1e-300), 0.0)
    shape /= np.sqrt(np.square(shape).sum())
    for channel in np.flatnonzero(is_clipped & (strengths_v > 0.0)):  # without, rails are steps within the noise
        strength_v = strengths_v[channel] * np.geomspace(0.9, 100.0, 500)
        wave_v = strength_v[:, np.newaxis] * shape
        clipped_v = np.clip(wave_v, low_v[channel], high_v[channel])
        is_free = clipped_v == wave_v
        expected_v2 = (np.square(clipped_v) + noise_v2[channel] * is_free).sum(axis=1)
        at = int(np.searchsorted(expected_v2, float(energy_v2[channel])))
        if at == strength_v.size:
            return None
        strengths_v[channel] = strength_v[at]
        slope_v = 2.0 * (np.square(wave_v[at]) * is_free[at]).sum() / strength_v[at]
        error_v4 = noise_v2[channel] * (4.0 * np.square(clipped_v[at] * is_free[at]).sum() + 2 * n * noise_v2[channel])
        relative2 = SHAPE_STD**2 + 1.0 / over_noise[reference] ** 2
        added_v2[channel] = error_v4 / max(slope_v, 1e-300) ** 2 + relative2 * strength_v[at] ** 2
    return strengths_v, added_v2
