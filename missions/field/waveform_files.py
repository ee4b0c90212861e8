"""Recorded waveforms, from .npz or .csv files that a table names, and the strengths of their pulses."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile

import numpy as np
from numpy.lib.npyio import NpzFile
from numpy.typing import NDArray

from dirmusic import (
    CsvTable,
    InputFileError,
    cut_windows,
    pulse_start,
    pulse_strengths,
    read_csv_table,
    strength_variance,
)

FloatArray = NDArray[np.float64]

MIN_CHANNELS = 3
"""With two elements, most strength ratios belong to two directions."""

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
    """Contents of one waveform file: volts, shape (n_pulses, n_channels, n_samples), and its sample rate."""

    waveforms_v: FloatArray
    sample_rate_hz: float


def read_waveforms(table: CsvTable, noise_v: float | None, gate_s: float) -> TablePulses:
    """Strengths of the pulses in the files that the column `waveform` of a table names.

    Args:
        table: The table; names of files are relative to its folder. Faults are added to it.
        noise_v: Deviation of a noise sample, volts; None to measure it in each channel outside the gates.
        gate_s: Length of the gate, which is cut out of each waveform where it holds most energy.

    Raises:
        InputFileError: If a file cannot be used, the files do not fit together, or they hold no noise to measure.
    """
    records: list[WaveformRecord] = []
    for row, name in enumerate(table.text("waveform")):
        try:
            record = _read_record(table.path.parent / name)
            _check_record(record, records[0] if records else None, gate_s)
            records.append(record)
        except ValueError as error:
            table.fault(row, f"waveform: {name}: {error}")
    table.check()
    n_gate = _gate_samples(records[0], gate_s)
    starts = [pulse_start(record.waveforms_v, n_gate) for record in records]
    gates = [cut_windows(record.waveforms_v, start, n_gate) for record, start in zip(records, starts, strict=True)]
    powers = [_noise_power(record.waveforms_v, start, n_gate) for record, start in zip(records, starts, strict=True)]
    if noise_v is None and sum(len(power) for power in powers) == 0:
        raise InputFileError(
            [
                f"{table.path}: waveforms of {records[0].waveforms_v.shape[-1]} samples hold no noise apart from their "
                f"gate of {n_gate}; give longer records, a shorter --gate-ns, or --noise-v"
            ]
        )
    n_channels = records[0].waveforms_v.shape[1]
    variance = np.median(np.concatenate(powers), axis=0) if noise_v is None else np.full(n_channels, noise_v**2)
    strengths = pulse_strengths(np.concatenate(gates), variance)
    row = np.repeat(np.arange(len(records)), [record.waveforms_v.shape[0] for record in records])
    return TablePulses(row, strengths, strength_variance(np.nan_to_num(strengths), variance, n_gate))


def _noise_power(waveforms_v: FloatArray, start: NDArray[np.intp], n_gate: int) -> FloatArray:
    """Mean square of the samples well outside the gate, shape (n, n_channels), of the n pulses that have enough."""
    sample = np.arange(waveforms_v.shape[-1]) - start[:, np.newaxis]
    is_quiet = (sample < -BEFORE_GATE_SAMPLES) | (sample >= 2 * n_gate)
    count = np.maximum(is_quiet.sum(axis=-1), 1)[:, np.newaxis]
    power = np.einsum("pik,pk->pi", np.square(waveforms_v), is_quiet.astype(np.float64)) / count
    return power[is_quiet.sum(axis=-1) >= QUIET_SAMPLES]


def _gate_samples(record: WaveformRecord, gate_s: float) -> int:
    return max(round(gate_s * record.sample_rate_hz), 2)


def _check_record(record: WaveformRecord, first: WaveformRecord | None, gate_s: float) -> None:
    """Raise ValueError if a record is not what the estimators, or the records before it, want."""
    x = record.waveforms_v
    broken = np.flatnonzero(~np.isfinite(x).all(axis=(0, 2))) + 1
    if broken.size:
        raise ValueError(f"NaN or infinite samples in channel {', '.join(map(str, broken))}; allowed are finite volts")
    if x.shape[1] < MIN_CHANNELS:
        raise ValueError(f"{x.shape[1]} channels; allowed are {MIN_CHANNELS} or more")
    if first is not None and x.shape[1] != first.waveforms_v.shape[1]:
        raise ValueError(f"{x.shape[1]} channels; the first file has {first.waveforms_v.shape[1]}")
    if first is not None and abs(record.sample_rate_hz / first.sample_rate_hz - 1) > ALIKE:
        raise ValueError(f"sampled at {record.sample_rate_hz:g} Hz; the first file at {first.sample_rate_hz:g} Hz")
    n_gate = _gate_samples(record, gate_s)
    if x.shape[-1] < n_gate:
        raise ValueError(f"{x.shape[-1]} samples; allowed are as many as the gate has, {n_gate}, or more")


def _read_record(path: Path) -> WaveformRecord:
    """One waveform file; raises ValueError without the file's name."""
    if path.suffix.lower() == ".npz":
        return _read_npz(path)
    if path.suffix.lower() == ".csv":
        return _read_csv(path)
    raise ValueError(f"ends in `{path.suffix}`; allowed are .npz and .csv")


