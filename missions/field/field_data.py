"""Field data: a table of poses with the strengths of pulses, or with the names of recorded waveforms."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic import InputFileError
from pdpatrol.missions.field.input_table import InputTable, read_table
from pdpatrol.missions.field.waveform_files import (
    MAX_CHANNELS,
    MAX_VOLTS,
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
"""Seconds since 1970 reach this in 2128; milliseconds since then exceed it."""

MIN_STRENGTH_V = 1e-12
"""Weaker strengths count as zero, and no standard deviation is smaller. Assumed; no receiver resolves it."""

MAX_STEPS = 20_000
"""Poses beyond which rows are pooled. Assumed; hours of a robot that reports its pose twice a second are kept apart."""

POOLED = np.array([1.0, 0.1, 0.1, np.radians(2.0)])
"""Span of time (s), x, y (m) and heading (rad) of pooled rows. Assumed; finer than the Locator pools its pulses."""


@dataclass(frozen=True, kw_only=True)
class FieldData:
    """Strengths of pulses and the poses at which they were received; rows of one time and pose are one step.

    Attributes:
        path: The table.
        time_s: Time of each step, not decreasing, shape (n_steps,).
        pose: x m, y m, yaw rad, shape (n_steps, 3).
        step: Step of each pulse, from 0, shape (n_pulses,).
        strengths_v: Strengths in the live channels, shape (n_pulses, n_channels).
        variance_v2: Noise variance of the strengths, same shape.
        mains_phase_rad: Phase of the mains at each pulse, in [0, 2 pi), NaN where unknown, shape (n_pulses,).
        channels: Numbers, from 0, of the live channels among the recorded ones, shape (n_channels,).
        n_recorded: Number of recorded channels.
        notes: Anything unusual, and how it was handled.
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


def read_field_data(path: Path, *, noise_v: float | None = None, gate_s: float = 4.5e-9) -> FieldData:
    """Read a table with the columns time_s, x_m, y_m, yaw_deg and the pulses received there.

    Pulses are either `strength_1` to `strength_n` in volts, one pulse per row, with standard deviations `std_1` to
    `std_n` where they are known; or `waveform`, the name of a file in the folder of the table (see `waveform_files`).
    A channel that is zero throughout is left out with a note. The column `mains_phase_deg`, from which the kind of
    discharge is classified, needs one pulse per row.

    Args:
        path: The table.
        noise_v: Standard deviation of a strength, or of a noise sample of a waveform, volts. Not needed where the table
            has deviations, or where waveforms hold noise outside the gate.
        gate_s: Length of the gate, which is cut out of a waveform where it holds most energy; the default is for a
            pulse of 2.5 ns and a ring of 0.2 m.

    Raises:
        InputFileError: If anything is wrong; file and line are named.
    """
    table = read_table(path)
    strengths, deviations = (
        [name for name in table.columns if re.fullmatch(rf"{kind}_\d+", name)] for kind in ("strength", "std")
    )
    _check_columns(table, strengths, deviations)
    time_s, pose = _poses(table)
    if strengths:
        pulses = _read_strengths(table, strengths, deviations, noise_v)
    else:
        pulses = read_waveforms(table, noise_v, gate_s)
    phase_rad = _mains_phase(table, pulses.row.size)
    steps = _steps(time_s, pose)
    n_channels = pulses.strengths_v.shape[1]
    data = FieldData(
        path=path,
        time_s=steps.time_s,
        pose=steps.pose,
        step=steps.of_row[pulses.row],
        strengths_v=pulses.strengths_v,
        variance_v2=pulses.variance_v2,
        mains_phase_rad=phase_rad[pulses.row],
        channels=np.arange(n_channels),
        n_recorded=n_channels,
        notes=(*doubts(steps.time_s, steps.pose), *steps.notes),
    )
    return _without_dead_channels(data)


class Steps(NamedTuple):
    """Distinct times and poses of a table.

    Attributes:
        time_s: Not decreasing, shape (n_steps,).
        pose: x m, y m, yaw rad, shape (n_steps, 3).
        of_row: Step of each row of the table, shape (n_rows,).
        notes: A note if rows were pooled.
    """

    time_s: FloatArray
    pose: FloatArray
    of_row: NDArray[np.intp]
    notes: tuple[str, ...] = ()


