"""A Locator of one's own makes the findings; what is wrong with it is one line that names file and line."""

from pathlib import Path

import pytest

from envs import Scenario, load_scenario
from envs.foreign_code import ForeignCodeError
from envs.scenario import SHIPPED
from missions.record.report import make_report
from missions.runner import run_mission

CODE = """\
from dirmusic import Locator


class Mine(Locator):
    calls = 0

    def update(self, time_s, pose, pulses):
        Mine.calls += 1
        return super().update(time_s, pose, pulses)
"""


def scenario_with(folder: Path, code: str, time_limit_s: float = 15.0) -> Scenario:
    (folder / "mine.py").write_text(code, encoding="utf-8")
    text = (SHIPPED / "bench.toml").read_text(encoding="utf-8").replace("3600.0", str(time_limit_s))
    (folder / "yard.toml").write_text(f'{text}\n[locating]\nlocator = "mine.py:Mine"\n', encoding="utf-8")
    return load_scenario(folder / "yard.toml")


def test_an_own_locator_makes_the_findings_of_a_mission(tmp_path: Path) -> None:
    own, usual = (
        run_mission(scenario, "patrol", 1)
        for scenario in (scenario_with(tmp_path, CODE), limited(load_scenario("bench"), 15.0))
    )
    assert own.n_rows("finding") == usual.n_rows("finding") > 0
    assert make_report(own, 0.0)["candidates"] == make_report(usual, 0.0)["candidates"]


def limited(scenario: Scenario, time_limit_s: float) -> Scenario:
    return scenario.model_copy(update={"task": scenario.task.model_copy(update={"time_limit_s": time_limit_s})})


@pytest.mark.parametrize(
    ("broken", "named"),
    [
        ("        return 'nothing'", "expected a tuple of dirmusic.Finding"),
        ("        raise KeyError('lost')", "mine.py:9: KeyError: 'lost'"),
        ("        return tuple(1 for _ in range(2))", "expected a tuple of dirmusic.Finding"),
    ],
)
def test_a_locator_that_fails_ends_a_mission_whose_log_is_whole(broken: str, named: str, tmp_path: Path) -> None:
    code = CODE.replace("        return super().update(time_s, pose, pulses)", broken)
    log = run_mission(scenario_with(tmp_path, code), "patrol", 1)
    assert log.column("event", "kind").tolist()[-2:] == ["error", "end"]
    assert named in log.column("event", "text")[-2]
    assert "mine.py" in log.column("event", "text")[-2]


def test_a_locator_that_cannot_be_made_is_refused_before_the_start(tmp_path: Path) -> None:
    code = CODE.replace("    calls = 0", "    def __init__(self, array):\n        pass")
    with pytest.raises(ForeignCodeError, match=r"mine\.py"):
        run_mission(scenario_with(tmp_path, code), "patrol", 1)
