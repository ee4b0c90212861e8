"""Far fields as antenna simulators write them: NEC, FEKO, CST, HFSS and TICRA.

All are text. Directions are given by the polar angle theta from the z axis and the azimuth phi about it. NEC (`.out`),
FEKO (`.ffe`) and CST (`.ffs`) have tables that start after a certain line; HFSS (`.ffd`) and TICRA (`.cut`) have grids.
"""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dirmusic.array.spatial_pattern import LEAST_GAIN, SpatialPattern
from dirmusic.arrays import FloatArray
from dirmusic.input_file import InputFileError

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
FLAGS = re.IGNORECASE | re.MULTILINE
NEC, FEKO, CST = r"RADIATION PATTERNS", r'^#.*"Theta".*', r"^//.*Phi,\s*Theta,"
"""Lines before the rows of a block."""

SAME_GAIN_DB, LEAST_COMPARED = 0.5, 0.01
"""Largest difference of gains that a file has for one direction, and gain relative to the largest one above which they
are compared. Assumed: simulators repeat directions where cuts meet, with equal gains."""

STEP_DEG = 5.0
"""Step in azimuth and elevation of a pattern that is turned from the z axis to the boresight. Cubic interpolation of a
lobe 50 degrees wide is accurate to 0.001."""


class FarField(NamedTuple):
    """Gains of one block of a file.

    Attributes:
        frequency_hz: Frequency.
        theta_deg: Polar angle of each direction, shape (n,).
        phi_deg: Azimuth of each direction.
        gain: Amplitude gain, of any reference level that is the same in all blocks.
    """

    frequency_hz: float
    theta_deg: FloatArray
    phi_deg: FloatArray
    gain: FloatArray


def _rows_after(text: str, n_cells: int) -> FloatArray:
    """Return the first numbers of each row of the table that begins after the first line, shape (n_rows, n_cells)."""
    rows: list[list[float]] = []
    for line in text.splitlines()[1:]:
        cells = re.split(r"[\s,;]+", line.strip())[:n_cells]
        if len(cells) == n_cells and all(re.fullmatch(NUMBER, cell) for cell in cells):
            rows.append([float(cell) for cell in cells])
        elif rows and line.strip():
            break
    if not rows:
        raise ValueError(f"must have rows of {n_cells} numbers")
    return np.array(rows)


def _numbers(rows: list[list[str]], n_rows: int, n_cells: int) -> FloatArray:
    """Convert rows of cells to an array of this shape."""
    for row in rows:
        if len(row) != n_cells or not all(re.fullmatch(NUMBER, cell) for cell in row):
            raise ValueError(f"must have rows of {n_cells} numbers, got {' '.join(row)[:40]!r}")
    if len(rows) != n_rows:
        raise ValueError(f"must have {n_rows} rows of {n_cells} numbers, got {len(rows)}")
    return np.array(rows, dtype=np.float64)


def _last_before(text: str, pattern: str, at: int) -> float:
    """Return the last frequency before a position, as stated by lines that match a pattern."""
    known = re.findall(pattern, text[:at], FLAGS)
    if not known:
        raise ValueError("must state the frequency before its rows")
    return float(known[-1])


def _nec(text: str) -> Iterator[FarField]:
    """Yield the blocks of NEC: theta, phi, and the gain in decibels: vertical, horizontal and total."""
    for start in re.finditer(NEC, text, FLAGS):
        frequency_mhz = _last_before(text, rf"FREQUENCY\s*[:=]\s*({NUMBER})\s*MHZ", start.start())
        theta_deg, phi_deg, _, _, total_db = _rows_after(text[start.start() :], 5).T
        yield FarField(1e6 * frequency_mhz, theta_deg, phi_deg, _from_db(total_db))


def _feko(text: str) -> Iterator[FarField]:
    """Yield the blocks of FEKO, whose columns are named: theta, phi, the field, and often a total gain in decibels."""
    for start in re.finditer(FEKO, text, FLAGS):
        names = re.findall(r'"([^"]+)"', start[0])
        total = next((k for k, name in enumerate(names) if "(total)" in name.lower()), None)
        table = _rows_after(text[start.start() :], 6 if total is None else total + 1)
        gain = _magnitude(table[:, 2:6]) if total is None else _from_db(table[:, total])
        frequency_hz = _last_before(text, rf"^#Frequency:\s*({NUMBER})", start.start())
        yield FarField(frequency_hz, table[:, 0], table[:, 1], gain)


def _cst(text: str) -> Iterator[FarField]:
    """Yield the blocks of CST: phi, theta and the field. Powers and frequencies are listed before the blocks."""
    head = re.search(r"^//.*\bFrequency\b(.*)", text, FLAGS)
    starts = list(re.finditer(CST, text, FLAGS))
    listed = re.findall(NUMBER, text[head.end() :].partition("//")[0]) if head else []
    frequencies_hz = [float(number) for number in (listed[3::4] if len(listed) > 1 else listed)]
    if len(frequencies_hz) != len(starts):
        raise ValueError(f"must list {len(starts)} frequencies, one for each block, lists {len(frequencies_hz)}")
    for frequency_hz, start in zip(frequencies_hz, starts, strict=True):
        table = _rows_after(text[start.start() :], 6)
        yield FarField(frequency_hz, table[:, 1], table[:, 0], _magnitude(table[:, 2:]))


