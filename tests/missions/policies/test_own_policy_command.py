"""User policies on the command line: exit status, messages and files."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from pdpatrol.missions.record.mission_log import MissionLog

pytestmark = pytest.mark.whole

PDPATROL = str(Path(sys.executable).with_name("pdpatrol"))

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


def pdpatrol(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    (folder / "my.py").write_text(POLICIES, encoding="utf-8")
    return subprocess.run([PDPATROL, "run", *arguments], cwd=folder, capture_output=True, text=True, timeout=120)


def test_run_with_failing_policy_writes_all_files(tmp_path: Path) -> None:
    done = pdpatrol(tmp_path, "--policy", "my.py:Fails", "--out", "here", "--json")
    assert done.returncode == 1
    lines = [line for line in done.stderr.splitlines() if not re.match(r" *\d+\.\d s  |$", line)]
    action = "an action of 2 finite numbers in [-1, 1], or None to end the mission"
    assert lines == [f"my.py:8: ValueError: out of ideas; expected {action}"]
    folder = tmp_path / "here"
    assert {path.name for path in folder.iterdir()} == {"log.npz", "report.json", "report.html", "mission.rrd"}
    assert MissionLog.load(folder).n_rows("step") == 19
    assert json.loads((folder / "report.json").read_text(encoding="utf-8")) == json.loads(done.stdout)


@pytest.mark.parametrize(
    ("policy", "message"),
    [
        ("my.py:FailsAtOnce", "my.py:13: KeyError: 'weights'; "),
        ("none.py:MyPolicy", "none.py: no such file; "),
        ("broken.py:MyPolicy", "broken.py:2: SyntaxError: '(' was never closed; "),
        (
            "magic",
            "magic: must be my_file.py:Name or package.module:Name; expected seek, active, patrol, random, oracle, or",
        ),
    ],
)
def test_run_with_invalid_policy_writes_nothing(policy: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "broken.py").write_text("x = 1\ny = (\n", encoding="utf-8")
    done = pdpatrol(tmp_path, "--policy", policy)
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith(message)
    assert {path.name for path in tmp_path.iterdir()} == {"my.py", "broken.py"}
