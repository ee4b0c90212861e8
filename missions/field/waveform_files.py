"""Recorded waveforms from the files that a table names, and the strengths of their pulses.

A file is `.npz` with `waveforms` of shape (n_channels, n_samples) or (n_pulses, n_channels, n_samples),
`sample_rate_hz` and, for counts, `volts_per_count`; or `.csv` with `time_s` and `channel_1` to `channel_n`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic import InputFileError, cut_windows, pulse_start, strength_variance
from dirmusic.input_file import opened
from dirmusic.pulses.strengths import strengths_of_energies
from pdpatrol.missions.field.input_table import InputTable, read_table

FloatArray = NDArray[np.float64]

MIN_CHANNELS = 3
"""With two elements, most ratios of strengths belong to two directions."""

MAX_CHANNELS = 32
"""Assumed; more elements than any portable array has."""

MAX_VOLTS = 1e6
"""Largest sample, and strength of a pulse. Assumed; no receiver withstands more."""

MIN_RATE_HZ, MAX_RATE_HZ = 1e6, 1e12
"""Sample rates. Assumed; pulses last for nanoseconds, and their envelopes for less than a microsecond."""

MAX_BYTES = 512 * 10**6
"""Size of a file of waveforms, compressed and not."""

MAX_SAMPLES = 10**7
"""Samples of a pulse in all channels together: 32 channels of 15 us at 20 GS/s."""

STEP_TOLERANCE = 0.01
"""Relative difference allowed between the time steps of a waveform, and between the sample rates of files."""


class TablePulses(NamedTuple):
    """Strengths of pulses and the rows that they came from.

    Attributes:
        row: Row of the table, from 0, shape (n_pulses,).
        strengths_v: Shape (n_pulses, n_channels).
        variance_v2: Noise variance of the strengths, same shape.
    """

    row: NDArray[np.intp]
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


class GatedPulses(NamedTuple):
    """Energies of the pulses of one waveform file.

    Attributes:
        energy_v2: Sum of the squares of the samples in the gate, shape (n_pulses, n_channels).
        noise_v2: Mean square well outside the gate, shape (n, n_channels), of the n pulses with enough samples there.
        n_samples: Samples of a waveform.
        n_gate: Samples of the gate.
        sample_rate_hz: Sample rate of the waveforms.
    """

    energy_v2: FloatArray
    noise_v2: FloatArray
    n_samples: int
    n_gate: int
    sample_rate_hz: float


def read_waveforms(table: InputTable, noise_v: float | None, gate_s: float) -> TablePulses:
    """Return the strengths of the pulses in the files that the column `waveform` of a table names.

    Args:
        table: The table; names of files are relative to its folder. Errors are added to it, one for each file.
        noise_v: Standard deviation of a noise sample, volts; None to measure it in each channel outside the gates.
        gate_s: Length of the gate, which is cut out of each waveform where it holds most energy.

    Raises:
        InputFileError: If a file cannot be used, the files do not fit together, or they hold no noise to measure.
    """
    gated: list[GatedPulses] = []
    refused: set[str] = set()
    for row, name in enumerate(table.columns["waveform"].to_pylist()):
        if name in refused:
            continue
        path = table.path.parent / name
        try:
            gated.append(_gate(_read_record(path), gate_s, gated[0] if gated else None))
        except ValueError as error:  # of which InputFileError is one
            refused.add(name)
            first, *others = str(error).splitlines()
            table.add_error(f"waveform {name}: {first.removeprefix(f'{path}: ')}{' (and more)' if others else ''}", row)
    table.check()
    first = gated[0]
    noise_v2 = np.concatenate([pulses.noise_v2 for pulses in gated])
    energy_v2 = np.concatenate([pulses.energy_v2 for pulses in gated])
    if noise_v is not None:
        variance_v2 = np.full(energy_v2.shape[1], noise_v**2)
    elif len(noise_v2):
        variance_v2 = np.median(noise_v2, axis=0)
    else:
        raise InputFileError(
            [
                f"{table.path}: waveforms of {first.n_samples} samples hold no noise outside their gate of "
                f"{first.n_gate}; give longer records, a shorter --gate-ns, or --noise-v"
            ]
        )
    strengths_v = strengths_of_energies(energy_v2, first.n_gate, variance_v2)
    row = np.repeat(np.arange(len(gated)), [len(pulses.energy_v2) for pulses in gated])
    return TablePulses(row, strengths_v, strength_variance(np.nan_to_num(strengths_v), variance_v2, first.n_gate))


def _gate(record: WaveformRecord, gate_s: float, first: GatedPulses | None) -> GatedPulses:
    """Measure the energy and noise of the pulses of a file; raises ValueError without the name of the file.

    Args:
        record: Contents of the file.
        gate_s: Length of the gate.
        first: Result of the first file, which all others must fit; None for that file itself.
    """
    n_pulses, n_channels, n_samples = record.samples.shape
    n_gate = round(gate_s * record.sample_rate_hz)
    if first is not None:
        if n_channels != first.energy_v2.shape[1]:
            raise ValueError(f"must have {first.energy_v2.shape[1]} channels as the first file, got {n_channels}")
        if abs(record.sample_rate_hz / first.sample_rate_hz - 1) > STEP_TOLERANCE:
            raise ValueError(
                f"must be sampled at {first.sample_rate_hz:g} Hz as the first file, got {record.sample_rate_hz:g} Hz"
            )
        n_gate = first.n_gate
    if n_gate < 4:  # fewer samples hold no pulse
        raise ValueError(
            f"the gate must have 4 samples or more; --gate-ns {gate_s * 1e9:g} is {n_gate} at "
            f"{record.sample_rate_hz:g} Hz"
        )
    if n_samples < n_gate:
        raise ValueError(f"must have as many samples as the gate, {n_gate}, or more, got {n_samples}")
    energies: list[FloatArray] = []
    powers: list[FloatArray] = []
    at_once = max(2_000_000 // (n_channels * n_samples), 1)  # bounds the memory
    for k in range(0, n_pulses, at_once):
        volts = _volts(record.samples[k : k + at_once], record.volts_per_sample)
        start = pulse_start(volts, n_gate)
        gate = cut_windows(volts, start, n_gate)
        energies.append(np.einsum("...k,...k->...", gate, gate))
        powers.append(_noise_power(volts, start, n_gate))
    return GatedPulses(np.concatenate(energies), np.concatenate(powers), n_samples, n_gate, record.sample_rate_hz)


def _volts(samples: NDArray[Any], volts_per_sample: float) -> FloatArray:
    """Convert samples to volts; raises ValueError if they are not finite or too large."""
    with np.errstate(over="ignore"):
        volts = samples.astype(np.float64) * volts_per_sample
    broken = np.flatnonzero(~np.isfinite(volts).all(axis=(0, 2))) + 1
    if broken.size:
        raise ValueError(f"samples must be finite, and are not in channel {', '.join(map(str, broken))}")
    largest = float(np.abs(volts).max())
    if largest > MAX_VOLTS:
        raise ValueError(f"samples must be at most {MAX_VOLTS:g} V, got {largest:.3g} V")
    return volts


def _noise_power(waveforms_v: FloatArray, start: NDArray[np.intp], n_gate: int) -> FloatArray:
    """Return the mean square well outside the gate, shape (n, n_channels), of the n pulses with 16 samples there."""
    sample = np.arange(waveforms_v.shape[-1]) - start[:, np.newaxis]
    is_noise = (sample < -10) | (sample >= 2 * n_gate)  # a pulse may begin before its gate and end after it
    count = np.maximum(is_noise.sum(axis=-1), 1)[:, np.newaxis]
    power = np.einsum("pik,pk->pi", np.square(waveforms_v), is_noise.astype(np.float64)) / count
    return power[is_noise.sum(axis=-1) >= 16]


def _read_record(path: Path) -> WaveformRecord:
    """Read one waveform file; raises ValueError without its name, or InputFileError with it."""
    readers = {".npz": _read_npz, ".csv": _read_csv}
    if path.suffix.lower() not in readers:
        raise ValueError(f"must end in .npz or .csv, got {path.suffix!r:.20}")
    record = readers[path.suffix.lower()](path)
    _, n_channels, n_samples = record.samples.shape
    if not MIN_CHANNELS <= n_channels <= MAX_CHANNELS:
        raise ValueError(f"must have {MIN_CHANNELS} to {MAX_CHANNELS} channels, got {n_channels}")
    if n_channels * n_samples > MAX_SAMPLES:
        raise ValueError(
            f"a pulse must have at most {MAX_SAMPLES:g} samples in all channels, got {n_channels * n_samples}; "
            "cut the pulses out"
        )
    return record


def _read_npz(path: Path) -> WaveformRecord:
    try:
        with opened(path, MAX_BYTES) as file, np.load(file, allow_pickle=False) as archive:
            n_bytes = sum(member.file_size for member in archive.zip.infolist())
            names = ("waveforms", "sample_rate_hz", "volts_per_count") if n_bytes <= MAX_BYTES else ()
            arrays = {name: np.asarray(archive[name]) for name in names if name in archive}  # bytes if not an array
    except InputFileError:
        raise
    except Exception:  # damaged bytes raise errors of many types in zipfile, zlib and the reader of headers
        raise ValueError("must be an .npz archive of plain numbers, and cannot be read as one") from None
    if n_bytes > MAX_BYTES:
        raise ValueError(f"arrays must have at most {MAX_BYTES / 1e6:.0f} MB, got {n_bytes / 1e6:.0f} MB")
    missing = [name for name in ("waveforms", "sample_rate_hz") if name not in arrays]
    if missing:
        raise ValueError(f"array {', '.join(missing)} is missing")
    samples = arrays["waveforms"]
    if samples.ndim not in (2, 3) or samples.dtype.kind not in "iuf" or 0 in samples.shape:
        raise ValueError(
            "waveforms must be numbers of shape (n_channels, n_samples) or (n_pulses, n_channels, n_samples), got "
            f"{samples.dtype} of shape {samples.shape}"
        )
    if samples.dtype.kind in "iu" and "volts_per_count" not in arrays:
        raise ValueError("waveforms that are whole numbers need volts_per_count")
    volts_per_sample = arrays.get("volts_per_count", np.array(1.0))
    return WaveformRecord(
        samples.reshape(-1, *samples.shape[-2:]),
        _scalar(volts_per_sample, "volts_per_count", 1e-15, MAX_VOLTS),
        _scalar(arrays["sample_rate_hz"], "sample_rate_hz", MIN_RATE_HZ, MAX_RATE_HZ),
    )


def _read_csv(path: Path) -> WaveformRecord:
    table = read_table(path)
    expected = ["time_s", *(f"channel_{k + 1}" for k in range(len(table.columns) - 1))]
    if list(table.columns) != expected:
        raise ValueError(
            f"columns must be time_s, channel_1, channel_2 ... in order, got {', '.join(table.columns):.200}"
        )
    time_s, *volts = (table.numbers(name) for name in expected)
    table.check()
    with np.errstate(over="ignore"):
        steps = np.diff(time_s)
    if steps.size == 0 or not (steps.min() > 0 and np.ptp(steps) <= STEP_TOLERANCE * float(np.median(steps))):
        raise ValueError("time_s must rise in even steps")
    rate_hz = _scalar(np.array(1.0 / float(steps.mean())), "sample rate, Hz", MIN_RATE_HZ, MAX_RATE_HZ)
    return WaveformRecord(np.array(volts)[np.newaxis], 1.0, rate_hz)


def _scalar(value: NDArray[Any], name: str, low: float, high: float) -> float:
    """Return an array of one number as a float; raises ValueError if it is anything else or out of range."""
    if value.shape != () or value.dtype.kind not in "iuf" or not low <= float(value) <= high:
        given = f"an array of shape {value.shape}" if value.shape else f"{value!s:.40}"
        raise ValueError(f"{name} must be one number from {low:g} to {high:g}, got {given}")
    return float(value)
