"""Trend as rows of a table and as the A4 page trend.html."""

import math
from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from pdpatrol.envs.scenario.base import weeks_between
from pdpatrol.missions.campaign.inspection import InspectionLog
from pdpatrol.missions.campaign.records import LinearTrend, TrackedDischarge, Trend
from pdpatrol.missions.report.figures import STYLE, draw_label, move_labels_apart
from pdpatrol.missions.report.page import embed, render
from pdpatrol.missions.yard_plan import draw_ground, draw_yard

COLOURS = {
    "grown": "#b3261e",
    "new": "#8e24aa",
    "constant": "#1f6fb2",
    "declined": "#1e8449",
    "gone": "#5f6b76",
    "not known": "#b9770e",
}
"""Colour of a discharge, by the change since earlier inspections."""

TEXTS = {"not known": "change not known"}
"""Text of a change, where it differs from its name."""

HEADINGS = ("No.", "Site", "Change", "Level\n(dBV)", "Its growth\n(dB/week)", "Rate\n(1/s)", "Its growth\n(%/week)")
"""Column headings for `summary_row`; a terminal shows them on two lines."""


def change_of(discharge: TrackedDischarge) -> str:
    """Return the key of `COLOURS` for a discharge: "gone" first, then the change of its level, then "new"."""
    changes = ("gone" if discharge.status == "gone" else discharge.verdict, discharge.status)
    return next((change for change in changes if change in COLOURS), "not known")


def describe_change(discharge: TrackedDischarge) -> str:
    """Describe the change of a discharge, such as `new on 2026-03-16; grown` or `constant within 0.6 dB a week`."""
    seen, words = discharge.observations, list[str]()
    found = [each.date for each in seen if each.presence == "found"]
    if discharge.status == "new":
        words.append(f"new on {found[0]}")
    elif discharge.status == "gone":
        absent = (each.date for each in seen if each.presence == "absent" and each.date >= found[-1])
        words.append(f"gone since {next(absent)}")
    slope = discharge.level.per_week if discharge.level else None
    if slope and discharge.verdict == "constant":
        words.append(f"constant within {max(-slope.lower, slope.upper):.1f} dB a week")
    elif slope and discharge.verdict == "not known":
        words.append(f"not known: growth between {slope.lower:+.1f} and {slope.upper:+.1f} dB a week is possible")
    elif discharge.verdict != "too few dates":
        words.append(discharge.verdict)
    elif not words:
        words.append("not known: too few dates")
    if seen[-1].presence == "not inspected":
        words.append(f"not inspected on {seen[-1].date}")
    return "; ".join(words)


def summary_row(discharge: TrackedDischarge) -> tuple[str, ...]:
    """Return the last known level and rate of a discharge and their changes, as one text per column of `HEADINGS`."""
    known = [each for each in discharge.observations if each.level_db is not None]
    level, rate = (known[-1].level_db, known[-1].rate_hz) if known else (None, None)
    return (
        str(discharge.number),
        discharge.site,
        describe_change(discharge),
        f"{level.value:.1f}" if level else "-",
        _slope_text(discharge.level, lambda slope: f"{slope:+.2f}"),
        f"{rate.value:.1f}" if rate else "-",
        _slope_text(discharge.rate, lambda slope: f"{100 * math.expm1(min(slope, 10.0)):+.0f}"),
    )


def _slope_text(line: LinearTrend | None, text_of: Callable[[float], str]) -> str:
    """Format a slope per week and its interval."""
    if line is None:
        return "-"
    value, lower, upper = (text_of(end) for _, end in line.per_week)
    return f"{value}\n({lower} to {upper})"


def trend_page(trend: Trend, inspections: Sequence[InspectionLog]) -> str:
    """Return the text of trend.html.

    Args:
        trend: Trend, as returned by `make_trend`.
        inspections: Inspections from which the trend was made.
    """
    counts = Counter(change_of(discharge) for discharge in trend.discharges)
    unknown = "change not known for"
    listed = ", ".join(f"{unknown} {n}" if change == "not known" else f"{n} {change}" for change, n in counts.items())
    return render(
        "campaign/trend.html",
        title="Partial discharge trend",
        subject=f"{trend.scenario}, {trend.dates[0]} to {trend.dates[-1]}",
        trend=trend,
        summary=f"Discharges in {len(trend.dates)} inspections: {listed or 'none found'}.",
        headings=HEADINGS,
        rows=[summary_row(discharge) for discharge in trend.discharges],
        colours=[COLOURS[change_of(discharge)] for discharge in trend.discharges],
        histories=[
            embed(draw_history(discharge), f"Level and rate of discharge {discharge.number} over weeks")
            for discharge in trend.discharges
        ],
        plan=embed(draw_plan(trend, inspections), "Plan of the yard with the change of each discharge"),
    )


def draw_plan(trend: Trend, inspections: Sequence[InspectionLog]) -> Figure:
    """Draw the positions of the discharges with their changes, on the yard if there is a map."""
    low_m = np.min([each.bounds_m[0] for each in inspections], axis=0)
    high_m = np.max([each.bounds_m[1] for each in inspections], axis=0)
    width_m, height_m = high_m - low_m
    with rc_context(STYLE):
        figure = Figure(figsize=(7.1, min(7.1 * height_m / width_m + 0.7, 6.2)), layout="constrained")
        axes = figure.subplots()
        draw_ground(axes, [low_m, high_m])
        if inspections[0].yard is not None:
            draw_yard(axes, inspections[0].yard)
        for discharge in trend.discharges:
            change, (x, y, _) = change_of(discharge), discharge.position_m
            axes.plot(x, y, "o", color=COLOURS[change], markersize=8, markeredgecolor="white", zorder=7)
            draw_label(axes, f"{discharge.number}: {TEXTS.get(change, change)}", (x, y), (0.0, 14.0), COLOURS[change])
        move_labels_apart(figure)
    return figure


def draw_history(discharge: TrackedDischarge) -> Figure:
    """Plot levels and rates against weeks with 99 % intervals, and the lines fitted to levels and log rates."""
    colour, seen = COLOURS[change_of(discharge)], discharge.observations
    weeks = np.array([weeks_between(seen[0].date, each.date) for each in seen])
    quantities = (
        ("level at 1 m (dBV)", [each.level_db for each in seen], discharge.level, np.asarray),
        ("rate (1/s)", [each.rate_hz for each in seen], discharge.rate, np.exp),
    )
    with rc_context(STYLE):
        figure = Figure(figsize=(7.1, 2.7), layout="constrained")
        panels = figure.subplots(1, 2, sharex=True)
    for axes, (label, intervals, line, scale) in zip(panels, quantities, strict=True):
        for week, each in zip(weeks, intervals, strict=True):
            if each:
                ends = [each.lower, each.value, each.upper]
                axes.plot([week] * 3, ends, "o-", color=colour, markevery=[1], markersize=5, linewidth=1.1)
        if line is not None:
            axes.plot(weeks, scale(line.at_start + line.per_week.value * weeks), color=colour, alpha=0.7)
        axes.set(xlabel=f"weeks since {seen[0].date}", ylabel=label)
        axes.grid(color="#e3e8ec", linewidth=0.5)
    levels, rates = panels
    middle, half_db = np.mean(levels.get_ylim()), max(0.5 * np.ptp(levels.get_ylim()), 5.0)
    levels.set_ylim(middle - half_db, middle + half_db)  # so that a constant level looks constant
    rates.set_ylim(bottom=0.0)
    return figure
