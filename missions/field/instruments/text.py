"""Text of oscilloscopes: one tolerant reader of the CSV dialects of Tektronix, LeCroy, Keysight, Rigol and others.

All dialects consist of a header, rows of numbers, and either a column of times or the sampling interval in the header.
They differ in the separator, the decimal sign, the names and units above the columns, the keys of the header, empty
cells, and columns of text to the left of the numbers.
"""

import io
import math
import re
from decimal import Decimal
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from dirmusic.arrays import FloatArray
from dirmusic.input_file import read_whole
from pdpatrol.missions.field.instruments.record import MAX_BYTES, VOLTS, WaveformRecord

SECONDS = {
    "s": 1.0, "sec": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6,
    "usec": 1e-6, "ns": 1e-9, "nsec": 1e-9, "ps": 1e-12,
}  # fmt: skip
"""Units of time, in seconds."""

HERTZ = {
    f"{prefix}{unit}": factor
    for prefix, factor in (("", 1.0), ("k", 1e3), ("m", 1e6), ("g", 1e9))
    for unit in ("hz", "s/s", "sa/s", "sps", "samples/s")
}
"""Units of the sampling rate, in hertz."""

OTHER_UNITS = {
    "a", "ma", "ua", "µa", "w", "mw", "uw", "db", "dbm", "dbv", "dbmv", "dbuv", "dbµv", "pc", "nc", "counts", "lsb",
    *HERTZ,
}  # fmt: skip
"""Units that are recognised to be refused."""

INTERVAL_KEYS = {
    "sampleinterval", "samplinginterval", "samplingperiod", "sampletime", "timeinterval", "increment", "xincrement",
    "xinc", "tinc", "deltat", "deltax", "dt", "hresolution", "resolution",
}  # fmt: skip
"""Keys of the sampling interval, without spaces and punctuation."""

RATE_KEYS = {"samplerate", "samplingrate", "samplefrequency", "samplerates"}
"""Keys of the sampling rate."""

NO_COLUMNS = {*INTERVAL_KEYS, "start"}
"""Keys that stand next to the names of columns."""

TIME_NAME = re.compile(r"(?i)(time|second|t$|t_s$|x$|x-axis|x_value$)")
"""Start of the name of a column of times."""

QUOTED = re.compile(r'(?m)(^|,)\s*"([^",]*\d),(\d[^",]*)"\s*(?=,|$)')
"""Number with a decimal comma in quotation marks, in a line with commas between the cells."""

BLANK = " ,;\t\r"
"""Characters of a line without contents."""

LAST_LINES = 50
"""Number of lines at the end that show the decimal sign, and whether the last one is cut off."""

LEAST_ROWS = 3
"""Number of rows of numbers above the block of numbers from which on they belong to it, and a line between is damaged.
Assumed; headers have one or two."""

MOST_ROUNDED = 0.02
"""Largest last digit of rounded times, relative to the length of the record: then the rate is right within 2 %."""

HOW_TO = "write a header such as time_s,channel_1,channel_2 and rows of as many numbers"


