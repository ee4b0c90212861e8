"""Reading of pattern files: CSV tables in the plane or in space, MSI Planet files, and far fields of simulators."""

import csv
import warnings
from itertools import takewhile
from pathlib import Path

import numpy as np

from dirmusic.array.far_field_file import read_far_field
from dirmusic.array.pattern import TabulatedPattern
from dirmusic.array.spatial_pattern import SpatialPattern
from dirmusic.arrays import FloatArray
from dirmusic.input_file import InputFileError, InputFileWarning, delimiter_of, read_lines, read_whole

Rows = list[tuple[int, list[str]]]
"""Line number in the file and cells of each row of a table."""

MAX_BYTES = 100_000_000
"""Largest size of a file. Assumed; the shipped patterns over all directions and frequencies have 0.14 MB."""

AXES = ("frequency_ghz", "azimuth_deg", "elevation_deg")
FREQUENCIES = ("frequency_hz", "frequency_ghz")
LIMITS = {
    "angle_deg": (-720.0, 720.0, "-720 to 720 degrees"),
    "frequency_hz": (1e6, 1e12, "1e6 to 1e12 Hz"),
    "frequency_ghz": (1e-3, 1000.0, "0.001 to 1000 GHz"),
    "azimuth_deg": (-360.0, 360.0, "-360 to 360 degrees"),
    "elevation_deg": (-90.0, 90.0, "-90 to 90 degrees"),
    "attenuation_db": (0.0, 200.0, "0 to 200 dB, without a sign"),
    "gain_db": (-200.0, 200.0, "-200 to 200 dB"),
    "gain": (1e-10, 1e10, "an amplitude ratio above 0; decibels belong in a column gain_db"),
}
"""Minimum and maximum of each column, and their wording in error messages. Real antennas stay well within the limits of
the gain."""

FRONT_RAD, SAME_CUT = np.radians(np.arange(-90.0, 91.0)), 0.02
"""Elevations at which the vertical cut is compared with the mean of both sides of the horizontal one, and the largest
difference of gains, relative to that of the boresight, at which both are the same: a pattern that is the same in all
planes is better combined by the angle off boresight. Assumed; the error of a pattern is as large."""

MOST_APART = 2.0
"""Largest ratio of two gains measured in one direction, at the beginning and the end of a turn, which are averaged.
Assumed: 6 dB are more than the drift of a measurement."""


def read_pattern(path: str | Path) -> TabulatedPattern:
    """Read the pattern of one element in the plane from a CSV table or another file, whatever its name.

    A CSV table has the columns `angle_deg` (angle off boresight, counter-clockwise: azimuth - boresight) and `gain`
    (amplitude ratio) or `gain_db`. Angles must increase and span at most one turn; a last row exactly one turn after
    the first is averaged with it. The reference level of the gains is arbitrary, because a common factor does not
    change a bearing. Columns are separated by commas, or by semicolons or tabs, in which case decimal commas are
    allowed. Lines that begin with `#` are comments. With a column `frequency_hz`, the rows of each frequency are such a
    table of the same angles, all with one reference level, and the rms of the gain over the band is used, which is the
    pattern for a flat spectrum.

    An MSI Planet file has the block `HORIZONTAL`: angles in degrees, clockwise from the boresight as on a compass, and
    attenuation relative to the peak in decibels, 0 or more; and `VERTICAL`, with angles downwards from the boresight.
    The vertical cut is used for directions in space where it differs from the horizontal one; see `gain_in_space`.

    From a table over all directions (`read_spatial_pattern`) or a far field of a simulator (`far_field_file`), the cut
    at elevation 0 is used, the rms over the band.

    Warns:
        InputFileWarning: If gains of one direction differ and are averaged, or if a vertical cut cannot be used.

    Raises:
        InputFileError: If the file cannot be read, a cell or an angle is invalid, or a gap between angles is too wide;
            the message gives file and line.
    """
    pattern = read_any_pattern(path)
    return pattern.cut() if isinstance(pattern, SpatialPattern) else pattern


def _read_plane(path: Path) -> TabulatedPattern:
    """Read the pattern of a CSV table in the plane."""
    names, rows = _read_csv(path)
    names = ["angle_deg" if name == "azimuth_deg" else name for name in names]
    if frequency := next((name for name in names if name in FREQUENCIES), None):
        return _tabulated(path, *_over_band(path, names, rows, frequency))
    return _tabulated(path, *_one_turn(path, names, rows))