def _hfss(text: str) -> Iterator[FarField]:
    """Yield the blocks of HFSS: ranges of theta and phi, then for each frequency rows of the field; phi runs first."""
    lines = [line.split() for line in text.splitlines() if line.strip()]
    ranges: list[list[float]] = _numbers(lines[:2], 2, 3).tolist()
    (theta_1, theta_2, n_theta), (phi_1, phi_2, n_phi) = ranges
    n_frequencies, rest, n = int(lines[2][1]), lines[3:], int(n_theta) * int(n_phi)
    if not 0 < n <= len(rest):
        raise ValueError("must have a row for each direction")
    theta_deg, phi_deg = np.linspace(theta_1, theta_2, int(n_theta)), np.linspace(phi_1, phi_2, int(n_phi))
    theta, phi = np.meshgrid(theta_deg, phi_deg, indexing="ij")
    for k in range(n_frequencies):
        head, *rows = rest[k * (n + 1) : (k + 1) * (n + 1)] or [[]]
        if len(head) != 2 or not re.fullmatch(NUMBER, head[1]):
            raise ValueError(
                f"must have {n_frequencies} blocks that begin with their frequency, got {' '.join(head)[:40]!r}"
            )
        yield FarField(float(head[1]), theta.ravel(), phi.ravel(), _magnitude(_numbers(rows, n, 4)))


TICRA_HEAD = r"^[ \t]*{0}[ \t]+{0}[ \t]+(\d+)[ \t]+{0}[ \t]+(\d+)[ \t]+([12])[ \t]+([23])[ \t]*$".format(f"({NUMBER})")
"""First value, step and number of values; the constant angle; polarisation; whether phi (1) or theta (2) is constant;
and number of components."""


def _ticra(text: str) -> Iterator[FarField]:
    """Yield all cuts of TICRA as one block, whose frequency is unknown: 1 GHz stands for it.

    The two components of the field are orthogonal (polarisation 1 to 5); others are ratios.
    """
    lines, cuts = text.splitlines(), list[FloatArray]()
    for k, line in enumerate(lines):
        if head := re.match(TICRA_HEAD, line):
            start, step, constant = (float(head[i]) for i in (1, 2, 4))
            n, polarisation, cut, n_components = (int(head[i]) for i in (3, 5, 6, 7))
            if polarisation > 5:
                raise ValueError(f"line {k + 1}: ICOMP must be 1 to 5, got {polarisation}")
            try:
                field = _numbers([row.split() for row in lines[k + 1 : k + 1 + n]], n, 2 * n_components)
            except ValueError as error:
                raise ValueError(f"after line {k + 1}: {error}") from None
            along, fixed = start + step * np.arange(n), np.full(n, constant)
            cuts.append(np.stack([*((along, fixed) if cut == 1 else (fixed, along)), _magnitude(field[:, :4])]))
    theta_deg, phi_deg, gain = np.concatenate(cuts, axis=1)
    yield FarField(1e9, theta_deg, phi_deg, gain)


READERS: dict[str, tuple[str, Callable[[str], Iterator[FarField]]]] = {
    "NEC": (NEC, _nec),
    "FEKO": (FEKO, _feko),
    "CST": (CST, _cst),
    "HFSS": (r"^\s*Frequencies\s+\d+\s*$", _hfss),
    "TICRA": (TICRA_HEAD, _ticra),
}
"""Program, pattern of a line by which its files are recognised, and reader."""


def _from_db(gain_db: FloatArray) -> FloatArray:
    """Convert decibels to amplitude ratios; programs write -999.99 for a gain of 0."""
    return 10 ** (np.clip(gain_db, -300.0, 300.0) / 20)


def _magnitude(field: FloatArray) -> FloatArray:
    """Return the magnitude of fields: real and imaginary parts of two components, shape (n, 4)."""
    return np.sqrt(np.square(field).sum(axis=1))


def read_far_field(path: Path, text: str) -> tuple[SpatialPattern, str] | None:
    """Read the far field of a simulator, if the text is one.

    The boresight is the x or the z axis of the file, whichever has the larger gain. For the z axis, the x axis points
    to the left and the y axis up.

    Returns:
        The pattern, and a sentence on how the file was read; None for other texts.

    Raises:
        InputFileError: If the text is incomplete, or does not cover all directions.
    """
    for program, (sign, read) in READERS.items():
        if not re.search(sign, text, FLAGS):
            continue
        try:
            fields = list(read(text))
            pattern, axis = _towards_boresight(_in_axes_of_file(fields))
        except ValueError as error:
            raise InputFileError([f"{path}: far field of {program}: {error}"]) from None
        return pattern, f"far field of {program}, {len(fields)} frequencies; the boresight is its {axis} axis"
    return None


