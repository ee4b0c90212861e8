"""Summaries as tables: for a terminal, as Markdown, and as CSV."""

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

from pdpatrol.missions.sweep.results.intervals import Interval
from pdpatrol.missions.sweep.results.paired import Difference
from pdpatrol.missions.sweep.results.summary import GroupSummary

HEADINGS = (
    "scenario or level",
    "policy",
    "set",
    "missions",
    "bearing RMSE (deg)",
    "found (%)",
    "median error (m)",
    "95 % below (m)",
    "in ellipse (%)",
    "right site (%)",
    "time to confirm (s)",
    "way over shortest",
    "OSPA (m)",
    "false",
    "contacts",
    "missed",
)


def cells(summary: GroupSummary) -> tuple[str, ...]:
    """A row of texts, as `HEADINGS`: values with their 95 % intervals."""
    settings = ", ".join(f"{key}={value}" for key, value in json.loads(summary.settings).items())
    unfinished = f" ({summary.n_unfinished} unfinished)" if summary.n_unfinished else ""
    return (
        summary.group,
        summary.policy,
        settings or "-",
        f"{summary.n_missions}{unfinished}",
        with_interval(summary.bearing_rmse_rad, 2, 180.0 / np.pi),
        with_interval(summary.found, 0, 100.0),
        with_interval(summary.error_m, 3),
        f"{summary.error95_m:.3f}" if np.isfinite(summary.error95_m) else "-",
        with_interval(summary.in_ellipse, 0, 100.0),
        with_interval(summary.right_site, 0, 100.0),
        with_interval(summary.confirmed_s, 0),
        with_interval(summary.detour, 1),
        with_interval(summary.ospa_m, 2),
        str(summary.false_findings),
        str(summary.contacts),
        str(summary.waypoints_missed),
    )


def with_interval(interval: Interval, digits: int, factor: float = 1.0) -> str:
    """A figure with its interval, both times `factor`; a dash where there is none."""
    value, low, high = (factor * end for end in interval)
    if np.isnan(value):
        return "-"
    if np.isnan(low):
        return f"{value:.{digits}f}"
    return f"{value:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


NARROW_HEADINGS = {"missions": "n", "time to confirm (s)": "time to\nconfirm (s)"}

WIDEST_NAME = 20
"""Letters of a name or setting that stay in one line."""


def _lines(name: str) -> list[str]:
    """A name or setting in lines that are narrow enough: the value of a long setting stands below its key."""
    parts = [name] if len(name) <= WIDEST_NAME else name.replace("=", "=\n").splitlines()
    return [line for part in parts for line in wrap(part, WIDEST_NAME)]


def terminal_table(summaries: Sequence[GroupSummary], title: str) -> Table:
    """For a terminal of eighty columns, what matters most, a section for each scenario; the other forms hold all.

    Settings that all rows share stand in the title.
    """
    settings = [json.loads(summary.settings) for summary in summaries]
    shared = (
        [item for item in settings[0].items() if all(item in each.items() for each in settings)] if settings else []
    )
    own = [[f"{key}={value}" for key, value in each.items() if (key, value) not in shared] for each in settings]
    title = ", ".join([title, *(f"{key}={value}" for key, value in shared)])
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=0, show_edge=False)
    shown = ("missions", "found (%)", "median error (m)", "time to confirm (s)", "false", "contacts")
    table.add_column("", no_wrap=True)
    for heading in shown:
        table.add_column(NARROW_HEADINGS.get(heading, heading.replace(" (", "\n(")), justify="right")
    before = ""
    for summary, settings_here in zip(summaries, own, strict=True):
        if summary.group != before:
            before = summary.group
            table.add_section()
            table.add_row(Text("\n".join(_lines(before)), style="bold"))
        named = dict(zip(HEADINGS, cells(summary), strict=True))
        figures = (named[heading].replace(" to ", "-") for heading in shown)
        table.add_row("\n".join(line for one in (summary.policy, *settings_here) for line in _lines(one)), *figures)
    return table


def differences_table(differences: Sequence[Difference], first: str, second: str) -> Table:
    """A paired comparison for a terminal: means, mean change with its interval, and both tests."""
    title = f"A: {first}, B: {second}; mission by mission, change from A to B with its 95 % interval"
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("")
    for heading in ("n", "A", "B", "change", "p", "B better : worse", "p by signs"):
        table.add_column(heading, justify="right")
    for each in differences:
        value, low, high = each.change
        change = f"{value:+.3g}" if np.isnan(low) or not value else f"{value:+.3g} ({low:+.3g} to {high:+.3g})"
        counts = f"{each.n_second_better} : {each.n_first_better}"
        means = f"{each.first:.3g}", f"{each.second:.3g}"
        tests = f"{each.permutation_p:.2g}", counts, f"{each.sign_p:.2g}"
        table.add_row(each.name, str(each.n_pairs), *means, change, *tests)
    return table


def markdown(summaries: Sequence[GroupSummary]) -> str:
    """As a Markdown table."""
    lines = [HEADINGS, ("---",) * len(HEADINGS), *(cells(summary) for summary in summaries)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def as_csv(summaries: Sequence[GroupSummary]) -> str:
    """As CSV in SI units: of each figure with an interval three columns."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    rows = [flat(summary) for summary in summaries]
    writer.writerow(rows[0].keys() if rows else GroupSummary._fields)
    writer.writerows(row.values() for row in rows)
    return file.getvalue()


def flat(summary: GroupSummary) -> dict[str, str | float]:
    """A summary without records in it."""
    found: dict[str, str | float] = {}
    for name, value in summary._asdict().items():
        if isinstance(value, Interval):
            found |= {name: value.value, f"{name}_low": value.low, f"{name}_high": value.high}
        else:
            found[name] = value
    return found
