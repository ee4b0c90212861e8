"""Tables from CSV files, read strictly: a wrong cell is named by file and line, and nothing is guessed silently."""

from __future__ import annotations

import csv
import re
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.dtypes import StringDType
from numpy.typing import NDArray

from dirmusic.input_file import InputFileError, InputFileWarning, read_text

FloatArray = NDArray[np.float64]
TextArray = NDArray[Any]  # of texts, `StringDType`

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
SEPARATORS = ",;\t"
SEPARATOR_LINE = re.compile(r'"?sep=(.)"?', re.IGNORECASE)
"""What Excel writes into the first line, and reads there."""

MAX_FAULTS = 20
"""A file with more faults than this is of another kind; the rest is counted, not listed."""

MOST_COLUMNS = 1000
"""Of a table (assumed)."""

LONGEST_LINE = 100_000
"""Characters of one line of a table (assumed): a hundred for each column; more is no line of numbers and names."""

ROWS_AT_ONCE = 50_000
"""So many rows are split at a time: what is kept of them takes a tenth of the memory."""

LONGEST_SHOWN = 40
"""Characters of a wrong cell that a message shows."""


class Faults:
    """What is wrong with a file: the first faults in words, the others as a number.

    Attributes:
        told: One line for each of the first `MAX_FAULTS`.
        n_more: How many there are beyond these.
    """

    def __init__(self) -> None:
        self.told: list[str] = []
        self.n_more = 0

    def append(self, text: str) -> None:
        """Note one."""
        if len(self.told) < MAX_FAULTS:
            self.told.append(text)
        else:
            self.n_more += 1


@dataclass(frozen=True, kw_only=True)
class CsvTable:
    """Cells by column, and the faults found in them so far; `check` raises them all at once.

    Attributes:
        path: The file.
        header: Names of the columns.
        columns: The cells as text, shape (n_rows,), by name of the column.
        lines: Line of the file on which each row stands, counted from 1, shape (n_rows,).
        decimal_comma: Whether numbers are written with a comma.
        faults: What is wrong so far.
    """

    path: Path
    header: tuple[str, ...]
    columns: dict[str, TextArray]
    lines: NDArray[np.intp]
    decimal_comma: bool = False
    faults: Faults = field(default_factory=Faults)

    @property
    def n_rows(self) -> int:
        """Rows below the header."""
        return self.lines.size

    def fault(self, row: int, text: str) -> None:
        """Note a fault in a row."""
        self.faults.append(f"{self.path}: line {self.lines[row]}: {text}")

    def text(self, column: str) -> list[str]:
        """The cells of a column."""
        return self.columns[column].tolist()

    def numbers(
        self, column: str, is_allowed: Callable[[FloatArray], NDArray[np.bool_]] | None = None, allowed: str = ""
    ) -> FloatArray:
        """The finite numbers of a column, shape (n_rows,), NaN where there is a fault.

        Args:
            column: Its name.
            is_allowed: Tells of an array of numbers which are allowed, if not any.
            allowed: The same in words, for the line about a fault.
        """
        cells = self.text(column)
        plain = cells
        if self.decimal_comma:
            plain = [cell if "." in cell else cell.replace(",", ".", 1) for cell in cells]
        values, is_number = _as_numbers(plain)
        is_right = is_number & np.isfinite(values)
        if is_allowed is not None:
            with np.errstate(invalid="ignore"):
                is_right &= is_allowed(values)
        for row in np.flatnonzero(~is_right).tolist():
            if is_number[row]:
                told = f"{column}: got {cells[row]:.{LONGEST_SHOWN}}; allowed is {allowed or 'a finite number'}"
            else:
                told = f"{column}: got {_short(cells[row])}; allowed is a number"
            self.fault(row, told)
        values[~is_right] = np.nan
        return values

    def check(self) -> None:
        """Raise what was found.

        Raises:
            InputFileError: If there is any fault.
        """
        if self.faults.told:
            more = self.faults.n_more
            raise InputFileError([*self.faults.told, *([f"{self.path}: and {more} faults more"] if more > 0 else [])])


