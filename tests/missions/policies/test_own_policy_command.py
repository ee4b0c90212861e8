"""User policies on the command line: exit status, messages and files."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from pdpatrol.envs.scenario import SHIPPED
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

class NotANumber(Fails):
    def __call__(self, observation, findings, site_map):
        return [0.1, float("nan")]

class Still(Fails):
    def __call__(self, observation, findings, site_map):
        return 0, 0

class FailsAtOnce:
    def __init__(self, rng):
        raise KeyError("weights")
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "my.py"
    path.write_text(POLICIES, encoding="utf-8")
    return path


def pdpatrol(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([PDPATROL, *arguments], cwd=cwd, capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize(
    ("name", "told", "n_steps"),
    [
        ("Fails", "my.py:8: ValueError: out of ideas; ", 19),
        ("NotANumber", "my.py:11: returned [0.1, nan]; ", 0),
    ],
)
def test_run_with_failing_policy_writes_all_files(name: str, told: str, n_steps: int, file: Path) -> None:
    done = pdpatrol("run", "--policy", f"my.py:{name}", "--out", "here", "--json", cwd=file.parent)
    assert done.returncode == 1
    told += "expected an action of 2 finite numbers in [-1, 1], or None to end the mission"
    assert without_news(done.stderr) == [told]
    report = whole_report(file.parent / "here", n_steps)
    assert report == json.loads(done.stdout)
    assert report["policy"] == f"my.py:{name}"


def whole_report(folder: Path, n_steps: int) -> dict:
    """Check the files of a mission and return its report."""
    assert {path.name for path in folder.iterdir()} == {"log.npz", "report.json", "report.html", "mission.rrd"}
    assert MissionLog.load(folder).n_rows("step") == n_steps
    verify = [sys.executable, "-m", "rerun", "rrd", "verify", str(folder / "mission.rrd")]
    assert subprocess.run(verify, capture_output=True, timeout=60).returncode == 0
    return json.loads((folder / "report.json").read_text(encoding="utf-8"))


def without_news(stderr: str) -> list[str]:
    """Return the lines that are not news of candidates."""
    return [line for line in stderr.splitlines() if not re.match(r" *\d+\.\d s  (candidate|outside|ghost)", line)]


def test_run_with_motionless_policy_ends_at_time_limit(file: Path) -> None:
    shipped = (SHIPPED / "one_source.toml").read_text(encoding="utf-8")
    (file.parent / "short.toml").write_text(f"{shipped}\n[task]\ntime_limit_s = 4.0\n", encoding="utf-8")
    done = pdpatrol("run", "short.toml", "--policy", "my.py:Still", "--out", "here", cwd=file.parent)
    assert (done.returncode, without_news(done.stderr)) == (0, [])
    assert "time limit after 4 s simulated" in done.stdout
    report = whole_report(file.parent / "here", 40)
    assert report["distance_m"] < 0.01
    assert report["waypoints"]["missed"] == [1, 2, 3, 4, 5, 6, 7, 8]


@pytest.mark.parametrize(
    ("policy", "told"),
    [
        ("my.py:FailsAtOnce", "my.py:21: KeyError: 'weights'; "),
        ("none.py:MyPolicy", "none.py: no such file; "),
        ("broken.py:MyPolicy", "broken.py:2: SyntaxError: '(' was never closed; "),
        ("magic", "magic: no such policy; expected seek, active, patrol, random, oracle, or my_file.py:MyPolicy"),
    ],
)
def test_run_with_invalid_policy_writes_nothing(policy: str, told: str, file: Path) -> None:
    (file.parent / "broken.py").write_text("x = 1\ny = (\n", encoding="utf-8")
    done = pdpatrol("run", "--policy", policy, cwd=file.parent)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith(told)
    assert len(done.stderr.splitlines()) == 1
    assert {path.name for path in file.parent.iterdir()} == {"my.py", "broken.py"}


def test_help_mentions_own_policies(tmp_path: Path) -> None:
    told = " ".join(pdpatrol("run", "--help", cwd=tmp_path).stdout.replace("│", " ").split())
    assert "my_policy.py:MyPolicy" in told
    assert "pdpatrol.missions.policies.protocol.Policy" in told
