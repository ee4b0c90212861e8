"""Summaries and comparisons as tables: for a terminal, as Markdown, and as CSV."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from pdpatrol.missions.sweep.analysis import COVERAGE, LEVELS, LOW, Difference, Estimate, Summary

DIGITS = {
    "bearing RMSE (deg)": 2,
    "median error (m)": 3,
    "95 % below (m)": 3,
    "log score": 2,
    "site log score": 3,
    "path length over shortest": 1,
    "OSPA (m)": 2,
}
"""Decimals of the estimates in a table; 0 for all others."""

COVERED = ("2-D", "3-D", f"2-D{LOW}", f"3-D{LOW}")
"""Lines of the table of coverages."""


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
        texts[heading] = with_interval(value, DIGITS.get(heading, 0)) if isinstance(value, Estimate) else str(value)
    return texts


def _settings(summary: Summary) -> list[str]:
    return [f"{key} = {value}" for key, value in json.loads(str(summary["settings"])).items()]


def with_interval(estimate: Estimate, digits: int) -> str:
    """Format an estimate with its interval, if it has one."""
    value, low, high = (f"{end:.{digits}f}" for end in estimate)
    if np.isnan(estimate.value):
        return "-"
    return value if np.isnan(estimate.low) else f"{value} ({low} to {high})"


def terminal_table(summaries: Sequence[Summary], name: str) -> Table:
    """Make a table of the main figures for a terminal of 80 columns, with a section for each scenario or level."""
    title = f"{name}, 95 % intervals over yards, or over seeds of a single yard"
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=0, show_edge=False)
    table.add_column("", width=17, overflow="fold")
    columns = {
        "missions": "n", "found (%)": "found\n(%)", "within 0.3 m (%)": "within\n0.3 m (%)",
        "median error (m)": "median\nerror (m)", "time to confirm (s)": "time to\nconfirm\n(s)", "false": "false",
        "wrong live (%)": "wrong\nlive\n(%)", "false all-clear": "false\nclear",
    }  # fmt: skip
    for heading in columns.values():
        table.add_column(heading, justify="right")
    group: object = None
    for summary in summaries:
        if summary["group"] != group:
            group = summary["group"]
            table.add_section()
            table.add_row(Text(str(group), style="bold"))
        texts = cells(summary)
        short = [_broken(texts[column]) for column in columns]
        table.add_row(Text(_name(summary)), short[0].replace(" of", "\nof"), *short[1:])
    return table


def _name(summary: Summary) -> str:
    return "\n".join([str(summary["policy"]), *_settings(summary)])


def _broken(text: str) -> str:
    """Put the interval of an estimate on a separate line."""
    return text.replace(" to ", "-").replace(" (", "\n").removesuffix(")")


def coverage_table(summaries: Sequence[Summary]) -> Table:
    """Make a table of stated shares against observed coverages for a terminal of 80 columns."""
    title = "\nFound sources inside the stated ellipse (2-D) or ellipsoid (3-D), in percent"
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=0, show_edge=False)
    table.add_column("stated", width=20, overflow="fold")
    for share in LEVELS:
        table.add_column(f"{100 * share:g}", justify="right", min_width=8)
    for summary in summaries:
        texts = cells(summary)
        if texts[f"{COVERAGE} 2-D 95 %"] == "-":
            continue
        table.add_section()
        table.add_row(Text(f"{summary['group']}, {_name(summary)}", style="bold"))
        for line in coverage_lines(texts):
            table.add_row(line[0], *map(_broken, line[1:]))
    return table


def coverage_lines(texts: Mapping[str, str]) -> list[list[str]]:
    """Return the lines of a table of coverages from the cells of a summary: the name, then each stated share."""
    lines: list[list[str]] = []
    for name in COVERED:
        shares = [texts[f"{COVERAGE} {name[:3]} {100 * share:g} %{name[3:]}"] for share in LEVELS]
        lines.append([name, *shares])
    return lines


def differences_table(differences: Mapping[str, Sequence[Difference]], first: str, second: str) -> Table:
    """Make a table of a paired comparison by group: means, mean change with its interval, and p-value."""
    title = f"A: {first}, B: {second}; paired by scenario and seed, means over yards, change with its 95 % interval"
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("")
    for heading in ("n", "A", "B", "change", "p"):
        table.add_column(heading, justify="right")
    for group, measures in differences.items():
        table.add_section()
        table.add_row(Text(group, style="bold"))
        for each in measures:
            value, low, high = each.change
            change = f"{value:+.3g}" if np.isnan(low) or not value else f"{value:+.3g} ({low:+.3g} to {high:+.3g})"
            table.add_row(each.name, str(each.n), f"{each.first:.3g}", f"{each.second:.3g}", change, f"{each.p:.2g}")
    return table


def markdown(headings: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Make a Markdown table."""
    return "".join(f"| {' | '.join(line)} |\n" for line in (headings, ["---"] * len(headings), *lines))


def markdown_table(summaries: Sequence[Summary]) -> str:
    """Make a Markdown table of all figures but coverages, and one of these."""
    if not summaries:
        return ""
    texts = [cells(summary) for summary in summaries]
    headings = [heading for heading in texts[0] if not heading.startswith(COVERAGE)]
    figures = markdown(headings, [[each[heading] for heading in headings] for each in texts])
    names = headings[:3]
    covered = [[*(each[name] for name in names), *line] for each in texts for line in coverage_lines(each)]
    return f"{figures}\n{markdown([*names, COVERAGE, *(f'{100 * share:g} %' for share in LEVELS)], covered)}"


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
