"""Findings and candidates as tables for 80 columns; the numbers are the ids of log, report and recording."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from rich.box import SIMPLE_HEAD
from rich.table import Table

from pdpatrol.missions.report.records import FindingRecord, Report, ScoredSource
from pdpatrol.missions.report.words import kind_in_words, site_in_words

SITE_COLUMNS = 24
"""Of a terminal, for the name of a site: longer names go on in the next line, after a slash or an underscore."""


class Column(NamedTuple):
    """A column of a table.

    Attributes:
        heading: With its unit.
        cell: What it says of a finding.
        is_word: Whether that is words: those stand on the left.
    """

    heading: str
    cell: Callable[[FindingRecord], str]
    is_word: bool = False


def findings_table(report: Report) -> Table:
    """The findings, for a terminal."""
    seed = "" if report.seed is None else f", seed {report.seed}"
    more = [Column("time\n(s)", lambda finding: "-" if finding.confirmed_s is None else f"{finding.confirmed_s:.1f}")]
    if report.evaluation is not None:
        sources = report.evaluation.sources
        more.append(Column("error\n(m)", lambda finding: _error_of(finding, sources)))
    return _table_of(report.findings, f"Findings: {report.scenario}{seed}", more)


def candidates_table(report: Report) -> Table:
    """What was detected but not confirmed, for a terminal."""
    title = "Not confirmed: detected from too few sides, from too far away, or beyond the fence"
    return _table_of(report.candidates, title, [Column("state", lambda finding: finding.state, is_word=True)])


def _table_of(findings: Sequence[FindingRecord], title: str, more: Iterable[Column]) -> Table:
    """Id, position and longer half-axis of the 95 % ellipse of each, site and kind where they are known, and more."""
    columns = [
        Column("x, y, z\n(m)", lambda finding: "{:.2f}, {:.2f}, {:.2f}".format(*finding.position_m)),
        Column("95 %\n± (m)", lambda finding: f"{finding.ellipse95.semi_major_m:.2f}"),
    ]
    if any(finding.sites or finding.state == "outside" for finding in findings):
        columns.append(Column("site", lambda finding: _folded(site_in_words(finding)), is_word=True))
    if any(finding.discharge for finding in findings):
        columns.append(Column("kind", lambda finding: kind_in_words(finding).replace(" ", "\n", 1), is_word=True))
    columns += more
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("#", justify="right", no_wrap=True)
    for column in columns:
        table.add_column(column.heading, justify="left" if column.is_word else "right", no_wrap=True)
    for finding in findings:
        table.add_row(str(finding.id), *(column.cell(finding) for column in columns))
    return table


def _folded(words: str) -> str:
    """Piece, site and other site below each other, in lines that fit the column."""
    lines: list[str] = []
    for line in words.replace("/", "/\n", 1).replace(", ", "\n").splitlines():
        lines.append("")
        for part in line.replace("_", "_\0").split("\0"):
            if lines[-1] and len(lines[-1]) + len(part) > SITE_COLUMNS:
                lines.append("")
            lines[-1] += part
    return "\n".join(lines)


def _error_of(finding: FindingRecord, sources: Sequence[ScoredSource]) -> str:
    """Distance to the source that the finding is paired with."""
    errors_m = {source.match.finding_id: source.match.error_m for source in sources if source.match is not None}
    return f"{errors_m[finding.id]:.2f}" if finding.id in errors_m else "false"
