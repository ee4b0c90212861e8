"""Pattern files: CSV tables in the plane or over azimuth, elevation and frequency, and MSI Planet files."""

from __future__ import annotations

import csv
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic.array.pattern import GainPattern, TabulatedPattern
from dirmusic.array.spatial_pattern import SpatialPattern
from dirmusic.input_file import InputFileError, read_whole

FloatArray = NDArray[np.float64]

MSI_SUFFIXES = (".msi", ".pln")
AXES = ("frequency_ghz", "azimuth_deg", "elevation_deg")
MAX_DB = 200.0
"""Largest gain and attenuation, dB; assumed, no antenna comes near."""

MAX_ERRORS = 20
"""Errors listed for one file; the others are counted."""


@dataclass
class _Table:
    """Cells of a text table by column, the line of the file of each row, and the errors found so far."""

    path: Path
    columns: dict[str, list[str]]
    lines: list[int]
    decimal_comma: bool = False
    errors: list[str] = field(default_factory=list[str])

    def add_error(self, row: int, text: str) -> None:
        """Record an error in a row."""
        self.errors.append(f"{self.path}: line {self.lines[row]}: {text}")

    def check(self) -> None:
        """Raise InputFileError if errors were recorded."""
        if self.errors:
            n_more = len(self.errors) - MAX_ERRORS
            more = [f"{self.path}: and {n_more} more errors"] if n_more > 0 else []
            raise InputFileError([*self.errors[:MAX_ERRORS], *more])

    def numbers(self, column: str, low: float, high: float, expected: str) -> FloatArray:
        """Convert a column to numbers within limits, and record an error and return NaN for every other cell."""
        values = np.full(len(self.lines), np.nan)
        for row, cell in enumerate(self.columns[column]):
            try:
                value = float(cell.replace(",", ".", 1) if self.decimal_comma and "." not in cell else cell)
            except ValueError:
                self.add_error(row, f"{column}: must be a number, got {cell[:40]!r}")
                continue
            if low <= value <= high:
                values[row] = value
            else:
                self.add_error(row, f"{column}: must be {expected}, got {cell[:40]}")
        return values

    def gains(self) -> FloatArray:
        """Convert the column `gain` or `gain_db` to amplitude ratios."""
        if "gain_db" in self.columns:
            return 10 ** (self.numbers("gain_db", -MAX_DB, MAX_DB, "-200 to 200 dB") / 20)
        low, high = 10 ** (-MAX_DB / 20), 10 ** (MAX_DB / 20)
        return self.numbers("gain", low, high, "an amplitude ratio above 0 (decibels belong in a column gain_db)")


def read_pattern(path: str | Path) -> TabulatedPattern:
    """Read the pattern of one element in the plane from a `.csv`, `.msi` or `.pln` file.

    A CSV file has the columns `angle_deg` (off boresight, counter-clockwise, as `azimuth - boresight`) and `gain`
    (amplitude ratio) or `gain_db`. Angles increase within one turn; a last row that repeats the first one a turn later
    is dropped. The reference of the gains is arbitrary: a common factor changes no bearing. Columns are separated by
    commas, or by semicolons or tabs with an optional decimal comma. Lines that begin with `#` are comments.

    Of an MSI Planet file the block `HORIZONTAL` is read: angles in degrees, clockwise from the boresight as on a
    compass, and attenuation relative to the peak in decibels, 0 or more.

    Raises:
        InputFileError: If the file cannot be read, or a cell, an angle or a gap is wrong; with file and line.
    """
    path = Path(path)
    is_msi = path.suffix.lower() in MSI_SUFFIXES
    if is_msi:
        table = _read_msi(path)
        gain = 10 ** (-table.numbers("attenuation_db", 0.0, MAX_DB, "0 to 200 dB, without a sign") / 20)
    elif path.suffix.lower() == ".csv":
        table = _read_csv(path, ("angle_deg",))
        gain = table.gains()
    else:
        raise InputFileError([f"{path}: name must end in .csv, {' or '.join(MSI_SUFFIXES)}"])
    angle_deg = table.numbers("angle_deg", -720.0, 720.0, "-720 to 720 degrees")
    for row in range(1, angle_deg.size):
        if angle_deg[row] <= angle_deg[row - 1]:
            table.add_error(row, f"angle_deg: must increase, {angle_deg[row - 1]:g} is followed by {angle_deg[row]:g}")
        elif angle_deg[row] - angle_deg[0] > 360.0:
            table.add_error(row, f"angle_deg: must lie within one turn from {angle_deg[0]:g}, got {angle_deg[row]:g}")
    if angle_deg[-1] - angle_deg[0] == 360.0:
        if not np.isclose(gain[-1], gain[0], rtol=1e-3):
            table.add_error(-1, f"gain: must be {gain[0]:.4g} as one turn before, got {gain[-1]:.4g}")
        angle_deg, gain = angle_deg[:-1], gain[:-1]
    table.check()
    angle_rad = np.radians(angle_deg)
    if is_msi:
        angle_rad, gain = -angle_rad[::-1], gain[::-1]
    try:
        return TabulatedPattern(angle_rad, gain)
    except ValueError as error:
        raise InputFileError([f"{path}: {error}"]) from None


