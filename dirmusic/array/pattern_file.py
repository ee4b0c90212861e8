"""Measured patterns from files and back: CSV tables, and the horizontal cut of MSI Planet files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic.array.pattern import GainPattern, TabulatedPattern
from dirmusic.array.spatial_pattern import SpatialPattern
from dirmusic.csv_table import NUMBER, CsvTable, as_texts, read_csv_table
from dirmusic.input_file import InputFileError, read_text

FloatArray = NDArray[np.float64]

MSI_SUFFIXES = (".msi", ".pln")
ANGLE = "angle_deg"
MAX_ANGLE_DEG = 720.0
MAX_DB = 200.0
"""Gains are told within so many decibels of one, by ratio as well."""

SAME_GAIN = 1e-3
"""Share by which a row at 360 degrees may differ from the one at 0 that it repeats."""


def read_pattern(path: str | Path) -> TabulatedPattern:
    """The pattern of one element from a `.csv`, `.msi` or `.pln` file.

    CSV has the columns `angle_deg` (off boresight, counter-clockwise, as `azimuth - boresight`) and `gain` (amplitude
    ratio) or `gain_db`. Angles rise within one turn; a last row that repeats the first one turn later is dropped. What
    the gains are relative to does not matter: a common factor changes no bearing.

    Of an MSI Planet file the block `HORIZONTAL` is read: angles in degrees, clockwise from the boresight like a
    compass, and attenuation in decibels, 0 or more, relative to the peak.

    Raises:
        InputFileError: If the file cannot be read, or a cell, an angle or a gap is wrong; file and line are named.
    """
    path = Path(path)
    if path.suffix.lower() in MSI_SUFFIXES:
        table, gain = _read_msi(path)
    elif path.suffix.lower() == ".csv":
        table, gain = _read_csv(path)
    else:
        raise InputFileError([f"{path}: ends in `{path.suffix}`; allowed are .csv, {' and '.join(MSI_SUFFIXES)}"])
    angle_deg = table.numbers(ANGLE, lambda x: abs(x) <= MAX_ANGLE_DEG, "-720 to 720 degrees")
    for row in range(1, angle_deg.size):
        if angle_deg[row] <= angle_deg[row - 1]:
            word = "is there twice" if angle_deg[row] == angle_deg[row - 1] else "goes back"
            table.fault(row, f"angle_deg: {angle_deg[row]:g} {word}; allowed are rising angles")
        elif angle_deg[row] - angle_deg[0] > 360.0:
            table.fault(row, f"angle_deg: {angle_deg[row]:g} is past one turn; allowed is up to {angle_deg[0] + 360:g}")
    table.check()
    if angle_deg[-1] - angle_deg[0] == 360.0:
        if not np.isclose(gain[-1], gain[0], rtol=SAME_GAIN):
            table.fault(
                angle_deg.size - 1, f"gain: {gain[-1]:.4g} one turn after {gain[0]:.4g}; allowed is the same gain again"
            )
        table.check()
        angle_deg, gain = angle_deg[:-1], gain[:-1]
    angle_rad = np.radians(angle_deg)
    if path.suffix.lower() in MSI_SUFFIXES:
        angle_rad, gain = -angle_rad[::-1], gain[::-1]
    try:
        return TabulatedPattern(angle_rad, gain)
    except ValueError as error:
        raise InputFileError([f"{path}: {error}"]) from None


def write_pattern(pattern: GainPattern, path: str | Path, *, off_boresight_rad: ArrayLike | None = None) -> None:
    """Write a pattern as `.csv` or as an MSI Planet file with its horizontal cut, 360 degrees long.

    Args:
        pattern: What to write.
        path: Where to; the ending decides.
        off_boresight_rad: Angles of the rows of a CSV file, rising. Default: those of a tabulated pattern, or 0 to 359
            degrees.

    Raises:
        ValueError: If the ending is unknown.
    """
    path = Path(path)
    if path.suffix.lower() in MSI_SUFFIXES:
        clockwise_deg = np.arange(360)
        gain = pattern(-np.radians(clockwise_deg))
        attenuation_db = -20 * np.log10(gain / gain.max())
        rows = [f"{a} {x:.4f}" for a, x in zip(clockwise_deg, np.abs(attenuation_db), strict=True)]
        lines = [f"NAME {path.stem}", "GAIN 0 dBi", "COMMENT relative pattern", "HORIZONTAL 360", *rows]
    elif path.suffix.lower() == ".csv":
        angles = off_boresight_rad
        if angles is None:
            tabulated = isinstance(pattern, TabulatedPattern)
            angles = pattern.off_boresight_rad if tabulated else np.radians(np.arange(360))
        angles = np.asarray(angles, dtype=np.float64)
        pairs = zip(np.degrees(angles), pattern(angles), strict=True)
        lines = ["angle_deg,gain", *(f"{a:.10g},{g:.10g}" for a, g in pairs)]
    else:
        raise ValueError(f"`path` must end in .csv, {' or '.join(MSI_SUFFIXES)}, got {path.name}")
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")


def _read_csv(path: Path) -> tuple[CsvTable, FloatArray]:
    table = read_csv_table(path)
    kinds = [name for name in table.header if name in ("gain", "gain_db")]
    if "angle_deg" not in table.header or len(kinds) != 1 or len(table.header) != 2:
        raise InputFileError(
            [f"{path}: columns {', '.join(table.header)}; allowed are angle_deg and either gain or gain_db"]
        )
    return table, read_gains(table, kinds[0])


def read_gains(table: CsvTable, kind: str) -> FloatArray:
    """The column `gain` or `gain_db` of a table as amplitude ratios, shape (n_rows,), NaN where there is a fault."""
    if kind == "gain_db":
        return 10 ** (table.numbers("gain_db", lambda x: abs(x) <= MAX_DB, "-200 to 200 dB") / 20)
    low, high = 10 ** (-MAX_DB / 20), 10 ** (MAX_DB / 20)
    told = f"an amplitude ratio above 0, {low:g} to {high:g} (name decibels gain_db)"
    return table.numbers("gain", lambda x: (x >= low) & (x <= high), told)


def _read_msi(path: Path) -> tuple[CsvTable, FloatArray]:
    """The block HORIZONTAL as a table with the columns angle_deg and attenuation, and the gains."""
    lines = list(enumerate(read_text(path).splitlines(), start=1))
    heads = [k for k, (_, line) in enumerate(lines) if line.split()[:1] and line.split()[0].upper() == "HORIZONTAL"]
    if len(heads) != 1:
        raise InputFileError([f"{path}: {len(heads)} lines begin with HORIZONTAL; allowed is one"])
    number, head = lines[heads[0]]
    count = head.split()[1] if len(head.split()) == 2 else ""
    if not (count.isascii() and count.isdigit() and len(count) < 7 and int(count) >= 4):
        raise InputFileError(
            [f"{path}: line {number}: got {head.strip()!r:.60}; allowed is HORIZONTAL and a count from 4 to 999999"]
        )
    body: list[tuple[int, tuple[str, ...]]] = []
    for place, line in lines[heads[0] + 1 :]:
        cells = tuple(line.split())
        if cells and not NUMBER.fullmatch(cells[0]):
            break
        if cells:
            body.append((place, cells))
    table = CsvTable(
        path=path,
        header=(ANGLE, "attenuation_db"),
        columns={
            ANGLE: as_texts([cells[0] for _, cells in body]),
            "attenuation_db": as_texts([cells[-1] for _, cells in body]),
        },
        lines=np.array([place for place, _ in body], dtype=np.intp),
    )
    for row, (_, cells) in enumerate(body):
        if len(cells) != 2:
            table.fault(row, f"got {len(cells)} values; allowed are angle and attenuation")
    if len(body) != int(count):
        table.faults.append(f"{path}: line {number}: HORIZONTAL announces {count} rows; {len(body)} follow")
    table.check()
    attenuation_db = table.numbers("attenuation_db", lambda x: (x >= 0) & (x <= MAX_DB), "0 to 200 dB, without a sign")
    return table, 10 ** (-attenuation_db / 20)


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
