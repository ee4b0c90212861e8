"""Preprocessing of raw records: band-pass, window around the pulse, common scale."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import numpy as np
import scipy  # its submodules are loaded when they are first used
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
_Sample = TypeVar("_Sample", np.float32, np.float64)

PAPER_BAND_HZ = (1.2e9, 2.3e9)
"""Assumed; contains the 1.5 to 2 GHz of the paper's pulses and excludes its interferer at 948 MHz."""


class Windows(NamedTuple):
    """Windows cut out of records around the pulses.

    Attributes:
        waveforms: Shape (..., n_elements, n_samples), scaled to [-1, 1] by one factor for all channels of a record.
        start: First sample of each window in its record, shape (...).
        scale_v: Voltage of the value 1, shape (...).
    """

    waveforms: FloatArray
    start: NDArray[np.intp]
    scale_v: FloatArray


def prepare_records(
    records: ArrayLike,
    sample_rate_hz: float,
    *,
    n_samples: int = 90,
    band_hz: tuple[float, float] | None = PAPER_BAND_HZ,
) -> Windows:
    """Filter records, cut the pulse out, and scale it to [-1, 1].

    The scale is common to all channels, so that the ratios of the strengths, which carry the direction, are kept.

    Args:
        records: Shape (..., n_elements, n_record), volts.
        sample_rate_hz: Sample rate of the records.
        n_samples: Length of the window. It must hold the pulse and its travel across the array: at 20 GS/s, 60 samples
            for the pulse and 13 for every 0.1 m of ring radius.
        band_hz: Corner frequencies of a Butterworth filter run forward and backward; None for no filter. The energy of
            filtered noise in a window varies more than that of white noise of the same variance.

    Returns:
        The windows.

    Raises:
        ValueError: If a record is not finite or shorter than the window, or the band does not fit below Nyquist.

    References:
        Dir-MUSIC, fig. 13.
    """
    x = np.asarray(records, dtype=np.float64)
    if x.ndim < 2 or not 1 <= n_samples <= x.shape[-1]:
        raise ValueError(f"`records` must have shape (..., n_elements, n_record >= {n_samples}), got {x.shape}")
    if not np.isfinite(x).all():
        raise ValueError("`records` must be finite; drop the broken record or channel first")
    if band_hz is not None:
        x = band_pass(x, sample_rate_hz, band_hz)
    start = pulse_start(x, n_samples)
    window = cut_windows(x, start, n_samples)
    scale_v = np.abs(window).max(axis=(-1, -2))
    scaled = window / np.where(scale_v > 0, scale_v, 1.0)[..., np.newaxis, np.newaxis]
    return Windows(scaled, start, scale_v)


def cut_windows(records: NDArray[_Sample], start: NDArray[np.intp], n_samples: int) -> NDArray[_Sample]:
    """Cut windows of `n_samples` from `start` (...) out of records (..., n_elements, n_record)."""
    index = start[..., np.newaxis, np.newaxis] + np.arange(n_samples)
    return np.take_along_axis(records, np.broadcast_to(index, (*records.shape[:-1], n_samples)), axis=-1)


def band_pass(records: ArrayLike, sample_rate_hz: float, band_hz: tuple[float, float]) -> FloatArray:
    """Apply a Butterworth band-pass forward and backward, without delay; same shape as `records`.

    Raises:
        ValueError: If the band does not lie between zero and half the sample rate.
    """
    low, high = band_hz
    if not 0 < low < high < 0.5 * sample_rate_hz:
        raise ValueError(
            f"`band_hz` must rise within 0 and half the sample rate, {0.5 * sample_rate_hz:.4g} Hz, got {band_hz}"
        )
    x = np.asarray(records, dtype=np.float64)
    order = 4
    sections = scipy.signal.butter(order, band_hz, btype="bandpass", fs=sample_rate_hz, output="sos")
    padding = min(3 * (2 * order + 1), x.shape[-1] - 1)
    return np.asarray(scipy.signal.sosfiltfilt(sections, x, axis=-1, padlen=padding), dtype=np.float64)


def pulse_start(records: ArrayLike, n_samples: int) -> NDArray[np.intp]:
    """Find the start of the window of `n_samples` with most energy of all channels together; shape (...).

    All channels share the window: one for each channel would collect more noise where the pulse is weak.
    """
    x = np.asarray(records)
    power = np.einsum("...ik,...ik->...k", x, x)
    total = np.cumsum(power, axis=-1, dtype=np.float64)
    energy = total[..., n_samples - 1 :].copy()
    energy[..., 1:] -= total[..., :-n_samples]
    return energy.argmax(axis=-1)