def _read_msi(path: Path, blocks: dict[str, Rows]) -> TabulatedPattern:
    """Make the pattern of an MSI Planet file from its blocks; angles become counter-clockwise, or upwards."""

    def read(block: str) -> tuple[FloatArray, FloatArray]:
        angle_deg, gain = _one_turn(path, ["angle_deg", "attenuation_db"], blocks[block])
        return -angle_deg[::-1], gain[::-1]

    angle_deg, gain = read("HORIZONTAL")
    pattern = _tabulated(path, angle_deg, gain)
    if "VERTICAL" not in blocks:
        return pattern
    try:
        vertical = _tabulated(path, *read("VERTICAL"))
    except InputFileError as error:
        text = f"{error}: VERTICAL is not used, so that heights are uncertain"
        warnings.warn(InputFileWarning(text), stacklevel=3)
        return pattern
    round_gain = 0.5 * (pattern(FRONT_RAD) + pattern(-FRONT_RAD))
    differs = np.abs(vertical(FRONT_RAD) / vertical(0.0) - round_gain / pattern(0.0)).max() > SAME_CUT
    return TabulatedPattern(pattern.off_boresight_rad, pattern.table_gain, vertical) if differs else pattern


def _one_turn(path: Path, names: list[str], rows: Rows) -> tuple[FloatArray, FloatArray]:
    """Return the angles, which must increase, and the gains of a table."""
    (angle_deg,), gain = _numbers(path, names, rows, ("angle_deg",))
    falls = np.flatnonzero(np.diff(angle_deg) <= 0.0)
    if falls.size:
        k = int(falls[0])
        before, after = angle_deg[k : k + 2]
        raise InputFileError(
            [f"{path}: line {rows[k + 1][0]}: angle_deg: must increase, {before:g} is followed by {after:g}"]
        )
    return angle_deg, gain


def _tabulated(path: Path, angle_deg: FloatArray, gain: FloatArray) -> TabulatedPattern:
    """Make a pattern of increasing angles; a last row exactly one turn after the first is averaged with it, in dB."""
    if angle_deg[-1] - angle_deg[0] == 360.0:
        first, last = gain[[0, -1]]
        rows_differ = f"{angle_deg[0]:g} and {angle_deg[-1]:g} degrees differ by {abs(20 * np.log10(last / first)):.2g}"
        if not 1.0 / MOST_APART <= last / first <= MOST_APART:
            most_db = 20 * np.log10(MOST_APART)
            raise InputFileError(
                [f"{path}: one direction must have one gain, up to {most_db:.0f} dB: {rows_differ} dB"]
            )
        if last != first:
            warnings.warn(InputFileWarning(f"{path}: {rows_differ} dB: averaged"), stacklevel=3)
        angle_deg, gain = angle_deg[:-1], np.append(np.sqrt(first * last) if last != first else first, gain[1:-1])
    try:
        return TabulatedPattern(np.radians(angle_deg), gain)
    except ValueError as error:
        raise InputFileError([f"{path}: {error}"]) from None


def _over_band(path: Path, names: list[str], rows: Rows, frequency: str) -> tuple[FloatArray, FloatArray]:
    """Return the angles of a table over frequency and angle, and the rms of the gain over frequency.

    Between frequencies, the square of the gain is interpolated linearly.
    """
    axes = frequency, "angle_deg"
    (known, angle_deg), table = _grid(path, axes, *_numbers(path, names, rows, axes))
    if known.size == 1:
        return angle_deg, table[0]
    return angle_deg, np.sqrt(np.trapezoid(np.square(table), known, axis=0) / np.ptp(known))


def _grid(
    path: Path, names: tuple[str, ...], axes: FloatArray, gain: FloatArray
) -> tuple[list[FloatArray], FloatArray]:
    """Arrange the rows of a table, in any order, on a grid; every combination must be present once.

    Args:
        path: The file.
        names: Names of the axes.
        axes: Values of the axes in each row, shape (n_axes, n_rows).
        gain: Gains, shape (n_rows,).

    Returns:
        Increasing values of each axis, and the gains, with one dimension for each axis.
    """
    values, places = zip(*(np.unique(axis, return_inverse=True) for axis in axes), strict=True)
    table, count = np.empty([axis.size for axis in values]), np.zeros([axis.size for axis in values])
    table[places] = gain
    np.add.at(count, places, 1)
    wrong = np.argwhere(count != 1)
    if wrong.size:
        at = ", ".join(f"{name} {axis[k]:g}" for name, axis, k in zip(names, values, wrong[0], strict=True))
        how = "missing" if count[tuple(wrong[0])] == 0 else "repeated"
        raise InputFileError([f"{path}: must have one row for each combination of {', '.join(names)}: {at} is {how}"])
    return list(values), table


def read_spatial_pattern(path: str | Path) -> SpatialPattern:
    """Read the pattern of one element from a `.csv` file with a row for each frequency, azimuth and elevation.

    The columns are `frequency_ghz`; `azimuth_deg`, off boresight, counter-clockwise seen from above, over one turn;
    `elevation_deg`, upwards from the plane of the boresight; and `gain` (amplitude ratio) or `gain_db`. Rows may be in
    any order, and every combination must be present. A row exactly one turn after another is dropped. The gains at all
    frequencies must have the same reference level, because the change of the gain with frequency matters.

    Raises:
        InputFileError: If the file cannot be read, a cell is invalid, or a combination is missing or repeated.
    """
    path = Path(path)
    axes, gain = _numbers(path, *_read_csv(path), AXES)
    if np.ptp(axes[1]) == 360.0:
        within = axes[1] < axes[1].max()
        axes, gain = axes[:, within], gain[within]
    values, table = _grid(path, AXES, axes, gain)
    try:
        return SpatialPattern(1e9 * values[0], np.radians(values[1]), np.radians(values[2]), table)
    except ValueError as error:
        raise InputFileError([f"{path}: {error}"]) from None