def read_csv_table(path: str | Path) -> CsvTable:
    """Read a table with a header line.

    Cells are split at commas; or at semicolons or tabs, if the header has them or a first line such as `sep=;` names
    them, and then numbers may have a decimal comma. Empty lines and lines that begin with `#` are skipped. A
    byte-order mark is skipped with a warning.

    Raises:
        InputFileError: If the file cannot be read, is no UTF-8 text, has no header or no rows, repeats or leaves out a
            column's name, or a row has more or fewer cells than the header.
    """
    path = Path(path)
    lines = list(enumerate(read_text(path).splitlines(), start=1))
    named = SEPARATOR_LINE.fullmatch(lines[0][1].strip(" ")) if lines else None
    if named is not None and named[1] not in SEPARATORS:
        raise InputFileError([f"{path}: line 1: got {lines[0][1]!r}; allowed are comma, semicolon and tab"])
    lines = [(number, line) for number, line in lines[named is not None :] if _holds_cells(line)]
    if not lines:
        raise InputFileError([f"{path}: no line in it; a table has a header and rows"])
    too_long = next((number for number, line in lines if len(line) > LONGEST_LINE), None)
    if too_long is not None:
        raise InputFileError([f"{path}: line {too_long}: has more than {LONGEST_LINE} characters; is this a table?"])
    delimiter = named[1] if named else next((mark for mark in ";\t" if mark in lines[0][1]), ",")
    if delimiter == ";":
        warnings.warn(
            f"{path}: semicolons separate its cells; a comma in a number is taken as the decimal sign",
            InputFileWarning,
            stacklevel=2,
        )
    header = tuple(_split(path, lines[:1], delimiter)[0])
    if "" in header or len(set(header)) < len(header):
        wrong = next((name for name in header if header.count(name) > 1), "")
        raise InputFileError([f"{path}: line {lines[0][0]}: column {_short(wrong)} is empty or there twice"])
    if len(header) > MOST_COLUMNS:
        raise InputFileError([f"{path}: {len(header)} columns; allowed are up to {MOST_COLUMNS}"])
    return _table(path, header, lines[1:], delimiter)


def _table(path: Path, header: tuple[str, ...], lines: list[tuple[int, str]], delimiter: str) -> CsvTable:
    """The rows below a header, some of them at a time: a list of texts takes ten times the memory of a column."""
    if not lines:
        raise InputFileError([f"{path}: no row after the header; a table has at least one"])
    parts: list[list[TextArray]] = [[] for _ in header]
    table = CsvTable(
        path=path,
        header=header,
        columns={},
        lines=np.array([number for number, _ in lines], dtype=np.intp),
        decimal_comma=delimiter != ",",
    )
    for first in range(0, len(lines), ROWS_AT_ONCE):
        rows = _split(path, lines[first : first + ROWS_AT_ONCE], delimiter)
        for row, cells in enumerate(rows, start=first):
            if len(cells) != len(header):
                table.fault(row, f"got {len(cells)} cells; allowed are {len(header)}, as in the header")
        if not table.faults.told:
            for part, cells in zip(parts, zip(*rows, strict=True), strict=True):
                part.append(as_texts(cells))
    table.check()
    table.columns.update({name: np.concatenate(part) for name, part in zip(header, parts, strict=True)})
    return table


def _split(path: Path, lines: list[tuple[int, str]], delimiter: str) -> list[list[str]]:
    """The cells of some lines, one list for each line."""
    reader = csv.reader((line for _, line in lines), delimiter=delimiter, skipinitialspace=True)
    rows: list[list[str]] = []
    try:
        for cells in reader:
            rows.append([cell.strip() for cell in cells])
            if reader.line_num != len(rows):
                break
    except csv.Error:  # a cell of 131072 characters, which lines by themselves do not have
        pass
    if len(rows) != len(lines):
        number = lines[max(len(rows) - 1, 0)][0]
        raise InputFileError([f"{path}: line {number}: a quoted cell goes on over several lines; allowed is one"])
    return rows


def as_texts(cells: Sequence[str]) -> TextArray:
    """A column of cells."""
    return np.array(cells, dtype=StringDType())


def _as_numbers(cells: Sequence[str]) -> tuple[FloatArray, NDArray[np.bool_]]:
    """The numbers in some cells, anything where there is none, and where there is one; both of shape (n,)."""
    joined = "".join(cells)
    if joined.isascii() and "_" not in joined:  # what else Python takes for a number is not finite
        try:
            values = np.array([float(cell) for cell in cells])
        except ValueError:
            pass
        else:
            if np.isfinite(values).all():
                return values, np.ones(len(cells), dtype=np.bool_)
    is_number = np.array([NUMBER.fullmatch(cell) is not None for cell in cells], dtype=np.bool_)
    return np.array([float(cell) if ok else 0.0 for cell, ok in zip(cells, is_number, strict=True)]), is_number


def _holds_cells(line: str) -> bool:
    return bool(line.strip(" ,;\t")) and not line.lstrip().startswith("#")


def _short(cell: str) -> str:
    shown = repr(cell)
    return shown if len(shown) <= LONGEST_SHOWN else shown[: LONGEST_SHOWN - 3] + "..."
