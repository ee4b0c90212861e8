"""The training example runs, a short training already improves the policy, and a mission can be driven by it."""

import json
import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.test_readme import blocks, served_on_loopback

pytestmark = [
    pytest.mark.whole,
    pytest.mark.skipif(find_spec("stable_baselines3") is None, reason="the extra `rl` is not installed"),
]

SCRIPT = Path(__file__).parents[2] / "examples" / "learning" / "train.py"
README = SCRIPT.with_name("README.md").read_text(encoding="utf-8")
SHORT = " --steps 8192 --yards 20"
"""Options that make the training short."""
FILES = {"model.zip", "learning_curve.json", "learning.png"}


@pytest.mark.parametrize(
    ("steps", "margin"), [(8192, -1.0), pytest.param(65536, 0.3, marks=pytest.mark.slow)]
)  # fmt: skip
def test_training_example_learns_and_writes_its_files(steps: int, margin: float, tmp_path: Path) -> None:
    words = [sys.executable, str(SCRIPT), "--steps", str(steps), "--yards", "20", "--out", "out"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert {path.name for path in (tmp_path / "out").iterdir()} == FILES
    policies = json.loads((tmp_path / "out" / "learning_curve.json").read_text(encoding="utf-8"))["policies"]
    assert policies["towards last bearing"]["reached"] == 20
    assert policies["PPO"]["success"] > policies["random"]["success"] + margin


@pytest.mark.slow
def test_commands_of_the_readme_train_run_watch_and_compare(tmp_path: Path) -> None:
    (tmp_path / "examples").symlink_to(SCRIPT.parents[1])
    environment = os.environ | {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    for line in [line for block in blocks("sh", README) for line in block.splitlines()]:
        command = re.sub(r"^uv run (--extra rl )?", "", line)
        if "replay" in command:
            served_on_loopback(command.split(), tmp_path, environment)
            continue
        words = (command + SHORT * command.endswith("train.py")).split()
        done = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=900)
        assert done.returncode == 0, f"{line}: {done.stderr}"
    assert (tmp_path / "runs" / "trained" / "report.html").is_file()
