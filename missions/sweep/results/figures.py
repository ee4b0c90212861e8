"""A dataset as pictures: how large errors are, how soon discharges are found, and how both follow a setting."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
import pyarrow as pa
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from pdpatrol.missions.sweep.results.intervals import bootstrap_interval, share_interval
from pdpatrol.missions.sweep.results.summary import group_of
from pdpatrol.missions.whole_file import whole_file

Row = Mapping[str, Any]
SIZE_IN = (7.0, 4.2)
COLOURS = [colormaps["tab20"](number) for number in (*range(0, 20, 2), *range(1, 20, 2))]
"""Ten strong ones first, then ten pale ones; more lines cannot be told apart."""

FAR_APART = 4.0
"""Values of a setting that span so large a ratio lie on a logarithmic axis."""


def draw_figures(rows: pa.Table, folder: Path) -> list[Path]:
    """Draw a dataset into a folder.

    Args:
        rows: The dataset.
        folder: Where to put the pictures; it is there.

    Returns:
        The pictures that were written: errors.png, found_over_time.png, and over_KEY.png for each setting that takes
        several values.
    """
    finished = [row for row in rows.to_pylist() if row["status"] == "finished" and row["n_sources"]]
    pictures = [
        (folder / "errors.png", draw_errors(groups(finished))),
        (folder / "found_over_time.png", draw_found_over_time(groups(finished))),
    ]
    settings = [json.loads(row["settings"]) for row in finished]
    for key in sorted({key for each in settings for key in each}):
        if len({json.dumps(each[key]) for each in settings if key in each}) > 1:
            pictures.append((folder / f"over_{key}.png", draw_over_setting(finished, key)))
    for path, figure in pictures:
        with whole_file(path) as picture:
            figure.savefig(picture, dpi=120, format="png")
    return [path for path, _ in pictures]


def groups(rows: Sequence[Row], without: str = "") -> dict[str, list[Row]]:
    """Missions that differ by their seed alone, or by one setting too, under what tells them from the others.

    Levels of the suite are told apart if there is nothing else that is.
    """
    texts: list[tuple[str, str, str]] = []
    for row in rows:
        settings = {key: value for key, value in json.loads(row["settings"]).items() if key != without}
        shown = ", ".join(f"{key}={label_of(value)}" for key, value in settings.items())
        texts.append((group_of(row), row["policy"], shown))
    differing = [part for part, column in enumerate(zip(*texts, strict=True)) if len(set(column)) > 1]
    if all(row["level"] for row in rows) and (without or differing != [0]):
        differing = [part for part in differing if part != 0]
    found: dict[str, list[Row]] = {}
    for row, parts in zip(rows, texts, strict=True):
        found.setdefault(", ".join(parts[part] for part in differing if parts[part]), []).append(row)
    return found


def label_of(value: object) -> str:
    """A value of a setting in a word or two: of a table its kind, of a list what it holds."""
    if isinstance(value, list):
        return ", ".join(label_of(item) for item in cast("list[object]", value)) or "none"
    if isinstance(value, dict):
        table = cast("dict[str, object]", value)
        return str(table.get("kind", json.dumps(table)))
    return f"{value:g}" if isinstance(value, float) else str(value)


def draw_errors(lines: Mapping[str, Sequence[Row]]) -> Figure:
    """Share of all sources that were found with at most so large an error: it ends at the share that was found."""
    figure, axes = _axes("position error (m)", "sources found with at most that error")
    for name, rows in _shown(lines):
        _steps(axes, [error for row in rows for error in row["errors_m"]], sum(row["n_sources"] for row in rows), name)
    axes.set_xlim(left=0.0)
    return _finish(figure, axes)


def draw_found_over_time(lines: Mapping[str, Sequence[Row]]) -> Figure:
    """Share of all sources that were confirmed by some time, and to the right of it the share that still hides."""
    figure, axes = _axes("time since the start (s)", "sources confirmed by then")
    hidden = axes.secondary_yaxis("right", functions=(_rest, _rest))
    hidden.set_ylabel("sources not confirmed by then")
    hidden.yaxis.set_major_formatter(PercentFormatter(1.0))
    end_s = max((row["sim_time_s"] for rows in lines.values() for row in rows), default=1.0)
    for name, rows in _shown(lines):
        times_s = [time_s for row in rows for time_s in row["confirmed_s"]]
        _steps(axes, times_s, sum(row["n_sources"] for row in rows), name, end_s)
    axes.set_xlim(0.0, end_s)
    return _finish(figure, axes)


def _rest(share: Any) -> Any:  # noqa: ANN401 - whatever matplotlib scales
    return 1.0 - share


def draw_over_setting(rows: Sequence[Row], key: str) -> Figure:
    """What is found, how well and how soon, over the values of a setting, with 95 % intervals."""
    figure = Figure(figsize=(11.0, 3.6), layout="constrained")
    panels = figure.subplots(1, 3)
    values = sorted(dict.fromkeys(json.dumps(json.loads(row["settings"])[key]) for row in rows), key=_by_size)
    numbers = [json.loads(value) for value in values]
    is_axis = all(isinstance(number, int | float) and not isinstance(number, bool) for number in numbers)
    places = np.array(numbers if is_axis else range(len(values)), dtype=np.float64)
    for name, members in _shown(groups(rows, key)):
        by_value = [[row for row in members if json.dumps(json.loads(row["settings"])[key]) == v] for v in values]
        figures_of = [
            [
                share_interval(*(sum(row[column] for row in some) for column in ("n_found", "n_sources")))
                for some in by_value
            ],
            [
                bootstrap_interval(np.array([e for row in some for e in row["errors_m"]]), np.median)
                for some in by_value
            ],
            [
                bootstrap_interval(np.array([t for row in some for t in row["confirmed_s"]]), np.median)
                for some in by_value
            ],
        ]
        for axes, intervals in zip(panels, figures_of, strict=True):
            value, low, high = np.array(intervals).T
            (line,) = axes.plot(places, value, marker="o", linestyle="-" if is_axis else "", label=name)
            axes.vlines(places, low, high, color=line.get_color(), alpha=0.6)
    for axes, title in zip(panels, ("sources found", "median error (m)", "median time to confirm (s)"), strict=True):
        axes.set_title(title)
        axes.set_xlabel(key)
        axes.set_ylim(bottom=0.0)
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
        if is_axis and places[0] > 0 and places[-1] / places[0] >= FAR_APART:
            axes.set_xscale("log")
        axes.set_xticks(places, [label_of(number) for number in numbers], rotation=0 if is_axis else 30)
        axes.minorticks_off()
    panels[0].set_ylim(0.0, 1.02)
    panels[0].yaxis.set_major_formatter(PercentFormatter(1.0))
    _finish(figure, panels[0])
    return figure


def _by_size(text: str) -> float:
    """Of numbers; all else keeps its order."""
    value = json.loads(text)
    return float(value) if isinstance(value, int | float) else 0.0


def _axes(x: str, y: str) -> tuple[Figure, Axes]:
    figure = Figure(figsize=SIZE_IN, layout="constrained")
    axes = figure.add_subplot()
    axes.set_prop_cycle(color=COLOURS)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_ylim(0.0, 1.02)
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _shown(lines: Mapping[str, Sequence[Row]]) -> list[tuple[str, Sequence[Row]]]:
    """The lines that a picture has colours for."""
    return list(lines.items())[: len(COLOURS)]


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
