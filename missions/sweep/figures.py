"""Figures of a dataset: error distribution, sources found over time, and both over a setting."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import cast

import numpy as np
import pyarrow as pa
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from pdpatrol.missions.atomic_file import atomic_file
from pdpatrol.missions.sweep.analysis import (
    Row,
    cluster_bootstrap,
    clusters_of,
    group_of,
    median,
    percentage_of,
    values_of,
)

COLOURS = [colormaps["tab20"](number) for number in (*range(0, 20, 2), *range(1, 20, 2))]
"""Ten dark colours, then ten pale ones; figures show no more lines than these."""

LOG_AXIS_RATIO = 4.0
"""Ratio of the largest to the smallest value of a setting from which its axis is logarithmic."""


def draw_figures(rows: pa.Table, folder: Path) -> list[Path]:
    """Draw a dataset into a folder.

    Args:
        rows: Rows of the dataset.
        folder: Existing folder.

    Returns:
        Paths of the figures: errors.png, found_over_time.png, and over_KEY.png for each setting with several values.
    """
    finished = [row for row in rows.to_pylist() if row["status"] == "finished" and row["n_sources"]]
    figures = {
        "errors": draw_errors(groups(finished)),
        "found_over_time": draw_found_over_time(groups(finished)),
    }
    settings = [json.loads(row["settings"]) for row in finished]
    for key in sorted({key for each in settings for key in each}):
        if len({json.dumps(each.get(key)) for each in settings}) > 1:
            figures[f"over_{key}"] = draw_over_setting(finished, key)
    paths = [folder / f"{name}.png" for name in figures]
    for path, figure in zip(paths, figures.values(), strict=True):
        with atomic_file(path) as file:
            figure.savefig(file, dpi=120, format="png")
    return paths


def groups(rows: Sequence[Row], without: str = "") -> dict[str, list[Row]]:
    """Group missions by policy and settings, except the setting `without`.

    If all missions are in one group, they are grouped by level or scenario instead, or have an empty label if `without`
    is given.
    """
    found: dict[str, list[Row]] = {}
    for row in rows:
        settings = {key: value for key, value in json.loads(row["settings"]).items() if key != without}
        label = ", ".join([row["policy"], *(f"{key}={label_of(value)}" for key, value in settings.items())])
        found.setdefault(label, []).append(row)
    if len(found) > 1:
        return found
    by_scenario: dict[str, list[Row]] = {}
    for row in rows:
        by_scenario.setdefault("" if without else group_of(row), []).append(row)
    return by_scenario


def label_of(value: object) -> str:
    """Format the value of a setting briefly: the kind of a table, the items of a list."""
    if isinstance(value, list):
        return ", ".join(label_of(item) for item in cast("list[object]", value)) or "none"
    if isinstance(value, dict):
        return str(cast("dict[str, object]", value).get("kind", json.dumps(value)))
    return f"{value:g}" if isinstance(value, float) else str(value)


def draw_errors(lines: Mapping[str, Sequence[Row]]) -> Figure:
    """Draw the share of all sources that were found with at most a given position error."""
    return _draw_steps(lines, "errors_m", "position error (m)", "sources found with at most that error")


def draw_found_over_time(lines: Mapping[str, Sequence[Row]]) -> Figure:
    """Draw the share of all sources that were confirmed by a given time."""
    end_s = max((row["sim_time_s"] for rows in lines.values() for row in rows), default=1.0)
    return _draw_steps(lines, "confirmed_s", "time since the start (s)", "sources confirmed by then", end_s)


def draw_over_setting(rows: Sequence[Row], key: str) -> Figure:
    """Draw share found, error and time over the values of a setting, with 95 % intervals.

    The intervals resample scenarios, or missions if there is only one scenario.
    """
    figure = Figure(figsize=(11.0, 3.6), layout="constrained")
    panels = dict(
        zip(("sources found", "median error (m)", "median time to confirm (s)"), figure.subplots(1, 3), strict=True)
    )
    by = "scenario" if len({row["scenario"] for row in rows}) > 1 else "key"
    chosen = [(json.loads(row["settings"])[key], row) for row in rows]
    is_numeric = all(isinstance(value, int | float) and not isinstance(value, bool) for value, _ in chosen)
    texts = dict.fromkeys(
        json.dumps(value) for value, _ in sorted(chosen, key=lambda pair: pair[0] if is_numeric else 0)
    )
    values = [json.loads(text) for text in texts]
    places = np.array(values if is_numeric else range(len(values)), dtype=np.float64)
    for label, members in list(groups(rows, key).items())[: len(COLOURS)]:
        of_value = [[row for row in members if json.loads(row["settings"])[key] == value] for value in values]
        clusters = [clusters_of(some, by) for some in of_value]
        estimates = (
            [percentage_of(each, "n_found", "n_sources") for each in clusters],
            [cluster_bootstrap(values_of(each, "errors_m"), median) for each in clusters],
            [cluster_bootstrap(values_of(each, "confirmed_s"), median) for each in clusters],
        )
        for axes, panel in zip(panels.values(), estimates, strict=True):
            value, low, high = np.array(panel).T
            (line,) = axes.plot(places, value, marker="o", linestyle="-" if is_numeric else "", label=label)
            axes.vlines(places, low, high, color=line.get_color(), alpha=0.6)
    for title, axes in panels.items():
        _decorate(axes)
        axes.set(title=title, xlabel=key)
        axes.set_ylim(bottom=0.0)
        if is_numeric and places[0] > 0 and places[-1] / places[0] >= LOG_AXIS_RATIO:
            axes.set_xscale("log")
        axes.set_xticks(places, [label_of(value) for value in values], rotation=0 if is_numeric else 30)
        axes.minorticks_off()
    first = panels["sources found"]
    first.set_ylim(0.0, 102.0)
    first.yaxis.set_major_formatter(PercentFormatter())
    _add_legend(first)
    return figure


def _decorate(axes: Axes) -> None:
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)


def _add_legend(axes: Axes) -> None:
    if any(axes.get_legend_handles_labels()[1]):
        axes.legend(frameon=False)


def _draw_steps(lines: Mapping[str, Sequence[Row]], column: str, x: str, y: str, end: float | None = None) -> Figure:
    """Draw for each line the share of all sources whose value in a column is at most x, up to `end`."""
    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    axes = figure.add_subplot()
    _decorate(axes)
    axes.set_prop_cycle(color=COLOURS)
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    for label, rows in list(lines.items())[: len(COLOURS)]:
        values = [0.0, *sorted(value for row in rows for value in row[column])]
        shares = np.arange(len(values)) / sum(row["n_sources"] for row in rows)
        if end is not None:
            values, shares = [*values, end], np.append(shares, shares[-1])
        axes.step(values, shares, where="post", label=label)
    axes.set(xlabel=x, ylabel=y, ylim=(0.0, 1.02), xlim=(0.0, end))
    _add_legend(axes)
    return figure
