"""Recorded waveforms from the files that a table names, and the strengths of their pulses."""

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dirmusic import InputFileError, strength_variance
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.pulses.clipping import Extremes, restored_strengths
from dirmusic.pulses.strengths import strengths_of_energies
from pdpatrol.missions.field.input_table import InputTable
from pdpatrol.missions.field.instruments import WaveformRecord, read_record
from pdpatrol.missions.field.record_pulses import RecordPulses, find_pulses
from pdpatrol.missions.record.words import counted

PRIOR_QUIET = 200
"""Number of quiet samples of a record for which its own noise and the median of the survey weigh the same. Assumed; few
samples give a variance to a tenth."""

NOTED_OFFSET = 0.3
"""Offset in standard deviations of the noise from which it is noted: it changes the energy of a gate as much as noise
does."""


class TablePulses(NamedTuple):
    """Strengths of pulses and the rows that they came from.

    Attributes:
        row: Row of the table, from 0, shape (n_pulses,).
        strengths_v: Shape (n_pulses, n_channels).
        variance_v2: Noise variance of the strengths, same shape.
        is_clipped: True where a strength is too small because the samples reached full scale, same shape.
        notes: Offsets, noise, clipped pulses, and records without a pulse.
    """

    row: IntArray
    strengths_v: FloatArray
    variance_v2: FloatArray
    is_clipped: BoolArray
    notes: tuple[str, ...] = ()


def read_waveforms(table: InputTable, columns: list[str], noise_v: float | None, gate_s: float) -> TablePulses:
    """Return the strengths of the pulses in the files that a table names.

    Args:
        table: The table; names of files are relative to its folder. With a column `segment`, a row has only that
            segment of its file, from 1.
        columns: Columns of the names: one, or one for each channel.
        noise_v: Standard deviation of a noise sample, volts; None to measure it in each channel outside the pulses.
        gate_s: Length of the gates.

    Raises:
        InputFileError: If a file cannot be used, the files are inconsistent, or they contain no noise to measure.
    """
    read = lru_cache(maxsize=len(columns))(read_record)
    of_columns = ([str(name or "").strip() for name in table.columns[column].tolist()] for column in columns)
    names = list(zip(*of_columns, strict=True))
    segments = table.columns["segment"].tolist() if "segment" in table.columns else [None] * len(names)
    _check_names(table, names)
    found, shape = list[RecordPulses](), (0, 0.0)
    for row, (of_row, segment) in enumerate(zip(names, segments, strict=True)):
        try:
            record = _record_of_row(table.path.parent, of_row, segment, read)
            shape = shape if row else (record.samples.shape[1], record.sample_rate_hz)
            found.append(_pulses_of_record(record, shape, noise_v, gate_s))
            if len(record.samples) > 1 and "mains_phase_deg" in table.columns:
                raise ValueError("must be one segment, because the table has mains_phase_deg")
        except ValueError as error:  # InputFileError is a subclass
            text = str(error).splitlines()[0]
            text = text if text.startswith("waveform ") else f"waveform {', '.join(of_row)}: {text}"
            raise InputFileError([f"{table.path}: line {table.lines[row]}: {text}"]) from None
    noise_v2 = _noise(table.path, found, noise_v)
    keys = list(zip(names, segments, strict=True))
    unique = {key: of_record.extremes for key, of_record in zip(keys, found, strict=True)}
    rails = dict(zip(unique, Extremes.rails(list(unique.values())), strict=True))
    if not any(len(each.energy_v2) for each in found):
        raise InputFileError([f"{table.path}: no waveform holds a pulse above the noise"])
    pulses = _strengths(found, noise_v2, [rails[key] for key in keys], round(gate_s * shape[1]), noise_v)
    if n_repeated := len(keys) - len(unique):
        note = f"{counted(n_repeated, 'row')} with the waveforms of an earlier row: check the names of the files"
        pulses = pulses._replace(notes=(*pulses.notes, note))
    return pulses


def _check_names(table: InputTable, names: list[tuple[str, ...]]) -> None:
    """Check that the channels of each row have different files.

    Raises:
        InputFileError: If a row lacks a name, or names one file twice.
    """
    errors = list[str]()
    for line, of_row in zip(table.lines.tolist(), names, strict=True):
        if "" in of_row:
            errors.append(f"{table.path}: line {line}: must name a waveform file for each channel")
            continue
        if repeated := [name for name in of_row if of_row.count(name) > 1]:
            text = f"must have a different file for each channel, got {repeated[0]:.60} twice"
            errors.append(f"{table.path}: line {line}: {text}")
    if errors:
        raise InputFileError(errors)


def _record_of_row(
    folder: Path, names: tuple[str, ...], segment: float | None, read: Callable[[Path], WaveformRecord]
) -> WaveformRecord:
    """Read the files of one row as one record; raise ValueError with the name of the file."""
    records = list[WaveformRecord]()
    for name in names:
        try:
            records.append(read(folder / name))
        except ValueError as error:
            text = str(error).splitlines()[0].removeprefix(f"{folder / name}: ")
            raise ValueError(f"waveform {name}: {text}") from None
    record = WaveformRecord.join(records)
    if segment is not None:
        if segment not in range(1, len(record.samples) + 1):
            raise ValueError(f"segment must be from 1 to {len(record.samples)}, got {segment:g}")
        record = record._replace(samples=record.samples[int(segment) - 1 : int(segment)])
    return record


