"""Table for a terminal that takes the width there is, and breaks texts only within names and at spaces."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Literal

from rich.box import SIMPLE_HEAD
from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table

BREAK = re.compile(r"(?<=[/_])|(?<= )(?<![<>] )(?!%)(?![^(]*\))")
"""Places at which a line may end: within names, and at spaces, but not within percentages and intervals."""

Justify = Literal["left", "right"]


class FittedTable:
    """Table whose columns are as wide as their texts where there is room, and else as wide as their longest pieces.

    Args:
        title: Title.
        columns: Justification of each column by its heading.
    """

    def __init__(self, title: str, columns: dict[str, Justify]) -> None:
        self._title, self._columns = title, columns
        self._rows = list[Sequence[str]]()

    def add_row(self, *texts: str) -> None:
        """Add a row of one text for each column; line breaks are kept."""
        self._rows.append(texts)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the table."""
        texts = list(zip(self._columns, *self._rows, strict=True))
        least = [max(len(piece.rstrip()) for text in column for piece in _pieces(text)) for column in texts]
        most = [max(len(line) for text in column for line in text.split("\n")) for column in texts]
        widths, spare = list(least), options.max_width - sum(least) - 2 * len(least) - 1  # paddings and borders
        for k in sorted(range(len(widths)), key=lambda k: most[k] - least[k]):
            widths[k] += max(min(spare, most[k] - least[k]), 0)
            spare -= widths[k] - least[k]
        for _ in range(-spare):  # even the pieces do not fit
            widths[widths.index(max(widths))] -= 1
        table = Table(title=self._title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
        for (heading, justify), width in zip(self._columns.items(), widths, strict=True):
            table.add_column(heading, justify=justify, width=width, overflow="fold")
        for row in self._rows:
            table.add_row(*(_broken(text, width) for text, width in zip(row, widths, strict=True)))
        yield table


def _pieces(text: str) -> list[str]:
    """Return the pieces into which a text may be broken."""
    return [piece for line in text.split("\n") for piece in BREAK.split(line)]


def _broken(text: str, width: int) -> str:
    """Break a text into lines of a width."""
    lines = list[str]()
    for given in text.split("\n"):
        line = ""
        for piece in BREAK.split(given):
            if line and len(line) + len(piece.rstrip()) > width:
                lines.append(line.rstrip())
                line = ""
            line += piece
        lines.append(line.rstrip())
    return "\n".join(lines)