def _steps(time_s: FloatArray, pose: FloatArray) -> Steps:
    """Make one step of all rows of one time and pose, or of neighbouring ones where there are too many."""
    is_new = np.ones(time_s.size, dtype=np.bool_)
    is_new[1:] = (np.diff(time_s) != 0) | np.any(np.diff(pose, axis=0) != 0, axis=-1)
    single = Steps(time_s[is_new], pose[is_new], np.cumsum(is_new) - 1)
    if single.time_s.size <= MAX_STEPS:
        return single
    starts = _pool_starts(single)
    count = np.diff(np.append(starts, single.time_s.size))
    mean_s = np.add.reduceat(single.time_s - single.time_s[0], starts) / count + single.time_s[0]
    mean_pose = np.add.reduceat(single.pose, starts) / count[:, np.newaxis]
    pool = np.repeat(np.arange(starts.size), count)
    note = f"{single.time_s.size} times and poses were pooled into {starts.size}: within 1 s, 0.1 m and 2 degrees"
    return Steps(np.maximum.accumulate(mean_s), mean_pose, pool[single.of_row], (note,))


def _pool_starts(steps: Steps) -> NDArray[np.intp]:
    """Find the first step of each pool: it is too far from the first step of the pool before."""
    starts: list[int] = []
    first = np.full(4, np.inf)
    for k, row in enumerate(np.column_stack([steps.time_s, steps.pose])):
        if (np.abs(row - first) > POOLED).any():
            starts.append(k)
            first = row
    return np.array(starts, dtype=np.intp)


def doubts(time_s: FloatArray, pose: FloatArray) -> list[str]:
    """Note units that the table probably does not have; the data are used all the same.

    Args:
        time_s: Not decreasing, shape (n,).
        pose: x m, y m, yaw rad as read, shape (n, 3).
    """
    notes: list[str] = []
    if len(pose) < 4:  # too few to judge their units
        return notes
    yaw_deg = np.degrees(pose[:, 2])
    turns = np.ptp(yaw_deg) > 2.0 and np.unique(yaw_deg).size >= 4
    if turns and np.abs(yaw_deg).max() <= 2 * np.pi:
        notes.append(
            f"yaw_deg: {yaw_deg.min():.3g} to {yaw_deg.max():.3g} in all rows looks like radians; read as degrees"
        )
    size_m, step_s = float(np.ptp(pose[:, :2], axis=0).max()), np.diff(time_s)
    speed_mps = np.linalg.norm(np.diff(pose[:, :2], axis=0), axis=-1)[step_s > 0] / step_s[step_s > 0]
    usual_mps = float(np.median(speed_mps[speed_mps > 0])) if (speed_mps > 0).any() else 0.0
    if size_m > 1000.0:  # wider than any site
        notes.append(f"x_m, y_m: a site of {size_m:.0f} m looks like millimetres; read as metres")
    elif usual_mps > 30.0:  # faster than any survey
        notes.append(f"x_m, y_m: {usual_mps:.0f} m/s from row to row looks like millimetres; read as metres")
    return notes


def _check_columns(table: InputTable, strengths: list[str], deviations: list[str]) -> None:
    known = {*POSE_COLUMNS, *strengths, *deviations, "waveform", PHASE_COLUMN}
    missing = [name for name in POSE_COLUMNS if name not in table.columns]
    others = [name for name in table.columns if name not in known]
    if missing:
        table.add_error(f"column {', '.join(missing)} is missing")
    if others:
        table.add_error(
            f"unknown column {', '.join(others):.200}; columns are {', '.join(POSE_COLUMNS)}, {PHASE_COLUMN}, and "
            "either waveform or strength_1, strength_2 ... and std_1, std_2 ..."
        )
    if bool(strengths) == ("waveform" in table.columns):
        table.add_error(f"must have strength_1 ... or waveform, got {'both' if strengths else 'neither'}")
    for kind, names in (("strength", strengths), ("std", deviations)):
        expected = [f"{kind}_{k + 1}" for k in range(len(strengths))]
        if strengths and names and sorted(names) != sorted(expected):
            table.add_error(f"columns must be {expected[0]} to {expected[-1]}, got {', '.join(names):.200}")
    if strengths and not MIN_CHANNELS <= len(strengths) <= MAX_CHANNELS:
        table.add_error(f"must have {MIN_CHANNELS} to {MAX_CHANNELS} columns of strengths, got {len(strengths)}")
    table.check()


