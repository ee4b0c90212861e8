"""Output of the exhibits: tables for a terminal, reproduction.json, reproduction.html and the figures."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from markupsafe import Markup
from rich.box import SIMPLE_HEAD
from rich.console import Group
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from pdpatrol.missions.atomic_file import atomic_file, write_text
from pdpatrol.missions.report.page import embed, render
from pdpatrol.missions.reproduction.exhibit import (
    COVERAGE,
    PAPER_TRIALS,
    Exhibit,
    Measured,
    Row,
    published,
    verdict,
)
from pdpatrol.missions.reproduction.figures import figures
from pdpatrol.missions.reproduction.simulation import N_RECORD, SAMPLE_RATE_HZ


def write_reproduction(
    exhibits: Sequence[Exhibit], trials: int, seed: int, folder: Path, progress: Callable[[float], None]
) -> dict[str, Any]:
    """Write the figures, reproduction.json and reproduction.html.

    Args:
        exhibits: All exhibits.
        trials: Trials of each cell.
        seed: Seed of the trials.
        folder: Existing folder.
        progress: Called with the share of the work that was done since the last call.

    Returns:
        Content of reproduction.json.
    """
    by_name = {exhibit.name: exhibit for exhibit in exhibits}
    elements, method = dict[str, Markup](), list[Markup]()
    every = figures(seed)
    for name, (shown, draw) in every.items():
        figure = draw(*(by_name[key] for key in shown))
        with atomic_file(folder / f"{name}.png") as file:
            figure.savefig(file, format="png")
        element = embed(figure, "; ".join(by_name[key].title for key in shown) or name)
        if shown:
            elements[shown[0]] = element
        else:
            method.append(element)
        progress(1.0 / len(every))
    data = as_json(exhibits, trials, seed)
    write_text(folder / "reproduction.json", json.dumps(data, indent=2) + "\n")
    page = render(
        "reproduction/reproduction.html",
        title="The Dir-MUSIC paper compared with pdpatrol",
        subject=f"{trials} trials per cell, seed {seed}",
        source=published()["source"],
        version=version("pdpatrol"),
        verdict=verdict(exhibits),
        paper_trials=PAPER_TRIALS,
        coverage=COVERAGE,
        exhibits=exhibits,
        columns=columns,
        cells=cells,
        figures=elements,
        method=method,
    )
    write_text(folder / "reproduction.html", page)
    return data


def as_json(exhibits: Sequence[Exhibit], trials: int, seed: int) -> dict[str, Any]:
    """Return all numbers with their intervals, ready for `json`."""
    result = verdict(exhibits)
    misses = [{**miss._asdict(), "predicted": miss.predicted._asdict()} for miss in result.misses]
    return {
        "schema": 2,
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
        "verdict": {"text": str(result), **result._asdict(), "misses": misses},
        "exhibits": {
            exhibit.name: {
                "title": exhibit.title,
                "rows": [_row_json(row) for row in exhibit.rows],
                "notes": list(exhibit.notes),
                **({"results": exhibit.results} if exhibit.results else {}),
            }
            for exhibit in exhibits
        },
    }


def _row_json(row: Row) -> dict[str, Any]:
    records = {
        "paper_method": row.paper_method,
        "best_method": row.best_method,
        "predicted": row.predicted,
        "best_method_unrounded": row.unrounded,
    }
    numbers = {name: None if record is None else record._asdict() for name, record in records.items()}
    return {"label": row.label, "paper": row.paper, "unit": row.unit, **numbers}


def columns(exhibit: Exhibit) -> tuple[str, ...]:
    """Return the headings of the numbers of an exhibit."""
    names = ("paper", "paper's method", "best method", "unrounded")
    return names if any(row.unrounded is not None for row in exhibit.rows) else names[:-1]


def cells(exhibit: Exhibit, row: Row) -> list[tuple[str, str]]:
    """Return number and interval as text for each of `columns`; a star marks a printed number that was not met.

    The last column has no interval, for want of space; it is in the JSON file.
    """
    printed = "-" if row.paper is None else f"{row.paper:g}"
    if row.is_met is False:
        printed += "*"
    last, _ = _cell(row.unrounded, row.unit)
    numbers = [(printed, ""), _cell(row.paper_method, row.unit), _cell(row.best_method, row.unit), (last, "")]
    return numbers[: len(columns(exhibit))]


def _cell(measured: Measured | None, unit: str) -> tuple[str, str]:
    if measured is None:
        return "-", ""
    digits = 1 if unit == "%" else 2
    interval = "" if measured.low is None else f"({measured.low:.{digits}f}, {measured.high:.{digits}f})"
    return f"{measured.value:.2f}", interval


def as_table(exhibit: Exhibit) -> Group:
    """Return an exhibit with its notes for a terminal."""
    table = Table(title=exhibit.title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1))
    table.add_column("")
    for name in columns(exhibit):
        table.add_column(name, justify="right", overflow="fold")
    for row in exhibit.rows:
        numbers = [
            Text.assemble(value, (f" {interval}" * bool(interval), "dim")) for value, interval in cells(exhibit, row)
        ]
        table.add_row(f"{row.label} (deg)" if row.unit == "deg" else row.label, *numbers)
    notes = [Padding(Text(note, style="dim"), (0, 0, 0, 2)) for note in exhibit.notes]
    return Group(table, *notes)