def read_spatial_pattern(path: str | Path) -> SpatialPattern:
    """Read the pattern of one element from a `.csv` file with a row for each frequency, azimuth and elevation.

    The columns are `frequency_ghz`; `azimuth_deg`, off boresight, counter-clockwise seen from above, for one turn;
    `elevation_deg`, up from the plane of the boresight; and `gain` (amplitude ratio) or `gain_db`. Rows may come in any
    order, and every combination must be present. A row one turn after another repeats it and is dropped. The gains of
    all frequencies have one reference: the change of the gain with frequency matters.

    Raises:
        InputFileError: If the file cannot be read, a cell is wrong, or a combination is missing or repeated; with file
            and line.
    """
    path = Path(path)
    table = _read_csv(path, AXES)
    gain = table.gains()
    axes = (
        table.numbers(AXES[0], 1e-3, 1000.0, "0.001 to 1000 GHz"),
        table.numbers(AXES[1], -360.0, 360.0, "-360 to 360 degrees"),
        table.numbers(AXES[2], -90.0, 90.0, "-90 to 90 degrees"),
    )
    table.check()
    rows = np.arange(gain.size)
    if np.ptp(axes[1]) == 360.0:
        rows = np.flatnonzero(axes[1] < axes[1].max())
    values, places = zip(*(np.unique(axis[rows], return_inverse=True) for axis in axes), strict=True)
    cells = np.full([axis.size for axis in values], np.nan)
    index = np.ravel_multi_index(places, cells.shape)
    _, first = np.unique(index, return_index=True)
    for row in np.delete(rows, first):
        table.add_error(int(row), f"{', '.join(AXES)}: this combination must appear once, is repeated")
    cells.ravel()[index] = gain[rows]
    missing = np.argwhere(np.isnan(cells))
    if missing.size:
        f, a, e = (axis[k] for axis, k in zip(values, missing[0], strict=True))
        table.errors.append(
            f"{path}: must have a row for each combination, {len(missing)} are missing, the first at {f:g} GHz, "
            f"azimuth {a:g}, elevation {e:g} degrees"
        )
    table.check()
    try:
        return SpatialPattern(1e9 * values[0], np.radians(values[1]), np.radians(values[2]), cells)
    except ValueError as error:
        raise InputFileError([f"{path}: {error}"]) from None


def read_any_pattern(path: str | Path) -> TabulatedPattern | SpatialPattern:
    """Read a pattern over azimuth, elevation and frequency if the file has such columns, else one in the plane.

    Raises:
        InputFileError: See `read_pattern` and `read_spatial_pattern`.
    """
    path = Path(path)
    if path.suffix.lower() == ".csv" and any(axis in _read_csv(path).columns for axis in AXES):
        return read_spatial_pattern(path)
    return read_pattern(path)


