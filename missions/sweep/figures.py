"""A dataset as pictures: how large errors are, how soon discharges are found, and how both follow a setting."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from missions.sweep.intervals import share_interval

Row = Mapping[str, Any]
SIZE_IN = (7.0, 4.2)
MOST_LINES = 10
"""So many lines can be told apart by colour."""


def draw_figures(rows: pa.Table, folder: Path) -> list[Path]:
    """Draw a dataset into a folder.

    Args:
        rows: The dataset.
        folder: Where to put the pictures; it is there.

    Returns:
        The pictures that were written: errors.png, found_over_time.png, and for each setting that takes several numbers
        found_over_KEY.png.
    """
    finished = [row for row in rows.to_pylist() if row["status"] == "finished" and row["n_sources"]]
    pictures = [
        (folder / "errors.png", draw_errors(groups(finished))),
        (folder / "found_over_time.png", draw_found_over_time(groups(finished))),
    ]
    settings = [json.loads(row["settings"]) for row in finished]
    for key in sorted({key for each in settings for key in each}):
        values = {each[key] for each in settings if isinstance(each.get(key), int | float)}
        if len(values) > 1:
            pictures.append((folder / f"found_over_{key}.png", draw_found_over_setting(finished, key)))
    for path, figure in pictures:
        figure.savefig(path, dpi=120)
    return [path for path, _ in pictures]


def groups(rows: Sequence[Row], without: str = "") -> dict[str, list[Row]]:
    """Missions that differ by their seed alone, or by one setting too, under what tells them from the others."""
    texts: list[tuple[str, ...]] = []
    for row in rows:
        settings = {key: value for key, value in json.loads(row["settings"]).items() if key != without}
        texts.append((row["scenario"], row["policy"], ", ".join(f"{key}={value}" for key, value in settings.items())))
    differing = [part for part, column in enumerate(zip(*texts, strict=True)) if len(set(column)) > 1]
    found: dict[str, list[Row]] = {}
    for row, parts in zip(rows, texts, strict=True):
        found.setdefault(", ".join(parts[part] for part in differing if parts[part]), []).append(row)
    return found


def draw_errors(lines: Mapping[str, Sequence[Row]]) -> Figure:
    """Share of all sources that were found with at most so large an error: it ends at the share that was found."""
    figure, axes = _axes("position error (m)", "sources found with at most that error")
    for name, rows in _shown(lines):
        _steps(axes, [error for row in rows for error in row["errors_m"]], sum(row["n_sources"] for row in rows), name)
    axes.set_xlim(left=0.0)
    return _finish(figure, axes)


def draw_found_over_time(lines: Mapping[str, Sequence[Row]]) -> Figure:
    """Share of all sources that were confirmed by some time."""
    figure, axes = _axes("time since the start (s)", "sources confirmed by then")
    end_s = max((row["sim_time_s"] for rows in lines.values() for row in rows), default=1.0)
    for name, rows in _shown(lines):
        times_s = [time_s for row in rows for time_s in row["confirmed_s"]]
        _steps(axes, times_s, sum(row["n_sources"] for row in rows), name, end_s)
    axes.set_xlim(0.0, end_s)
    return _finish(figure, axes)


def draw_found_over_setting(rows: Sequence[Row], key: str) -> Figure:
    """Share of all sources that were found, over the values of a setting, with 95 % intervals."""
    figure, axes = _axes(key, "sources found")
    for name, members in _shown(groups(rows, key)):
        by_value: dict[float, list[Row]] = {}
        for row in members:
            by_value.setdefault(json.loads(row["settings"])[key], []).append(row)
        values = sorted(by_value)
        shares = [
            share_interval(*(sum(row[column] for row in by_value[value]) for column in ("n_found", "n_sources")))
            for value in values
        ]
        share, low, high = np.array(shares).T
        (line,) = axes.plot(values, share, marker="o", label=name)
        axes.fill_between(values, low, high, alpha=0.15, color=line.get_color(), linewidth=0.0)
        if values[0] > 0 and values[-1] / values[0] >= 4:
            axes.set_xscale("log")
    return _finish(figure, axes)


def _axes(x: str, y: str) -> tuple[Figure, Axes]:
    figure = Figure(figsize=SIZE_IN, layout="constrained")
    axes = figure.add_subplot()
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_ylim(0.0, 1.02)
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _shown(lines: Mapping[str, Sequence[Row]]) -> list[tuple[str, Sequence[Row]]]:
    """The lines that a picture has colours for."""
    return list(lines.items())[:MOST_LINES]


def _steps(axes: Axes, values: Sequence[float], n_all: int, name: str, end: float | None = None) -> None:
    """How large a share of `n_all` is at most each value, drawn as steps from zero, and level up to `end`."""
    ordered = [0.0, *sorted(values)]
    shares = [count / n_all for count in range(len(ordered))]
    if end is not None:
        ordered, shares = [*ordered, end], [*shares, shares[-1]]
    axes.step(ordered, shares, where="post", label=name)


def _finish(figure: Figure, axes: Axes) -> Figure:
    if any(label for label in axes.get_legend_handles_labels()[1]):
        axes.legend(frameon=False, loc="best")
    return figure
