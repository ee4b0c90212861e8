"""reproduction.html: the verdict, and every exhibit with its numbers and picture, one file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import NamedTuple

from markupsafe import Markup

from pdpatrol.missions.report.page import render
from pdpatrol.missions.reproduction.exhibit import Exhibit, published
from pdpatrol.missions.reproduction.output.tables import Cell, cells, columns, label_of
from pdpatrol.missions.reproduction.prediction import COVERAGE, PAPER_TRIALS
from pdpatrol.missions.reproduction.verdict import verdict


class Section(NamedTuple):
    """What the page shows of one exhibit.

    Attributes:
        exhibit: Itself.
        columns: Headings of its numbers.
        rows: Of its table: what each is, and its numbers.
        picture: Its picture; None where another exhibit shows it.
    """

    exhibit: Exhibit
    columns: tuple[str, ...]
    rows: tuple[tuple[str, tuple[Cell, ...]], ...]
    picture: Markup | None


def reproduction_page(
    exhibits: Sequence[Exhibit], pictures: Mapping[str, Markup], method: Sequence[Markup], trials: int, seed: int
) -> str:
    """The page of all exhibits.

    Args:
        exhibits: In the order of the page.
        pictures: As elements of HTML, by the name of the exhibit that they stand under.
        method: Those that show the method itself.
        trials: Of each cell.
        seed: Of what was drawn.
    """
    return render(
        "reproduction.html",
        title="The Dir-MUSIC paper beside pdpatrol",
        subject=f"{trials} trials a cell, seed {seed}",
        source=published()["source"],
        version=version("pdpatrol"),
        verdict=verdict(exhibits),
        paper_trials=PAPER_TRIALS,
        coverage=COVERAGE,
        sections=[_section(exhibit, pictures.get(exhibit.name)) for exhibit in exhibits],
        method=method,
    )


def _section(exhibit: Exhibit, picture: Markup | None) -> Section:
    rows = tuple((label_of(row), cells(exhibit, row)) for row in exhibit.rows)
    return Section(exhibit, columns(exhibit), rows, picture)
