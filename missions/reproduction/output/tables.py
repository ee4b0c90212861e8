"""The exhibits for a terminal and as data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import version
from typing import Any, NamedTuple

from rich.box import SIMPLE_HEAD
from rich.console import Group
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from pdpatrol.missions.reproduction.exhibit import Exhibit, Measured, Row, published
from pdpatrol.missions.reproduction.protocol import N_RECORD, SAMPLE_RATE_HZ
from pdpatrol.missions.reproduction.verdict import Verdict, verdict

SCHEMA = 2

LAST_COLUMN = {"ring_size": "gain and delay"}
"""What the last column holds where it is not the unrounded peak."""


def as_json(exhibits: Sequence[Exhibit], trials: int, seed: int) -> dict[str, Any]:
    """All numbers with their intervals, ready for `json`."""
    return {
        "schema": SCHEMA,
        "versions": {name: version(name) for name in ("pdpatrol", "numpy", "scipy")},
        "source": published()["source"],
        "trials": trials,
        "seed": seed,
        "protocol": {
            "record_samples": N_RECORD,
            "sample_rate_hz": SAMPLE_RATE_HZ,
            "directions_deg": "integers 1 to 360",
            "grid_deg": 1,
            "success": "|error on the grid| <= 2 degrees",
            "interval": "95 %: exact binomial for shares, chi-square for spreads; table 3: central 90 % of the draws",
        },
        "verdict": _verdict_json(verdict(exhibits)),
        "exhibits": {exhibit.name: _exhibit_json(exhibit) for exhibit in exhibits},
    }


def _verdict_json(found: Verdict) -> dict[str, Any]:
    misses = [{**miss._asdict(), "predicted": miss.predicted._asdict()} for miss in found.misses]
    return {"text": str(found), **found._asdict(), "misses": misses}


def _exhibit_json(exhibit: Exhibit) -> dict[str, Any]:
    return {
        "title": exhibit.title,
        "rows": [_row_json(exhibit, row) for row in exhibit.rows],
        "notes": list(exhibit.notes),
        **({"results": exhibit.results} if exhibit.results else {}),
    }


def _row_json(exhibit: Exhibit, row: Row) -> dict[str, Any]:
    last = LAST_COLUMN.get(exhibit.name, "best_method_unrounded").replace(" ", "_")
    data = asdict(row)
    data["predicted"] = None if row.predicted is None else row.predicted._asdict()
    data[last] = data.pop("unrounded")
    return data


class Cell(NamedTuple):
    """A number as it is shown.

    Attributes:
        value: The number; a dash where there is none.
        interval: Its interval in brackets; empty where it has none.
    """

    value: str
    interval: str = ""


def columns(exhibit: Exhibit) -> tuple[str, ...]:
    """Headings of the numbers of an exhibit."""
    names = ("paper", "paper's method", "best method", LAST_COLUMN.get(exhibit.name, "unrounded"))
    return names if any(row.unrounded is not None for row in exhibit.rows) else names[:-1]


def cells(exhibit: Exhibit, row: Row) -> tuple[Cell, ...]:
    """The numbers of a row, one for each of `columns`; the paper's has a star if it is not where it should be."""
    printed = "-" if row.paper is None else f"{row.paper:g}"
    star = "*" if row.is_compared and not row.is_met else ""
    paper, best = (_cell(measured, row.unit) for measured in (row.paper_method, row.best_method))
    last = _cell(row.unrounded, row.unit)._replace(interval="")  # for there is no room; it is in the JSON file
    return (Cell(printed + star), paper, best, last)[: len(columns(exhibit))]


def label_of(row: Row) -> str:
    """What a row is, with its unit."""
    return f"{row.label} (deg)" if row.unit == "deg" else row.label


def as_table(exhibit: Exhibit) -> Group:
    """One exhibit for a terminal: paper, ours by the paper's method, ours by the best method, and what was noticed."""
    table = Table(title=exhibit.title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1))
    table.add_column("")
    for name in columns(exhibit):
        table.add_column(name, justify="right", overflow="fold")
    for row in exhibit.rows:
        told = [
            Text.assemble(value, (f" {interval}" * bool(interval), "dim")) for value, interval in cells(exhibit, row)
        ]
        table.add_row(label_of(row), *told)
    notes = [Padding(Text(note, style="dim"), (0, 0, 0, 2)) for note in exhibit.notes]
    return Group(table, *notes)


def _cell(measured: Measured | None, unit: str) -> Cell:
    if measured is None:
        return Cell("-")
    value, digits = f"{measured.value:.2f}", 1 if unit == "%" else 2
    if measured.low is None or measured.high is None:
        return Cell(value)
    return Cell(value, f"({measured.low:.{digits}f}, {measured.high:.{digits}f})")
