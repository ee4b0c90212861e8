"""Text of oscilloscopes: one tolerant reader of the CSV dialects of Tektronix, LeCroy, Keysight, Rigol and others.

All dialects consist of a header, rows of numbers, and either a column of times or the sampling interval in the header.
They differ in the separator, the decimal sign, the names and units above the columns, the keys of the header, empty
cells, and columns of text to the left of the numbers.
"""

import io
import math
import re
from decimal import Decimal
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from dirmusic.arrays import FloatArray
from dirmusic.input_file import read_whole
from pdpatrol.missions.field.instruments.record import MAX_BYTES, WaveformRecord

SECONDS = {
    "s": 1.0, "sec": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9,
    "ps": 1e-12,
}  # fmt: skip
"""Units of time, in seconds."""

VOLTS = {
    "v": 1.0, "volt": 1.0, "volts": 1.0, "kv": 1e3, "mv": 1e-3, "uv": 1e-6, "µv": 1e-6, "μv": 1e-6, "nv": 1e-9,
}  # fmt: skip
"""Units of voltage, in volts."""

OTHER_UNITS = {"a", "ma", "w", "dbm", "db", "dbv", "dbmv", "hz", "khz", "mhz", "ghz"}
"""Units that are recognised to be refused."""

INTERVAL_KEYS = {"sampleinterval", "increment", "xincrement", "xinc", "hresolution", "resolution", "samplingperiod"}
"""Keys of the sampling interval, without spaces and punctuation."""

RATE_KEYS = {"samplerate", "samplingrate", "samplefrequency", "samplerates"}
"""Keys of the sampling rate."""

LEAST_ROWS = 3
"""Number of rows of numbers above the block of numbers from which on they belong to it, and a line between is damaged.
Assumed; headers have one or two."""

HOW_TO = "write a header such as time_s,channel_1,channel_2 and rows of as many numbers"


class _Layout(NamedTuple):
    """Where the numbers stand in a file.

    Attributes:
        separator: Separator of the cells.
        decimal: Decimal sign.
        first: Line of the first row of numbers, from 0.
        columns: Columns that hold numbers.
        header: Cells of the lines before the numbers, without empty lines.
    """

    separator: str
    decimal: str
    first: int
    columns: list[int]
    header: list[list[str]]


def read_text(path: Path) -> WaveformRecord:
    """Read the text of an oscilloscope.

    Raises:
        ValueError: If no rows of numbers are found, or their times or units are not those of a waveform.
    """
    lines = _text(path).splitlines()
    layout = _layout(lines)
    try:
        frame = pd.read_csv(
            io.StringIO("\n".join(lines[layout.first :])),
            sep=layout.separator,
            decimal=layout.decimal,
            header=None,
            usecols=layout.columns,
            skipinitialspace=True,
            dtype=np.float64,
        )
    except ValueError as error:
        raise ValueError(f"must have rows of {len(layout.columns)} numbers ({' '.join(str(error).split())})") from None
    numbers = _within_range(frame.to_numpy(np.float64)).T
    if np.isnan(numbers).any():
        row = int(np.isnan(numbers).any(axis=0).argmax())
        raise ValueError(f"line {layout.first + row + 1} must have {len(layout.columns)} numbers; {HOW_TO}")
    return _record(path, numbers, layout, lines)


def _within_range(rows: FloatArray) -> FloatArray:
    """Replace infinite samples, which PicoScope writes beyond the range of its ADC, by the ends of this range.

    The largest finite sample of a channel is that end, or just below it.
    """
    is_infinite = np.isinf(rows)
    if is_infinite.any():
        low, high = np.where(is_infinite, np.inf, rows), np.where(is_infinite, -np.inf, rows)
        rows = np.clip(rows, np.fmin.reduce(low), np.fmax.reduce(high))
    return rows


def _text(path: Path) -> str:
    """Return the text of a file: UTF-8 or, as older oscilloscopes write it, Windows-1252.

    Rohde & Schwarz writes the header to a separate file: NAME.csv next to the numbers in NAME.Wfm.csv.
    """
    data = read_whole(path, MAX_BYTES)
    if re.search(r"(?i)\.wfm\.csv$", path.name) and (header := path.with_name(f"{path.name[:-8]}.csv")).exists():
        data = read_whole(header, MAX_BYTES).rstrip() + b"\n" + data
    elif (numbers := path.with_name(f"{path.name[:-4]}.Wfm.csv")).exists():
        data = data.rstrip() + b"\n" + read_whole(numbers, MAX_BYTES)
    if b"\0" in data:
        raise ValueError("must be a file of an oscilloscope of a known kind, or text; is neither")
    try:
        return data.decode("utf-8-sig").replace("∞", "inf")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")


