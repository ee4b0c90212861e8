"""Recorded waveforms, from .npz or .csv files that a table names, and the strengths of their pulses."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic import CsvTable, InputFileError, cut_windows, pulse_start, read_csv_table, strength_variance
from dirmusic.npz_file import read_npz
from dirmusic.pulses.strengths import strengths_of_energies

FloatArray = NDArray[np.float64]

MIN_CHANNELS = 3
"""With two elements, most strength ratios belong to two directions."""

MAX_CHANNELS = 32
"""More elements than any ring has that is carried about (assumed)."""

MAX_STRENGTH_V = 1e6
"""Of a sample, and of a pulse (assumed): no receiver stands more."""

SAMPLE_RATES_HZ = (1e6, 1e12)
"""Lowest and highest (assumed): pulses last for nanoseconds, and envelopes of them for less than a microsecond."""

VOLTS_PER_COUNT = (1e-15, MAX_STRENGTH_V)

MOST_BYTES = 512 * 10**6
"""Of one file of waveforms, and of its array (assumed)."""

MOST_SAMPLES = 10**7
"""Of one pulse, all channels together (assumed): more than 10 us of 32 channels at 20 GS/s."""

SAMPLES_AT_ONCE = 2 * 10**6
"""So many samples of a file are worked on at a time, or one pulse."""

MIN_GATE_SAMPLES = 4
"""A gate of fewer samples holds no pulse (assumed)."""

WAVEFORM_ARRAYS = ("waveforms", "sample_rate_hz", "volts_per_count")
"""Arrays of an .npz file; the last is for counts."""

QUIET_SAMPLES = 16
"""A record needs at least so many samples outside its gate, for the noise."""

BEFORE_GATE_SAMPLES = 10
"""Left out of the noise before the gate, for a pulse that the gate begins with; after it, as many as it is long."""

ALIKE = 0.01
"""Share by which time steps of a waveform table, or sample rates of several files, may differ."""


class TablePulses(NamedTuple):
    """Strengths of pulses and where they came from.

    Attributes:
        row: Row of the table that each pulse came from, from 0, shape (n_pulses,).
        strengths_v: Shape (n_pulses, n_channels).
        variance_v2: Noise variance of the strengths, same shape.
    """

    row: NDArray[np.intp]
    strengths_v: FloatArray
    variance_v2: FloatArray


class WaveformRecord(NamedTuple):
    """Contents of one waveform file.

    Attributes:
        samples: Numbers of any kind, shape (n_pulses, n_channels, n_samples).
        volts_per_sample: What one stands for.
        sample_rate_hz: Of all channels.
    """

    samples: NDArray[Any]
    volts_per_sample: float
    sample_rate_hz: float


class GatedPulses(NamedTuple):
    """What is left of one waveform file.

    Attributes:
        energy_v2: Sum of the squares of the samples in the gate, shape (n_pulses, n_channels).
        noise_v2: Mean square well outside the gate, shape (n, n_channels), of the n pulses with enough samples there.
        n_samples: Of a waveform.
        n_gate: Samples of the gate.
        sample_rate_hz: Of the waveforms.
    """

    energy_v2: FloatArray
    noise_v2: FloatArray
    n_samples: int
    n_gate: int
    sample_rate_hz: float


def read_waveforms(table: CsvTable, noise_v: float | None, gate_s: float) -> TablePulses:
    """Strengths of the pulses in the files that the column `waveform` of a table names.

    Args:
        table: The table; names of files are relative to its folder. Faults are added to it, one for each file.
        noise_v: Deviation of a noise sample, volts; None to measure it in each channel outside the gates.
        gate_s: Length of the gate, which is cut out of each waveform where it holds most energy.

    Raises:
        InputFileError: If a file cannot be used, the files do not fit together, or they hold no noise to measure.
    """
    gated: list[GatedPulses] = []
    refused: set[str] = set()
    for row, name in enumerate(table.text("waveform")):
        if name in refused:
            continue
        path = table.path.parent / name
        try:
            gated.append(_gated(_read_record(path), gate_s, gated[0] if gated else None))
        except InputFileError as error:
            refused.add(name)
            told, *others = error.faults
            table.fault(row, f"waveform: {name}: {told.removeprefix(f'{path}: ')}{' (and more)' if others else ''}")
        except ValueError as error:
            refused.add(name)
            table.fault(row, f"waveform: {name}: {error}")
    table.check()
    first = gated[0]
    noise_v2 = np.concatenate([pulses.noise_v2 for pulses in gated])
    if noise_v is None and len(noise_v2) == 0:
        raise InputFileError(
            [
                f"{table.path}: waveforms of {first.n_samples} samples hold no noise apart from their "
                f"gate of {first.n_gate}; give longer records, a shorter --gate-ns, or --noise-v"
            ]
        )
    energy_v2 = np.concatenate([pulses.energy_v2 for pulses in gated])
    variance = np.median(noise_v2, axis=0) if noise_v is None else np.full(energy_v2.shape[1], noise_v**2)
    strengths = strengths_of_energies(energy_v2, first.n_gate, variance)
    row = np.repeat(np.arange(len(gated)), [len(pulses.energy_v2) for pulses in gated])
    return TablePulses(row, strengths, strength_variance(np.nan_to_num(strengths), variance, first.n_gate))


def _gated(record: WaveformRecord, gate_s: float, first: GatedPulses | None) -> GatedPulses:
    """Energy and noise of the pulses of a file, some at a time; raises ValueError without the file's name.

    Args:
        record: What the file holds.
        gate_s: Length of the gate.
        first: What the first file gave, which all have to fit; None for that one itself.
    """
    n_pulses, n_channels, n_samples = record.samples.shape
    n_gate = round(gate_s * record.sample_rate_hz)
    if first is not None:
        if n_channels != first.energy_v2.shape[1]:
            raise ValueError(f"{n_channels} channels; the first file has {first.energy_v2.shape[1]}")
        if abs(record.sample_rate_hz / first.sample_rate_hz - 1) > ALIKE:
            raise ValueError(f"sampled at {record.sample_rate_hz:g} Hz; the first file at {first.sample_rate_hz:g} Hz")
        n_gate = first.n_gate
    if n_gate < MIN_GATE_SAMPLES:
        raise ValueError(
            f"a gate of {gate_s * 1e9:g} ns has {n_gate} samples at {record.sample_rate_hz:g} Hz; allowed are "
            f"{MIN_GATE_SAMPLES} or more: --gate-ns"
        )
    if n_samples < n_gate:
        raise ValueError(f"{n_samples} samples; allowed are as many as the gate has, {n_gate}, or more")
    energies: list[FloatArray] = []
    powers: list[FloatArray] = []
    at_once = max(SAMPLES_AT_ONCE // (n_channels * n_samples), 1)
    for k in range(0, n_pulses, at_once):
        volts = _volts(record.samples[k : k + at_once], record.volts_per_sample)
        start = pulse_start(volts, n_gate)
        gate = cut_windows(volts, start, n_gate)
        energies.append(np.einsum("...k,...k->...", gate, gate))
        powers.append(_noise_power(volts, start, n_gate))
    return GatedPulses(np.concatenate(energies), np.concatenate(powers), n_samples, n_gate, record.sample_rate_hz)


def _volts(samples: NDArray[Any], volts_per_sample: float) -> FloatArray:
    """Samples in volts; raises ValueError where they are none."""
    with np.errstate(over="ignore"):
        volts = samples.astype(np.float64) * volts_per_sample
    broken = np.flatnonzero(~np.isfinite(volts).all(axis=(0, 2))) + 1
    if broken.size:
        raise ValueError(f"NaN or infinite samples in channel {', '.join(map(str, broken))}; allowed are finite volts")
    largest = float(np.abs(volts).max())
    if largest > MAX_STRENGTH_V:
        raise ValueError(f"samples of {largest:.3g} V; allowed are up to {MAX_STRENGTH_V:g} V")
    return volts


def _noise_power(waveforms_v: FloatArray, start: NDArray[np.intp], n_gate: int) -> FloatArray:
    """Mean square of the samples well outside the gate, shape (n, n_channels), of the n pulses that have enough."""
    sample = np.arange(waveforms_v.shape[-1]) - start[:, np.newaxis]
    is_quiet = (sample < -BEFORE_GATE_SAMPLES) | (sample >= 2 * n_gate)
    count = np.maximum(is_quiet.sum(axis=-1), 1)[:, np.newaxis]
    power = np.einsum("pik,pk->pi", np.square(waveforms_v), is_quiet.astype(np.float64)) / count
    return power[is_quiet.sum(axis=-1) >= QUIET_SAMPLES]


def _read_record(path: Path) -> WaveformRecord:
    """One waveform file; raises ValueError without the file's name, or InputFileError with it."""
    if path.suffix.lower() == ".npz":
        record = _read_npz(path)
    elif path.suffix.lower() == ".csv":
        record = _read_csv(path)
    else:
        raise ValueError(f"ends in `{path.suffix:.20}`; allowed are .npz and .csv")
    _, n_channels, n_samples = record.samples.shape
    if not MIN_CHANNELS <= n_channels <= MAX_CHANNELS:
        raise ValueError(f"{n_channels} channels; allowed are {MIN_CHANNELS} or more, up to {MAX_CHANNELS}")
    if n_channels * n_samples > MOST_SAMPLES:
        raise ValueError(
            f"{n_samples} samples of {n_channels} channels for each pulse; allowed are up to {MOST_SAMPLES:g} "
            "together: cut the pulses out"
        )
    return record


