"""Data from the field: a table of poses with strengths, or with the names of recorded waveforms."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic import CsvTable, InputFileError, read_csv_table
from pdpatrol.missions.field.plausibility import doubts
from pdpatrol.missions.field.waveform_files import (
    MAX_CHANNELS,
    MAX_STRENGTH_V,
    MIN_CHANNELS,
    TablePulses,
    read_waveforms,
)

FloatArray = NDArray[np.float64]

POSE_COLUMNS = ("time_s", "x_m", "y_m", "yaw_deg")
PHASE_COLUMN = "mains_phase_deg"

MAX_COORDINATE_M = 1e5
"""Positions are in a frame of the site; map coordinates of millions of metres would lose their centimetres."""

MAX_TIME_S = 5e9
"""Seconds since 1970 reach this in 2128; milliseconds since then are beyond it."""

LEAST_STRENGTH_V = 1e-12
"""A strength below is none, and no deviation is smaller (assumed): no receiver resolves it."""

MOST_STEPS = 20_000
"""With more times and poses than this, rows are pooled by pose (assumed): hours of a robot that reports its pose twice
a second keep their own."""

POOLED_S, POOLED_M, POOLED_RAD = 1.0, 0.1, np.radians(2.0)
"""So near each other in time, place and heading are rows that are pooled (assumed): less than what the Locator pools
its pulses by."""

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
    steps = _steps(time_s, pose)
    data = FieldData(
        path=path,
        time_s=steps.time_s,
        pose=steps.pose,
        step=steps.of_row[pulses.row],
        strengths_v=pulses.strengths_v,
        variance_v2=pulses.variance_v2,
        mains_phase_rad=phase[pulses.row],
        channels=np.arange(pulses.strengths_v.shape[1]),
        n_recorded=pulses.strengths_v.shape[1],
        notes=(*doubts(steps.time_s, steps.pose), *steps.notes),
    )
    return _without_dead(data)


class Steps(NamedTuple):
    """Times and poses of a table, without repetition.

    Attributes:
        time_s: Shape (n_steps,), not falling.
        pose: x m, y m, yaw rad, shape (n_steps, 3).
        of_row: Step of each row of the table, shape (n_rows,).
        notes: Whether, and how far, they were pooled.
    """

    time_s: FloatArray
    pose: FloatArray
    of_row: NDArray[np.intp]
    notes: tuple[str, ...] = ()


def _steps(time_s: FloatArray, pose: FloatArray) -> Steps:
    """Rows of one time and pose as one step; where there are too many, those of nearly one time and pose."""
    is_new = np.ones(time_s.size, dtype=np.bool_)
    is_new[1:] = (np.diff(time_s) != 0) | np.any(np.diff(pose, axis=0) != 0, axis=-1)
    single = Steps(time_s[is_new], pose[is_new], np.cumsum(is_new) - 1)
    if single.time_s.size <= MOST_STEPS:
        return single
    starts = _starts_of_pools(single)
    count = np.diff(np.append(starts, single.time_s.size))
    mean_s = np.add.reduceat(single.time_s - single.time_s[0], starts) / count + single.time_s[0]
    mean_pose = np.add.reduceat(single.pose, starts) / count[:, np.newaxis]
    pool = np.repeat(np.arange(starts.size), count)
    note = f"{single.time_s.size} times and poses, pooled into {starts.size}: within 1 s, 0.1 m and 2 degrees"
    return Steps(np.maximum.accumulate(mean_s), mean_pose, pool[single.of_row], (note,))


def _starts_of_pools(steps: Steps) -> NDArray[np.intp]:
    """The first step of each pool: one that is further than the rules say from the first step of the pool before."""
    starts: list[int] = []
    first_s = x_m = y_m = yaw_rad = np.inf
    for k, (time_s, (x, y, yaw)) in enumerate(zip(steps.time_s.tolist(), steps.pose.tolist(), strict=True)):
        is_near = abs(x - x_m) <= POOLED_M and abs(y - y_m) <= POOLED_M and abs(yaw - yaw_rad) <= POOLED_RAD
        if not is_near or time_s - first_s > POOLED_S:
            starts.append(k)
            first_s, x_m, y_m, yaw_rad = time_s, x, y, yaw
    return np.array(starts, dtype=np.intp)


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
            f"{table.path}: unknown column {', '.join(others):.200}; allowed are {', '.join(POSE_COLUMNS)} and either "
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
        return np.full(table.n_rows, np.nan)
    phase = np.radians(table.numbers(PHASE_COLUMN, lambda v: abs(v) <= 360, "-360 to 360 degrees")) % (2 * np.pi)
    if n_pulses > table.n_rows:
        table.faults.append(
            f"{table.path}: {PHASE_COLUMN}: allowed where each row is one pulse, not with files of several"
        )
    table.check()
    return phase


def _poses(table: CsvTable) -> tuple[FloatArray, FloatArray]:
    near = f"-{MAX_COORDINATE_M:g} to {MAX_COORDINATE_M:g} m, in a frame of the site"
    time_s = table.numbers("time_s", lambda v: abs(v) <= MAX_TIME_S, f"-{MAX_TIME_S:g} to {MAX_TIME_S:g} s")
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
    if not MIN_CHANNELS <= n <= MAX_CHANNELS:
        table.faults.append(
            f"{table.path}: {n} strength columns; allowed are {MIN_CHANNELS} or more, up to {MAX_CHANNELS}"
        )
    if not deviations and noise_v is None:
        table.faults.append(
            f"{table.path}: no columns std_1 to std_{n} and no --noise-v; give one: how far a strength can be trusted"
        )
    table.check()
    order = [f"strength_{k + 1}" for k in range(n)]
    most = f"{MAX_STRENGTH_V:g} V"
    values = [
        table.numbers(name, lambda v: (v >= 0) & (v <= MAX_STRENGTH_V), f"0 V or more, up to {most}") for name in order
    ]
    if deviations:
        above = f"above 0 V, {LEAST_STRENGTH_V:g} to {most}"
        std = [
            table.numbers(f"std_{k + 1}", lambda v: (v >= LEAST_STRENGTH_V) & (v <= MAX_STRENGTH_V), above)
            for k in range(n)
        ]
    else:
        std = [np.full(table.n_rows, noise_v)] * n
    table.check()
    strengths_v = np.column_stack(values)
    strengths_v[strengths_v < LEAST_STRENGTH_V] = 0.0
    return TablePulses(np.arange(table.n_rows), strengths_v, np.square(np.column_stack(std)))


def _without_dead(data: FieldData) -> FieldData:
    """Leave out channels that never gave anything, and pulses in which another channel was dead for once."""
    notes = list(data.notes)
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
