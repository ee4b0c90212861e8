"""Status text, phases and outcome of a recording."""

from pathlib import Path

import numpy as np

from pdpatrol.envs import load_scenario
from pdpatrol.missions.record.events import Phase
from pdpatrol.missions.record.mission_log import MissionLog
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


def add_candidate(log: MissionLog, step: int, number: int = 3, state: str = "candidate") -> None:
    uncertain = {"covariance_m2": np.diag([0.8, 0.04, 0.09]), "aperture_rad": np.radians(20.0)}
    add_finding(log, step, number, state, (18.0, 5.0, 1.5), **uncertain)


def status_texts(log: MissionLog, folder: Path) -> dict[int | None, str]:
    return {step: text for step, (text,) in recorded(log, folder)["mission/status"]["text"].items()}


def test_status_states_phase_and_candidates(tmp_path: Path) -> None:
    log = log_of(Phase("seek", 3), Phase("listen"))
    add_candidate(log, 4)
    text = status_texts(log, tmp_path)[4]
    assert "### Approaches candidate 3" in text
    assert "| **candidate 3** | 18.0, 5.0 | 1.5 m | 2.19 m | 20° |" in text


def test_status_lists_no_ghosts(tmp_path: Path) -> None:
    log = log_of(Phase("patrol", 1), Phase("listen"))
    add_candidate(log, 1)
    add_candidate(log, 1, 4, "confirmed")
    add_candidate(log, 5, state="ghost")
    add_candidate(log, 5, 4, "confirmed")
    texts = status_texts(log, tmp_path)
    assert "candidate 3" in texts[4]
    assert "candidate 3" not in texts[9]
    assert "**finding 4**" in texts[9]


def test_outcome_states_site_and_kind(tmp_path: Path) -> None:
    log = log_of(Phase("return to dock"))
    site, place_m = next(iter(log.meta["sites"].items()))
    add_finding(log, 8, 3, "confirmed", place_m, covariance_m2=1e-4 * np.eye(3), confirmed_s=0.5)
    log.append("event", step=9, kind="end", number=0, subject="docked", text="mission over: docked")
    drawn = recorded(log, tmp_path)
    (text,) = drawn["mission/status"]["text"][9]
    assert "### Mission over after 1 s: docked" in text
    assert site.replace("_", "\\_") in text
    assert drawn["world/findings/3/label"]["labels"][9][0].startswith(f"finding 3: {site}")
