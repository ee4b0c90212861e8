"""trend.html is self-contained, shows each discharge over its dates, and escapes names."""

from pdpatrol.missions.campaign.page import trend_page
from pdpatrol.missions.campaign.trend import make_trend
from pdpatrol.missions.record.mission_log import MissionLog
from tests.missions.campaign.surveys import DAYS, PAST, growing, inspections, survey
from tests.missions.report.page_reader import PageReader

HOSTILE = '</p><script>alert("1")</script>'


def page_of(logs: list[MissionLog]) -> PageReader:
    seen = inspections(logs)
    return PageReader(trend_page(make_trend(seen), seen))


def test_page_shows_dates_sites_and_figures_loads_nothing_and_escapes_names() -> None:
    logs = growing(name=HOSTILE)
    piece = {
        "name": "tank", "kind": "power_transformer", "shape": "box", "position_m": [10.0, 11.0], "yaw_deg": 0.0,
        "footprint_m": [3.0, 2.0], "height_m": 2.5, "sites": {"south": [0.0, -1.0, 1.6]},
    }  # fmt: skip
    for log in logs:
        log.meta["scenario"] = {"yard": {"size_m": [40.0, 30.0], "equipment": [piece]}}
    page = page_of(logs)
    tags = [tag for tag, _ in page.elements]
    assert tags.count("img") == 2
    assert "script" not in tags
    for text in (*DAYS[:4], HOSTILE, "Discharges in 4 inspections: 1 grown.", "tank/south"):
        assert text in page.text
    links = [value or "" for _, each in page.elements for key, value in each.items() if key in ("src", "href")]
    assert all(link.startswith(("#", "data:image/svg+xml;base64,")) for link in links)
    assert "@import" not in page.styles


def test_page_without_discharges_says_so() -> None:
    assert "Discharges in 4 inspections: none found." in page_of([survey(PAST, day=day) for day in DAYS[:4]]).text
