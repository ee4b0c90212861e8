"""Summaries and comparisons as tables: for a terminal, as Markdown, and as CSV."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from pdpatrol.missions.sweep.analysis import Difference, Estimate, Summary

DIGITS = {
    "bearing RMSE (deg)": 2,
    "found (%)": 0,
    "median error (m)": 3,
    "95 % below (m)": 3,
    "in ellipse (%)": 0,
    "right site (%)": 0,
    "time to confirm (s)": 0,
    "path length over shortest": 1,
    "OSPA (m)": 2,
}
"""Decimals of the estimates in a table."""


def cells(summary: Summary) -> dict[str, str]:
    """Format a summary as one text for each heading; a dash stands for an estimate without data."""
    n_missions: Any = summary["missions"]
    n_finished = n_missions - summary["unfinished"]
    texts = {
        "scenario or level": str(summary["group"]),
        "policy": str(summary["policy"]),
        "set": ", ".join(_settings(summary)) or "-",
        "missions": str(n_missions) if n_finished == n_missions else f"{n_finished} of {n_missions}",
    }
    for heading, value in list(summary.items())[5:]:
        texts[heading] = with_interval(value, DIGITS[heading]) if isinstance(value, Estimate) else str(value)
    return texts


def _settings(summary: Summary) -> list[str]:
    return [f"{key} = {value}" for key, value in json.loads(str(summary["settings"])).items()]


def with_interval(estimate: Estimate, digits: int) -> str:
    """Format an estimate with its interval, if it has one."""
    value, low, high = (f"{end:.{digits}f}" for end in estimate)
    if np.isnan(estimate.value):
        return "-"
    return value if np.isnan(estimate.low) else f"{value} ({low} to {high})"


def terminal_table(summaries: Sequence[Summary], title: str) -> Table:
    """Make a table of the main figures for a terminal of 80 columns, with a section for each scenario or level."""
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=0, show_edge=False)
    table.add_column("", width=20, overflow="fold")
    columns = ("missions", "found (%)", "median error (m)", "time to confirm (s)", "false", "contacts")
    for heading in ("n", "found\n(%)", "median error\n(m)", "time to\nconfirm (s)", "false", "contacts"):
        table.add_column(heading, justify="right")
    group: object = None
    for summary in summaries:
        if summary["group"] != group:
            group = summary["group"]
            table.add_section()
            table.add_row(Text(str(group), style="bold"))
        texts = cells(summary)
        name = "\n".join([texts["policy"], *_settings(summary)])
        short = [texts[column].replace(" to ", "-").replace(" (", "\n(") for column in columns]
        table.add_row(Text(name), short[0].replace(" of", "\nof"), *short[1:])
    return table


def differences_table(differences: Sequence[Difference], first: str, second: str) -> Table:
    """Make a table of a paired comparison: means, mean change with its interval, and p-value."""
    title = f"A: {first}, B: {second}; paired by scenario and seed, change from A to B with its 95 % interval"
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("")
    for heading in ("n", "A", "B", "change", "p"):
        table.add_column(heading, justify="right")
    for each in differences:
        value, low, high = each.change
        change = f"{value:+.3g}" if np.isnan(low) or not value else f"{value:+.3g} ({low:+.3g} to {high:+.3g})"
        table.add_row(each.name, str(each.n), f"{each.first:.3g}", f"{each.second:.3g}", change, f"{each.p:.2g}")
    return table


def markdown(headings: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Make a Markdown table."""
    return "".join(f"| {' | '.join(line)} |\n" for line in (headings, ["---"] * len(headings), *lines))


def markdown_table(summaries: Sequence[Summary]) -> str:
    """Make a Markdown table of all figures."""
    texts = [cells(summary) for summary in summaries]
    return markdown(list(texts[0]), [list(each.values()) for each in texts]) if texts else ""


def as_csv(summaries: Sequence[Summary]) -> str:
    """Make a CSV table with three columns for each estimate: value, lower and upper end of its interval."""
    rows: list[dict[str, object]] = []
    for summary in summaries:
        row: dict[str, object] = {}
        for name, value in summary.items():
            if isinstance(value, Estimate):
                row |= {name: value.value, f"{name} low": value.low, f"{name} high": value.high}
            else:
                row[name] = value
        rows.append(row)
    return pd.DataFrame(rows).to_csv(index=False, na_rep="nan", lineterminator="\n")