def _mains_phase(table: InputTable, n_pulses: int) -> FloatArray:
    """Return the phase of the mains in each row, in [0, 2 pi); NaN if the table has no such column."""
    n_rows = table.lines.size
    if PHASE_COLUMN not in table.columns:
        return np.full(n_rows, np.nan)
    phase_rad = np.radians(table.numbers(PHASE_COLUMN, -360, 360, " degrees")) % (2 * np.pi)
    if n_pulses > n_rows:
        table.add_error(f"{PHASE_COLUMN} needs one pulse per row, and a waveform file holds several")
    table.check()
    return phase_rad


def _poses(table: InputTable) -> tuple[FloatArray, FloatArray]:
    time_s = table.numbers("time_s", -MAX_TIME_S, MAX_TIME_S, " s")
    x, y = (
        table.numbers(name, -MAX_COORDINATE_M, MAX_COORDINATE_M, " m, in a frame of the site")
        for name in ("x_m", "y_m")
    )
    yaw_deg = table.numbers("yaw_deg", -720, 720, " degrees, counter-clockwise from x")
    for row in np.flatnonzero(np.diff(time_s) < 0).tolist():
        table.add_error(f"time_s must not decrease: {time_s[row]:g} is followed by {time_s[row + 1]:g}", row + 1)
    table.check()
    return time_s, np.column_stack([x, y, np.radians(yaw_deg)])


def _read_strengths(
    table: InputTable, strengths: list[str], deviations: list[str], noise_v: float | None
) -> TablePulses:
    n = len(strengths)
    if not deviations and noise_v is None:
        table.add_error(f"needs the columns std_1 to std_{n}, or --noise-v: how far a strength can be trusted")
    table.check()
    strengths_v = np.column_stack([table.numbers(f"strength_{k + 1}", 0, MAX_VOLTS, " V") for k in range(n)])
    if deviations:
        std_v = np.column_stack([table.numbers(f"std_{k + 1}", MIN_STRENGTH_V, MAX_VOLTS, " V") for k in range(n)])
    else:
        std_v = np.full(strengths_v.shape, noise_v)
    table.check()
    strengths_v[strengths_v < MIN_STRENGTH_V] = 0.0
    return TablePulses(np.arange(table.lines.size), strengths_v, np.square(std_v))


def _without_dead_channels(data: FieldData) -> FieldData:
    """Leave out channels that are zero throughout, and pulses in which another channel was dead."""
    notes = list(data.notes)
    strengths = data.strengths_v
    is_alive = np.any(np.nan_to_num(strengths) > 0, axis=0)
    if is_alive.sum() < MIN_CHANNELS:
        raise InputFileError(
            [f"{data.path}: must have {MIN_CHANNELS} or more channels with a signal, got {is_alive.sum()}"]
        )
    notes += [f"channel {channel + 1} is zero throughout: left out" for channel in np.flatnonzero(~is_alive)]
    is_complete = np.isfinite(strengths[:, is_alive]).all(axis=-1)
    if not is_complete.all():
        notes.append(f"{int((~is_complete).sum())} pulses with a channel of zeros: left out")
    is_weak = is_complete & ~np.any(strengths[:, is_alive] > 0, axis=-1)
    if is_weak.any():
        notes.append(f"{int(is_weak.sum())} pulses no stronger than the noise: no bearing")
    return replace(
        data,
        step=data.step[is_complete],
        strengths_v=strengths[np.ix_(is_complete, is_alive)],
        variance_v2=data.variance_v2[np.ix_(is_complete, is_alive)],
        mains_phase_rad=data.mains_phase_rad[is_complete],
        channels=np.flatnonzero(is_alive),
        notes=tuple(notes),
    )