def _read_npz(path: Path) -> WaveformRecord:
    arrays = read_npz(path, WAVEFORM_ARRAYS[:2], WAVEFORM_ARRAYS[2:], most_bytes=MOST_BYTES)
    samples = arrays["waveforms"]
    if samples.ndim not in (2, 3) or samples.dtype.kind not in "iuf" or 0 in samples.shape:
        raise ValueError(
            f"waveforms of shape {samples.shape} and type {samples.dtype}; allowed are numbers, "
            "(n_channels, n_samples) or (n_pulses, n_channels, n_samples)"
        )
    if samples.dtype.kind in "iu" and "volts_per_count" not in arrays:
        raise ValueError("waveforms are whole numbers; allowed with `volts_per_count`, or in volts")
    rate_hz = _one_number(arrays["sample_rate_hz"], "sample_rate_hz", *SAMPLE_RATES_HZ)
    scale_v = 1.0
    if "volts_per_count" in arrays:
        scale_v = _one_number(arrays["volts_per_count"], "volts_per_count", *VOLTS_PER_COUNT)
    return WaveformRecord(samples.reshape(-1, *samples.shape[-2:]), scale_v, rate_hz)


def _one_number(value: NDArray[Any], name: str, low: float, high: float) -> float:
    if value.shape != () or value.dtype.kind not in "iuf" or not low <= float(value) <= high:
        came = f"an array of shape {value.shape}" if value.shape else f"{value!s:.40}"
        raise ValueError(f"{name}: got {came}; allowed is one number from {low:g} to {high:g}")
    return float(value)


def _read_csv(path: Path) -> WaveformRecord:
    table = read_csv_table(path)
    n = len(table.header) - 1
    expected = ["time_s", *(f"channel_{k + 1}" for k in range(n))]
    if list(table.header) != expected:
        columns = ", ".join(table.header)
        raise ValueError(f"columns {columns:.200}; allowed are time_s, channel_1, channel_2 ... in order")
    time_s = table.numbers("time_s")
    volts = np.array([table.numbers(name) for name in expected[1:]])
    table.check()
    with np.errstate(over="ignore"):
        steps = np.diff(time_s)
    if steps.size == 0 or not (steps.min() > 0 and np.ptp(steps) <= ALIKE * float(np.median(steps))):
        raise ValueError("time_s: allowed are even steps, rising")
    rate_hz = _one_number(np.array(1.0 / float(steps.mean())), "sampling rate, Hz", *SAMPLE_RATES_HZ)
    return WaveformRecord(volts[np.newaxis], 1.0, rate_hz)
