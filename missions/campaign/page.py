"""A trend as a table for the terminal and as trend.html, one page for A4."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from datetime import date
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.box import SIMPLE_HEAD
from rich.table import Table

from pdpatrol.envs.scenario.base import DAYS_PER_WEEK
from pdpatrol.missions.campaign.inspection import InspectionLog
from pdpatrol.missions.campaign.records import LinearTrend, TrackedDischarge, Trend, TrendInterval
from pdpatrol.missions.report.figures import STYLE, draw_ground, draw_label, draw_yard
from pdpatrol.missions.report.page import embed, render

FloatArray = NDArray[np.float64]

MIN_AXIS_DB = 10.0
"""Least range of an axis of levels, so that a constant level looks constant."""


class Mark(NamedTuple):
    """Colour, marker, size and legend of a discharge in a figure."""

    colour: str
    marker: str
    size: float
    label: str


MARKS = {
    "grown": Mark("#b3261e", "^", 8.5, "grown"),
    "new": Mark("#8e24aa", "*", 13.0, "new"),
    "constant": Mark("#1f6fb2", "o", 8.0, "constant"),
    "declined": Mark("#1e8449", "v", 8.5, "declined"),
    "gone": Mark("#5f6b76", "X", 9.0, "gone"),
    "unclear": Mark("#b9770e", "D", 7.5, "not clear yet"),
}


def mark_of(discharge: TrackedDischarge) -> Mark:
    """Return the mark of a discharge: gone before its change of level, and that before new."""
    if discharge.status == "gone":
        return MARKS["gone"]
    return MARKS.get(discharge.verdict) or MARKS["new" if discharge.status == "new" else "unclear"]


def describe_change(discharge: TrackedDischarge) -> str:
    """Describe a discharge in words such as `new on 2026-03-16; grown` or `constant within 0.6 dB a week`."""
    found = [each.date for each in discharge.observations if each.presence == "found"]
    words: list[str] = []
    if discharge.status == "new":
        words.append(f"new on {found[0]}")
    elif discharge.status == "gone":
        absent = [each.date for each in discharge.observations if each.presence == "absent" and each.date >= found[-1]]
        words.append(f"gone since {absent[0]}")
    if discharge.verdict == "constant" and discharge.level is not None:
        slope = discharge.level.per_week
        words.append(f"constant within {max(-slope.lower, slope.upper):.1f} dB a week")
    elif discharge.verdict != "too few dates" or discharge.status == "standing":
        words.append("level not clear" if discharge.verdict == "not clear" else discharge.verdict)
    last = discharge.observations[-1]
    if last.presence == "not inspected":
        words.append(f"not inspected on {last.date}")
    return "; ".join(words)


def slope_texts(line: LinearTrend | None, *, is_log: bool = False) -> tuple[str, str]:
    """Format a slope per week and its interval: dB for levels, per cent for logarithms; a dash without a line."""
    if line is None:
        return "-", ""
    value, lower, upper = (_per_cent(end) if is_log else f"{end:+.2f}" for _, end in line.per_week)
    return value, f"{lower} to {upper}"


def _per_cent(log_ratio: float) -> str:
    change = round(100 * math.expm1(min(log_ratio, 10.0)))
    return f"{change:+d}" if change else "0"


def trend_table(trend: Trend) -> Table:
    """Make a table for a terminal of 80 columns, with a row for each discharge."""
    first, last, n = trend.dates[0], trend.dates[-1], len(trend.dates)
    title = f"{trend.scenario}: {n} inspections, {first} to {last}, 99 % intervals"
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("#")
    table.add_column("site", overflow="fold")
    table.add_column("change", overflow="fold")
    for heading in ("level\n(dBV)", "a week\n(dB)", "rate\n(1/s)", "a week\n(%)"):
        table.add_column(heading, justify="right", no_wrap=True)
    for discharge in trend.discharges:
        known = discharge.last_known
        level, rate = (known.level_db, known.rate_hz) if known else (None, None)
        slopes = slope_texts(discharge.level), slope_texts(discharge.rate, is_log=True)
        level_slope, rate_slope = ("\n".join(slope).strip().replace(" to ", " to\n") for slope in slopes)
        site = discharge.site.replace(" %", "\N{NO-BREAK SPACE}%").replace("/", "/\n", 1).replace(", ", "\n")
        table.add_row(
            str(discharge.number),
            site or "{:.1f}, {:.1f}, {:.1f} m".format(*discharge.position_m),
            describe_change(discharge).replace("; ", "\n"),
            f"{level.value:.1f}" if level else "-",
            level_slope,
            f"{rate.value:.1f}" if rate else "-",
            rate_slope,
        )
    return table


def trend_page(trend: Trend, inspections: Sequence[InspectionLog]) -> str:
    """Return the text of trend.html.

    Args:
        trend: Trend as `make_trend` returns it.
        inspections: Inspections from which it was made.
    """
    n = len(trend.discharges)
    summary = f"No discharge was found in {len(trend.dates)} inspections."
    if n:
        counts = Counter(mark_of(discharge).label for discharge in trend.discharges)
        listed = ", ".join(f"{count} {label}" for label, count in counts.items())
        summary = f"{n} discharge{'s' if n > 1 else ''} in {len(trend.dates)} inspections: {listed}."
    return render(
        "campaign/trend.html",
        title="Partial discharge trend",
        subject=f"{trend.scenario}, {trend.dates[0]} to {trend.dates[-1]}",
        trend=trend,
        summary=summary,
        sections=[_section(discharge) for discharge in trend.discharges],
        plan=embed(draw_plan(trend, inspections), "Plan of the yard with the change of each discharge"),
    )


def _section(discharge: TrackedDischarge) -> dict[str, Any]:
    known = discharge.last_known
    title = f"of discharge {discharge.number} against date, with 99 % intervals"
    return {
        "discharge": discharge,
        "mark": mark_of(discharge),
        "change": describe_change(discharge),
        "known": known,
        "level_slope": slope_texts(discharge.level),
        "rate_slope": slope_texts(discharge.rate, is_log=True),
        "levels": embed(draw_levels(discharge), f"Level {title}") if known else None,
        "rates": embed(draw_rates(discharge), f"Rate {title}") if known and known.rate_hz else None,
    }


def draw_plan(trend: Trend, inspections: Sequence[InspectionLog]) -> Figure:
    """Draw the positions of the discharges and the mark of each, on the yard if there is a map."""
    bounds_m = np.array([each.log.meta["bounds_m"] for each in inspections])
    low_m, high_m = bounds_m[:, 0].min(axis=0) - 1.0, bounds_m[:, 1].max(axis=0) + 1.0
    width_m, height_m = high_m - low_m
    with rc_context(STYLE):
        figure = Figure(figsize=(7.1, min(7.1 * height_m / width_m + 0.7, 6.2)), layout="constrained")
        axes = figure.subplots()
        draw_ground(axes, low_m, high_m)
        if inspections[0].yard is not None:
            draw_yard(axes, inspections[0].yard)
        for mark in MARKS.values():
            shown = [discharge for discharge in trend.discharges if mark_of(discharge) == mark]
            if shown:
                x, y, _ = zip(*(discharge.position_m for discharge in shown), strict=True)
                axes.plot(x, y, mark.marker, color=mark.colour, ms=mark.size, mec="white", label=mark.label, zorder=7)
            for discharge in shown:
                draw_label(axes, str(discharge.number), discharge.position_m[:2], (12.0, 10.0), mark.colour)
        if trend.discharges:
            figure.legend(loc="outside lower center", ncols=6, fontsize=7.5, frameon=False)
    return figure


def draw_levels(discharge: TrackedDischarge) -> Figure:
    """Draw levels over dates, with 99 % intervals and their line."""
    values = [each.level_db for each in discharge.observations]
    figure, axes = _draw(discharge, "level at 1 m (dBV)", values, discharge.level, lambda value: value)
    low, high = axes.get_ylim()
    margin = 0.5 * max(MIN_AXIS_DB - (high - low), 0.0)
    axes.set_ylim(low - margin, high + margin)
    return figure


def draw_rates(discharge: TrackedDischarge) -> Figure:
    """Draw rates over dates, with 99 % intervals and the line through their logarithms."""
    values = [each.rate_hz for each in discharge.observations]
    figure, axes = _draw(discharge, "rate (1/s)", values, discharge.rate, np.exp)
    axes.set_ylim(bottom=0.0)
    return figure


def _draw(
    discharge: TrackedDischarge,
    label: str,
    values: Sequence[TrendInterval | None],
    line: LinearTrend | None,
    scale: Callable[[FloatArray], FloatArray],
) -> tuple[Figure, Axes]:
    """Draw values over dates; candidates are hollow, and inspections without a value have a sign above the axis."""
    colour, observations = mark_of(discharge).colour, discharge.observations
    days = [float(date2num(date.fromisoformat(each.date))) for each in observations]
    with rc_context(STYLE):
        figure = Figure(figsize=(3.5, 2.7), layout="constrained")
        axes = figure.subplots()
    axes.grid(color="#e3e8ec", linewidth=0.5)
    for each, day, value in zip(observations, days, values, strict=True):
        if value is not None:
            ends = [[value.value - value.lower], [value.upper - value.value]]
            face = colour if each.is_confirmed else "white"
            axes.errorbar([day], [value.value], ends, fmt="o", color=colour, mfc=face, ms=5, capsize=3, lw=1.1)
        else:
            sign = {"absent": "✕", "not inspected": "?", "found": "…"}[each.presence]
            axes.text(day, 0.06, sign, transform=axes.get_xaxis_transform(), ha="center", va="center", color="#45525e")
    if line is not None:
        weeks = np.linspace(0.0, observations[-1].week, 50)
        fitted = scale(line.at_start + line.per_week.value * weeks)
        axes.plot(days[0] + DAYS_PER_WEEK * weeks, fitted, color=colour, linewidth=1.4, alpha=0.7)
    margin = max(2.0, 0.06 * (days[-1] - days[0]))
    axes.set_xlim(days[0] - margin, days[-1] + margin)
    locator = AutoDateLocator(minticks=3, maxticks=7)
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(ConciseDateFormatter(locator))
    axes.set_ylabel(label)
    return figure, axes
