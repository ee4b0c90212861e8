"""Tables from CSV files, read strictly: a wrong cell is named by file and line, and nothing is guessed silently."""

from __future__ import annotations

import csv
import re
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
MAX_FAULTS = 20
"""A file with more faults than this is of another kind; the rest is counted, not listed."""


class InputFileError(ValueError):
    """A file that cannot be used; one line per fault, each with file, place, what came and what is allowed."""

    def __init__(self, faults: Sequence[str]) -> None:
        super().__init__("\n".join(faults))
        self.faults = tuple(faults)


class InputFileWarning(UserWarning):
    """Something unusual about a file, which could be read all the same."""


@dataclass(frozen=True, kw_only=True)
class CsvTable:
    """Cells by column, and the faults found in them so far; `check` raises them all at once.

    Attributes:
        path: The file.
        header: Names of the columns.
        rows: The cells as text, one tuple per row.
        lines: Line of the file on which each row stands, counted from 1.
        decimal_comma: Whether numbers are written with a comma.
        faults: What is wrong so far.
    """

    path: Path
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    decimal_comma: bool = False
    faults: list[str] = field(default_factory=list[str])

    def fault(self, row: int, text: str) -> None:
        """Note a fault in a row."""
        self.faults.append(f"{self.path}: line {self.lines[row]}: {text}")

    def text(self, column: str) -> list[str]:
        """The cells of a column."""
        index = self.header.index(column)
        return [row[index] for row in self.rows]

    def numbers(self, column: str, is_allowed: Callable[[float], bool] | None = None, allowed: str = "") -> FloatArray:
        """The finite numbers of a column, NaN where there is a fault.

        Args:
            column: Its name.
            is_allowed: What a number must be, if not any.
            allowed: The same in words, for the line about a fault.
        """
        values = np.full(len(self.rows), np.nan)
        for row, cell in enumerate(self.text(column)):
            plain = cell.replace(",", ".", 1) if self.decimal_comma and "." not in cell else cell
            if not NUMBER.fullmatch(plain):
                self.fault(row, f"{column}: got {_short(cell)}; allowed is a number")
            elif not np.isfinite(float(plain)) or (is_allowed is not None and not is_allowed(float(plain))):
                self.fault(row, f"{column}: got {cell}; allowed is {allowed or 'a finite number'}")
            else:
                values[row] = float(plain)
        return values

    def check(self) -> None:
        """Raise what was found.

        Raises:
            InputFileError: If there is any fault.
        """
        if self.faults:
            more = len(self.faults) - MAX_FAULTS
            raise InputFileError(
                [*self.faults[:MAX_FAULTS], *([f"{self.path}: and {more} faults more"] if more > 0 else [])]
            )


def read_csv_table(path: str | Path) -> CsvTable:
    """Read a table with a header line.

    Cells are split at commas; or at semicolons or tabs, if the header has them, and then numbers may have a decimal
    comma. Empty lines and lines that begin with `#` are skipped. A byte-order mark is skipped with a warning.

    Raises:
        InputFileError: If the file cannot be read, is no UTF-8 text, has no header or no rows, repeats or leaves out a
            column's name, or a row has more or fewer cells than the header.
    """
    path = Path(path)
    text = read_text(path)
    lines = [(number, line) for number, line in enumerate(text.splitlines(), start=1) if _holds_cells(line)]
    if not lines:
        raise InputFileError([f"{path}: no line in it; a table has a header and rows"])
    delimiter = next((mark for mark in ";\t" if mark in lines[0][1]), ",")
    if delimiter == ";":
        warnings.warn(
            f"{path}: semicolons separate its cells; a comma in a number is taken as the decimal sign",
            InputFileWarning,
            stacklevel=2,
        )
    cells = [
        tuple(cell.strip() for cell in row)
        for row in csv.reader((line for _, line in lines), delimiter=delimiter, skipinitialspace=True)
    ]
    if len(cells) != len(lines):
        raise InputFileError([f"{path}: a quoted cell goes on over several lines; allowed is one line for each row"])
    header = cells[0]
    if "" in header or len(set(header)) < len(header):
        wrong = next((name for name in header if header.count(name) > 1), "")
        raise InputFileError([f"{path}: line {lines[0][0]}: column `{wrong}` is empty or there twice"])
    table = CsvTable(
        path=path,
        header=header,
        rows=tuple(cells[1:]),
        lines=tuple(number for number, _ in lines[1:]),
        decimal_comma=delimiter != ",",
    )
    if not table.rows:
        raise InputFileError([f"{path}: no row after the header; a table has at least one"])
    for row, content in enumerate(table.rows):
        if len(content) != len(header):
            table.fault(row, f"got {len(content)} cells; allowed are {len(header)}, as in the header")
    table.check()
    return table


def read_text(path: Path) -> str:
    """UTF-8 text of a file, without a byte-order mark.

    Raises:
        InputFileError: If it cannot be read or is no such text.
    """
    try:
        data = path.read_bytes()
        text = data.decode("utf-8-sig")
    except OSError as error:
        raise InputFileError([f"{path}: cannot be read ({error.strerror})"]) from None
    except UnicodeDecodeError as error:
        raise InputFileError([f"{path}: byte {error.start} is no UTF-8; allowed is a UTF-8 text file"]) from None
    if "\0" in text:
        raise InputFileError([f"{path}: holds zero bytes; allowed is a UTF-8 text file"])
    if data.startswith(b"\xef\xbb\xbf"):
        warnings.warn(f"{path}: begins with a byte-order mark, which is skipped", InputFileWarning, stacklevel=3)
    return text


def _holds_cells(line: str) -> bool:
    return bool(line.strip(" ,;\t")) and not line.lstrip().startswith("#")


def _short(cell: str) -> str:
    shown = repr(cell)
    return shown if len(shown) <= 40 else shown[:37] + "..."
