"""Summaries and comparisons as tables: for a terminal, as Markdown, and as CSV."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from textwrap import wrap

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from pdpatrol.missions.sweep.analysis import DIGITS, Difference, Estimate, Summary

TERMINAL_HEADINGS = {
    "missions": "n",
    "found (%)": "found\n(%)",
    "median error (m)": "median error\n(m)",
    "time to confirm (s)": "time to\nconfirm (s)",
    "false": "false",
    "contacts": "contacts",
}
NAME_WIDTH = 20
"""Characters of a name or setting in a terminal table before it is broken."""


def cells(summary: Summary) -> dict[str, str]:
    """Format a summary as one text for each heading; a dash stands for an estimate without data."""
    settings = json.loads(str(summary["settings"]))
    texts = {
        "scenario or level": str(summary["group"]),
        "policy": str(summary["policy"]),
        "set": ", ".join(f"{key}={value}" for key, value in settings.items()) or "-",
        "missions": f"{summary['missions']}"
        + (f" ({summary['unfinished']} unfinished)" if summary["unfinished"] else ""),
    }
    for heading, value in list(summary.items())[len(texts) + 1 :]:
        texts[heading] = with_interval(value, DIGITS[heading]) if isinstance(value, Estimate) else str(value)
    return texts


def with_interval(estimate: Estimate, digits: int) -> str:
    """Format an estimate with its interval, if it has one."""
    value, low, high = (f"{end:.{digits}f}" for end in estimate)
    if np.isnan(estimate.value):
        return "-"
    return value if np.isnan(estimate.low) else f"{value} ({low} to {high})"


def _lines(name: str) -> list[str]:
    """Break a long name, or a long setting after its key."""
    parts = [name] if len(name) <= NAME_WIDTH else name.replace("=", "=\n").splitlines()
    return [line for part in parts for line in wrap(part, NAME_WIDTH)]


def terminal_table(summaries: Sequence[Summary], title: str) -> Table:
    """Make a table of the main figures for a terminal of 80 columns, with a section for each scenario or level.

    Settings that all rows share stand in the title.
    """
    settings = [
        {f"{key}={value}" for key, value in json.loads(str(summary["settings"])).items()} for summary in summaries
    ]
    shared = set.intersection(*settings) if settings else set()
    title = ", ".join([title, *sorted(shared)])
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=0, show_edge=False)
    table.add_column("", no_wrap=True)
    for heading in TERMINAL_HEADINGS.values():
        table.add_column(heading, justify="right")
    group: str | None = None
    for summary, own in zip(summaries, settings, strict=True):
        texts = cells(summary)
        if texts["scenario or level"] != group:
            group = texts["scenario or level"]
            table.add_section()
            table.add_row(Text("\n".join(_lines(group)), style="bold"))
        name = "\n".join(line for each in (texts["policy"], *sorted(own - shared)) for line in _lines(each))
        table.add_row(name, *(texts[heading].replace(" to ", "-") for heading in TERMINAL_HEADINGS))
    return table


def differences_table(differences: Sequence[Difference], first: str, second: str) -> Table:
    """Make a table of a paired comparison: means, mean change with its interval, and p-value."""
    title = f"A: {first}, B: {second}; paired by scenario and seed, change from A to B with its 95 % interval"
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("")
    for heading in ("n", "A", "B", "change", "p", "B better : worse"):
        table.add_column(heading, justify="right")
    for each in differences:
        value, low, high = each.change
        change = f"{value:+.3g}" if np.isnan(low) or not value else f"{value:+.3g} ({low:+.3g} to {high:+.3g})"
        counts = f"{each.n_second_better} : {each.n_first_better}"
        means = f"{each.first:.3g}", f"{each.second:.3g}"
        table.add_row(each.name, str(each.n), *means, change, f"{each.p:.2g}", counts)
    return table


def markdown(headings: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Make a Markdown table."""
    return "".join(f"| {' | '.join(line)} |\n" for line in (headings, ["---"] * len(headings), *lines))


def as_csv(summaries: Sequence[Summary]) -> str:
    """Make a CSV table with three columns for each estimate: value, lower and upper end of its interval."""
    rows = [
        {
            f"{name}{suffix}": part
            for name, value in summary.items()
            for suffix, part in zip(
                ("", " low", " high"), value if isinstance(value, Estimate) else (value,), strict=False
            )
        }
        for summary in summaries
    ]
    file = io.StringIO()
    writer = csv.DictWriter(file, rows[0] if rows else (), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return file.getvalue()