def read_any_pattern(path: str | Path) -> TabulatedPattern | SpatialPattern:
    """Read a pattern over all directions if the file has them, else a pattern in the plane.

    Warns:
        InputFileWarning: See `read_pattern`; and to say how a far field of a simulator was read.

    Raises:
        InputFileError: See `read_pattern` and `read_spatial_pattern`.
    """
    path = Path(path)
    if blocks := _msi_blocks(path):
        return _read_msi(path, blocks)
    if far_field := read_far_field(path, read_whole(path, MAX_BYTES).decode(errors="replace")):
        pattern, note = far_field
        warnings.warn(InputFileWarning(f"{path}: {note}"), stacklevel=2)
        return pattern
    return read_spatial_pattern(path) if "elevation_deg" in _read_csv(path)[0] else _read_plane(path)


def _read_csv(path: Path) -> tuple[list[str], Rows]:
    """Return the column names and the rows of a CSV table; decimal commas are replaced by points."""
    lines = read_lines(path, MAX_BYTES)
    if len(lines) < 2:
        raise InputFileError([f"{path}: must have a header and at least one row"])
    delimiter = delimiter_of(lines[0][1])
    texts = [line if delimiter == "," else line.replace(",", ".") for _, line in lines]
    try:
        names, *cells = csv.reader(texts, delimiter=delimiter, skipinitialspace=True, strict=True)
    except csv.Error as error:
        raise InputFileError([f"{path}: must be a CSV table: {error}"]) from None
    return [name.strip() for name in names], [(line, row) for (line, _), row in zip(lines[1:], cells, strict=False)]


def _msi_blocks(path: Path) -> dict[str, Rows]:
    """Return the blocks HORIZONTAL and VERTICAL of an MSI Planet file, angle and attenuation; none for other files.

    The header may have any encoding.
    """
    lines = [(number, words) for number, line in read_lines(path, MAX_BYTES, "replace") if (words := line.split())]
    blocks: dict[str, Rows] = {}
    for k, (number, words) in enumerate(lines):
        block = words[0].upper()
        if block not in {"HORIZONTAL", "VERTICAL"}:
            continue
        if block in blocks:
            raise InputFileError([f"{path}: line {number}: must have one line that begins with {block}"])
        rows = list(takewhile(lambda line: not line[1][0][0].isalpha(), lines[k + 1 :]))
        if not rows or words[1:2] != [str(len(rows))]:  # some programs write a second number after the count
            given = " ".join(words)
            raise InputFileError(
                [f"{path}: line {number}: must be {block} and the number of rows, {len(rows)}, got {given:.60}"]
            )
        blocks[block] = rows
    return blocks if "HORIZONTAL" in blocks else {}


def _numbers(path: Path, names: list[str], rows: Rows, axes: tuple[str, ...]) -> tuple[FloatArray, FloatArray]:
    """Convert the cells of a table to numbers; its columns must be the axes and `gain` or `gain_db`.

    Returns:
        Values of the axes, in the order of `axes`, shape (n_axes, n_rows), and gains as amplitude ratios, shape
        (n_rows,).
    """
    kind = next((name for name in names if name in {"gain", "gain_db", "attenuation_db"}), "gain")
    if sorted(names) != sorted([*axes, kind]):
        raise InputFileError(
            [
                f"{path}: must be an MSI Planet file with a line HORIZONTAL, a far field, or a CSV table whose columns "
                f"are {', '.join(axes)} and either gain or gain_db, got {', '.join(names):.200}"
            ]
        )
    values = np.empty((len(names), len(rows)))
    for row, (line, cells) in enumerate(rows):
        if len(cells) != len(names):
            raise InputFileError([f"{path}: line {line}: must have {len(names)} cells, has {len(cells)}"])
        for column, (name, cell) in enumerate(zip(names, cells, strict=True)):
            low, high, expected = LIMITS[name]
            try:
                values[column, row] = float(cell)
            except ValueError:
                values[column, row] = np.nan
            if not low <= values[column, row] <= high:
                raise InputFileError([f"{path}: line {line}: {name}: must be {expected}, got {cell.strip()[:40]!r}"])
    given = values[names.index(kind)]
    gain = given if kind == "gain" else 10 ** (given / (20 if kind == "gain_db" else -20))
    return values[[names.index(axis) for axis in axes]], gain
