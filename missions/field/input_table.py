"""CSV tables of field data, read by pyarrow."""

import warnings
from csv import reader
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import csv

from dirmusic import InputFileError, InputFileWarning
from dirmusic.arrays import FloatArray, IntArray
from dirmusic.input_file import delimiter_of, read_lines

MAX_ERRORS = 20
"""Largest number of errors listed for one file; a file with more errors is probably of another kind."""


@dataclass(frozen=True, kw_only=True)
class InputTable:
    """Columns of a CSV table, and the errors found in them so far.

    Attributes:
        path: The file.
        columns: Values by name of the column: numbers, NaN for empty cells; text in columns `waveform...`.
        lines: Line of the file on which each row stands, shape (n_rows,).
        errors: One line each.
    """

    path: Path
    columns: dict[str, NDArray[Any]]
    lines: IntArray
    errors: list[str] = field(default_factory=list[str])

    def numbers(self, low: float, high: float, *names: str) -> FloatArray:
        """Return columns, shape (n_rows, n_names); add an error for each cell that is not a number from low to high."""
        values = np.column_stack([self.columns[name] for name in names])
        for row, column in np.argwhere(~((values >= low) & (values <= high)))[:MAX_ERRORS]:
            must = f"{names[column]} must be a number from {low:g} to {high:g}"
            self.errors.append(f"{self.path}: line {self.lines[row]}: {must}, got {values[row, column]:g}")
        return values

    def check(self) -> None:
        """Raise `InputFileError` if errors were found so far."""
        if self.errors:
            raise InputFileError(self.errors[:MAX_ERRORS])


def read_table(path: Path) -> InputTable:
    """Read a CSV table with a header; cells are separated by commas, semicolons or tabs.

    With semicolons or tabs, numbers may have a decimal comma. Empty lines, lines that begin with `#` and the first line
    `sep=;` that Excel writes are skipped, and so are separators at the end of all lines.

    Raises:
        InputFileError: If the file cannot be read, is not UTF-8 text, or contains a cell that is not a number.
    """
    lines = read_lines(path, 256 * 10**6)  # about three million pulses
    if lines and lines[0][1].strip('" ').lower().startswith("sep="):
        del lines[0]
    if len(lines) < 2:
        raise InputFileError([f"{path}: must have a header and at least one row"])
    numbers, (header, *rows) = zip(*lines, strict=True)
    delimiter = delimiter_of(header)
    end = header[len(header.rstrip(delimiter)) :]
    if end and all(row.endswith(end) for row in rows):
        header, *rows = [line.removesuffix(end) for line in (header, *rows)]
    names = [name.strip(' "') for name in header.split(delimiter)]
    if "" in names:
        raise InputFileError([f"{path}: line {numbers[0]}: column {names.index('') + 1} must have a name"])
    if len(set(names)) < len(names):
        name = next(name for name in names if names.count(name) > 1)
        raise InputFileError([f"{path}: line {numbers[0]}: columns must have different names, got {name:.60} twice"])
    has_decimal_comma = delimiter != "," and any("," in row for row in rows)
    if has_decimal_comma:
        warnings.warn(InputFileWarning(f"{path}: a comma in a number is read as the decimal sign"), stacklevel=2)
    types = {name: pa.string() if name.startswith("waveform") else pa.float64() for name in names}
    try:
        table = csv.read_csv(
            pa.BufferReader("\n".join(rows).encode()),
            csv.ReadOptions(column_names=names, use_threads=False),
            csv.ParseOptions(delimiter=delimiter),
            csv.ConvertOptions(column_types=types, decimal_point="," if has_decimal_comma else "."),
        )
    except pa.ArrowInvalid as error:
        text = _first_error(names, list(zip(numbers[1:], rows, strict=True)), delimiter, has_decimal_comma)
        raise InputFileError([f"{path}: {text or ' '.join(str(error).split()):.300}"]) from None
    if table.num_rows != len(rows):
        raise InputFileError([f"{path}: a quoted cell must end on the line on which it begins"])
    columns = {name: table[name].to_numpy() for name in names}
    return InputTable(path=path, columns=columns, lines=np.array(numbers[1:]))


def _first_error(names: list[str], lines: list[tuple[int, str]], delimiter: str, has_decimal_comma: bool) -> str | None:
    """Return the number of the first line that has not one number in each column, and its error; None without one."""
    empty = csv.ConvertOptions().null_values
    for number, line in lines:
        cells = next(reader([line], delimiter=delimiter))
        if len(cells) != len(names):
            return f"line {number}: must have {len(names)} cells as the header has, got {len(cells)}"
        for name, cell in zip(names, cells, strict=True):
            text = cell.replace(".", "?").replace(",", ".") if has_decimal_comma else cell
            if not name.startswith("waveform") and cell not in empty and not _is_number(text):
                return f"line {number}: {name} must be a number, got {cell.strip()[:40]!r}"
    return None


def _is_number(text: str) -> bool:
    """Return whether pyarrow reads a text as a number; Python's `float` also takes 1_0 and digits of other scripts."""
    try:
        float(text)
    except ValueError:
        return False
    return text.isascii() and "_" not in text