def _layout(lines: list[str]) -> _Layout:
    """Find separator, decimal sign, and the block of numbers that ends with the last line."""
    while lines and not lines[-1].strip(" ,;\t"):
        lines.pop()
    if not lines:
        raise ValueError("must have contents, is empty")
    before, last = next((line for line in reversed(lines[:-1]) if line.strip(" ,;\t")), lines[-1]), lines[-1]
    separator = next((mark for mark in ";\t," if mark in before), ",")
    decimal = "," if separator != "," and "," in before else "."
    columns = _numeric(before, separator, decimal)
    if columns and (_numeric(last, separator, decimal) != columns or last.count(separator) != before.count(separator)):
        text = (
            f"must have {len(columns)} numbers as the line before it, got {last.strip()[:40]!r}; is the file cut off?"
        )
        raise ValueError(f"line {len(lines)} {text}")
    first = len(lines)
    while first > 0 and columns:
        if lines[first - 1].strip(" ,;\t\r"):
            cells = _cells(lines[first - 1], separator)
            if len(cells) <= columns[-1] or any(_number(cells[k], decimal) is None for k in columns):
                break
        first -= 1
    while first < len(lines) and not lines[first].strip(" ,;\t\r"):
        first += 1
    if len(lines) - first < 2:
        at, text = len(lines), last.strip()[:40]
        raise ValueError(f"line {at} must be a row of numbers as the lines before it, got {text!r}; {HOW_TO}")
    header = [_cells(line, separator) for line in lines[:first] if line.strip(" ,;\t")]
    rows = [cells for cells in header if all(_number(cell, decimal) is not None for cell in cells if cell)]
    if len(rows) >= LEAST_ROWS:
        at = max(k for k in range(first) if lines[k].strip(" ,;\t\r"))
        raise ValueError(f"line {at + 1} must have {len(columns)} numbers, got {lines[at].strip()[:40]!r}; {HOW_TO}")
    return _Layout(separator, decimal, first, columns, header)


def _cells(line: str, separator: str) -> list[str]:
    return [cell.strip(' "\r') for cell in line.split(separator)]


def _numeric(line: str, separator: str, decimal: str) -> list[int]:
    """Return the columns of a line that hold numbers."""
    return [k for k, cell in enumerate(_cells(line, separator)) if _number(cell, decimal) is not None]


def _number(cell: str, decimal: str) -> float | None:
    try:
        value = float(cell.replace(decimal, ".") if decimal != "." else cell)
    except ValueError:
        return None
    return value if "_" not in cell else None


