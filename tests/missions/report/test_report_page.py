"""report.html: one file that an operator can file, of whole missions, of field data, and of what is left of others."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.advice import LIMITS
from pdpatrol.missions.report.inspection import inspected_sites
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.records import Report
from pdpatrol.missions.report.report_page import report_page
from pdpatrol.missions.runner import Mission, run_mission
from tests.missions.report.html import Page
from tests.missions.report.logs import empty_log
from tests.missions.report.test_schema import field_log, killed
from tests.missions.test_phase_patterns import log_of_two_findings

HOSTILE = '<script>alert(1)</script>"; } @import url(http://a.b/c); <img src=http://a.b/d>'


@pytest.fixture(scope="module")
def mission() -> MissionLog:
    """Thirty seconds of a mission, which find one of its sources."""

    def end_early(mission: Mission) -> None:
        if mission.time_s >= 30.0 and not mission.is_over:
            mission.end("interrupted")

    return run_mission(load_scenario("two_sources"), "seek", seed=1, after_step=end_early)


def bounded(log: MissionLog) -> MissionLog:
    log.meta["bounds_m"] = [[-5.0, -5.0], [20.0, 20.0]]
    return log


def of_both(log: MissionLog) -> tuple[Report, Page]:
    inspected = inspected_sites(log)
    report = make_report(log, 1.0, inspected)
    return report, Page(report_page(log, report, inspected))


def named_badly() -> MissionLog:
    log = bounded(log_of_two_findings(1))
    log.meta |= {"name": HOSTILE, "policy": HOSTILE, "versions": {HOSTILE: HOSTILE}}
    log.append("event", step=0, kind="channel fault", number=0, subject="", text=HOSTILE)
    log.append("event", step=0, kind="end", number=0, subject=HOSTILE, text=HOSTILE)
    return log


LOGS: dict[str, Callable[[], MissionLog]] = {
    "two findings": lambda: bounded(log_of_two_findings(1)),
    "no mains": lambda: bounded(log_of_two_findings(1, mains=False)),
    "killed": lambda: killed(bounded(log_of_two_findings(1))),
    "nothing": empty_log,
    "field": field_log,
    "named badly": named_badly,
}


@pytest.mark.parametrize("name", LOGS)
def test_a_page_is_one_well_formed_file_without_scripts_that_loads_nothing(name: str) -> None:
    _, page = of_both(LOGS[name]())
    assert page.faults == []
    assert page.loads == []
    assert not {"script", "iframe", "link", "img", "object", "embed"} & set(page.tags)
    assert len(page.ids) == len(set(page.ids))
    assert not [key for _, attributes in page.elements for key in attributes if key.startswith("on")]
    targets = [attributes["href"] or "" for tag, attributes in page.elements if tag == "a"]
    assert {target[1:] for target in targets} <= set(page.ids)


def test_foreign_names_are_read_as_they_are_written() -> None:
    _, page = of_both(named_badly())
    assert page.text.count("<script>alert(1)</script>") >= 5


def test_a_finding_has_the_same_number_in_log_report_and_page(mission: MissionLog) -> None:
    report, page = of_both(mission)
    table = mission.table("finding")
    last = (table["step"] == table["step"][-1]) & (table["state"] == "confirmed")
    ids = table["id"][last].tolist()
    assert ids == [finding.id for finding in report.findings]
    assert ids
    assert [name for name in page.ids if name.startswith("finding-")] == [f"finding-{number}" for number in ids]
    for number in ids:
        assert {f"phase-{number}-figure_1", f"from-{number}-figure_1"} <= set(page.ids)
        assert f"finding {number} at " in page.text


def test_a_page_tells_what_an_operator_has_to_know(mission: MissionLog) -> None:
    report, page = of_both(mission)
    (finding,) = report.findings
    assert finding.discharge is not None
    assert finding.strength is not None
    for told in (
        report.scenario, f"{finding.position_m[2]:.2f} ± {finding.position_std_m[2]:.2f}", finding.sites[0].name,
        f"{finding.discharge.kind}, confidence", f"{finding.strength.level_db:.1f} dBV", "Recommended action", LIMITS,
        "Truth and errors", "No fault of a channel was noticed.", "maximum_likelihood",
    ):  # fmt: skip
        assert told in page.text, told
    assert page.text.count("Time frame:") == 1


def test_what_was_inspected_follows_from_the_way_driven(mission: MissionLog) -> None:
    report, page = of_both(mission)
    inspected = inspected_sites(mission)
    assert inspected is not None
    assert report.inspection is not None
    assert report.inspection.not_inspected  # half a minute is not enough for the yard
    words = {"not_inspected": "not inspected", "heard_narrowly": "heard from too few sides"}
    for site in inspected.sites:
        assert site.state == "inspected" or f"{site.name} {words[site.state]}" in page.text
    still = MissionLog(mission.meta)
    first = {column: values[0] for column, values in mission.table("step").items()}
    still.append("step", **first)
    at_dock = inspected_sites(still)
    assert at_dock is not None
    assert at_dock.names("inspected") == ()  # one pose has no aperture
    assert set(at_dock.names("heard_narrowly")) <= {
        site.name for site in inspected.sites if site.state != "not_inspected"
    }


def test_where_nothing_was_found_the_page_says_what_that_is_worth() -> None:
    log = run_mission(load_scenario("quiet_yard", {"task.time_limit_s": 20.0, "interferers": ()}), "patrol", seed=1)
    report, page = of_both(log)
    assert report.findings == ()
    assert "No discharge was located." in page.text
    assert "for the others it means nothing" in page.text
    assert "waypoints were missed" in page.text


def test_truth_is_on_the_page_only_where_it_is_known() -> None:
    assert "truth" not in of_both(field_log())[1].ids
    assert "truth" not in of_both(bounded(log_of_two_findings(1)))[1].ids


def test_a_mission_cut_off_without_warning_has_a_page_that_says_so() -> None:
    report, page = of_both(killed(bounded(log_of_two_findings(1))))
    assert len(report.findings) == 2
    assert "cut off without warning" in page.text


def test_what_lies_beyond_the_fence_is_told_to_be_no_asset_of_the_yard() -> None:
    log = bounded(log_of_two_findings(1))
    log.append(
        "finding", step=59, id=9, position_m=np.array([-40.0, 5.0, 2.0]), covariance_m2=np.eye(3), state="outside",
        n_bearings=30, first_detected_s=0.0, confirmed_s=np.nan, aperture_rad=0.3,
    )  # fmt: skip
    _, page = of_both(log)
    assert "One lies beyond the fence." in page.text
    assert "none of this yard" in page.text


def test_a_page_takes_less_than_two_seconds(mission: MissionLog, tmp_path: Path) -> None:
    of_both(mission)  # the first one loads matplotlib
    started_s = time.perf_counter()
    of_both(mission)
    assert time.perf_counter() - started_s < 2.0
