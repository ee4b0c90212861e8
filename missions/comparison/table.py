"""The comparison as a table: for a terminal, and as Markdown for a document."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.table import Table

from missions.comparison.scores import Score
from missions.comparison.variants import Variant
from missions.sweep.results.intervals import Interval

HEADINGS = ("", "bearing RMSE (deg)", "found (%)", "median error (m)", "time to confirm (s)", "false")


def rows(variants: Sequence[Variant], scores: Mapping[str, Score]) -> list[tuple[str, ...]]:
    """A row of cells for each variant, as `HEADINGS`: values with their 95 % intervals."""
    return [
        (
            variant.name.replace("_", " "),
            _cell(score.bearing_rmse_deg, 2),
            _cell(Interval(*(100.0 * value for value in score.found)), 0),
            _cell(score.error_m, 3),
            _cell(score.confirmed_s, 0),
            str(score.false_findings),
        )
        for variant in variants
        for score in (scores[variant.key],)
    ]


def _cell(interval: Interval, digits: int) -> str:
    if np.isnan(interval.value):
        return "-"
    if np.isnan(interval.low):
        return f"{interval.value:.{digits}f}"
    return f"{interval.value:.{digits}f} ({interval.low:.{digits}f} to {interval.high:.{digits}f})"


def terminal_table(variants: Sequence[Variant], scores: Mapping[str, Score], title: str) -> Table:
    """For a terminal, a section for each group."""
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in HEADINGS:
        table.add_column(heading, justify="left" if heading == "" else "right")
    before = ""
    for variant, cells in zip(variants, rows(variants, scores), strict=True):
        if variant.group != before:
            before = variant.group
            table.add_section()
            table.add_row(f"[bold]{variant.group}[/bold]")
        table.add_row(*cells)
    return table


def markdown(variants: Sequence[Variant], scores: Mapping[str, Score]) -> str:
    """As a Markdown table, the groups in bold."""
    lines = [f"| {' | '.join(HEADINGS)} |", f"|{'---|' * len(HEADINGS)}"]
    before = ""
    for variant, cells in zip(variants, rows(variants, scores), strict=True):
        if variant.group != before:
            before = variant.group
            lines.append(f"| **{variant.group}** |{' |' * (len(HEADINGS) - 1)}")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join([*lines, ""])
