"""Figures and tables of a dataset show its rows."""

import csv
import io
import re
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from pdpatrol.envs.scenario import SHIPPED
from pdpatrol.missions.sweep.analysis import Estimate, summarise_groups
from pdpatrol.missions.sweep.dataset import Dataset, MissionRow
from pdpatrol.missions.sweep.figures import (
    draw_errors,
    draw_figures,
    draw_found_over_time,
    draw_over_setting,
    missions_with_sources,
)
from pdpatrol.missions.sweep.plan import make_plan
from pdpatrol.missions.sweep.tables import as_csv, cells, coverage_table, terminal_table

NOISE_V = [5e-4, 1e-3, 2e-3]


@pytest.fixture
def dataset(tmp_path: Path) -> Dataset:
    """Return missions that find the source from seed 1 on at low noise, from seed 2 on at the next level, and so on."""
    plan = make_plan(["one_source"], ["seek", "patrol"], {"receiver.noise_v": NOISE_V}, range(5))
    dataset = Dataset.open_or_make(tmp_path / "out", plan)
    for job in plan.jobs:
        found = job.seed > NOISE_V.index(job.settings["receiver.noise_v"])
        row = MissionRow.of_failure(job, "finished", "")._replace(n_sources=1, sim_time_s=100.0, ospa_m=1.0)
        if found:
            row = row._replace(n_found=1, errors_m=(0.01 * job.seed,), confirmed_s=(10.0 * job.seed,))
        dataset.write(row)
    return dataset


def test_lines_end_at_the_share_found(dataset: Dataset) -> None:
    missions = missions_with_sources(dataset.read())
    for figure in (draw_errors(missions), draw_found_over_time(missions)):
        drawn = figure.axes[0].get_lines()
        assert drawn[0].get_label() == "seek, receiver.noise_v=0.0005"
        assert [line.get_ydata()[-1] for line in drawn] == pytest.approx(np.repeat([0.8, 0.6, 0.4], 2))  # pyright: ignore
        for line in drawn:
            assert np.all(np.diff(np.asarray(line.get_ydata(), dtype=np.float64)) >= 0)
            assert np.all(np.diff(np.asarray(line.get_xdata(), dtype=np.float64)) >= 0)


def test_setting_is_an_axis(dataset: Dataset) -> None:
    panels = draw_over_setting(missions_with_sources(dataset.read()), "receiver.noise_v").axes
    assert [label.get_text() for label in panels[0].get_xticklabels()] == ["0.0005", "0.001", "0.002"]
    assert panels[0].get_legend_handles_labels()[1] == ["seek", "patrol"]
    for axes, expected in zip(panels, ([80.0, 60.0, 40.0], [0.025, 0.03, 0.035], [25.0, 30.0, 35.0]), strict=True):
        for container in axes.containers:
            np.testing.assert_allclose(container[0].get_ydata(), expected)  # pyright: ignore


def test_all_figures_are_written(dataset: Dataset, tmp_path: Path) -> None:
    written = draw_figures(dataset.read(), tmp_path)
    assert [path.name for path in written] == ["errors.png", "found_over_time.png", "over_receiver.noise_v.png"]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in written)


def test_terminal_table_breaks_no_word_at_80_columns(dataset: Dataset) -> None:
    wide = {"median error (m)": Estimate(0.056, 0.046, 0.107), "missions": 100, "unfinished": 1, "false": 1000}
    summary = summarise_groups(dataset.read())[0] | wide
    words = [file.stem for file in SHIPPED.glob("*.toml")]
    summaries = [summary | {"group": name} for name in words]
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(terminal_table(summaries, "runs/some"), coverage_table(summaries))
    shown = console.export_text()
    for word in (*words, "clear", "confirm", "0.046-0.107", "1000", "of 100"):
        assert re.search(rf"(?<!\S){re.escape(word)}(?!\S)", shown), word


def test_markdown_and_csv_hold_all_figures(dataset: Dataset) -> None:
    summaries = summarise_groups(dataset.read())
    assert set(cells(summaries[0])) >= {"found (%)", "OSPA (m)", "false all-clear", "coverage 3-D 99.9 % below 1.5 m"}
    read = list(csv.DictReader(io.StringIO(as_csv(summaries))))
    assert [row["policy"] for row in read] == [summary["policy"] for summary in summaries]
    assert float(read[0]["found (%)"]) == pytest.approx(80.0)
    assert float(read[0]["found (%) low"]) < 80.0 < float(read[0]["found (%) high"])
