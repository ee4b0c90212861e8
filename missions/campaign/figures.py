"""Pictures of a trend: levels and rates over dates, and the plan with what became of each discharge."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date
from typing import NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pdpatrol.envs.scenario.base import DAYS_PER_WEEK
from pdpatrol.missions.campaign.inspection import Inspection
from pdpatrol.missions.campaign.records import Discharge, Interval, Line, Observation, Trend
from pdpatrol.missions.report.figures import STYLE, draw_ground, draw_yard

SIZE_IN = (3.5, 2.7)
PLAN_WIDTH_IN, PLAN_MOST_IN = 7.1, 6.2
AROUND_M = 1.0
LEAST_SHOWN_DB = 10.0
"""Of an axis of levels: what is constant is to look so."""

EDGE = 0.06
"""Of the height of a picture: where the marks of what was not found stand, above the axis."""


class Mark(NamedTuple):
    """How a discharge is drawn: what became of it by colour and by shape."""

    colour: str
    shape: str
    size: float
    label: str


MARKS = {
    "grown": Mark("#b3261e", "^", 8.5, "grown"),
    "new": Mark("#8e24aa", "*", 13.0, "new"),
    "constant": Mark("#1f6fb2", "o", 8.0, "constant"),
    "declined": Mark("#1e8449", "v", 8.5, "declined"),
    "gone": Mark("#5f6b76", "X", 9.0, "gone"),
    "open": Mark("#b9770e", "D", 7.5, "not clear yet"),
}


def mark_of(discharge: Discharge) -> Mark:
    """What became of it: gone before all else, then how its level changes, then new."""
    if discharge.status == "gone":
        return MARKS["gone"]
    if discharge.verdict in MARKS:
        return MARKS[discharge.verdict]
    return MARKS["new" if discharge.status == "new" else "open"]


def draw_plan(trend: Trend, inspections: Sequence[Inspection]) -> Figure:
    """Where the discharges are, and what became of each; without a map, the bounds of the poses alone."""
    bounds_m = np.array([each.log.meta["bounds_m"] for each in inspections])
    low_m, high_m = bounds_m[:, 0].min(axis=0) - AROUND_M, bounds_m[:, 1].max(axis=0) + AROUND_M
    across_m, up_m = high_m - low_m
    height_in = min(PLAN_WIDTH_IN * up_m / across_m + 0.7, PLAN_MOST_IN)
    with rc_context(STYLE):
        figure = Figure(figsize=(PLAN_WIDTH_IN, height_in), layout="constrained")
        axes = figure.subplots()
        draw_ground(axes, low_m, high_m)
        yard = inspections[0].yard
        if yard is not None:
            draw_yard(axes, yard)
        for discharge in trend.discharges:
            _draw_place(axes, discharge)
        shown = {mark_of(discharge) for discharge in trend.discharges}
        handles = [_handle(mark) for mark in MARKS.values() if mark in shown]
        if handles:
            figure.legend(handles=handles, loc="outside lower center", ncols=6, fontsize=7.5, frameon=False)
    return figure


def _handle(mark: Mark) -> Line2D:
    return Line2D(
        [],
        [],
        marker=mark.shape,
        linestyle="",
        color=mark.colour,
        markersize=0.8 * mark.size,
        markeredgecolor="white",
        label=mark.label,
    )


def _draw_place(axes: Axes, discharge: Discharge) -> None:
    mark, (x, y, _) = mark_of(discharge), discharge.position_m
    axes.plot(x, y, mark.shape, color=mark.colour, markersize=mark.size, markeredgecolor="white", zorder=7)
    axes.annotate(
        str(discharge.number),
        (x, y),
        (11, 9),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=8.5,
        fontweight="bold",
        color="white",
        bbox={"boxstyle": "round,pad=0.25", "facecolor": mark.colour, "edgecolor": "white"},
        zorder=8,
    )


def draw_levels(discharge: Discharge) -> Figure:
    """Level against date, with 99 % intervals and the line through them."""
    return _draw(discharge, "level at 1 m (dBV)", [each.level_db for each in discharge.observations], discharge.level)


def draw_rates(discharge: Discharge) -> Figure:
    """Rate against date, with 99 % intervals and the line through its logarithms."""
    rates = [each.rate_hz for each in discharge.observations]
    return _draw(discharge, "rate (1/s)", rates, discharge.rate, is_ratio=True)


def _draw(
    discharge: Discharge, label: str, values: Sequence[Interval | None], line: Line | None, *, is_ratio: bool = False
) -> Figure:
    """What each inspection tells of it and the line, which runs through logarithms where it is a ratio that counts."""
    colour, observations = mark_of(discharge).colour, discharge.observations
    days = [_day(each) for each in observations]
    with rc_context(STYLE):
        figure = Figure(figsize=SIZE_IN, layout="constrained")
        axes = figure.subplots()
        axes.grid(color="#e3e8ec", linewidth=0.5)
        for each, day, value in zip(observations, days, values, strict=True):
            if value is None:
                _draw_absence(axes, day, each)
            else:
                _draw_value(axes, day, value, colour, is_confirmed=each.is_confirmed)
        if line is not None:
            weeks = np.linspace(0.0, observations[-1].week, 50)
            fitted = line.at_start + line.per_week.value * weeks
            along = days[0] + DAYS_PER_WEEK * weeks
            axes.plot(along, np.exp(fitted) if is_ratio else fitted, color=colour, linewidth=1.4, alpha=0.7)
        if is_ratio:
            axes.set_ylim(bottom=0.0)
        else:
            low, high = axes.get_ylim()
            wider = 0.5 * max(LEAST_SHOWN_DB - (high - low), 0.0)
            axes.set_ylim(low - wider, high + wider)
        margin = max(2.0, 0.06 * (days[-1] - days[0]))
        axes.set_xlim(days[0] - margin, days[-1] + margin)
        locator = AutoDateLocator(minticks=3, maxticks=7)
        axes.xaxis.set_major_locator(locator)
        axes.xaxis.set_major_formatter(ConciseDateFormatter(locator))
        axes.set_ylabel(label)
    return figure


def _day(observation: Observation) -> float:
    """Days as matplotlib counts them."""
    return float(date2num(date.fromisoformat(observation.date)))


def _draw_value(axes: Axes, day: float, value: Interval, colour: str, *, is_confirmed: bool) -> None:
    ends = np.array([[value.value - value.lower], [value.upper - value.value]])
    face = colour if is_confirmed else "white"
    axes.errorbar(
        [day], [value.value], ends, fmt="o", color=colour, markerfacecolor=face, markersize=5, capsize=3, lw=1.1
    )


def _draw_absence(axes: Axes, day: float, observation: Observation) -> None:
    """A mark above the axis: a cross for what was not there, a question mark for what was not inspected."""
    text = {"absent": "✕", "not inspected": "?", "found": "…"}[observation.presence]
    axes.annotate(
        text,
        (day, EDGE),
        xycoords=("data", "axes fraction"),
        ha="center",
        va="center",
        fontsize=10,
        color="#1c2833" if observation.presence == "absent" else "#7b8a97",
    )