def _read_npz(path: Path) -> WaveformRecord:
    try:
        with path.open("rb") as file:
            archive = np.load(file, allow_pickle=False)
            if not isinstance(archive, NpzFile):
                raise ValueError("is a single array; allowed is an .npz archive")
            arrays = {name: archive[name] for name in WAVEFORM_ARRAYS if name in archive.files}
            held = ", ".join(archive.files) or "nothing"
    except FileNotFoundError:
        raise ValueError("no such file") from None
    except (OSError, EOFError, BadZipFile) as error:
        raise ValueError(f"cannot be read ({type(error).__name__}); allowed is an .npz archive") from None
    missing = [name for name in WAVEFORM_ARRAYS[:2] if name not in arrays]
    if missing:
        raise ValueError(f"no array {', '.join(missing)}; it holds {held}")
    counts, rate = arrays["waveforms"], arrays["sample_rate_hz"]
    scale = arrays.get("volts_per_count", np.array(1.0))
    if counts.ndim not in (2, 3) or counts.dtype.kind not in "iuf" or 0 in counts.shape:
        raise ValueError(
            f"waveforms of shape {counts.shape} and type {counts.dtype}; allowed are numbers, "
            "(n_channels, n_samples) or (n_pulses, n_channels, n_samples)"
        )
    if counts.dtype.kind in "iu" and "volts_per_count" not in arrays:
        raise ValueError("waveforms are whole numbers; allowed with `volts_per_count`, or in volts")
    for name, value in (("sample_rate_hz", rate), ("volts_per_count", scale)):
        if value.shape != () or value.dtype.kind not in "iuf" or not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name}: got {value!r}; allowed is one number above 0")
    volts = counts.astype(np.float64) * float(scale)
    return WaveformRecord(volts.reshape(-1, *volts.shape[-2:]), float(rate))


def _read_csv(path: Path) -> WaveformRecord:
    table = read_csv_table(path)
    n = len(table.header) - 1
    expected = ["time_s", *(f"channel_{k + 1}" for k in range(n))]
    if list(table.header) != expected:
        raise ValueError(f"columns {', '.join(table.header)}; allowed are time_s, channel_1, channel_2 ... in order")
    time_s = table.numbers("time_s")
    volts = np.array([table.numbers(name) for name in expected[1:]])
    table.check()
    steps = np.diff(time_s)
    if steps.size == 0 or not (steps.min() > 0 and np.ptp(steps) <= ALIKE * float(np.median(steps))):
        raise ValueError("time_s: allowed are even steps, rising")
    return WaveformRecord(volts[np.newaxis], 1.0 / float(steps.mean()))
