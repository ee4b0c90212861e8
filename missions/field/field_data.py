"""Data from the field: a table of poses with strengths, or with the names of recorded waveforms."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dirmusic import CsvTable, InputFileError, read_csv_table
from missions.field.waveform_files import MIN_CHANNELS, TablePulses, read_waveforms

FloatArray = NDArray[np.float64]

POSE_COLUMNS = ("time_s", "x_m", "y_m", "yaw_deg")
PHASE_COLUMN = "mains_phase_deg"

MAX_COORDINATE_M = 1e5
"""Positions are in a frame of the site; map coordinates of millions of metres would lose their centimetres."""

GATE_S = 4.5e-9
"""Default length of the gate: 90 samples at 20 GS/s, for a pulse of 2.5 ns and a ring of 0.2 m."""


@dataclass(frozen=True, kw_only=True)
class FieldData:
    """Strengths of pulses and the poses they were received at; rows of one time and pose are one step.

    Attributes:
        path: The table.
        time_s: Shape (n_steps,), not falling.
        pose: x m, y m, yaw rad, shape (n_steps, 3).
        step: Step that each pulse belongs to, from 0, shape (n_pulses,).
        strengths_v: Shape (n_pulses, n_channels); live channels alone.
        variance_v2: Noise variance of the strengths, same shape.
        mains_phase_rad: Phase of the mains at each pulse, in [0, 2 pi), shape (n_pulses,), NaN where it is not known.
        channels: Numbers, from 0, of the live ones among the recorded channels, shape (n_channels,).
        n_recorded: Number of recorded channels.
        notes: Whatever was unusual, and how it was dealt with.
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
    """Read a table with the columns time_s, x_m, y_m, yaw_deg and the pulses received there.

    Pulses are either `strength_1` to `strength_n` in volts, one pulse a row, with `std_1` to `std_n` where the
    deviations are known; or `waveform`, a file in the table's folder: `.npz` with `waveforms` of shape (n_channels,
    n_samples) or (n_pulses, n_channels, n_samples), `sample_rate_hz` and, for counts, `volts_per_count`; or `.csv` with
    `time_s` and `channel_1` to `channel_n`. A channel that is zero throughout is left out, with a note. A column
    `mains_phase_deg` gives the kind of discharge, where each row is one pulse.

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
    _check_columns(table, strengths, deviations)
    time_s, pose = _poses(table)
    if strengths:
        pulses = _read_strengths(table, strengths, deviations, noise_v)
    else:
        pulses = read_waveforms(table, noise_v, gate_s)
    phase = _mains_phase(table, pulses.row.size)
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


def _check_columns(table: CsvTable, strengths: list[str], deviations: list[str]) -> None:
    known = (*POSE_COLUMNS, *strengths, *deviations, "waveform", PHASE_COLUMN)
    others = [name for name in table.header if name not in known]
    missing = [name for name in POSE_COLUMNS if name not in table.header]
    if missing:
        table.faults.append(
            f"{table.path}: no column {', '.join(missing)}; allowed are {', '.join(POSE_COLUMNS)} and more"
        )
    if others:
        table.faults.append(
            f"{table.path}: unknown column {', '.join(others)}; allowed are {', '.join(POSE_COLUMNS)} and either "
            f"waveform or strength_1, strength_2 ... with or without std_1, std_2 ..., and {PHASE_COLUMN}"
        )
    if bool(strengths) == ("waveform" in table.header):
        table.faults.append(
            f"{table.path}: has {'both' if strengths else 'neither'} of strength_1 ... and waveform; give one"
        )
    table.check()


def _mains_phase(table: CsvTable, n_pulses: int) -> FloatArray:
    """Phase of the mains in each row of the table, in [0, 2 pi); NaN where the table has no such column."""
    if PHASE_COLUMN not in table.header:
        return np.full(len(table.rows), np.nan)
    phase = np.radians(table.numbers(PHASE_COLUMN, lambda v: abs(v) <= 360, "-360 to 360 degrees")) % (2 * np.pi)
    if n_pulses > len(table.rows):
        table.faults.append(
            f"{table.path}: {PHASE_COLUMN}: allowed where each row is one pulse, not with files of several"
        )
    table.check()
    return phase


def _poses(table: CsvTable) -> tuple[FloatArray, FloatArray]:
    near = f"-{MAX_COORDINATE_M:g} to {MAX_COORDINATE_M:g} m, in a frame of the site"
    time_s = table.numbers("time_s")
    x, y = (table.numbers(name, lambda v: abs(v) <= MAX_COORDINATE_M, near) for name in ("x_m", "y_m"))
    yaw_deg = table.numbers("yaw_deg", lambda v: abs(v) <= 720, "-720 to 720 degrees, counter-clockwise from x")
    for row in np.flatnonzero(np.diff(time_s) < 0) + 1:
        table.fault(int(row), f"time_s: {time_s[row]:g} after {time_s[row - 1]:g}; allowed is not to fall")
    table.check()
    return time_s, np.column_stack([x, y, np.radians(yaw_deg)])


def _read_strengths(table: CsvTable, strengths: list[str], deviations: list[str], noise_v: float | None) -> TablePulses:
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
    return TablePulses(np.arange(len(table.rows)), np.column_stack(values), np.square(np.column_stack(std)))


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
