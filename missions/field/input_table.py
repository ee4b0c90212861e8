"""CSV tables of field data: pyarrow splits them into cells, and errors are collected with file and line."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import csv

from dirmusic import InputFileError, InputFileWarning
from dirmusic.input_file import read_whole

FloatArray = NDArray[np.float64]

MAX_BYTES = 256 * 10**6
"""Size of the largest table that is read: about three million pulses."""

MAX_COLUMNS = 1000

MAX_ERRORS = 20
"""Errors listed for one file; more of them mean that it is a file of another kind."""

NUMBER = r"^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$"
"""Decimal numbers; Python and Arrow also accept other forms such as `nan` and `1_000`."""


@dataclass(frozen=True, kw_only=True)
class InputTable:
    """Columns of a CSV table as text, and the errors found in them so far.

    Attributes:
        path: The file.
        columns: Cells by name of the column.
        lines: Line of the file on which each row stands, shape (n_rows,).
        decimal_comma: True if numbers may have a decimal comma.
        errors: One line each.
    """

    path: Path
    columns: dict[str, pa.StringArray]
    lines: NDArray[np.intp]
    decimal_comma: bool = False
    errors: list[str] = field(default_factory=list[str])

    def add_error(self, text: str, row: int | None = None) -> None:
        """Add an error of the table, or of one of its rows (from 0)."""
        where = "" if row is None else f"line {self.lines[row]}: "
        self.errors.append(f"{self.path}: {where}{text}")

    def check(self) -> None:
        """Raise the errors found so far.

        Raises:
            InputFileError: If there are any.
        """
        if len(self.errors) > MAX_ERRORS:
            raise InputFileError([*self.errors[:MAX_ERRORS], f"{self.path}: more errors are not listed"])
        if self.errors:
            raise InputFileError(self.errors)

    def numbers(self, name: str, low: float = -math.inf, high: float = math.inf, unit: str = "") -> FloatArray:
        """Return a column of numbers from `low` to `high`, with NaN and an error for every other cell."""
        cells = self.columns[name]
        if self.decimal_comma:
            cells = pc.replace_substring(cells, ",", ".", max_replacements=1)  # pyright: ignore
        is_number = pc.match_substring_regex(cells, NUMBER).to_numpy(zero_copy_only=False)  # pyright: ignore
        values = np.where(is_number, cells.to_numpy(zero_copy_only=False), "nan").astype(np.float64)
        is_allowed = np.isfinite(values) & (values >= low) & (values <= high)
        expected = "a finite number" if math.isinf(high) else f"a number from {low:g} to {high:g}{unit}"
        for row in np.flatnonzero(~is_allowed)[: MAX_ERRORS + 1].tolist():
            self.add_error(f"{name} must be {expected}, got {self.columns[name][row].as_py()!r:.40}", row)
        return np.where(is_allowed, values, np.nan)


def read_table(path: Path) -> InputTable:
    """Read a CSV table with a header; cells are separated by commas, semicolons or tabs.

    With semicolons or tabs, numbers may have a decimal comma. Empty lines, lines that begin with `#` and the first line
    `sep=;` that Excel writes are skipped.

    Raises:
        InputFileError: If the file cannot be read, is not UTF-8 text, or its rows do not fit its header.
    """
    try:
        text = read_whole(path, MAX_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputFileError([f"{path}: must be UTF-8 text, and byte {error.start} is not"]) from None
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    lines = [
        (number, line)
        for number, line in enumerate(text.split("\n"), start=1)
        if line.strip(" ,;\t") and not line.lstrip().startswith("#")
    ]
    if lines and lines[0][1].strip('" ').lower().startswith("sep="):
        del lines[0]
    if len(lines) < 2:
        raise InputFileError([f"{path}: must have a header and at least one row"])
    delimiter = next((mark for mark in ";\t" if mark in lines[0][1]), ",")
    if delimiter == ";":
        note = f"{path}: cells are separated by semicolons; a comma in a number is read as the decimal sign"
        warnings.warn(InputFileWarning(note), stacklevel=2)
    header, columns = _split(path, lines, delimiter)
    if "" in header or len(set(header)) < len(header):
        name = next((name for name in header if header.count(name) > 1), "")
        raise InputFileError([f"{path}: names of columns must be unique and not empty, got {name!r:.40}"])
    numbers = np.array([number for number, _ in lines[1:]], dtype=np.intp)
    named = dict(zip(header, columns, strict=True))
    return InputTable(path=path, columns=named, lines=numbers, decimal_comma=delimiter != ",")


def _split(path: Path, lines: list[tuple[int, str]], delimiter: str) -> tuple[list[str], list[pa.StringArray]]:
    """Split numbered lines into a header and columns of text."""
    errors: list[str] = []

    def refuse_row(row: csv.InvalidRow) -> str:
        if len(errors) <= MAX_ERRORS:
            number = lines[row.number - 1][0]
            errors.append(f"{path}: line {number}: must have {row.expected_columns} cells, got {row.actual_columns}")
        return "skip"

    try:
        table = csv.read_csv(
            pa.BufferReader("\n".join(line for _, line in lines).encode()),
            csv.ReadOptions(autogenerate_column_names=True, use_threads=False),
            csv.ParseOptions(delimiter=delimiter, invalid_row_handler=refuse_row),
            csv.ConvertOptions(column_types={f"f{k}": pa.string() for k in range(MAX_COLUMNS)}),
        )
    except pa.ArrowInvalid as error:
        raise InputFileError([f"{path}: cannot be split into cells ({str(error).splitlines()[0]:.200})"]) from None
    if table.num_columns > MAX_COLUMNS:
        raise InputFileError([f"{path}: must have at most {MAX_COLUMNS} columns, got {table.num_columns}"])
    if not errors and table.num_rows != len(lines):
        errors.append(f"{path}: a quoted cell must end on the line on which it begins")
    if errors:
        raise InputFileError(errors[:MAX_ERRORS])
    columns = [pc.utf8_trim_whitespace(column.combine_chunks()) for column in table.columns]  # pyright: ignore
    return [column[0].as_py() for column in columns], [column[1:] for column in columns]