def write_pattern(pattern: GainPattern, path: str | Path, *, off_boresight_rad: ArrayLike | None = None) -> None:
    """Write a pattern to a `.csv` file, or to an MSI Planet file as its horizontal cut in steps of 1 degree.

    Args:
        pattern: Pattern to write.
        path: Destination; its suffix selects the format.
        off_boresight_rad: Increasing angles of the rows of a CSV file. Default: those of a tabulated pattern, or 0 to
            359 degrees.

    Raises:
        ValueError: If the suffix is unknown.
    """
    path = Path(path)
    if path.suffix.lower() in MSI_SUFFIXES:
        clockwise_deg = np.arange(360)
        gain = pattern(-np.radians(clockwise_deg))
        attenuation_db = np.abs(20 * np.log10(gain / gain.max()))
        rows = [f"{a} {x:.4f}" for a, x in zip(clockwise_deg, attenuation_db, strict=True)]
        lines = [f"NAME {path.stem}", "GAIN 0 dBi", "COMMENT relative pattern", "HORIZONTAL 360", *rows]
    elif path.suffix.lower() == ".csv":
        angles = off_boresight_rad
        if angles is None:
            is_tabulated = isinstance(pattern, TabulatedPattern)
            angles = pattern.off_boresight_rad if is_tabulated else np.radians(np.arange(360))
        angles = np.asarray(angles, dtype=np.float64)
        pairs = zip(np.degrees(angles), pattern(angles), strict=True)
        lines = ["angle_deg,gain", *(f"{a:.10g},{g:.10g}" for a, g in pairs)]
    else:
        raise ValueError(f"`path` must end in .csv, {' or '.join(MSI_SUFFIXES)}, got {path.name}")
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")


def _read_lines(path: Path) -> list[tuple[int, str]]:
    """Return the lines of a UTF-8 file that are neither empty nor comments, with their numbers from 1."""
    try:
        text = read_whole(path, 100_000_000).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputFileError([f"{path}: must be UTF-8 text, byte {error.start} is not"]) from None
    lines = enumerate(text.splitlines(), start=1)
    return [(number, line) for number, line in lines if line.strip(" ,;\t") and not line.lstrip().startswith("#")]


def _read_csv(path: Path, axes: tuple[str, ...] = ()) -> _Table:
    """Read a CSV table; with `axes`, its columns must be these and one of `gain` and `gain_db`."""
    lines = _read_lines(path)
    if len(lines) < 2:
        raise InputFileError([f"{path}: must have a header and at least one row"])
    delimiter = next((mark for mark in ";\t" if mark in lines[0][1]), ",")
    try:
        rows = [next(csv.reader([line], delimiter=delimiter, skipinitialspace=True)) for _, line in lines]
    except csv.Error as error:
        raise InputFileError([f"{path}: must be a CSV table: {error}"]) from None
    header = [name.strip() for name in rows.pop(0)]
    if axes and sorted(header) not in [sorted([*axes, kind]) for kind in ("gain", "gain_db")]:
        raise InputFileError(
            [f"{path}: columns must be {', '.join(axes)} and either gain or gain_db, got {', '.join(header):.200}"]
        )
    numbers = [number for number, _ in lines[1:]]
    table = _Table(path, {}, numbers, decimal_comma=delimiter != ",")
    for row, cells in enumerate(rows):
        if len(cells) != len(header):
            table.add_error(row, f"must have {len(header)} cells as the header, has {len(cells)}")
    table.check()
    table.columns = {name: [cells[k].strip() for cells in rows] for k, name in enumerate(header)}
    return table


def _read_msi(path: Path) -> _Table:
    """Read the block HORIZONTAL of an MSI Planet file as a table with the columns angle_deg and attenuation_db."""
    lines = [(number, line.split()) for number, line in _read_lines(path)]
    heads = [k for k, (_, words) in enumerate(lines) if words[0].upper() == "HORIZONTAL"]
    if len(heads) != 1:
        raise InputFileError([f"{path}: must have one line that begins with HORIZONTAL, has {len(heads)}"])
    number, head = lines[heads[0]]
    if len(head) != 2 or not head[1].isdecimal():
        raise InputFileError([f"{path}: line {number}: must be HORIZONTAL and a count, got {' '.join(head):.60}"])
    body: list[tuple[int, list[str]]] = []
    for line, words in lines[heads[0] + 1 :]:
        if words[0][:1].isalpha():
            break
        body.append((line, words))
    table = _Table(path, {}, [line for line, _ in body])
    for row, (_, words) in enumerate(body):
        if len(words) != 2:
            table.add_error(row, f"must have angle and attenuation, has {len(words)} values")
    if str(len(body)) != head[1] or len(body) < 4:
        table.errors.append(f"{path}: line {number}: must be followed by {head[1]:.20} >= 4 rows, has {len(body)}")
    table.check()
    table.columns = {"angle_deg": [words[0] for _, words in body], "attenuation_db": [words[1] for _, words in body]}
    return table
