"""Status text, phases and outcome of a recording."""

from pathlib import Path

import numpy as np

from pdpatrol.envs import load_scenario
from pdpatrol.missions.record.events import Phase
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.closing_card import closing_card
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.wording import kind_text
from pdpatrol.missions.runner import Mission
from tests.missions.replay.read_back import recorded
from tests.missions.report.logs import add_finding
from tests.missions.steps import append_step


def log_of(*phases: Phase) -> MissionLog:
    """Return a log of one second in each phase, in the yard of a shipped scenario."""
    log, pose = MissionLog(Mission(load_scenario("one_source"), "seek", 0).log.meta), np.array([10.0, 5.0, 0.0])
    for k in range(10 * len(phases)):
        phase = phases[k // 10]
        append_step(log, 0.1 * (k + 1), pose, true_pose=pose, phase=phase.name, phase_target=phase.target)
    return log


def test_story_states_phase_and_current_findings(tmp_path: Path) -> None:
    log = log_of(Phase("seek", 3), Phase("listen"), Phase("listen"))
    place_m = (*next(iter(log.meta["sites"].values()))[:2], 1.5)
    for step, state in ((4, "candidate"), (15, "dropped")):
        add_finding(log, step, 3, state, place_m, covariance_m2=np.diag([0.8, 0.04, 0.09]), possibly_two=True)
        add_finding(log, step, 4, "confirmed", (10.0, 15.0, 1.5))
    texts = {step: text for step, (text,) in recorded(log, tmp_path)["mission/status"]["text"].items()}
    assert "### The robot approaches candidate 3" in texts[4]
    assert "- **candidate 3** near " in texts[4]
    assert ", within 2.31 m, probability 90\N{NO-BREAK SPACE}%, possibly two" in texts[4]
    assert "candidate 3" not in texts[19]
    assert "- **finding 4** near " in texts[19]


def test_closing_card_states_what_where_which_kind_and_by_when(tmp_path: Path) -> None:
    log = log_of(Phase("return to dock"))
    site, place_m = next(iter(log.meta["sites"].items()))
    add_finding(log, 8, 3, "confirmed", place_m, covariance_m2=1e-4 * np.eye(3), confirmed_s=0.5)
    log.append("event", step=9, kind="end", number=0, subject="docked", text="mission over: docked")
    drawn = recorded(log, tmp_path)
    (text,) = drawn["mission/status"]["text"][9]
    (finding,) = make_report(log, 0.0).findings
    advice = finding.assessment
    assert advice is not None
    assert text.startswith("### 1 discharge located")
    for words in (
        "Finding 3",
        site.replace("_", "\\_"),
        kind_text(finding),
        f"act by {advice.due}" if advice.due else f"act within {advice.within_days} days",
        advice.action,
    ):
        assert words in text
    assert "The mission ended after 1 s: docked." in text
    assert drawn["world/findings/3/label"]["labels"][9] == [f"3 {site.partition('/')[2]}"]


def test_closing_card_gives_the_position_where_no_sites_are_known() -> None:
    log = log_of(Phase("field"))
    add_finding(log, 8, 1, "confirmed", (14.0, 9.01, 1.7), covariance_m2=1e-4 * np.eye(3), confirmed_s=0.5)
    report = make_report(log, 0.0)
    findings = tuple(finding.model_copy(update={"sites": ()}) for finding in report.findings)
    (row,) = closing_card(report.model_copy(update={"findings": findings})).rows
    assert row.where.startswith("at (14.00, 9.01) m, 95 % within 0.0")
