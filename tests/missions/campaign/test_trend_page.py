"""trend.html is self-contained, shows each discharge over its dates, and escapes names."""

import numpy as np
import pytest

from pdpatrol.missions.campaign.page import describe_change, draw_levels, draw_rates, mark_of, trend_page
from pdpatrol.missions.campaign.trend import make_trend
from pdpatrol.missions.record.mission_log import MissionLog
from tests.missions.campaign.surveys import SurveyedSource, along, inspection, survey
from tests.missions.report.page_reader import PageReader

DAYS = ("2026-03-02", "2026-03-09", "2026-03-16", "2026-03-23")
PAST = along((6.0, 7.0), (14.0, 7.0))
HOSTILE = '</p><script>alert("1")</script>'


def logs(name: str = "survey") -> list[MissionLog]:
    return [
        survey(PAST, SurveyedSource((10.0, 10.0, 1.6), -20.0 + 3.0 * k, 2.0), day=day, seed=k, name=name)
        for k, day in enumerate(DAYS)
    ]


def page_of(some: list[MissionLog]) -> PageReader:
    inspections = [inspection(log) for log in some]
    return PageReader(trend_page(make_trend(inspections), inspections))


def test_page_has_plan_two_figures_for_each_discharge_and_dates() -> None:
    page = page_of(logs())
    assert [tag for tag, _ in page.elements].count("img") == 3
    for text in (*DAYS, "grown", "1 discharge in 4 inspections: 1 grown."):
        assert text in page.text


def test_page_loads_nothing_and_escapes_names() -> None:
    page = page_of(logs(HOSTILE))
    assert "script" not in {tag for tag, _ in page.elements}
    assert HOSTILE in page.text
    links = [value or "" for _, each in page.elements for key, value in each.items() if key in ("src", "href")]
    assert all(link.startswith(("#", "data:image/svg+xml;base64,")) for link in links)
    assert "@import" not in page.styles


def test_page_of_a_yard_names_the_site() -> None:
    some = logs()
    piece = {
        "name": "tank", "kind": "power_transformer", "shape": "box", "position_m": [10.0, 11.0], "yaw_deg": 0.0,
        "footprint_m": [3.0, 2.0], "height_m": 2.5, "sites": {"south": [0.0, -1.0, 1.6]},
    }  # fmt: skip
    for log in some:
        log.meta["scenario"] = {"yard": {"size_m": [40.0, 30.0], "equipment": [piece]}}
    page = page_of(some)
    assert "tank/south" in page.text


def test_page_without_discharges_says_so() -> None:
    page = page_of([survey(PAST, day=day) for day in DAYS])
    assert "No discharge was found in 4 inspections." in page.text


def test_line_runs_through_values_and_rate_axis_starts_at_zero() -> None:
    (discharge,) = make_trend([inspection(log) for log in logs()]).discharges
    (levels,), (rates,) = draw_levels(discharge).axes, draw_rates(discharge).axes
    line = max(levels.lines, key=lambda each: np.size(each.get_xdata()))
    assert np.asarray(line.get_ydata())[[0, -1]] == pytest.approx([-20.0, -11.0], abs=1.0)
    assert rates.get_ylim()[0] == 0.0
    assert levels.get_ylim()[1] - levels.get_ylim()[0] >= 10.0
    assert (mark_of(discharge).label, describe_change(discharge)) == ("grown", "grown")
