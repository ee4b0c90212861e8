"""Records: the samples of one file of an instrument."""

from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic.arrays import FloatArray

MAX_BYTES = 512 * 10**6
"""Largest size of a file of waveforms, both compressed and uncompressed."""

MAX_VOLTS = 1e6
"""Largest sample, and strength of a pulse. Assumed; no receiver withstands more."""

VOLTS = {
    "v": 1.0, "volt": 1.0, "volts": 1.0, "kv": 1e3, "mv": 1e-3, "mvolt": 1e-3, "mvolts": 1e-3, "millivolt": 1e-3,
    "millivolts": 1e-3, "uv": 1e-6, "µv": 1e-6, "μv": 1e-6, "microvolt": 1e-6, "microvolts": 1e-6, "nv": 1e-9,
}  # fmt: skip
"""Units of voltage, in volts."""


class WaveformRecord(NamedTuple):
    """Samples of one file.

    Attributes:
        samples: Numbers of any type, shape (n_pulses, n_channels, n_samples). Instruments that record a sequence of
            pulses give several; others give one, which may hold several pulses.
        volts_per_count: Factor from samples to volts, shape (n_channels,).
        sample_rate_hz: Sample rate of all channels.
        channels: Names of the channels.
        start_s: Time of the first sample; None if it is not stated.
    """

    samples: NDArray[Any]
    volts_per_count: FloatArray
    sample_rate_hz: float
    channels: tuple[str, ...]
    start_s: float | None = None

    @classmethod
    def of(
        cls,
        samples: NDArray[Any],
        sample_rate_hz: float,
        channels: tuple[str, ...] = (),
        volts_per_count: ArrayLike = 1.0,
        start_s: float | None = None,
    ) -> Self:
        """Check the contents of a file and make a record of them.

        Args:
            samples: Shape (n_channels, n_samples) or (n_pulses, n_channels, n_samples).
            sample_rate_hz: Sample rate.
            channels: Names; default: channel_1, channel_2 and so on.
            volts_per_count: One factor, or one for each channel.
            start_s: Time of the first sample; None if it is not stated.

        Raises:
            ValueError: If the contents cannot be those of a record.
        """
        if samples.ndim not in (2, 3) or 0 in samples.shape or samples.dtype.kind not in "iuf":
            raise ValueError(
                "waveforms must be numbers of shape (n_channels, n_samples) or (n_pulses, n_channels, n_samples), got "
                f"{samples.dtype} of shape {samples.shape}"
            )
        if samples.shape[-2] > samples.shape[-1]:
            raise ValueError(
                f"waveforms must have more samples than channels, got shape {samples.shape}: transpose them"
            )
        samples, scale = samples.reshape(-1, *samples.shape[-2:]), np.asarray(volts_per_count, dtype=np.float64)
        n_channels = samples.shape[1]
        if scale.shape not in ((), (n_channels,)):
            raise ValueError(f"volts_per_count must be one number or {n_channels}, one per channel, got {scale.size}")
        scale = np.broadcast_to(scale, n_channels)
        largest_v = np.maximum(samples.max(axis=(0, 2)), -samples.min(axis=(0, 2)).astype(np.float64)) * scale
        for name, low, value, high in (
            ("sample_rate_hz", 1e-3, sample_rate_hz, 1e15),
            ("volts_per_count", 1e-15, scale.min(), MAX_VOLTS),
            ("volts_per_count", 1e-15, scale.max(), MAX_VOLTS),
            ("the number of samples of a pulse", 1, samples[0].size, 1e7),  # 80 MB as float64
            ("the largest sample in volts", 0.0, largest_v.max(), MAX_VOLTS),
        ):
            if not low <= value <= high:
                raise ValueError(f"{name} must be from {low:g} to {high:g}, got {value:g}")
        unique = tuple(name.strip() for name in channels)
        if len(set(unique)) < n_channels or "" in unique:
            unique = tuple(f"channel_{k + 1}" for k in range(n_channels))
        return cls(samples, scale, float(sample_rate_hz), unique, start_s)

    @property
    def volts(self) -> FloatArray:
        """Samples in volts, shape (n_pulses, n_channels, n_samples)."""
        return np.multiply(self.samples, self.volts_per_count[:, np.newaxis], dtype=np.float64)

    @classmethod
    def join(cls, records: "list[WaveformRecord]") -> "WaveformRecord":
        """Join the channels of several files, each with the same pulses.

        Raises:
            ValueError: If their rates, numbers of pulses or samples, or start times differ.
        """
        first, *others = records
        if not others:
            return first
        for k, other in enumerate(others, start=2):
            shapes = [(len(record.samples), record.samples.shape[2]) for record in (first, other)]
            rates = first.sample_rate_hz, other.sample_rate_hz
            if shapes[0] != shapes[1] or abs(rates[1] / rates[0] - 1) > 1e-3:
                lengths = " and ".join(
                    f"{n} samples at {rate:g} Hz" for (_, n), rate in zip(shapes, rates, strict=True)
                )
                raise ValueError(f"files of one row must have the same rate and length, got {lengths} in file {k}")
            if first.start_s is not None and other.start_s is not None:
                late_s = other.start_s - first.start_s
                if abs(late_s * first.sample_rate_hz) > 1.5:
                    raise ValueError(
                        f"files of one row must start at the same time, got {late_s:g} s later in file {k}"
                    )
        names = tuple(name for record in records for name in record.channels)
        scale = np.concatenate([record.volts_per_count for record in records])
        return cls.of(
            np.concatenate([record.samples for record in records], axis=1), first.sample_rate_hz, names, scale
        )
