"""The example of a user's policy."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.missions.runner import run_mission

pytestmark = pytest.mark.whole

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "examples" / "own_policy"
README = (FOLDER / "README.md").read_text(encoding="utf-8")
PDPATROL = str(Path(sys.executable).with_name("pdpatrol"))


def test_readme_command_finds_the_discharge(tmp_path: Path) -> None:
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    command = re.findall(r"^uv run pdpatrol (.*)$", README, flags=re.MULTILINE)[0]
    done = subprocess.run([PDPATROL, *command.split()], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    (folder,) = (tmp_path / "runs").iterdir()
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert report["policy"] == "examples/own_policy/my_policy.py:guarded"
    assert report["evaluation"]["sources"][0]["found"]
    assert report["collisions"] == 0
    assert report["waypoints"]["missed"] == []


def test_policy_circles_finding_and_returns_to_route() -> None:
    log = run_mission(load_scenario("one_source"), f"{FOLDER}/my_policy.py:guarded", seed=1)
    phases, steps, states = log.column("step", "phase"), log.column("finding", "step"), log.column("finding", "state")
    fixed = steps[states == "confirmed"][0]
    assert (phases[fixed + 1 :] == "circle").sum() > 50
    assert phases[-1] == "return to dock"
    circling = phases == "circle"
    centre_m = log.column("finding", "position_m")[-1]
    aspects = log.column("step", "pose")[circling][:, :2] - centre_m[:2]
    turned = np.abs(np.diff(np.unwrap(np.arctan2(aspects[:, 1], aspects[:, 0])))).sum()
    assert turned > np.pi


def test_example_is_short() -> None:
    for path in FOLDER.glob("*.py"):
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 60, path.name
