"""Field data: a table of poses with the strengths of pulses, or with the names of recorded waveforms."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dirmusic import InputFileError, PulseBatch
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from pdpatrol.missions.field.input_table import InputTable, read_table
from pdpatrol.missions.field.instruments.record import MAX_VOLTS
from pdpatrol.missions.field.waveform_files import TablePulses, read_waveforms

MIN_CHANNELS, MAX_CHANNELS = 3, 32
"""Range of the number of channels. With two elements, most ratios of strengths occur in two directions; no portable
array has more than 32."""

MIN_STRENGTH_V = 1e-12
"""Strength below which a value counts as zero, and smallest standard deviation. Assumed; no receiver resolves it."""

MAX_STEPS = 20_000
"""Number of poses beyond which rows are pooled. Assumed; nearly three hours at two poses per second."""

POOLED = np.array([1.0, 0.1, 0.1, np.radians(2.0)])
"""Cell size for pooling rows: time (s), x, y (m) and heading (rad). Assumed; smaller than the cells of the Locator."""


@dataclass(frozen=True, kw_only=True)
class FieldData:
    """Strengths of pulses and the poses at which they were received; rows with the same time and pose form one step.

    Attributes:
        path: The table.
        time_s: Time of each step, not decreasing, shape (n_steps,).
        pose: x m, y m, yaw rad, shape (n_steps, 3).
        step: Step of each pulse, from 0, shape (n_pulses,).
        pulses: Pulses in the live channels, without directions.
        channels: Numbers, from 0, of the live channels among the recorded ones, shape (n_channels,).
        n_recorded: Number of recorded channels.
        notes: Anything unusual, and how it was handled.
    """

    path: Path
    time_s: FloatArray
    pose: FloatArray
    step: IntArray
    pulses: PulseBatch
    channels: IntArray
    n_recorded: int
    notes: tuple[str, ...] = ()


def read_field_data(path: Path, *, noise_v: float | None = None, gate_s: float = 4.5e-9) -> FieldData:
    """Read a table with the columns time_s, x_m, y_m, yaw_deg and the pulses received there.

    Pulses are either `strength_1` to `strength_n` in volts, one pulse per row, with standard deviations `std_1` to
    `std_n` where they are known; or `waveform`, the name of a file of an instrument in the folder of the table, or
    `waveform_1` to `waveform_n` for one file per channel (see `instruments`). All pulses of a file are found; the
    column `segment` selects one segment of it, from 1. A channel that is zero throughout is omitted, with a note. With
    the column `mains_phase_deg`, the kind of discharge is classified.

    Args:
        path: The table.
        noise_v: Standard deviation of a strength, or of a noise sample of a waveform, volts. Not needed where the table
            has deviations, or where waveforms contain noise outside the gate.
        gate_s: Length of the gate of a pulse; the default is for a pulse of 2.5 ns and a ring of 0.2 m.

    Raises:
        InputFileError: If the table or a waveform file is invalid; the message names file and line.
    """
    table = read_table(path)
    strengths, deviations, waveforms = _check_columns(table)
    poses = np.hstack(
        [
            table.numbers(-5e9, 5e9, "time_s"),  # includes Unix times in seconds, but not in milliseconds
            table.numbers(-1e5, 1e5, "x_m", "y_m"),
            np.radians(table.numbers(-720, 720, "yaw_deg")),
        ]
    )
    time_s, phase_rad = poses[:, 0], np.full(len(poses), np.nan)
    if "mains_phase_deg" in table.columns:
        phase_rad = np.radians(table.numbers(-360, 360, "mains_phase_deg")[:, 0]) % (2 * np.pi)
    for row in np.flatnonzero(np.diff(time_s) < 0):
        text = f"time_s must not decrease: {time_s[row]:g} is followed by {time_s[row + 1]:g}"
        table.errors.append(f"{path}: line {table.lines[row + 1]}: {text}")
    table.check()
    if strengths:
        pulses = _read_strengths(table, strengths, deviations, noise_v)
    else:
        pulses = read_waveforms(table, waveforms, noise_v, gate_s)
    is_alive = np.any(np.nan_to_num(pulses.strengths_v) > 0, axis=0)
    if not MIN_CHANNELS <= is_alive.sum() <= MAX_CHANNELS:
        must = f"must have {MIN_CHANNELS} to {MAX_CHANNELS} channels with a signal"
        raise InputFileError([f"{path}: {must}, got {is_alive.sum()}"])
    is_complete = np.isfinite(pulses.strengths_v[:, is_alive]).all(axis=-1)
    steps, step_of_row, notes = _steps(poses)
    notes += pulses.notes
    notes += doubts(steps[:, 1:])
    notes += [f"channel {channel + 1} is zero throughout: left out" for channel in np.flatnonzero(~is_alive)]
    if not is_complete.all():
        notes.append(f"{np.sum(~is_complete)} pulses with a channel of zeros: left out")
    row, used = pulses.row[is_complete], np.ix_(is_complete, is_alive)
    step = step_of_row[row]
    batch = PulseBatch.detected(steps[step, 0], pulses.strengths_v[used], pulses.variance_v2[used], phase_rad[row])
    return FieldData(
        path=path,
        time_s=steps[:, 0],
        pose=steps[:, 1:],
        step=step,
        pulses=batch._replace(is_clipped=pulses.is_clipped[used]),
        channels=np.flatnonzero(is_alive),
        n_recorded=is_alive.size,
        notes=tuple(notes),
    )


def _steps(poses: FloatArray) -> tuple[FloatArray, IntArray, list[str]]:
    """Group consecutive rows with the same time and pose into steps; if these are too many, pool the rows by cell.

    Args:
        poses: time s, x m, y m and yaw rad of each row, shape (n_rows, 4).

    Returns:
        The same for each step; the step of each row, shape (n_rows,); and a note if rows were pooled.
    """
    notes: list[str] = []
    is_first = _changes(poses)
    if is_first.sum() > MAX_STEPS:
        n_steps, is_first = is_first.sum(), _changes(np.floor((poses - poses[0]) / POOLED))
        notes = [f"{n_steps} times and poses were pooled into {is_first.sum()}: within 1 s, 0.1 m and 2 degrees"]
    starts = np.flatnonzero(is_first)
    count = np.diff(starts, append=len(poses))
    means = poses[0] + np.add.reduceat(poses - poses[0], starts) / count[:, np.newaxis]
    return means, np.cumsum(is_first) - 1, notes


def _changes(rows: FloatArray) -> BoolArray:
    """Return True for the first row and for each row that differs from the one before it."""
    return np.append(True, np.any(np.diff(rows, axis=0) != 0, axis=-1))


def doubts(pose: FloatArray) -> list[str]:
    """Return notes on values that are probably in the wrong unit; the data are used nevertheless.

    Args:
        pose: x m, y m, yaw rad as read, shape (n, 3).
    """
    notes: list[str] = []
    yaw_deg, size_m = np.degrees(pose[:, 2]), np.ptp(pose[:, :2], axis=0).max()
    turns = np.ptp(yaw_deg) > 2.0 and np.unique(yaw_deg).size >= 4
    if turns and np.abs(yaw_deg).max() <= 2 * np.pi:
        notes.append(
            f"yaw_deg: {yaw_deg.min():.3g} to {yaw_deg.max():.3g} in all rows looks like radians; read as degrees"
        )
    if size_m > 1000.0:  # wider than any site
        notes.append(f"x_m, y_m: a site of {size_m:.0f} m looks like millimetres; read as metres")
    return notes


def _check_columns(table: InputTable) -> tuple[list[str], list[str], list[str]]:
    """Check the names of the columns; return those of strengths, of their deviations, and of waveform files."""
    kinds = ("strength", "std", "waveform")
    counts = [sum(name.startswith(f"{kind}_") for name in table.columns) for kind in kinds]
    strengths, deviations, waveforms = (
        [f"{kind}_{k + 1}" for k in range(n)] for kind, n in zip(kinds, counts, strict=True)
    )
    deviations = [f"std_{k + 1}" for k in range(len(strengths))] if deviations else []
    waveforms = [] if strengths else waveforms or ["waveform"]
    needed = ["time_s", "x_m", "y_m", "yaw_deg", *strengths, *deviations, *waveforms]
    optional = ["mains_phase_deg", *(["segment"] if waveforms else [])]
    missing = [name for name in needed if name not in table.columns]
    unknown = [name for name in table.columns if name not in (*needed, *optional)]
    for kind, names in (("missing", missing), ("unknown", unknown)):
        if names:
            table.errors.append(
                f"{table.path}: column {', '.join(names):.200} is {kind}; columns are time_s, x_m, y_m, yaw_deg, "
                "either waveform (or waveform_1, waveform_2 ...) and segment, or strength_1, strength_2 ... and std_1, "
                "std_2 ..., and mains_phase_deg"
            )
    table.check()
    return strengths, deviations, waveforms


def _read_strengths(
    table: InputTable, strengths: list[str], deviations: list[str], noise_v: float | None
) -> TablePulses:
    levels = np.column_stack([table.columns[name] for name in strengths])
    if np.mean(levels < 0) > 0.5:
        text = f"strengths must be in volts, not in decibels: most are negative, such as {levels[levels < 0][0]:g}"
        raise InputFileError([f"{table.path}: {text}"])
    strengths_v = table.numbers(0, MAX_VOLTS, *strengths)
    if deviations:
        std_v = table.numbers(MIN_STRENGTH_V, MAX_VOLTS, *deviations)
    elif noise_v is not None:
        std_v = np.full(strengths_v.shape, noise_v)
    else:
        text = f"needs the columns std_1 to std_{len(strengths)}, or --noise-v: how far a strength can be trusted"
        raise InputFileError([f"{table.path}: {text}"])
    table.check()
    strengths_v[strengths_v < MIN_STRENGTH_V] = 0.0
    return TablePulses(
        np.arange(len(strengths_v)), strengths_v, np.square(std_v), np.zeros(strengths_v.shape, np.bool_)
    )
