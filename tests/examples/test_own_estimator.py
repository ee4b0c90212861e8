"""The example of a user-written estimator does what its README states."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from dirmusic import ArrayModel, ElementSpread, GainManifold, PulseBatch
from dirmusic.angles import difference
from pdpatrol.envs import load_scenario
from pdpatrol.envs.user_code import make_estimator

pytestmark = pytest.mark.whole

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "examples" / "own_estimator"
README = (FOLDER / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("file", ["vector_sum.py", "yard.toml"])
def test_files_have_at_most_60_lines(file: str) -> None:
    assert len((FOLDER / file).read_text(encoding="utf-8").splitlines()) <= 60


def test_command_of_readme_finds_the_discharge(tmp_path: Path) -> None:
    (command,) = re.findall(r"^uv run pdpatrol (.*)$", README, flags=re.MULTILINE)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    pdpatrol = str(Path(sys.executable).with_name("pdpatrol"))
    done = subprocess.run([pdpatrol, *command.split()], cwd=tmp_path, capture_output=True, text=True, timeout=180)
    assert done.returncode == 0, done.stderr
    report = json.loads((tmp_path / "runs" / "yard-0" / "report.json").read_text(encoding="utf-8"))
    assert report["evaluation"]["sources"][0]["found"]


@pytest.mark.parametrize("noise_v", [0.002, 0.01, 0.05])
def test_own_estimator_states_its_deviation(noise_v: float) -> None:
    method = load_scenario(FOLDER / "yard.toml").estimator.method
    array = ArrayModel(manifold=GainManifold.ring(6), positions_m=np.zeros((6, 3)), spread=ElementSpread())
    azimuth_rad = np.radians(np.arange(-179.5, 180.0, 0.5))
    gain = array.manifold.gain(azimuth_rad).T
    drawn_v = gain + noise_v * np.random.default_rng(0).standard_normal(gain.shape)
    pulses = PulseBatch.detected(np.zeros(azimuth_rad.size), np.maximum(drawn_v, 0.0), np.full(gain.shape, noise_v**2))
    found = make_estimator(method, array)(pulses, array)
    share = difference(found.azimuth_rad, azimuth_rad) / found.std_rad
    assert 0.7 < np.sqrt(np.square(share).mean()) < 1.3
