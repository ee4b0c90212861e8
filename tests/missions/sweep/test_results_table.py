"""The table of results on a terminal."""

import re

from rich.console import Console

from pdpatrol.envs.scenario import SHIPPED
from pdpatrol.missions.sweep.results.intervals import Interval
from pdpatrol.missions.sweep.results.summary import GroupSummary
from pdpatrol.missions.sweep.results.tables import terminal_table


def summary(group: str, settings: str = "{}") -> GroupSummary:
    return GroupSummary(
        group=group,
        policy="active",
        settings=settings,
        n_missions=100,
        n_unfinished=0,
        bearing_rmse_rad=Interval(0.1, 0.05, 0.2),
        found=Interval(1.0, 0.96, 1.0),
        error_m=Interval(0.056, 0.046, 0.107),
        error95_m=0.2,
        in_ellipse=Interval(0.95, 0.9, 0.99),
        right_site=Interval(1.0, 0.9, 1.0),
        confirmed_s=Interval(142.0, 125.0, 150.0),
        detour=Interval(1.2, 1.1, 1.3),
        ospa_m=Interval(0.1, 0.05, 0.2),
        false_findings=10,
        contacts=1000,
        waypoints_missed=0,
    )


def test_no_word_or_figure_of_the_results_breaks_at_80_columns() -> None:
    names = [file.stem for file in SHIPPED.glob("*.toml")]
    varied = [summary("yard", f'{{"estimator.method": "{method}"}}') for method in ("strongest", "maximum_likelihood")]
    console = Console(width=80, record=True, file=open("/dev/null", "w", encoding="utf-8"))  # noqa: SIM115
    with console.file:
        console.print(terminal_table([*map(summary, names), *varied], "runs/some"))
        shown = console.export_text()
    for word in (
        *names,
        "strongest",
        "maximum_likelihood",
        "contacts",
        "confirm (s)",
        "(0.046-0.107)",
        "(125-150)",
        "(96-100)",
        "1000",
    ):
        assert re.search(rf"(?<!\S){re.escape(word)}(?!\S)", shown), word


def test_settings_that_all_rows_share_stand_in_the_title_alone() -> None:
    rows = [summary(name, '{"array.n_elements": 8}') for name in ("one", "two")]
    table = terminal_table(rows, "runs/some")
    assert table.title == "runs/some, array.n_elements=8"
    assert list(table.columns[0].cells)[1] == "active"
