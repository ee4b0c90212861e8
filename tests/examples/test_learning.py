"""The training example runs, and a short training already improves the policy."""

import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

pytestmark = [
    pytest.mark.whole,
    pytest.mark.skipif(find_spec("stable_baselines3") is None, reason="the extra `rl` is not installed"),
]

SCRIPT = Path(__file__).parents[2] / "examples" / "learning" / "train.py"
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