def _in_axes_of_file(fields: list[FarField]) -> SpatialPattern:
    """Make a pattern over azimuth phi and elevation 90 degrees - theta."""
    frequency_hz = np.unique([field.frequency_hz for field in fields])
    if not frequency_hz.size:
        raise ValueError("must have a frequency and its rows")
    grids: list[tuple[FloatArray, FloatArray, FloatArray]] = []
    for frequency in frequency_hz:
        own = [field for field in fields if field.frequency_hz == frequency]
        theta_deg, phi_deg, gain = (np.concatenate([field[i] for field in own]) for i in (1, 2, 3))
        grids.append(_on_grid(theta_deg, phi_deg, gain))
    azimuth_deg, elevation_deg, first = grids[0]
    if any(table.shape != first.shape for _, _, table in grids):
        raise ValueError("must have the same directions at all frequencies")
    gain = np.stack([table for _, _, table in grids])
    gain = np.maximum(gain, LEAST_GAIN * gain.max())
    return SpatialPattern(frequency_hz, np.radians(azimuth_deg), np.radians(elevation_deg), gain)


def _on_grid(theta_deg: FloatArray, phi_deg: FloatArray, gain: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Arrange gains on a grid; those of one direction are averaged.

    Returns:
        Azimuths in [0, 360), elevations, and gains, shape (n_azimuths, n_elevations).

    Raises:
        ValueError: If directions are missing, or have different gains.
    """
    turned_deg = np.where(np.mod(theta_deg, 360.0) > 180.0, 180.0, 0.0)  # negative theta is beyond the z axis
    theta = np.round(np.abs(np.mod(theta_deg + 180.0, 360.0) - 180.0), 6)
    azimuth_deg, column = np.unique(np.round(np.mod(phi_deg + turned_deg, 360.0), 6) % 360.0, return_inverse=True)
    elevation_deg, row = np.unique(90.0 - theta, return_inverse=True)
    shape = azimuth_deg.size, elevation_deg.size
    if shape[0] * shape[1] > 3 * gain.size:
        raise ValueError("must be on a grid of theta and phi")
    count, total = np.zeros(shape), np.zeros(shape)
    np.add.at(count, (column, row), 1.0)
    np.add.at(total, (column, row), gain)
    for end in (0, -1):
        if abs(elevation_deg[end]) == 90.0:  # all phi are one direction
            total[:, end], count[:, end] = total[:, end].sum(), count[:, end].sum()
    least, most = np.full(shape, np.inf), np.zeros(shape)
    np.minimum.at(least, (column, row), gain)
    np.maximum.at(most, (column, row), gain)
    differ = np.argwhere(
        (most > least * 10 ** (SAME_GAIN_DB / 20)) & (most > LEAST_COMPARED * gain.max()) & (count > 0)
    )
    if differ.size:
        i, j = differ[0]
        direction = f"theta {90.0 - elevation_deg[j]:g}, phi {azimuth_deg[i]:g} degrees"
        raise ValueError(f"{direction} has several gains: keep the blocks of one antenna and port")
    missing = np.argwhere(count == 0.0)
    if missing.size:
        i, j = missing[0]
        raise ValueError(f"theta {90.0 - elevation_deg[j]:g}, phi {azimuth_deg[i]:g} degrees is missing")
    steps_deg = np.diff(azimuth_deg, append=azimuth_deg[0] + 360.0)
    widest = int(steps_deg.argmax())
    if steps_deg[widest] > 1.5 * np.median(steps_deg):
        from_deg = azimuth_deg[widest]
        raise ValueError(
            f"phi must have equal steps, got none from {from_deg:g} to {from_deg + steps_deg[widest]:g} degrees"
        )
    return azimuth_deg.astype(np.float64), elevation_deg.astype(np.float64), total / count


def _towards_boresight(pattern: SpatialPattern) -> tuple[SpatialPattern, str]:
    """Turn a pattern so that its azimuth and elevation are 0 along the boresight; also return the axis of the file."""
    along_x, along_z = (pattern.gain(0.0, up, pattern.frequency_hz).mean() for up in (0.0, 0.5 * np.pi))
    if along_x >= along_z:
        return pattern, "x"
    azimuth_rad = np.radians(np.arange(0.0, 360.0, STEP_DEG))
    elevation_rad = np.radians(np.arange(-90.0, 90.0 + STEP_DEG, STEP_DEG))
    level = np.cos(elevation_rad)
    z, x = level * np.cos(azimuth_rad[:, np.newaxis]), level * np.sin(azimuth_rad[:, np.newaxis])
    y = np.broadcast_to(np.sin(elevation_rad), x.shape)
    gain = pattern.gain(np.arctan2(y, x), np.arcsin(np.clip(z, -1.0, 1.0)), pattern.frequency_hz)
    return SpatialPattern(pattern.frequency_hz, azimuth_rad, elevation_rad, gain), "z"
