"""The exhibits for a terminal and as data."""

from __future__ import annotations

from dataclasses import asdict
from importlib.metadata import version
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Group
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from missions.reproduction.exhibits import Exhibit, Measured, Row, published
from missions.reproduction.protocol import N_RECORD, SAMPLE_RATE_HZ

SCHEMA = 1

LAST_COLUMN = {"ring_size": "gain and delay"}
"""What the last column holds where it is not the unrounded peak."""


def as_json(exhibits: tuple[Exhibit, ...], trials: int, seed: int) -> dict[str, Any]:
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
        "exhibits": {exhibit.name: _exhibit_json(exhibit) for exhibit in exhibits},
    }


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
    data["label"] = row.label.strip()
    data[last] = data.pop("unrounded")
    return data


def as_table(exhibit: Exhibit) -> Group:
    """One exhibit for a terminal: paper, ours by the paper's method, ours by the best method, and what was noticed."""
    columns = ["paper", "paper's method", "best method", LAST_COLUMN.get(exhibit.name, "unrounded")]
    if all(row.unrounded is None for row in exhibit.rows):
        columns.pop()
    table = Table(title=exhibit.title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1))
    table.add_column("")
    for name in columns:
        table.add_column(name, justify="right", overflow="fold")
    for row in exhibit.rows:
        measured = (row.paper_method, row.best_method, row.unrounded)
        cells = ["-" if row.paper is None else f"{row.paper:g}", *(_told(m, row.unit) for m in measured)]
        cells[-1] = cells[-1].partition(" ")[0]  # its interval is in the JSON file
        label = f"{row.label} (deg)" if row.unit == "deg" else row.label
        table.add_row(label, *cells[: len(columns)])
    notes = [Padding(Text(note, style="dim"), (0, 0, 0, 2)) for note in exhibit.notes]
    return Group(table, *notes)


def _told(measured: Measured | None, unit: str) -> str:
    """A number and, in brackets, its interval."""
    if measured is None:
        return "-"
    if measured.low is None or measured.high is None:
        return f"{measured.value:.2f}"
    digits = 1 if unit == "%" else 2
    return f"{measured.value:.2f} [dim]({measured.low:.{digits}f}, {measured.high:.{digits}f})[/dim]"
