"""Run the trials of all exhibits, and write reproduction.json, reproduction.html and the pictures."""

import json
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from threading import Event
from typing import Any

from threadpoolctl import threadpool_limits

from pdpatrol.missions.atomic_file import atomic_file, write_text
from pdpatrol.missions.report.page import embed, render
from pdpatrol.missions.reproduction import exhibits
from pdpatrol.missions.reproduction.comparison import Exhibit, Measured, Row, published, verdict
from pdpatrol.missions.reproduction.figures import draw_bars
from pdpatrol.missions.reproduction.simulation import N_RECORD, SAMPLE_RATE_HZ, Trials

PARTS = (
    exhibits.illustrations,
    exhibits.noise_tables,
    exhibits.manifold_errors,
    exhibits.element_counts,
    exhibits.field_test,
    exhibits.phase_method,
    exhibits.sample_rates,
)
"""Functions that make the exhibits, in the order in which they are shown."""

COLUMNS = ("paper", "paper's method", "best method", "unrounded")
"""Headings of the numbers of a row."""


def n_cells() -> int:
    """Return the number of cells of all exhibits; each has separate trials."""
    rows = [published()[name]["rows"] for name in ("table1", "table3", "fig5", "fig7", "phase_method", "sample_rate")]
    return sum(map(len, [*rows, published()["sample_rate"]["phase_rows"]]))


def reproduce(trials: int, seed: int, advance: Callable[[float], None]) -> list[Exhibit]:
    """Make every exhibit of the paper on all cores; the results depend on the seed alone.

    Args:
        trials: Trials of each cell, >= 1; the paper has 3600.
        seed: Seed of all trials.
        advance: Called with the share of a cell of which trials are finished; all shares add up to `n_cells()`.
    """
    cancelled, made = Event(), list[Exhibit]()
    settings = Trials(trials, seed, cancelled, advance)
    with threadpool_limits(limits=1), ThreadPoolExecutor(os.cpu_count()) as pool:
        try:
            for part in pool.map(lambda make: list(make(settings)), PARTS):
                made += part
        finally:
            cancelled.set()
    return made


def write_reproduction(made: Sequence[Exhibit], trials: int, seed: int, folder: Path) -> dict[str, Any]:
    """Write the pictures, reproduction.json and reproduction.html.

    Args:
        made: All exhibits.
        trials: Trials of each cell.
        seed: Seed of the trials.
        folder: Existing folder.

    Returns:
        Content of reproduction.json.
    """
    figures = dict[str, str]()
    for exhibit in made:
        figure = draw_bars(exhibit) if exhibit.draw is None else exhibit.draw()
        with atomic_file(folder / f"{exhibit.name}.png") as file:
            figure.savefig(file, format="png", dpi=140)
        figures[exhibit.name] = embed(figure, exhibit.title)
    summary, misses = verdict(made)
    data = {
        "schema": 3,
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
        "verdict": {"summary": summary, "misses": misses},
        "exhibits": {
            exhibit.name: {
                "title": exhibit.title,
                "rows": [asdict(row) for row in exhibit.rows],
                "notes": exhibit.notes,
            }
            for exhibit in made
        },
    }
    write_text(folder / "reproduction.json", json.dumps(data, indent=2) + "\n")
    page = render(
        "reproduction/reproduction.html",
        title="The Dir-MUSIC paper compared with pdpatrol",
        subject=f"{trials} trials per cell, seed {seed}",
        data=data,
        exhibits=made,
        columns=COLUMNS,
        cells=cells,
        figures=figures,
    )
    write_text(folder / "reproduction.html", page)
    return data


def cells(row: Row) -> tuple[str, ...]:
    """Return a label and a text for each of `COLUMNS`; a star marks a printed number outside its predicted interval."""
    printed = "-" if row.paper is None else f"{row.paper:g}{'*' * (row.is_met is False)}"
    numbers = [_number(each, row.unit) for each in (row.paper_method, row.best_method, row.unrounded)]
    return f"{row.label} (deg)" if row.unit == "deg" else row.label, printed, *numbers


def _number(measured: Measured | None, unit: str) -> str:
    if measured is None:
        return "-"
    digits = 1 if unit == "%" else 2
    interval = "" if not measured.interval else " ({:.{d}f}, {:.{d}f})".format(*measured.interval, d=digits)
    return f"{measured.value:.2f}{interval}"
