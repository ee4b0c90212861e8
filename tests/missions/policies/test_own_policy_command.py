"""User policies on the command line: exit status, messages and files."""

import json
import re
from pathlib import Path

import pytest

from pdpatrol.missions.record.mission_log import MissionLog
from tests.missions.conftest import Refused
from tests.processes import pdpatrol

pytestmark = pytest.mark.whole

POLICIES = """\
class Fails:
    n_calls = 0
    def __init__(self, rng):
        pass
    def __call__(self, observation, findings, site_map):
        self.n_calls += 1
        if self.n_calls == 20:
            raise ValueError("out of\\nideas")
        return 0.5, 0.1

class FailsAtOnce:
    def __init__(self, rng):
        raise KeyError("weights")
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "my.py").write_text(POLICIES, encoding="utf-8")
    return tmp_path


def test_run_with_failing_policy_writes_all_files(folder: Path) -> None:
    done = pdpatrol("run", "--policy", "my.py:Fails", "--out", "here", "--json", cwd=folder)
    assert done.returncode == 1
    lines = [line for line in done.stderr.splitlines() if not re.match(r" *\d+\.\d s  |$", line)]
    action = "an action of 2 finite numbers in [-1, 1], or None to end the mission"
    assert lines == [f"my.py:8: ValueError: out of ideas; expected {action}"]
    here = folder / "here"
    assert {path.name for path in here.iterdir()} == {"log.npz", "report.json", "report.html", "mission.rrd"}
    assert MissionLog.load(here).n_rows("step") == 19
    assert json.loads((here / "report.json").read_text(encoding="utf-8")) == json.loads(done.stdout)


def test_run_with_invalid_policy_writes_nothing(folder: Path, refused: Refused) -> None:
    (line,) = refused("run", "--policy", "my.py:FailsAtOnce", cwd=folder)
    assert line.startswith("my.py:13: KeyError: 'weights'; ")
    assert {path.name for path in folder.iterdir()} - {"__pycache__"} == {"my.py"}
