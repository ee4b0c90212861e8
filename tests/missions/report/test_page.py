"""report.html."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.envs.scenario.severity import default_severity
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.figures import draw_site_plan
from pdpatrol.missions.report.inspection import inspect_sites
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.page import report_page
from pdpatrol.missions.report.records import Report, SiteInspection
from pdpatrol.missions.report.wording import SITE_STATES
from pdpatrol.missions.runner import run_mission
from tests.missions.replay.short_mission import copy_of, short_mission
from tests.missions.report.logs import LOGS, add_finding, two_findings
from tests.missions.report.page_reader import PageReader

HOSTILE = '<script>alert(1)</script>"; } @import url(http://a.b/c); <img src=http://a.b/d>'


@pytest.fixture(scope="module")
def mission() -> MissionLog:
    """Run 60 s of a mission, which find one of its sources."""
    return short_mission(60.0, seed=1, scenario="two_sources")


def report_and_page(log: MissionLog) -> tuple[Report, PageReader]:
    report = make_report(log, 1.0, inspect_sites(log))
    return report, PageReader(report_page(log, report))


@pytest.mark.whole
def test_finding_in_a_yard_without_equipment_has_its_picture() -> None:
    """Draw the open yard of the learning example, where no pieces could hide a finding or be near it."""
    yard = Path(__file__).parents[3] / "examples" / "learning" / "open_yard.toml"
    report, page = report_and_page(run_mission(load_scenario(yard), "seek", seed=5))
    assert [finding.asset for finding in report.findings] == [None]
    texts = [str(attributes["alt"]) for tag, attributes in page.elements if tag == "img"]
    assert any("inding" in text for text in texts)


def hostile_log() -> MissionLog:
    log = two_findings()
    log.meta |= {"name": HOSTILE, "policy": HOSTILE, "versions": {HOSTILE: HOSTILE}}
    for kind in ("channel fault", "end"):
        log.append("event", step=0, kind=kind, number=0, subject=HOSTILE, text=HOSTILE)
    return log


PAGES: dict[str, Callable[[], MissionLog]] = {**LOGS, "hostile": hostile_log}


@pytest.mark.whole
@pytest.mark.parametrize("name", PAGES)
def test_page_is_well_formed_and_loads_nothing(name: str) -> None:
    _, page = report_and_page(PAGES[name]())
    assert page.text.count("<script>alert(1)</script>") >= (5 if name == "hostile" else 0)
    assert page.errors == []
    assert not {"script", "iframe", "link", "object", "embed"} & {tag for tag, _ in page.elements}
    assert len(page.ids) == len(set(page.ids))
    assert "url(" not in page.styles
    assert "@import" not in page.styles
    for tag, attributes in page.elements:
        assert not [key for key in attributes if key.startswith("on")]
        for key in {"src", "srcset", "data", "href"} & attributes.keys():
            link = attributes[key] or ""
            assert re.match(r"data:image/(svg\+xml|jpeg);base64,", link) if tag == "img" else link[1:] in page.ids


def test_page_has_a_section_and_a_picture_for_each_finding(mission: MissionLog) -> None:
    report, page = report_and_page(mission)
    assert report.findings
    numbers = [str(finding.id) for finding in report.findings]
    assert [name for name in page.ids if name.startswith("finding-")] == [f"finding-{number}" for number in numbers]
    pictures = [attributes["alt"] or "" for tag, attributes in page.elements if tag == "img"]
    for kind in ("Phase-resolved pattern of", "with a ring around"):
        assert [picture.rpartition(" ")[2] for picture in pictures if kind in picture] == numbers


def test_page_states_what_an_operator_needs(mission: MissionLog) -> None:
    report, page = report_and_page(mission)
    (finding,) = report.findings
    assert finding.discharge is not None
    assert finding.strength is not None
    for text in (
        report.scenario, f"{finding.position_m[2]:.2f} ± {finding.position_std_m[2]:.2f}", finding.sites[0].name,
        f"{finding.discharge.kind}, confidence", f"{finding.strength.level_db:.1f} dBV", "Recommended action",
        default_severity().limits, "Truth and errors", "No channel fault was detected.", "maximum likelihood",
    ):  # fmt: skip
        assert text in page.text, text
    assert page.text.count("Recommended action:") == 1


def test_inspection_follows_from_the_path(mission: MissionLog) -> None:
    report, page = report_and_page(mission)
    assert report.inspection is not None
    assert report.inspection.names("not_inspected")  # half a minute is not enough for the yard
    for site in report.inspection.sites:
        assert site.state == "inspected" or f"{site.name} {SITE_STATES[site.state]}" in page.text
    still = MissionLog(mission.meta)
    still.append("step", **{column: values[0] for column, values in mission.table("step").items()})
    at_dock = inspect_sites(still)
    assert at_dock is not None
    assert at_dock.names("inspected") == []  # one pose has no aperture


def site_inspections(log: MissionLog) -> tuple[SiteInspection, ...]:
    inspections = inspect_sites(log)
    assert inspections is not None
    return inspections.sites


def test_site_in_the_ellipse_of_a_confirmed_finding_is_not_judged(mission: MissionLog) -> None:
    assert {site.state for site in site_inspections(mission)} > {"finding"}
    log = copy_of(mission, "step", "pulse", "bearing", "finding", "association", "event")
    add_finding(log, mission.last_step, 1, "confirmed", (15.0, 15.0, 1.0), covariance_m2=400.0 * np.eye(3))
    assert {site.state for site in site_inspections(log)} == {"finding"}


def test_findings_that_explain_their_pulses_badly_exclude_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    mission = short_mission(120.0, seed=1, scenario="two_sources")  # inspects some sites
    assert max(site.probability for site in site_inspections(mission)) > 0.5
    monkeypatch.setitem(mission.meta["array_estimate"], "unexplained_error", 1.0)
    assert max(site.probability for site in site_inspections(mission)) < 0.05


def test_page_warns_of_false_all_clears(mission: MissionLog) -> None:
    report, page = report_and_page(mission)
    assert "False all-clear" not in page.text
    scores = report.scores.model_copy(update={"false_all_clears": ("transformer_1/tank_south",)})
    wrong = PageReader(report_page(mission, report.model_copy(update={"evaluation": scores})))
    assert "False all-clear: transformer_1/tank_south" in wrong.text


def test_page_without_findings_states_what_that_means() -> None:
    log = run_mission(load_scenario("quiet_yard", {"task.time_limit_s": 20.0, "interferers": ()}), "patrol", seed=1)
    report, page = report_and_page(log)
    assert report.findings == ()
    for text in ("No discharge was located.", "for the other sites the result means nothing", "waypoints were missed"):
        assert text in page.text


@pytest.mark.parametrize("name", ["two_findings", "field"])
def test_page_has_no_truth_if_it_is_unknown(name: str) -> None:
    assert "truth" not in report_and_page(LOGS[name]())[1].ids


def test_page_of_a_killed_mission_says_so() -> None:
    report, page = report_and_page(LOGS["killed"]())
    assert len(report.findings) == 2
    assert "killed: this report covers what was written until then" in page.text


def test_sources_beyond_the_fence_are_listed_and_at_the_edge_of_the_plan() -> None:
    log = two_findings()
    for number, place_m in ((8, (3.0, 90.0, 2.0)), (9, (-40.0, 5.0, 2.0))):
        add_finding(log, 59, number, "outside", place_m, covariance_m2=np.eye(3))
    report, page = report_and_page(log)
    assert "Sources beyond the fence: 2." in page.text
    assert "not in this yard" in page.text
    labels = [text.get_text() for text in draw_site_plan(log, report).axes[0].texts]
    assert sorted(labels[-4:]) == ["1", "2", "8", "9"]