class _Layout(NamedTuple):
    """Where the numbers stand in a file.

    Attributes:
        separator: Separator of the cells.
        decimal: Decimal sign.
        first: Line of the first row of numbers, from 0.
        columns: Columns that hold numbers.
        header: Cells of the lines before the numbers and of the columns left of them, without empty lines.
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
    text = QUOTED.sub(r"\1\2.\3", _text(path))
    lines = text.splitlines()
    layout = _layout(lines, is_ended=text.endswith(("\n", "\r")))
    numbered = [k for k in range(layout.first, len(lines)) if lines[k].strip(BLANK)]
    try:
        frame = pd.read_csv(
            io.StringIO("\n".join(lines[k] for k in numbered)),
            sep=r"\s+" if layout.separator == " " else layout.separator,
            decimal=layout.decimal,
            header=None,
            usecols=layout.columns,
            skipinitialspace=True,
            dtype=np.float64,
        )
    except ValueError as error:
        raise ValueError(f"must have rows of {len(layout.columns)} numbers ({' '.join(str(error).split())})") from None
    numbers = frame.to_numpy(np.float64).T
    if np.isnan(numbers).any():
        row = int(np.isnan(numbers).any(axis=0).argmax())
        raise ValueError(f"line {numbered[row] + 1} must have {len(layout.columns)} numbers; {HOW_TO}")
    return _record(path, numbers, layout, [lines[k] for k in numbered])


def _within_range(channels: FloatArray) -> FloatArray:
    """Replace infinite samples, which PicoScope writes beyond the range of its ADC, by the ends of this range.

    The largest finite sample of a channel is that end, or just below it.

    Args:
        channels: Samples, shape (n_channels, n_samples).

    Raises:
        ValueError: If a channel has no finite sample.
    """
    is_finite = np.isfinite(channels)
    if is_finite.all():
        return channels
    if not is_finite.any(axis=1).all():
        raise ValueError(f"channel {int(is_finite.any(axis=1).argmin()) + 1} must have finite samples")
    low, high = np.where(is_finite, channels, np.inf).min(axis=1), np.where(is_finite, channels, -np.inf).max(axis=1)
    return np.clip(channels, low[:, np.newaxis], high[:, np.newaxis])


def _text(path: Path) -> str:
    """Return the text of a file: UTF-8, UTF-16 with a mark, or, as older oscilloscopes write it, Windows-1252.

    Rohde & Schwarz writes the header to a separate file: NAME.csv next to the numbers in NAME.Wfm.csv.
    """
    data = read_whole(path, MAX_BYTES)
    if re.search(r"(?i)\.wfm\.csv$", path.name) and (header := path.with_name(f"{path.name[:-8]}.csv")).exists():
        data = read_whole(header, MAX_BYTES).rstrip() + b"\n" + data
    elif (numbers := path.with_name(f"{path.name[:-4]}.Wfm.csv")).exists():
        data = data.rstrip() + b"\n" + read_whole(numbers, MAX_BYTES)
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace").replace("∞", "inf")
    if b"\0" in data:
        raise ValueError("must be a file of an oscilloscope of a known kind, or text; is neither")
    try:
        return data.decode("utf-8-sig").replace("∞", "inf")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")


def _layout(lines: list[str], *, is_ended: bool) -> _Layout:
    """Find separator, decimal sign, and the block of numbers that ends with the last line.

    Args:
        lines: Lines of the file; empty ones at the end are removed.
        is_ended: False if the last line does not end with a line break.
    """
    while lines and not lines[-1].strip(BLANK):
        lines.pop()
    if not lines:
        raise ValueError("must have contents, is empty")
    some = [k for k in range(max(len(lines) - LAST_LINES, 0), len(lines)) if lines[k].strip(BLANK)]
    before, last = lines[some[-2:][0]], lines[-1]
    separator = next((mark for mark in ";\t," if mark in before), " " if len(before.split()) > 1 else ",")
    decimal = "," if separator != "," and any("," in lines[k] for k in some) else "."
    columns, width = _numeric(before, separator, decimal), len(_cells(before, separator))
    if not columns or columns[-1] < width - 1:
        at = some[-2:][0] if columns else len(lines) - 1
        raise ValueError(f"line {at + 1} must be a row of numbers, got {lines[at].strip()[:40]!r}; {HOW_TO}")

    def is_row(line: str) -> bool:
        cells = _cells(line, separator)
        is_number = [_number(cell, decimal) is not None for cell in cells[columns[0] :]]
        rest = [cell for cell, number in zip(cells[columns[0] :], is_number, strict=True) if cell and not number]
        return len(cells) == width and not rest and sum(is_number) == len(columns)

    ends = [_cells(lines[k], separator)[-1] for k in some if is_row(lines[k])]
    if not is_row(last) or (not is_ended and _is_cut(ends)):
        text = (
            f"must have {len(columns)} numbers as the line before it, got {last.strip()[:40]!r}; is the file cut off?"
        )
        raise ValueError(f"line {len(lines)} {text}")
    first = len(lines)
    while first > 0 and (not lines[first - 1].strip(BLANK) or is_row(lines[first - 1])):
        first -= 1
    while first < len(lines) and not lines[first].strip(BLANK):
        first += 1
    if len(lines) - first < 2:
        at, text = len(lines), last.strip()[:40]
        raise ValueError(f"line {at} must be a row of numbers as the lines before it, got {text!r}; {HOW_TO}")
    header = [_cells(line, separator) for line in lines[:first] if line.strip(BLANK)]
    rows = [cells for cells in header if all(_number(cell, decimal) is not None for cell in cells if cell)]
    if len(rows) >= LEAST_ROWS:
        at = max(k for k in range(first) if lines[k].strip(BLANK))
        raise ValueError(f"line {at + 1} must have {len(columns)} numbers, got {lines[at].strip()[:40]!r}; {HOW_TO}")
    beside = [_cells(line, separator)[: columns[0]] for line in lines[first : first + LAST_LINES]]
    return _Layout(separator, decimal, first, columns, header + [cells for cells in beside if any(cells)])


def _cells(line: str, separator: str) -> list[str]:
    """Split a line into cells, without empty ones at its end; blanks may separate several cells."""
    cells = [cell.strip(' "\r') for cell in (line.split() if separator == " " else line.split(separator))]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _is_cut(ends: list[str]) -> bool:
    """Return whether the last of some numbers in one column is cut off: without its exponent, or with fewer digits."""
    *others, last = (text.lower().lstrip("+-") for text in ends)
    if not others:
        return False
    lengths = {len(text) for text in others}
    return (all("e" in text for text in others) and "e" not in last) or (len(lengths) == 1 and len(last) < min(lengths))


def _numeric(line: str, separator: str, decimal: str) -> list[int]:
    """Return the columns of a line that hold numbers."""
    return [k for k, cell in enumerate(_cells(line, separator)) if _number(cell, decimal) is not None]


def _number(cell: str, decimal: str) -> float | None:
    try:
        value = float(cell.replace(decimal, ".") if decimal != "." else cell)
    except ValueError:
        return None
    return value if "_" not in cell else None


def _record(path: Path, numbers: FloatArray, layout: _Layout, rows: list[str]) -> WaveformRecord:
    """Make a record of the columns of numbers, shape (n_columns, n_rows), and the lines with them."""
    names, interval_s = _names(layout), _interval_s(layout)
    units, names = _units(layout, names), [re.sub(r"\s*[\(\[][^()]*[\)\]]$", "", name) for name in names]
    n_columns, first = numbers.shape[0], numbers[0]
    is_time = [
        bool(TIME_NAME.match(name)) or (not name and unit in SECONDS) for name, unit in zip(names, units, strict=True)
    ]
    counts_up = n_columns > 1 and np.array_equal(first - first[0], np.arange(first.size))
    has_index = counts_up and (interval_s is not None or (is_time[1] and not is_time[0]))
    k = int(has_index)
    has_time = n_columns > k + 1 and (is_time[k] if has_index else _is_time(names[0], first))
    times, n_segments, start_s = numbers[k], 1, None
    channels = list(range(k + has_time, n_columns))
    if has_time:
        channels = [c for c in channels if not np.array_equal(numbers[c], times)]
        n_segments = _count_segments(times)
        segment, unit_s = times[: times.size // n_segments], SECONDS.get(units[k], 1.0)
        some = rows[: segment.size][:: segment.size // 100 + 1]
        texts = [_cells(row, layout.separator)[layout.columns[k]].replace(layout.decimal, ".") for row in some]
        interval_s, start_s = _time_step_s(segment, unit_s, texts, interval_s), float(times[0]) * unit_s
    for c in channels:
        if is_time[c] and c > 0:
            raise ValueError(f"column {c + 1} must be a channel, got times: these must be in the first column")
    if interval_s is None:
        stem = re.sub(r"(?i)(\.wfm)?\.csv$", "", path.name)
        raise ValueError(
            f"must have a column of times, or the sampling interval in a header or in the header file {stem}.csv next "
            f"to it; {HOW_TO}"
        )
    scale = np.array([VOLTS.get(units[c], 1.0) for c in channels])
    for n, c in enumerate(channels, start=1):
        if units[c] and units[c] not in VOLTS | SECONDS:
            raise ValueError(f"channel {n} must be in volts, got {units[c]} in the header")
    samples = _within_range(numbers[channels]).reshape(len(scale), n_segments, -1).swapaxes(0, 1)
    _check_length(layout, samples.shape[0] * samples.shape[2], samples.shape[2])
    return WaveformRecord.of(samples, 1.0 / interval_s, tuple(names[c] for c in channels), scale, start_s)


def _count_segments(times: FloatArray) -> int:
    """Return the number of segments, each of which begins where the times fall back.

    Raises:
        ValueError: If a time is infinite, or the segments do not have the same times.
    """
    if not np.isfinite(times).all():
        raise ValueError(
            f"times must be finite, got {times[~np.isfinite(times)][0]} in row {np.isinf(times).argmax() + 1}"
        )
    starts = np.flatnonzero(np.diff(times) < 0) + 1
    n = starts.size + 1
    if times.size % n or not np.array_equal(starts, np.arange(1, n) * (times.size // n)):
        at = int(starts[0]) + 1
        raise ValueError(f"times must rise, or fall back after segments of one length; they first fall in row {at}")
    segments = times.reshape(n, -1)
    step = (segments[0, -1] - segments[0, 0]) / max(segments.shape[1] - 1, 1)
    off = np.abs(segments - segments[:, :1] - (segments[0] - segments[0, 0])).max(axis=1)
    if (off > 1.5 * step).any() or (np.abs(segments[:, 0] - segments[0, 0]) > 1.5 * step).any():
        raise ValueError("segments must have the same times")
    return n


def _check_length(layout: _Layout, n_rows: int, n_samples: int) -> None:
    """Compare the number of samples with the header.

    Raises:
        ValueError: If the header states more.
    """
    for cells in layout.header:
        for cell, value in pairwise(cells):
            length = {"recordlength": n_rows, "segmentsize": n_samples}.get(_key(cell))
            stated = _quantity(value, "", layout.decimal, {"": 1.0}) if length else None
            if length and stated and stated > length:
                raise ValueError(f"must have {stated:.0f} samples as its header states, got {length}; is it cut off?")


def _key(cell: str) -> str:
    """Return a key of a header in lower case, without units, spaces and punctuation."""
    return re.sub(r"[^a-z]", "", re.sub(r"[\(\[].*", "", cell.lower()))


def _quantity(cell: str, unit: str, decimal: str, units: dict[str, float]) -> float | None:
    """Return the number in a cell such as `5e-11`, `Analog:5e-11` or `50 ps`; None without one.

    Args:
        cell: Text of the cell.
        unit: Unit of numbers without a unit; empty for that of the result.
        decimal: Decimal sign.
        units: Factors of known units.
    """
    text = cell.rsplit("=", 1)[-1].rstrip(":").rsplit(":", 1)[-1].strip().lower()
    if decimal == ",":
        text = text.replace(",", ".")
    found = re.fullmatch(r"([-+]?[\d.]+(?:e[-+]?\d+)?)\s*(\S*)", text)
    value, factor = (_number(found[1], "."), units.get(found[2] or unit)) if found else (None, None)
    return None if value is None or factor is None else value * factor


def _interval_s(layout: _Layout) -> float | None:
    """Find the sampling interval in the header, to the right of its key, below it, or after a colon or equals sign.

    Its unit is behind the number, in the next cell, or in brackets behind the key.
    """
    for row, cells in enumerate(layout.header):
        below = layout.header[row + 1] if row + 1 < len(layout.header) else []
        for column, cell in enumerate(cells):
            key = _key(re.split("[:=]", cell)[0])
            if key not in INTERVAL_KEYS | RATE_KEYS:
                continue
            units = SECONDS if key in INTERVAL_KEYS else HERTZ
            of_key = re.search(r"[\(\[](.*)[\)\]]", cell)
            near = [of_key[1] if of_key else "", *cells[column + 2 : column + 3]]
            unit = next((text.strip().lower() for text in near if text.strip().lower() in units), "")
            for place in (cell, *cells[column + 1 :], *below[column : column + 1]):
                value = _quantity(place, unit, layout.decimal, units | {"": 1.0})
                if value is not None and value > 0 and math.isfinite(value):
                    return value if key in INTERVAL_KEYS else 1.0 / value
    return None


def _above(layout: _Layout, cells: list[str]) -> list[str]:
    """Return the cells of a header line above the columns of numbers; empty where the line is too short."""
    return [cells[column] if column < len(cells) else "" for column in layout.columns]


def _is_unit(cell: str) -> bool:
    return cell.strip("()[] ").lower() in SECONDS.keys() | VOLTS.keys() | OTHER_UNITS


def _is_line_of_units(cells: list[str]) -> bool:
    """Return whether all cells above the columns are units, or at least two and half of them."""
    stated = [cell for cell in cells if cell.strip("-")]
    n_units = sum(_is_unit(cell) for cell in stated)
    return n_units > 0 and (n_units == len(stated) or (n_units >= 2 and 2 * n_units >= len(stated)))


def _unit_behind(name: str) -> str:
    """Return the unit at the end of a name, in lower case; empty if it has none.

    It stands in brackets, after `in`, or after a slash, colon, underscore or blank, where it may not be `a` or `w`.
    """
    if found := re.search(r"[\(\[]([^()\[\]]+)[\)\]][\s\w]*$", name):
        unit = found[1].split()[0].lower() if found[1].strip() else ""
        return unit if _is_unit(unit) else ""
    found = re.search(r"(\bin\s+|[/:_\s])\s*([^\s()\[\]/:_]+)$", name)
    unit = found[2].lower() if found else ""
    is_letter = found is not None and len(unit) == 1 and unit in OTHER_UNITS and found[1][0] not in "i/"
    return unit if _is_unit(unit) and not is_letter else ""


def _names(layout: _Layout) -> list[str]:
    """Return the names above the columns, with units behind them; empty where the header has no names.

    Raises:
        ValueError: If the last line begins with the name of a column of times, but has not one name for each column.
    """
    for cells in layout.header[-1:]:
        named = [
            each for each in cells[layout.columns[0] :] if each and "=" not in each and _key(each) not in NO_COLUMNS
        ]
        is_line = len(named) > 1 and TIME_NAME.match(named[0]) and not any(":" in cell for cell in named)
        if is_line and len(named) != len(layout.columns):
            raise ValueError(f"rows must have {len(named)} numbers as the header has names, got {len(layout.columns)}")
    for cells in reversed(layout.header):
        names = _above(layout, cells)
        if all(names[1:]) and any(names) and not any(_number(name, layout.decimal) is not None for name in names[1:]):
            if _is_line_of_units(names[1:] or names) or any(re.search("[:=]", name) for name in names):
                continue
            return names
    return [""] * len(layout.columns)


def _units(layout: _Layout, names: list[str]) -> list[str]:
    """Return the unit of each column in lower case, empty if it is not stated.

    It stands behind its name, in a line of units above the columns, or behind a key such as `Vertical Units`.
    """
    units = [_unit_behind(name) for name in names]
    for cells in layout.header:
        key, above = _key(cells[0]), _above(layout, cells)
        values = [cell.rsplit(":", 1)[-1].lower() for cell in cells[1:] if cell]
        if key in ("verticalunits", "verticalunit", "vunit", "yunits") and values:
            for k, cell in enumerate(above):
                units[k] = cell.rsplit(":", 1)[-1].lower() or units[k] or values[0]
        elif key in ("horizontalunits", "horizontalunit", "hunit", "xunits") and values:
            units[0] = values[0] if layout.columns[0] == 0 else units[0]
        elif _is_line_of_units(above):
            units = [cell.strip("()[] ").lower() or unit for cell, unit in zip(above, units, strict=True)]
            units = ["" if unit == "-" else unit for unit in units]
    return units


def _is_time(name: str, column: FloatArray) -> bool:
    """Return whether a column is named as time, or rises evenly at least until it falls back at a new segment."""
    if TIME_NAME.match(name):
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
    try:
        exponents = (Decimal(text).as_tuple().exponent for text in texts)
        digit = 10.0 ** float(np.median([exponent for exponent in exponents if isinstance(exponent, int)]))
    except ArithmeticError:
        raise ValueError("the column of times must rise in even steps") from None
    uneven = float(np.abs(centred - step * sample).max())
    if not step > 0 or uneven > 0.51 * digit + 0.02 * step + 1e-7 * float(np.abs(column).max()):  # 1e-7: 32-bit floats
        raise ValueError("the column of times must rise in even steps")
    if interval_s is not None and abs(step * unit_s / interval_s - 1) < 0.01:
        return interval_s
    if uneven > 0.02 * step and digit > MOST_ROUNDED * step * sample.size:
        raise ValueError("times must have more digits, or the header the sampling interval")
    return step * unit_s
