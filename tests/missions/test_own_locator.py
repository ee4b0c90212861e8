"""Locators from user code."""

from pathlib import Path

import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.envs.user_code import UserCodeError
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.runner import Mission, run_mission
from tests.envs.helpers import write_yard

GOOD = """\
import numpy as np
from dirmusic import Finding


class Mine:
    def __init__(self, array, pose_error, *, fence_m, rules, sight):
        self.findings, self.n = (), 0

    def update(self, time_s, pose, pulses):
        self.n += pulses.n_pulses
        if self.n >= 20 and not self.findings:
            self.findings = (
                Finding(
                    id=7, state="confirmed", position_m=np.append(pose[:2] + 1.0, 1.5), covariance_m2=np.eye(3),
                    existence=0.97, n_bearings=self.n, first_detected_s=0.0, last_detected_s=0.0, confirmed_s=time_s,
                    aperture_rad=1.0, nearest_m=1.0, level_db=0.0,
                ),
            )
        return self.findings

    def refit(self, time_s):
        return self.findings

    def association(self):
        return np.full(self.n, 7 if self.findings else 0)
"""


def scenario_with(folder: Path, code: str, table: str = 'locator = "mine.py:Mine"') -> Path:
    """Write a scenario that names a Locator in the same folder."""
    (folder / "mine.py").write_text(code, encoding="utf-8")
    return write_yard(folder, f"[locating]\n{table}")


def mission_log(folder: Path, code: str, table: str = 'locator = "mine.py:Mine"') -> MissionLog:
    scenario = load_scenario(scenario_with(folder, code, table), {"task.time_limit_s": 15.0})
    return run_mission(scenario, "patrol", seed=1)


def test_own_locator_makes_findings_and_association(tmp_path: Path) -> None:
    log = mission_log(tmp_path, GOOD)
    (finding,) = make_report(log, 0.0).findings
    assert finding.id == 7
    assert finding.discharge is not None
    assert set(log.column("association", "finding").tolist()) == {7}
    assert log.n_rows("association") == log.n_rows("bearing") > 20


@pytest.mark.whole
def test_subclass_of_locator_finds_the_same(tmp_path: Path) -> None:
    derived = "from dirmusic import Locator\n\n\nclass Mine(Locator):\n    pass\n"
    own, usual = (mission_log(tmp_path, derived, table) for table in ('locator = "mine.py:Mine"', ""))
    assert own.n_rows("finding") == usual.n_rows("finding") > 0
    assert make_report(own, 0.0).candidates == make_report(usual, 0.0).candidates


def test_own_locator_gets_rules_of_the_scenario(tmp_path: Path) -> None:
    code = GOOD.replace("self.findings, self.n = (), 0", "raise ValueError(f'merge {rules.merge_m}, fence {fence_m}')")
    table = 'locator = "mine.py:Mine"\nmerge_m = 3.5'
    with pytest.raises(UserCodeError, match=r"mine\.py:7: ValueError: merge 3\.5, fence \(40\.0, 30\.0\)"):
        Mission(load_scenario(scenario_with(tmp_path, code, table)), "patrol", 0)


@pytest.mark.parametrize(
    ("there", "instead", "message"),
    [
        ("return self.findings\n\n    def refit", "return list(self.findings)\n\n    def refit", "mine.py:5: gave []"),
        ("self.n += pulses.n_pulses", "self.n += pulses.n_pulse", "mine.py:10: AttributeError"),
        (
            "position_m=np.append(pose[:2] + 1.0, 1.5)",
            "position_m=np.append(pose[:2], np.nan)",
            "finding 7: `position_m` must be finite",
        ),
        ("id=7", "id=0", "`id` must be at least 1, got 0"),
        ("id=7", "id=-1", "`id` must be at least 1, got -1"),
        ("existence=0.97", "existence=97.0", "finding 7: `existence` must be a probability, got 97.0"),
        ("            )\n        return", "            ) * 2\n        return", "gave (Finding(id=7"),
        ("np.full(self.n,", "np.full(3,", "association gave int64 of shape (3,)"),
        ("np.full(self.n, 7", "np.full(self.n, 9", ", array([9, 9"),
        ("np.full(self.n,", "1.0 * np.full(self.n,", "association gave float64"),
    ],
)
def test_failing_locator_ends_mission_with_complete_log(there: str, instead: str, message: str, tmp_path: Path) -> None:
    assert there in GOOD
    log = mission_log(tmp_path, GOOD.replace(there, instead))
    kinds, texts = log.column("event", "kind").tolist(), log.column("event", "text").tolist()
    assert (kinds[-2:], texts[-1]) == (["error", "end"], "mission over: error")
    assert message in texts[-2]
    assert kinds.count("error") == 1
    assert make_report(log, 0.0).sim_time_s > 0


def test_invalid_locator_is_refused_before_the_start(tmp_path: Path) -> None:
    for code, message in (
        (GOOD.replace("def association", "def associate"), r"mine\.py:5: has no association"),
        (GOOD.replace("class Mine", "class Yours"), r"must define `Mine`, defines Yours"),
        (GOOD.replace("fence_m, rules", "rules"), r"mine\.py:5: TypeError.*fence_m"),
    ):
        with pytest.raises(UserCodeError, match=message):
            Mission(load_scenario(scenario_with(tmp_path, code)), "patrol", 0)
    unnamed = load_scenario(scenario_with(tmp_path, GOOD, 'locator = "Mine"'))
    with pytest.raises(UserCodeError, match=r"Mine: must be my_file\.py:Name or package\.module:Name"):
        Mission(unnamed, "patrol", 0)
