"""Data from the field: a table of poses with strengths, or with the names of recorded waveforms."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile

import numpy as np
from numpy.lib.npyio import NpzFile
from numpy.typing import NDArray

from dirmusic import (
    ArrayModel,
    CsvTable,
    ElementSpread,
    GainManifold,
    GainPattern,
    GaussianPattern,
    InputFileError,
    cut_windows,
    pulse_start,
    pulse_strengths,
    read_csv_table,
    strength_variance,
)

FloatArray = NDArray[np.float64]

POSE_COLUMNS = ("time_s", "x_m", "y_m", "yaw_deg")
PHASE_COLUMN = "mains_phase_deg"

MAX_COORDINATE_M = 1e5
"""Positions are in a frame of the site; map coordinates of millions of metres would lose their centimetres."""

MIN_CHANNELS = 3
"""Two elements hear most directions in pairs."""

GATE_S = 4.5e-9
"""Default length of the gate: 90 samples at 20 GS/s, for a pulse of 2.5 ns and a ring of 0.2 m."""

WAVEFORM_ARRAYS = ("waveforms", "sample_rate_hz", "volts_per_count")
"""Arrays of an .npz file; the last is for counts."""

QUIET_SAMPLES = 16
"""A record needs at least so many samples outside its gate, for the noise."""

BEFORE_GATE_SAMPLES = 10
"""Left out of the noise before the gate, for a pulse that the gate begins with; after it, as many as it is long."""

ALIKE = 0.01
"""Share by which time steps of a waveform table, or sample rates of several files, may differ."""


@dataclass(frozen=True, kw_only=True)
class FieldData:
    """Pulses and the poses they were heard from; rows of one time and pose are one step.

    Attributes:
        path: The table.
        time_s: Shape (n_steps,), not falling.
        pose: x m, y m, yaw rad, shape (n_steps, 3).
        step: Which step each pulse belongs to, shape (n_pulses,).
        strengths_v: Shape (n_pulses, n_channels); only channels that live.
        variance_v2: Of those, same shape.
        mains_phase_rad: Phase of the mains at each pulse, shape (n_pulses,), NaN where it is not known.
        channels: Which of the recorded channels live, from 0, shape (n_channels,).
        n_recorded: How many channels were recorded.
        notes: What was unusual and how it was dealt with.
    """

    path: Path
    time_s: FloatArray
    pose: FloatArray
    step: NDArray[np.intp]
    strengths_v: FloatArray
    variance_v2: FloatArray
    mains_phase_rad: FloatArray
    channels: NDArray[np.intp]
    n_recorded: int
    notes: tuple[str, ...] = ()


def read_field_data(path: Path, *, noise_v: float | None = None, gate_s: float = GATE_S) -> FieldData:
    """Read a table with the columns time_s, x_m, y_m, yaw_deg and what was heard there.

    That is either `strength_1` to `strength_n` in volts, one pulse a row, with `std_1` to `std_n` where the deviations
    are known; or `waveform`, a file beside the table: `.npz` with `waveforms` of shape (n_channels, n_samples) or
    (n_pulses, n_channels, n_samples), `sample_rate_hz` and, for counts, `volts_per_count`; or `.csv` with `time_s` and
    `channel_1` to `channel_n`. A channel that is zero throughout is left out, with a note. A column `mains_phase_deg`
    tells the kind of discharge, where each row is one pulse.

    Args:
        path: The table.
        noise_v: Deviation of a strength, or of a noise sample of a waveform, volts. Not needed where the table has
            deviations, or where waveforms hold noise outside the gate.
        gate_s: Length of the gate that is cut out of a waveform where it holds most energy.

    Raises:
        InputFileError: If anything is wrong; file and line are named.
    """
    table = read_csv_table(path)
    strengths = [name for name in table.header if re.fullmatch(r"strength_\d+", name)]
    deviations = [name for name in table.header if re.fullmatch(r"std_\d+", name)]
    known = (*POSE_COLUMNS, *strengths, *deviations, "waveform", PHASE_COLUMN)
    others = [name for name in table.header if name not in known]
    missing = [name for name in POSE_COLUMNS if name not in table.header]
    if missing:
        table.faults.append(f"{path}: no column {', '.join(missing)}; allowed are {', '.join(POSE_COLUMNS)} and more")
    if others:
        table.faults.append(
            f"{path}: unknown column {', '.join(others)}; allowed are {', '.join(POSE_COLUMNS)} and either waveform or "
            f"strength_1, strength_2 ... with or without std_1, std_2 ..., and {PHASE_COLUMN}"
        )
    if bool(strengths) == ("waveform" in table.header):
        table.faults.append(
            f"{path}: has {'both' if strengths else 'neither'} of strength_1 ... and waveform; give one"
        )
    table.check()
    time_s, pose = _poses(table)
    if strengths:
        pulses = _read_strengths(table, strengths, deviations, noise_v)
    else:
        pulses = _read_waveforms(table, noise_v, gate_s)
    phase = np.full(time_s.size, np.nan)
    if PHASE_COLUMN in table.header:
        phase = np.radians(table.numbers(PHASE_COLUMN, lambda v: abs(v) <= 360, "-360 to 360 degrees"))
        if pulses.row.size > time_s.size:
            table.faults.append(
                f"{path}: {PHASE_COLUMN}: allowed where each row is one pulse, not with files of several"
            )
        table.check()
    is_new = np.ones(time_s.size, dtype=np.bool_)
    is_new[1:] = (np.diff(time_s) != 0) | np.any(np.diff(pose, axis=0) != 0, axis=-1)
    data = FieldData(
        path=path,
        time_s=time_s[is_new],
        pose=pose[is_new],
        step=(np.cumsum(is_new) - 1)[pulses.row],
        strengths_v=pulses.strengths_v,
        variance_v2=pulses.variance_v2,
        mains_phase_rad=phase[pulses.row],
        channels=np.arange(pulses.strengths_v.shape[1]),
        n_recorded=pulses.strengths_v.shape[1],
    )
    return _without_dead(data)


def array_model(
    data: FieldData,
    spread: ElementSpread,
    pattern: GainPattern | None,
    boresights_deg: Sequence[float] | None,
    ring_radius_m: float,
) -> ArrayModel:
    """The array that heard the data, its live channels alone.

    Args:
        data: What was heard.
        spread: How far such arrays spread about the data sheet.
        pattern: Of every element; None for eq. (1).
        boresights_deg: One for each recorded channel; None for a ring, six elements of which four channels have the
            first four.
        ring_radius_m: Radius of the ring.

    Raises:
        InputFileError: If there are not as many boresights as channels, or the pattern tells no direction.
    """
    n = data.n_recorded
    if boresights_deg is not None and (len(boresights_deg) != n or not np.isfinite(boresights_deg).all()):
        raise InputFileError(
            [f"--boresights-deg: got {len(boresights_deg)} for {n} channels; allowed is one number for each"]
        )
    boresights = np.array(GainManifold.ring(6 if n == 4 else n).boresights_rad[:n])
    if boresights_deg is not None:
        boresights = np.radians(boresights_deg)
    try:
        manifold = GainManifold(pattern or GaussianPattern(), boresights).take(data.channels)
    except ValueError as error:
        raise InputFileError([f"--pattern, --boresights-deg: {error}"]) from None
    positions = ring_radius_m * np.stack([np.cos(boresights), np.sin(boresights)], axis=-1)
    return ArrayModel(manifold=manifold, positions_m=positions[data.channels], spread=spread)


class _Pulses(NamedTuple):
    """Pulses and the row of the table each came from."""

    row: NDArray[np.intp]
    strengths_v: FloatArray
    variance_v2: FloatArray


def _poses(table: CsvTable) -> tuple[FloatArray, FloatArray]:
    near = f"-{MAX_COORDINATE_M:g} to {MAX_COORDINATE_M:g} m, in a frame of the site"
    time_s = table.numbers("time_s")
    x, y = (table.numbers(name, lambda v: abs(v) <= MAX_COORDINATE_M, near) for name in ("x_m", "y_m"))
    yaw_deg = table.numbers("yaw_deg", lambda v: abs(v) <= 720, "-720 to 720 degrees, counter-clockwise from x")
    for row in np.flatnonzero(np.diff(time_s) < 0) + 1:
        table.fault(int(row), f"time_s: {time_s[row]:g} after {time_s[row - 1]:g}; allowed is not to fall")
    table.check()
    return time_s, np.column_stack([x, y, np.radians(yaw_deg)])


def _read_strengths(table: CsvTable, strengths: list[str], deviations: list[str], noise_v: float | None) -> _Pulses:
    n = len(strengths)
    for kind, names in (("strength", strengths), ("std", deviations)):
        expected = [f"{kind}_{k + 1}" for k in range(n)]
        if names and sorted(names) != sorted(expected):
            table.faults.append(
                f"{table.path}: columns {', '.join(names)}; allowed are {expected[0]} to {expected[-1]}, each once"
            )
    if n < MIN_CHANNELS:
        table.faults.append(f"{table.path}: {n} strength columns; allowed are {MIN_CHANNELS} or more")
    if not deviations and noise_v is None:
        table.faults.append(
            f"{table.path}: no columns std_1 to std_{n} and no --noise-v; give one: how far a strength can be trusted"
        )
    table.check()
    order = [f"strength_{k + 1}" for k in range(n)]
    values = [table.numbers(name, lambda v: v >= 0, "0 V or more") for name in order]
    if deviations:
        std = [table.numbers(f"std_{k + 1}", lambda v: v > 0, "above 0 V") for k in range(n)]
    else:
        std = [np.full(len(table.rows), noise_v)] * n
    table.check()
    return _Pulses(np.arange(len(table.rows)), np.column_stack(values), np.square(np.column_stack(std)))


class _Record(NamedTuple):
    """One waveform file: volts (n_pulses, n_channels, n_samples)."""

    waveforms_v: FloatArray
    sample_rate_hz: float


def _read_waveforms(table: CsvTable, noise_v: float | None, gate_s: float) -> _Pulses:
    records: list[_Record] = []
    for row, name in enumerate(table.text("waveform")):
        try:
            record = _read_record(table.path.parent / name)
            _check_record(record, records[0] if records else None, gate_s)
            records.append(record)
        except ValueError as error:
            table.fault(row, f"waveform: {name}: {error}")
    table.check()
    n_gate = _gate_samples(records[0], gate_s)
    gates: list[FloatArray] = []
    quiet: list[FloatArray] = []
    for record in records:
        x = record.waveforms_v
        start = pulse_start(x, n_gate)
        gates.append(cut_windows(x, start, n_gate))
        sample = np.arange(x.shape[-1]) - start[:, np.newaxis]
        is_quiet = (sample < -BEFORE_GATE_SAMPLES) | (sample >= 2 * n_gate)
        count = np.maximum(is_quiet.sum(axis=-1), 1)[:, np.newaxis]
        power = np.einsum("pik,pk->pi", np.square(x), is_quiet.astype(np.float64)) / count
        quiet.append(power[is_quiet.sum(axis=-1) >= QUIET_SAMPLES])
    if noise_v is None and sum(len(q) for q in quiet) == 0:
        raise InputFileError(
            [
                f"{table.path}: waveforms of {records[0].waveforms_v.shape[-1]} samples hold no noise apart from their "
                f"gate of {n_gate}; give longer records, a shorter --gate-ns, or --noise-v"
            ]
        )
    n_channels = records[0].waveforms_v.shape[1]
    variance = np.median(np.concatenate(quiet), axis=0) if noise_v is None else np.full(n_channels, noise_v**2)
    strengths = pulse_strengths(np.concatenate(gates), variance)
    row = np.repeat(np.arange(len(records)), [record.waveforms_v.shape[0] for record in records])
    return _Pulses(row, strengths, strength_variance(np.nan_to_num(strengths), variance, n_gate))


def _gate_samples(record: _Record, gate_s: float) -> int:
    return max(round(gate_s * record.sample_rate_hz), 2)


def _check_record(record: _Record, first: _Record | None, gate_s: float) -> None:
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


def _read_record(path: Path) -> _Record:
    """One waveform file; raises ValueError without the file's name."""
    if path.suffix.lower() == ".npz":
        return _read_npz(path)
    if path.suffix.lower() == ".csv":
        return _read_csv(path)
    raise ValueError(f"ends in `{path.suffix}`; allowed are .npz and .csv")