def _pulses_of_record(
    record: WaveformRecord, shape: tuple[int, float], noise_v: float | None, gate_s: float
) -> RecordPulses:
    """Find the pulses of a record that must have the number of channels and the sample rate `shape`."""
    if record.samples.shape[1] != shape[0] or abs(record.sample_rate_hz / shape[1] - 1) > 0.01:
        raise ValueError(
            f"must have {shape[0]} channels at {shape[1]:g} Hz as the first file, got {record.samples.shape[1]} at "
            f"{record.sample_rate_hz:g} Hz"
        )
    if not 1e6 <= shape[1] <= 1e12:  # pulses last for nanoseconds
        raise ValueError(f"sample_rate_hz must be from 1e+06 to 1e+12, got {shape[1]:g}")
    n_gate, n_samples = round(gate_s * shape[1]), record.samples.shape[2]
    if not 4 <= n_gate <= n_samples:  # fewer samples cannot hold a pulse
        raise ValueError(f"the gate must have 4 to {n_samples} samples; --gate-ns {gate_s * 1e9:g} is {n_gate}")
    return find_pulses(record, n_gate, noise_v)


def _noise(path: Path, found: list[RecordPulses], noise_v: float | None) -> FloatArray:
    """Return the variance of a noise sample in each record and channel, shape (n_records, n_channels)."""
    measured_v2, n_quiet = np.array([each.noise_v2 for each in found]), np.array([each.n_quiet for each in found])
    if noise_v is not None:
        return np.full(measured_v2.shape, noise_v**2)
    is_measured = np.isfinite(measured_v2).all(axis=1)
    if not is_measured.any():
        text = "waveforms hold no noise outside their gates; give longer records, a shorter --gate-ns, or --noise-v"
        raise InputFileError([f"{path}: {text}"])
    typical_v2 = np.median(measured_v2[is_measured], axis=0)
    weight = (n_quiet / (n_quiet + PRIOR_QUIET) * is_measured)[:, np.newaxis]
    return weight * np.where(is_measured[:, np.newaxis], measured_v2, 0.0) + (1 - weight) * typical_v2


def _strengths(
    found: list[RecordPulses], noise_v2: FloatArray, rails: list[BoolArray], n_gate: int, noise_v: float | None
) -> TablePulses:
    """Return the strengths of all pulses; those of clipped channels are restored where possible.

    Args:
        found: Pulses of each row.
        noise_v2: Variance of a noise sample, shape (n_rows, n_channels).
        rails: Which extremes of each row are rails, shape (2, n_channels) each.
        n_gate: Length of the gates.
        noise_v: Noise that was given.
    """
    row = np.repeat(np.arange(len(found)), [len(each.energy_v2) for each in found])
    strengths_v = strengths_of_energies(np.concatenate([each.energy_v2 for each in found]), n_gate, noise_v2[row])
    variance_v2 = strength_variance(np.nan_to_num(strengths_v), noise_v2[row], n_gate)
    is_clipped, is_restored = np.zeros(strengths_v.shape, np.bool_), np.zeros(strengths_v.shape, np.bool_)
    first = np.searchsorted(row, np.arange(len(found)))
    for k, (of_record, is_rail) in enumerate(zip(found, rails, strict=True)):
        end_v = of_record.extremes.volts - of_record.offset_v
        for pulse, gate_v in of_record.gates_v.items():
            reached = of_record.touches[pulse] & is_rail
            if reached.any():
                low_v, high_v = np.where(reached, end_v, [[-np.inf], [np.inf]])
                restored, at = restored_strengths(gate_v, low_v, high_v, noise_v2[k]), first[k] + pulse
                (is_clipped if restored is None else is_restored)[at] = reached.any(axis=0)
                if restored is not None:
                    strengths_v[at, is_restored[at]] = restored[0][is_restored[at]]
                    variance_v2[at] += restored[1]
    notes = [*_record_notes(found, noise_v2, noise_v), *_clipping_notes(is_restored, is_clipped)]
    return TablePulses(row, strengths_v, variance_v2, is_clipped, tuple(notes))


def _record_notes(found: list[RecordPulses], noise_v2: FloatArray, noise_v: float | None) -> list[str]:
    n_pulses, n_empty = sum(len(each.energy_v2) for each in found), sum(each.n_empty for each in found)
    notes = [f"{counted(n_pulses, 'pulse')} found in {counted(len(found), 'record')}"]
    if n_empty:
        notes.append(f"{n_empty} records or segments hold no pulse above the noise: left out")
    std_v, offset_v = np.sqrt(np.median(noise_v2, axis=0)), np.median([each.offset_v for each in found], axis=0)
    if noise_v is None:
        notes.append(f"noise outside the pulses: {', '.join(f'{1e3 * v:.3g}' for v in std_v)} mV, channel by channel")
    if (is_noted := np.abs(offset_v) > NOTED_OFFSET * std_v).any():
        of_channels = (f"{1e3 * offset_v[k]:+.3g} mV in channel {k + 1}" for k in np.flatnonzero(is_noted))
        notes.append(f"offset of the part without pulses removed: {', '.join(of_channels)}")
    return notes


def _clipping_notes(is_restored: BoolArray, is_clipped: BoolArray) -> list[str]:
    notes = list[str]()
    for is_such, done in (
        (is_restored, "strengths estimated from the samples between the rails, with larger deviations"),
        (is_clipped, "left out, because no other channel shows the shape of the pulse"),
    ):
        if n := np.count_nonzero(is_such.any(axis=1)):
            channels = ", ".join(f"{count} in channel {k + 1}" for k, count in enumerate(is_such.sum(axis=0)) if count)
            notes.append(f"{n} of {len(is_such)} pulses are clipped ({channels}): {done}")
    return notes
