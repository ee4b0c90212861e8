"""Patterns over azimuth, elevation and frequency from CSV files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dirmusic.array.pattern import TabulatedPattern
from dirmusic.array.pattern_file import read_gains, read_pattern
from dirmusic.array.spatial_pattern import SpatialPattern
from dirmusic.csv_table import CsvTable, read_csv_table
from dirmusic.input_file import InputFileError

AXES = ("frequency_ghz", "azimuth_deg", "elevation_deg")
ONE_TURN_DEG = 360.0


def read_any_pattern(path: str | Path) -> TabulatedPattern | SpatialPattern:
    """A pattern from a file: over all three axes if its columns say so, else in the plane, as of `read_pattern`.

    Raises:
        InputFileError: As of `read_pattern` and `read_spatial_pattern`.
    """
    path = Path(path)
    if path.suffix.lower() == ".csv" and any(axis in read_csv_table(path).header for axis in AXES):
        return read_spatial_pattern(path)
    return read_pattern(path)


def read_spatial_pattern(path: str | Path) -> SpatialPattern:
    """The pattern of one element from a `.csv` file with a row for each frequency, azimuth and elevation.

    Columns are `frequency_ghz`; `azimuth_deg`, off the boresight, counter-clockwise seen from above, once round;
    `elevation_deg`, up from the plane of the boresight; and `gain` (amplitude ratio) or `gain_db`. Rows come in any
    order, and all combinations are there. A row one turn after another repeats it, and is dropped. What the gains are
    relative to is one for all frequencies: how the gain changes with frequency counts.

    Raises:
        InputFileError: If the file cannot be read, a cell is wrong, or a combination is missing or there twice; file
            and line are named.
    """
    path = Path(path)
    table = read_csv_table(path)
    kinds = [name for name in table.header if name in ("gain", "gain_db")]
    if len(kinds) != 1 or sorted(table.header) != sorted([*AXES, *kinds]):
        raise InputFileError(
            [f"{path}: columns {', '.join(table.header)}; allowed are {', '.join(AXES)} and either gain or gain_db"]
        )
    frequency_ghz = table.numbers(AXES[0], lambda x: (x >= 1e-3) & (x <= 1000), "0.001 to 1000 GHz")
    azimuth_deg = table.numbers(AXES[1], lambda x: abs(x) <= ONE_TURN_DEG, "-360 to 360 degrees")
    elevation_deg = table.numbers(AXES[2], lambda x: abs(x) <= 90, "-90 to 90 degrees")
    gain = read_gains(table, kinds[0])
    table.check()
    if np.ptp(azimuth_deg) == ONE_TURN_DEG:
        is_kept = azimuth_deg < azimuth_deg.max()
    else:
        is_kept = np.ones(azimuth_deg.size, dtype=np.bool_)
    rows = np.flatnonzero(is_kept)
    values, places = zip(
        *(np.unique(column[rows], return_inverse=True) for column in (frequency_ghz, azimuth_deg, elevation_deg)),
        strict=True,
    )
    filled = np.full([axis.size for axis in values], np.nan)
    _fill(table, rows, places, gain, filled)
    missing = np.argwhere(np.isnan(filled))
    if missing.size:
        f, a, e = missing[0]
        raise InputFileError(
            [
                f"{path}: {len(missing)} combinations are missing, the first is {values[0][f]:g} GHz, azimuth "
                f"{values[1][a]:g}, elevation {values[2][e]:g} degrees; allowed is a row for each"
            ]
        )
    try:
        return SpatialPattern(1e9 * values[0], np.radians(values[1]), np.radians(values[2]), filled)
    except ValueError as error:
        raise InputFileError([f"{path}: {error}"]) from None


def _fill(
    table: CsvTable, rows: np.ndarray, places: tuple[np.ndarray, ...], gain: np.ndarray, filled: np.ndarray
) -> None:
    """Put the gains of rows where they belong."""
    for row, place in zip(rows.tolist(), zip(*(at.tolist() for at in places), strict=True), strict=True):
        if not np.isnan(filled[place]):
            table.fault(row, f"{', '.join(AXES)}: this combination is there twice; allowed is one row for each")
        filled[place] = gain[row]
    table.check()
