"""Recorded waveforms from the files that a table names, and the strengths of their pulses.

A file is `.npz` with `waveforms` of shape (n_channels, n_samples) or (n_pulses, n_channels, n_samples),
`sample_rate_hz` and, for counts, `volts_per_count`; or `.csv` with `time_s` and `channel_1` to `channel_n`.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic import InputFileError, pulse_start, strength_variance
from dirmusic.arrays import FloatArray, IntArray
from dirmusic.input_file import opened
from dirmusic.pulses.strengths import strengths_of_energies
from pdpatrol.missions.field.input_table import InputTable, read_table

MAX_VOLTS = 1e6
"""Largest sample, and strength of a pulse. Assumed; no receiver withstands more."""

MAX_BYTES = 512 * 10**6
"""Largest size of a waveform file, both compressed and uncompressed."""


class TablePulses(NamedTuple):
    """Strengths of pulses and the rows that they came from.

    Attributes:
        row: Row of the table, from 0, shape (n_pulses,).
        strengths_v: Shape (n_pulses, n_channels).
        variance_v2: Noise variance of the strengths, same shape.
    """

    row: IntArray
    strengths_v: FloatArray
    variance_v2: FloatArray


class WaveformRecord(NamedTuple):
    """Contents of one waveform file.

    Attributes:
        samples: Numbers of any type, shape (n_pulses, n_channels, n_samples).
        volts_per_sample: Factor from samples to volts.
        sample_rate_hz: Sample rate of all channels.
    """

    samples: NDArray[Any]
    volts_per_sample: float
    sample_rate_hz: float


def read_waveforms(table: InputTable, noise_v: float | None, gate_s: float) -> TablePulses:
    """Return the strengths of the pulses in the files that the column `waveform` of a table names.

    Args:
        table: The table; names of files are relative to its folder.
        noise_v: Standard deviation of a noise sample, volts; None to measure it in each channel outside the gates.
        gate_s: Length of the gate, which is cut out of each waveform where its energy is largest.

    Raises:
        InputFileError: If a file cannot be used, the files are inconsistent, or they contain no noise to measure.
    """
    rows: list[int] = []
    energies: list[FloatArray] = []
    noises: list[FloatArray] = []
    shape: tuple[int, float] | None = None
    n_gate = 0
    for row, name in enumerate(table.columns["waveform"].tolist()):
        path = table.path.parent / name
        try:
            record = _read_record(path)
            shape = shape or (record.samples.shape[1], record.sample_rate_hz)
            if record.samples.shape[1] != shape[0] or abs(record.sample_rate_hz / shape[1] - 1) > 0.01:
                raise ValueError(f"must have {shape[0]} channels at {shape[1]:g} Hz as the first file")
            n_gate = round(gate_s * shape[1])
            if not 4 <= n_gate <= record.samples.shape[2]:  # fewer samples cannot hold a pulse
                raise ValueError(
                    f"the gate must have 4 to {record.samples.shape[2]} samples; --gate-ns {gate_s * 1e9:g} is {n_gate}"
                )
            for samples in record.samples:
                volts = np.multiply(samples, record.volts_per_sample, dtype=np.float64)
                start = pulse_start(volts, n_gate)
                energies.append(np.square(volts[:, start : start + n_gate]).sum(axis=-1))
                sample = np.arange(volts.shape[-1]) - start
                is_noise = (sample < -10) | (sample >= 2 * n_gate)  # a pulse may begin before its gate and end after it
                if is_noise.sum() >= 16:
                    noises.append(np.square(volts[:, is_noise]).mean(axis=-1))
                rows.append(row)
        except ValueError as error:  # InputFileError is a subclass
            first = str(error).splitlines()[0].removeprefix(f"{path}: ")
            raise InputFileError([f"{table.path}: line {table.lines[row]}: waveform {name}: {first}"]) from None
    energy_v2 = np.array(energies)
    if noise_v is not None:
        variance_v2 = np.full(energy_v2.shape[1], noise_v**2)
    elif noises:
        variance_v2 = np.median(noises, axis=0)
    else:
        raise InputFileError(
            [
                f"{table.path}: waveforms hold no noise outside their gate of {n_gate} samples; give longer records, a "
                "shorter --gate-ns, or --noise-v"
            ]
        )
    strengths_v = strengths_of_energies(energy_v2, n_gate, variance_v2)
    variance_v2 = strength_variance(np.nan_to_num(strengths_v), variance_v2, n_gate)
    return TablePulses(np.array(rows), strengths_v, variance_v2)


def _read_record(path: Path) -> WaveformRecord:
    """Read one waveform file; raise ValueError without its name, or InputFileError with it."""
    record = _read_csv(path) if path.suffix.lower() == ".csv" else _read_npz(path)
    largest_v = max(float(record.samples.max()), -float(record.samples.min())) * record.volts_per_sample
    for name, value, low, high in (
        ("sample_rate_hz", record.sample_rate_hz, 1e6, 1e12),  # pulses last for nanoseconds
        ("volts_per_count", record.volts_per_sample, 1e-15, MAX_VOLTS),
        ("the number of samples of a pulse", record.samples[0].size, 1, 1e7),  # 80 MB as float64
        ("the largest sample in volts", largest_v, 0.0, MAX_VOLTS),
    ):
        if not low <= value <= high:
            raise ValueError(f"{name} must be from {low:g} to {high:g}, got {value:g}")
    return record


def _read_npz(path: Path) -> WaveformRecord:
    try:
        with opened(path, MAX_BYTES) as file, np.load(file, allow_pickle=False) as archive:
            if sum(member.file_size for member in archive.zip.infolist()) > MAX_BYTES:
                raise InputFileError([f"arrays must have at most {MAX_BYTES / 1e6:.0f} MB"])
            samples, rate_hz = archive["waveforms"], float(archive["sample_rate_hz"])
            has_counts = "volts_per_count" in archive
            scale = float(archive["volts_per_count"]) if has_counts else 1.0
    except InputFileError:
        raise
    except Exception as error:  # damaged bytes raise errors of many types in zipfile, zlib and the header reader
        raise ValueError(
            "must be an .npz archive with the arrays waveforms, sample_rate_hz and, for counts, volts_per_count "
            f"({' '.join(str(error).split()):.100})"
        ) from None
    if samples.ndim not in (2, 3) or samples.dtype.kind not in ("iuf" if has_counts else "f") or 0 in samples.shape:
        raise ValueError(
            "waveforms must be numbers of shape (n_channels, n_samples) or (n_pulses, n_channels, n_samples), and "
            f"whole numbers need volts_per_count; got {samples.dtype} of shape {samples.shape}"
        )
    return WaveformRecord(samples.reshape(-1, *samples.shape[-2:]), scale, rate_hz)


def _read_csv(path: Path) -> WaveformRecord:
    table = read_table(path)
    expected = ["time_s", *(f"channel_{k + 1}" for k in range(len(table.columns) - 1))]
    if list(table.columns) != expected:
        raise ValueError("columns must be time_s, channel_1, channel_2 ... in order")
    time_s, *volts = table.numbers(-MAX_VOLTS, MAX_VOLTS, *expected).T
    table.check()
    steps = np.diff(time_s)
    if steps.size == 0 or not (steps.min() > 0 and np.ptp(steps) <= 0.01 * np.median(steps)):
        raise ValueError("time_s must rise in even steps")
    return WaveformRecord(np.array([volts]), 1.0, 1.0 / float(steps.mean()))
