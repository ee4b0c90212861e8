"""A trend as a table for a terminal of 80 columns."""

from __future__ import annotations

from rich.box import SIMPLE_HEAD
from rich.table import Table

from pdpatrol.missions.campaign.records import Discharge, Trend
from pdpatrol.missions.campaign.words import last_known, rate_slope_in_words, slope_in_words, what_became


def trend_table(trend: Trend) -> Table:
    """A row for each discharge: what became of it, its last level and rate, and how they change."""
    first, last, n = trend.dates[0], trend.dates[-1], len(trend.dates)
    table = Table(
        title=f"{trend.scenario}: {n} inspections, {first} to {last}, 99 % intervals",
        title_justify="left",
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    table.add_column("#")
    table.add_column("site", overflow="fold")
    table.add_column("since then", overflow="fold")
    for heading in ("level\n(dBV)", "a week\n(dB)", "rate\n(1/s)", "a week\n(%)"):
        table.add_column(heading, justify="right", no_wrap=True)
    for discharge in trend.discharges:
        table.add_row(*_row(discharge))
    return table


def _row(discharge: Discharge) -> list[str]:
    known = last_known(discharge)
    level, rate = (known.level_db, known.rate_hz) if known else (None, None)
    return [
        str(discharge.number),
        _place(discharge),
        what_became(discharge).replace("; ", "\n"),
        f"{level.value:.1f}" if level else "-",
        _stacked(slope_in_words(discharge.level)),
        f"{rate.value:.1f}" if rate else "-",
        _stacked(rate_slope_in_words(discharge.rate)),
    ]


def _place(discharge: Discharge) -> str:
    """Site, or without a map the position."""
    if discharge.site:
        return discharge.site.replace(" %", "\N{NO-BREAK SPACE}%").replace("/", "/\n", 1).replace(", ", "\n")
    return "{:.1f}, {:.1f}, {:.1f} m".format(*discharge.position_m)


def _stacked(words: tuple[str, str]) -> str:
    """A value, and each end of its interval below it."""
    value, interval = words
    return "\n".join([value, *interval.replace(" to ", " to\n").split("\n")]) if interval else value