def _read_npz(path: Path) -> _Record:
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
    return _Record(volts.reshape(-1, *volts.shape[-2:]), float(rate))


def _read_csv(path: Path) -> _Record:
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
    return _Record(volts[np.newaxis], 1.0 / float(steps.mean()))


def _without_dead(data: FieldData) -> FieldData:
    """Leave out channels that never gave anything, and pulses in which another channel was dead for once."""
    notes: list[str] = []
    strengths = data.strengths_v
    is_alive = np.any(np.nan_to_num(strengths) > 0, axis=0)
    if is_alive.sum() < MIN_CHANNELS:
        told = "no channel gave anything" if not is_alive.any() else f"only {is_alive.sum()} channels gave anything"
        raise InputFileError([f"{data.path}: {told}; allowed are {MIN_CHANNELS} live channels or more"])
    for channel in np.flatnonzero(~is_alive):
        notes.append(f"channel {channel + 1} is zero throughout: left out")
    whole = np.isfinite(strengths[:, is_alive]).all(axis=-1)
    if not whole.all():
        notes.append(f"{int((~whole).sum())} pulses with a channel of nothing but zeros: left out")
    silent = whole & ~np.any(strengths[:, is_alive] > 0, axis=-1)
    if silent.any():
        notes.append(f"{int(silent.sum())} pulses no stronger than the noise: no bearing")
    return replace(
        data,
        step=data.step[whole],
        strengths_v=strengths[np.ix_(whole, is_alive)],
        variance_v2=data.variance_v2[np.ix_(whole, is_alive)],
        mains_phase_rad=data.mains_phase_rad[whole],
        channels=np.flatnonzero(is_alive),
        notes=tuple(notes),
    )