def _record(path: Path, numbers: FloatArray, layout: _Layout, lines: list[str]) -> WaveformRecord:
    """Make a record of the columns of numbers, shape (n_columns, n_rows)."""
    names, units, interval_s = _names(layout), _units(layout), _interval_s(layout)
    first = numbers[0]
    has_index = interval_s is not None and np.array_equal(first - first[0], np.arange(first.size))
    has_time = not has_index and len(numbers) > 1 and _is_time(names[0], first)
    n_segments = 1 + np.count_nonzero(np.diff(first) < 0) if has_time else 1
    if first.size % n_segments:
        raise ValueError(f"must have segments of one length, got {first.size} rows in {n_segments}")
    if has_time:
        segment, unit_s = first[: first.size // n_segments], SECONDS.get(units[0], 1.0)
        some = lines[layout.first : layout.first + segment.size][:: segment.size // 100 + 1]
        texts = [
            _cells(line, layout.separator)[layout.columns[0]].replace(layout.decimal, ".")
            for line in some
            if line.strip(" ,;\t\r")
        ]
        interval_s = _time_step_s(segment, unit_s, texts, interval_s)
    if interval_s is None:
        stem = re.sub(r"(?i)(\.wfm)?\.csv$", "", path.name)
        raise ValueError(
            f"must have a column of times, or the sampling interval in a header or in the header file {stem}.csv next "
            f"to it; {HOW_TO}"
        )
    skipped = 1 if has_time or has_index else 0
    scale = np.ones(len(numbers) - skipped)
    for k, unit in enumerate(units[skipped:]):
        if unit in OTHER_UNITS:
            raise ValueError(f"channel {k + 1} must be in volts, got {unit} in the header")
        scale[k] = VOLTS.get(unit, 1.0)
    samples = numbers[skipped:].reshape(len(scale), n_segments, -1).swapaxes(0, 1)
    return WaveformRecord.of(samples, 1.0 / interval_s, tuple(names[skipped:]), scale)


def _key(cell: str) -> str:
    """Return a key of a header in lower case, without units, spaces and punctuation."""
    return re.sub(r"[^a-z]", "", re.sub(r"[\(\[].*", "", cell.lower()))


def _quantity(cell: str, decimal: str) -> float | None:
    """Return the number in a cell such as `5e-11`, `Analog:5e-11` or `50 ps`, in seconds or hertz; None without one."""
    text = cell.rsplit("=", 1)[-1].rstrip(":").rsplit(":", 1)[-1].strip()
    if decimal == ",":
        text = text.replace(",", ".")
    found = re.fullmatch(r"([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*([a-zµμ/]*)", text)
    value = _number(found[1], ".") if found else None
    return None if value is None or found is None else value * SECONDS.get(found[2], 1.0)


def _interval_s(layout: _Layout) -> float | None:
    """Find the sampling interval in the header, to the right of its key, below it, or after a colon or equals sign."""
    for row, cells in enumerate(layout.header):
        below = layout.header[row + 1] if row + 1 < len(layout.header) else []
        for column, cell in enumerate(cells):
            key = _key(re.split("[:=]", cell)[0])
            if key not in INTERVAL_KEYS | RATE_KEYS:
                continue
            for place in (cell, *cells[column + 1 :], *below[column : column + 1]):
                value = _quantity(place, layout.decimal)
                if value is not None and value > 0 and math.isfinite(value):
                    return value if key in INTERVAL_KEYS else 1.0 / value
    return None


def _above(layout: _Layout, cells: list[str]) -> list[str]:
    """Return the cells of a header line above the columns of numbers; empty where the line is too short."""
    return [cells[column] if column < len(cells) else "" for column in layout.columns]


def _is_unit(cell: str) -> bool:
    return cell.strip("()[] ").lower() in SECONDS.keys() | VOLTS.keys() | OTHER_UNITS


def _names(layout: _Layout) -> list[str]:
    """Return the names above the columns, without units; empty where the header has no names."""
    for cells in reversed(layout.header):
        names = _above(layout, cells)
        if all(names[1:]) and any(names) and not any(_number(name, layout.decimal) is not None for name in names[1:]):
            if all(_is_unit(name) for name in names[1:] or names) or any(re.search("[:=]", name) for name in names):
                continue
            return [re.sub(r"\s*[\(\[][^()]*[\)\]]$", "", name) for name in names]
    return [""] * len(layout.columns)


def _units(layout: _Layout) -> list[str]:
    """Return the unit of each column in lower case, empty if it is not stated.

    It stands in brackets or after `_` behind a name, in a line of units above the columns, or behind a key such as
    `Vertical Units`.
    """
    units = [""] * len(layout.columns)
    for cells in layout.header:
        key, above = _key(cells[0]), _above(layout, cells)
        values = [cell.rsplit(":", 1)[-1].lower() for cell in cells[1:] if cell]
        if key in ("verticalunits", "verticalunit", "vunit", "yunits") and values:
            for k, cell in enumerate(above):
                units[k] = cell.rsplit(":", 1)[-1].lower() or values[0]
        elif key in ("horizontalunits", "horizontalunit", "hunit", "xunits") and values:
            units[0] = values[0] if layout.columns[0] == 0 else units[0]
        else:
            is_line = any(above) and all(_is_unit(cell) for cell in above if cell)
            for k, cell in enumerate(above):
                behind = re.search(r"[\(\[_]([^()\[\]_]*)[\)\]]?$", cell)
                if is_line and cell:
                    units[k] = cell.strip("()[] ").lower()
                elif behind and _is_unit(behind[1]):
                    units[k] = behind[1].strip().lower()
    return units


def _is_time(name: str, column: FloatArray) -> bool:
    """Return whether a column is named as time, or rises evenly at least until it falls back at a new segment."""
    if re.match(r"(?i)(time|second|t$|t_s$|x$|x-axis)", name):
        return True
    first = column[: int(np.append(np.diff(column) < 0, True).argmax()) + 1]
    line = np.linspace(first[0], first[-1], first.size)
    return first.size > 2 and bool(np.abs(first - line).max() <= 0.01 * (first[-1] - first[0]) > 0)


def _time_step_s(column: FloatArray, unit_s: float, texts: list[str], interval_s: float | None) -> float:
    """Return the step of a column of times: from all rows, so that times that were printed with few digits will do.

    Args:
        column: Times of a segment.
        unit_s: Unit of these times.
        texts: Some of them as printed.
        interval_s: Sampling interval of the header, which is more exact; None if it has none.

    Raises:
        ValueError: If the times are not even to the last printed digit.
    """
    sample = np.arange(column.size) - 0.5 * (column.size - 1)
    centred = column - column.mean()
    step = float(sample @ centred / max(sample @ sample, 1.0))
    exponents = (Decimal(text).as_tuple().exponent for text in texts)
    digit = 10.0 ** float(np.median([exponent for exponent in exponents if isinstance(exponent, int)]))
    uneven = float(np.abs(centred - step * sample).max())
    if not step > 0 or uneven > 0.51 * digit + 0.02 * step + 1e-7 * float(np.abs(column).max()):  # 1e-7: 32-bit floats
        raise ValueError("the column of times must rise in even steps")
    if interval_s is not None and abs(step * unit_s / interval_s - 1) < 0.01:
        return interval_s
    return step * unit_s
