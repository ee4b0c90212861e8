"""Field data: a table of poses with the strengths of pulses, or with the names of recorded waveforms."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dirmusic import InputFileError, PulseBatch
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from pdpatrol.missions.field.input_table import InputTable, read_table
from pdpatrol.missions.field.instruments.record import MAX_VOLTS
from pdpatrol.missions.field.survey import HEADINGS, Heading
from pdpatrol.missions.field.waveform_files import TablePulses, read_waveforms
from pdpatrol.missions.record.words import counted

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


def read_field_data(
    path: Path, *, noise_v: float | None = None, gate_s: float = 4.5e-9, heading: Heading = "counterclockwise"
) -> FieldData:
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
        heading: Convention of the angles in yaw_deg.

    Raises:
        InputFileError: If the table or a waveform file is invalid; the message names file and line.
    """
    table = read_table(path)
    check_columns(table)
    poses, phase_rad, pulses = survey_rows(table, noise_v, gate_s, heading)
    time_s = poses[:, 0]
    for row in np.flatnonzero(np.diff(time_s) < 0):
        text = f"time_s must not decrease: {time_s[row]:g} is followed by {time_s[row + 1]:g}"
        table.errors.append(f"{path}: line {table.lines[row + 1]}: {text}")
    table.check()
    return assemble(path, poses, phase_rad, pulses)


def assemble(path: Path, poses: FloatArray, phase_rad: FloatArray, pulses: TablePulses) -> FieldData:
    """Leave out channels without a signal, and group rows into steps.

    Args:
        path: The table or recording.
        poses: time s, x m, y m and yaw rad of each row, shape (n_rows, 4); the times do not decrease.
        phase_rad: Mains phase of each row, NaN where it is unknown, shape (n_rows,).
        pulses: Pulses and their rows; a row may have none.

    Raises:
        InputFileError: If too few or too many channels have a signal.
    """
    is_alive = np.any(np.nan_to_num(pulses.strengths_v) > 0, axis=0)
    if not MIN_CHANNELS <= is_alive.sum() <= MAX_CHANNELS:
        must = f"must have {MIN_CHANNELS} to {MAX_CHANNELS} channels with a signal"
        raise InputFileError([f"{path}: {must}, got {is_alive.sum()}"])
    is_complete = np.isfinite(pulses.strengths_v[:, is_alive]).all(axis=-1)
    steps, step_of_row, notes = steps_of(poses, MAX_STEPS)
    notes += pulses.notes
    notes += [f"channel {channel + 1} is zero throughout: left out" for channel in np.flatnonzero(~is_alive)]
    if not is_complete.all():
        notes.append(f"{counted(np.sum(~is_complete), 'pulse')} with a channel of zeros: left out")
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


def survey_rows(
    table: InputTable, noise_v: float | None, gate_s: float, heading: Heading = "counterclockwise"
) -> tuple[FloatArray, FloatArray, TablePulses]:
    """Check and convert the cells of a table; see `read_field_data` for the arguments.

    Returns:
        time s, x m, y m and yaw rad of each row, shape (n_rows, 4); mains phase in radians, NaN where it is unknown,
        shape (n_rows,); and the pulses.

    Raises:
        InputFileError: If a cell or a waveform file is invalid.
    """
    poses = np.hstack(
        [
            table.numbers(-5e9, 5e9, "time_s"),  # includes Unix times in seconds, but not in milliseconds
            table.numbers(-1e6, 1e6, "x_m", "y_m"),  # a site of 1 km in millimetres is read, and doubted
            np.radians(HEADINGS[heading].yaw_deg(table.numbers(-36_000, 36_000, "yaw_deg"))),  # up to a hundred turns
        ]
    )
    phase_rad = np.full(len(poses), np.nan)
    if "mains_phase_deg" in table.columns:
        phase_rad = np.radians(table.numbers(-360, 360, "mains_phase_deg")[:, 0]) % (2 * np.pi)
    table.check()
    if waveforms := waveform_columns(table):
        return poses, phase_rad, read_waveforms(table, waveforms, noise_v, gate_s)
    return poses, phase_rad, _read_strengths(table, noise_v)


def steps_of(poses: FloatArray, most: int) -> tuple[FloatArray, IntArray, list[str]]:
    """Group consecutive rows with the same time and pose into steps; if these are too many, pool the rows by cell.

    Args:
        poses: time s, x m, y m and yaw rad of each row, shape (n_rows, 4), n_rows >= 1.
        most: Number of steps from which on rows are pooled.

    Returns:
        The same for each step; the step of each row, shape (n_rows,); and a note if rows were pooled.
    """
    notes: list[str] = []
    is_first = _changes(poses)
    if is_first.sum() > most:
        n_steps, is_first = is_first.sum(), _changes(np.floor((poses - poses[0]) / POOLED))
        notes = [f"{n_steps} times and poses were pooled into {is_first.sum()}: within 1 s, 0.1 m and 2 degrees"]
    starts = np.flatnonzero(is_first)
    count = np.diff(starts, append=len(poses))
    means = poses[0] + np.add.reduceat(poses - poses[0], starts) / count[:, np.newaxis]
    return means, np.cumsum(is_first) - 1, notes


def _changes(rows: FloatArray) -> BoolArray:
    """Return True for the first row and for each row that differs from the one before it."""
    return np.append(True, np.any(np.diff(rows, axis=0) != 0, axis=-1))


def check_columns(table: InputTable) -> None:
    """Check the names of the columns.

    Raises:
        InputFileError: If a column is missing or unknown.
    """
    (strengths, deviations), waveforms = strength_columns(table), waveform_columns(table)
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


def _numbered(table: InputTable, kind: str) -> list[str]:
    """Return the names kind_1, kind_2 ... that the columns of a kind must have."""
    return [f"{kind}_{k + 1}" for k in range(sum(name.startswith(f"{kind}_") for name in table.columns))]


def strength_columns(table: InputTable) -> tuple[list[str], list[str]]:
    """Return the names that the columns of strengths, and of their deviations if there are any, must have."""
    strengths = _numbered(table, "strength")
    return strengths, [name.replace("strength", "std") for name in strengths if _numbered(table, "std")]


def waveform_columns(table: InputTable) -> list[str]:
    """Return the names that the columns of waveform files must have; none if the table has strengths."""
    return [] if _numbered(table, "strength") else _numbered(table, "waveform") or ["waveform"]


def _read_strengths(table: InputTable, noise_v: float | None) -> TablePulses:
    strengths, deviations = strength_columns(table)
    levels = np.column_stack([table.columns[name] for name in strengths])
    if np.count_nonzero(levels < 0) > 0.5 * levels.size:
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
