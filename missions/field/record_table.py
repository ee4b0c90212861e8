"""Records of a survey as they arrive: checked, put in order, and stored as a table that `locate` reads."""

import json
from collections import deque
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dirmusic import InputFileError
from dirmusic.input_file import delimiter_of
from pdpatrol.missions.field.field_data import check_columns, survey_rows
from pdpatrol.missions.field.input_table import InputTable
from pdpatrol.missions.field.line_sources import Report

Record = tuple[float, ...]
"""Numbers of one record, in the order of the columns of the table."""

GAP_S, GAP_FACTOR, N_INTERVALS, FEW_INTERVALS, FEW_GAP_S = 5.0, 10.0, 100, 10, 60.0
"""Shortest gap that is reported, absolute and as a multiple of the median of the latest intervals, and shortest gap
before there are enough intervals (assumed)."""

MOST_LINES = 5
"""Number of faulty lines of a piece that are reported one by one."""


class RecordTable:
    """CSV table to which records are appended in the order of their times.

    A line is a row of a CSV table, whose header is a line with a cell `time_s`, or a JSON object with the same names.
    Each line that cannot be used is reported and left out: a repeated or late record, a torn line, an invalid number.
    A header that changes is reported; as long as it has the columns of the table, its rows are used.

    Args:
        path: The table; if it exists, it is continued, without a torn last line.
        source: Name of the source of the records.
        noise_v: As in `read_field_data`.
        report: Called with a line on anything that is left out or unusual.

    Attributes:
        columns: Names of the columns; empty before the first record.

    Raises:
        InputFileError: If the existing table, or the first header, cannot be used.
    """

    def __init__(self, path: Path, source: Path, noise_v: float | None, report: Report) -> None:
        self.columns: tuple[str, ...] = ()
        self._path, self._source, self._noise_v, self._report = path, source, noise_v, report
        self._layout: list[int] = []
        self._n_cells, self._delimiter, self._keys = 0, ",", set[str]()
        self._last_s, self._at_last = -np.inf, set[Record]()
        self._ahead: Record | None = None
        self._intervals: deque[float] = deque(maxlen=N_INTERVALS)
        self._n_repeated, self._repeated_s = 0, (np.inf, -np.inf)
        self._faults: list[str] = []

    def stored(self) -> Iterator[InputTable]:
        """Return the records of an existing table, in pieces; call it once, before `add`."""
        if not self._path.exists():
            return
        with self._path.open("r+b") as file:
            n_bytes = file.seek(0, 2)
            while n_bytes and (file.seek(n_bytes - 1), file.read(1))[1] != b"\n":
                n_bytes -= 1
            file.truncate(n_bytes)
        with self._path.open(encoding="utf-8") as file:
            while lines := list(islice(file, 5000)):
                records = [record for line in lines if (record := self._parse(line.strip())) is not None]
                for record in records:
                    self._advance(record)
                yield self._table(records)

    def add(self, lines: list[str], *, is_end: bool = False) -> InputTable:
        """Store the records of the next lines, and return those that are new; with `is_end`, also those held back."""
        parsed = [record for line in lines if (record := self._parse(line.strip())) is not None]
        records = self._in_order(self._valid(parsed))
        if is_end and self._ahead is not None:
            records.append(self._take_ahead(self._ahead))
        if self._n_repeated and (records or is_end or not lines):
            first_s, last_s = self._repeated_s
            self._report(f"{self._n_repeated} records from {first_s:g} to {last_s:g} s are repeated or late: left out")
            self._n_repeated, self._repeated_s = 0, (np.inf, -np.inf)
        for fault in self._faults[:MOST_LINES]:
            self._report(fault)
        if (n_more := len(self._faults) - MOST_LINES) > 0:
            self._report(f"{n_more} more lines cannot be used: left out")
        self._faults = []
        if records:
            with self._path.open("a", encoding="utf-8") as file:
                file.writelines(",".join(map(repr, record)) + "\n" for record in records)
        return self._table(records)

    def _parse(self, line: str) -> Record | None:
        """Return the record on a line; None for a header, an empty line, or a line that cannot be used."""
        if not line.strip(" ,;\t") or line.startswith("#") or line.strip('" ').lower().startswith("sep="):
            return None
        try:
            if line.startswith("{"):
                return self._parse_object(line)
            cells = [cell.strip(' "') for cell in line.split(delimiter_of(line))]
            if "time_s" in cells:
                self._take_header(cells, delimiter_of(line))
                return None
            cells = [cell.strip() for cell in line.split(self._delimiter)]
            if not self._layout or len(cells) != self._n_cells:
                raise ValueError(
                    f"must have {self._n_cells} cells" if self._layout else "has no usable header before it"
                )
            if self._delimiter != ",":
                cells = [cell.replace(",", ".") for cell in cells]
            return tuple([float(cells[at]) for at in self._layout])
        except InputFileError:
            raise
        except (ValueError, KeyError, ArithmeticError, RecursionError) as error:
            self._faults.append(f"line left out, {' '.join(str(error).split()):.80}: {line:.60}")
            return None

    def _parse_object(self, line: str) -> Record:
        values = json.loads(line)
        if values.keys() != self._keys:
            self._keys = values.keys()
            self._take_header(list(values), ",")
        if not self._layout:
            raise ValueError("has not the keys of the first record")
        record = tuple(values[name] for name in self.columns)
        if any(isinstance(value, bool) or not isinstance(value, int | float) for value in record):
            raise ValueError("must have numbers only")
        return tuple(map(float, record))

    def _take_header(self, names: list[str], delimiter: str) -> None:
        """Start the table with the first header; later ones say in which cells its columns are from now on."""
        n_cells = len(names)
        while names and not names[-1]:  # separators at the end of all lines
            names.pop()
        if not self.columns:
            self._start(names)
        missing = [name for name in self.columns if name not in names]
        layout = [] if missing or len(set(names)) < len(names) else [names.index(name) for name in self.columns]
        others = [name for name in names if name not in self.columns]
        if (layout != self._layout and self._layout) or others or missing:
            text = f"without {', '.join(missing)}: its records are left out" if missing else "its records are used"
            ignored = f", without {', '.join(others)}" if others and not missing else ""
            self._report(f"header changed to {', '.join(names):.120}: {text}{ignored}")
        self._layout, self._n_cells, self._delimiter = layout, n_cells, delimiter

    def _start(self, names: list[str]) -> None:
        """Check the names of the columns and write them, unless the table exists."""
        if "" in names or len(set(names)) < len(names):
            raise InputFileError([f"{self._source}: must have columns whose names are unique and not empty"])
        if "waveform" in names:
            raise InputFileError([f"{self._source}: --follow takes strength_1, strength_2 ..., not waveform"])
        self.columns = tuple(names)
        empty = self._table([])
        check_columns(empty)
        survey_rows(empty, self._noise_v, 0.0)
        if not self._path.exists() or not self._path.stat().st_size:
            self._path.write_text(",".join(names) + "\n", encoding="utf-8")

    def _table(self, records: list[Record]) -> InputTable:
        """Return records as a table."""
        values: NDArray[np.float64] = np.array(records, dtype=np.float64).reshape(len(records), len(self.columns))
        columns = dict(zip(self.columns, values.T, strict=True))
        return InputTable(path=self._source, columns=columns, lines=np.arange(len(records)))

    def _valid(self, records: list[Record]) -> list[Record]:
        """Return the records whose numbers are in range."""
        if not records or self._fault_of(records) is None:
            return records
        valid: list[Record] = []
        for record in records:
            if fault := self._fault_of([record]):
                text = fault.partition(": line 0: ")[2]
                self._faults.append(f"record at {record[self.columns.index('time_s')]:g} s left out, {text}")
            else:
                valid.append(record)
        return valid

    def _fault_of(self, records: list[Record]) -> str | None:
        try:
            survey_rows(self._table(records), self._noise_v, 0.0)
        except InputFileError as error:
            return error.faults[0]
        return None

    def _in_order(self, records: list[Record]) -> list[Record]:
        """Return the records that are new. One far ahead is held back until the next one confirms its time."""
        at, new = self.columns.index("time_s") if self.columns else 0, list[Record]()
        for record in records:
            if self._ahead is not None and record[at] > self._last_s:
                if record[at] < self._ahead[at]:
                    self._report(f"record at {self._ahead[at]:g} s is far ahead of the next one: left out")
                else:
                    new.append(self._take_ahead(self._ahead))
                self._ahead = None
            if record[at] < self._last_s or record in self._at_last:
                first_s, last_s = self._repeated_s
                self._n_repeated += 1
                self._repeated_s = min(first_s, record[at]), max(last_s, record[at])
            elif self._is_after_gap(record[at]):
                self._ahead = record
            else:
                new.append(record)
                self._advance(record)
        return new

    def _is_after_gap(self, time_s: float) -> bool:
        """Test whether a time is much later than that of the latest record."""
        interval_s = time_s - self._last_s
        if interval_s <= GAP_S or not self._at_last:
            return False
        if len(self._intervals) < FEW_INTERVALS:
            return interval_s > FEW_GAP_S
        return interval_s > GAP_FACTOR * float(np.median(self._intervals))

    def _take_ahead(self, record: Record) -> Record:
        """Report the gap before the record that was held back, and return the record."""
        time_s = record[self.columns.index("time_s")]
        self._report(f"no records from {self._last_s:g} to {time_s:g} s")
        self._advance(record)
        self._ahead = None
        return record

    def _advance(self, record: Record) -> None:
        """Remember the time of the latest record, and all records of that time."""
        time_s = record[self.columns.index("time_s")]
        if time_s > self._last_s:
            if self._at_last:
                self._intervals.append(time_s - self._last_s)
            self._last_s, self._at_last = time_s, set()
        self._at_last.add(record)
