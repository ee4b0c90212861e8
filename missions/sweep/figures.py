"""Figures of a dataset: error distribution, sources found over time, and both over a setting."""

import json
from pathlib import Path
from typing import cast

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from pdpatrol.missions.atomic_file import atomic_file
from pdpatrol.missions.sweep.analysis import level_or_scenario, percentage_of, statistic_of
from pdpatrol.missions.sweep.dataset import Frame


def draw_figures(rows: Frame, folder: Path) -> list[Path]:
    """Draw a dataset into a folder.

    Args:
        rows: Rows of the dataset.
        folder: Existing folder.

    Returns:
        Paths of the figures: errors.png, found_over_time.png, and over_KEY.png for each setting with several values.
    """
    missions = missions_with_sources(rows)
    figures = {"errors": draw_errors(missions), "found_over_time": draw_found_over_time(missions)}
    settings: Frame = pd.DataFrame([json.loads(text) for text in missions["settings"]]).astype(str)
    for key in settings.columns[settings.nunique() > 1]:
        figures[f"over_{key}"] = draw_over_setting(missions, key)
    paths = [folder / f"{name}.png" for name in figures]
    for path, figure in zip(paths, figures.values(), strict=True):
        with atomic_file(path) as file:
            figure.savefig(file, dpi=120, format="png")
    return paths


def missions_with_sources(rows: Frame) -> Frame:
    """Return the finished missions of a dataset whose yard contains a source."""
    return rows[(rows["status"] == "finished") & (rows["n_sources"] > 0)]


def _with_lines(missions: Frame, without: str = "") -> Frame:
    """Add a column `line` of policy and settings, except the setting `without`.

    If these are the same for all missions, the column contains level or scenario instead, or an empty text if `without`
    is given.
    """
    lines: list[str] = []
    for policy, text in zip(missions["policy"], missions["settings"], strict=True):
        settings = [f"{key}={label_of(value)}" for key, value in json.loads(text).items() if key != without]
        lines.append(", ".join([policy, *settings]))
    if len(set(lines)) > 1:
        return missions.assign(line=lines)
    return missions.assign(line="" if without else level_or_scenario(missions))


def label_of(value: object) -> str:
    """Format the value of a setting briefly: the kind of a table, the items of a list."""
    if isinstance(value, list):
        return ", ".join(label_of(item) for item in cast("list[object]", value)) or "none"
    if isinstance(value, dict):
        return str(cast("dict[str, object]", value).get("kind", json.dumps(value)))
    return f"{value:g}" if isinstance(value, float) else str(value)


def draw_errors(missions: Frame) -> Figure:
    """Draw the share of all sources that were found with at most a given position error, a line for each label."""
    return _draw_steps(missions, "errors_m", "position error (m)", "sources found with at most that error")


def draw_found_over_time(missions: Frame) -> Figure:
    """Draw the share of all sources that were confirmed by a given time, a line for each label."""
    end_s = missions["sim_time_s"].max()
    return _draw_steps(missions, "confirmed_s", "time since the start (s)", "sources confirmed by then", end_s)


def _draw_steps(missions: Frame, column: str, x: str, y: str, end: float | None = None) -> Figure:
    """Draw the share of all sources whose value in a column is at most x, up to `end`."""
    figure = Figure(figsize=(8.5, 4.4), layout="constrained")
    axes = figure.add_subplot()
    axes.set_prop_cycle(color=[colormaps["tab20"](number) for number in (*range(0, 20, 2), *range(1, 20, 2))])
    for line, members in _with_lines(missions).groupby("line", sort=False):
        values = np.sort(np.concatenate([[0.0], *members[column]]))
        shares = np.arange(values.size) / members["n_sources"].sum()
        if end is not None:
            values, shares = np.append(values, end), np.append(shares, shares[-1])
        axes.step(values, shares, where="post", label=str(line))
    axes.set(xlabel=x, ylabel=y, ylim=(0.0, 1.02), xlim=(0.0, end))
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    _finish(figure, "outside right upper")
    return figure


def draw_over_setting(missions: Frame, key: str) -> Figure:
    """Draw share found, error and time over the values of a setting in their order in the sweep, with 95 % intervals.

    The intervals resample yards, or missions if there is only one yard.
    """
    place, labels = pd.factorize(missions["settings"].map(lambda text: label_of(json.loads(text).get(key))))
    missions = missions.assign(place=place)
    figure = Figure(figsize=(11.0, 3.6), layout="constrained")
    panels = {
        "sources found (%)": lambda members: percentage_of(members, "n_found", "n_sources"),
        "median error (m)": lambda members: statistic_of(members, "errors_m", np.nanmedian),
        "median time to confirm (s)": lambda members: statistic_of(members, "confirmed_s", np.nanmedian),
    }
    for axes, (title, estimate) in zip(figure.subplots(1, 3), panels.items(), strict=True):
        lines = list(_with_lines(missions, key).groupby("line", sort=False))
        for shift, (line, members) in zip(0.08 * (np.arange(len(lines)) - 0.5 * (len(lines) - 1)), lines, strict=True):
            of_place = {place: estimate(some) for place, some in members.groupby("place")}
            value, low, high = np.array(list(of_place.values())).T
            axes.errorbar(
                np.array(list(of_place)) + shift, value, [value - low, high - value], fmt="o", label=str(line)
            )
        axes.set(title=title, xlabel=key)
        axes.set_ylim(0.0, 104.0 if title.endswith("(%)") else None)
        axes.set_xticks(range(len(labels)), labels, rotation=30, ha="right", rotation_mode="anchor")
    _finish(figure, "outside lower center")
    return figure


def _finish(figure: Figure, place: str) -> None:
    """Draw a grid, and at a place outside of the panels a legend if the lines have names."""
    for axes in figure.axes:
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    handles, names = figure.axes[0].get_legend_handles_labels()
    if any(names):
        figure.legend(handles, names, loc=place, frameon=False, ncols=3 if "lower" in place else 1)
