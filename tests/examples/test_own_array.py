"""The example of a user-defined array does what its README states."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from dirmusic import read_pattern
from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.runner import run_mission

pytestmark = pytest.mark.whole

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "examples" / "own_array"
README = (FOLDER / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("file", ["yard.toml", "helix.csv", "helix_measured.csv"])
def test_files_have_at_most_60_lines(file: str) -> None:
    assert len((FOLDER / file).read_text(encoding="utf-8").splitlines()) <= 60


def test_commands_of_readme_find_the_discharge(tmp_path: Path) -> None:
    commands = re.findall(r"^uv run pdpatrol (.*)$", README, flags=re.MULTILINE)
    assert len(commands) == 2
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    pdpatrol = str(Path(sys.executable).with_name("pdpatrol"))
    for command in commands:
        done = subprocess.run([pdpatrol, *command.split()], cwd=tmp_path, capture_output=True, text=True, timeout=180)
        assert done.returncode == 0, done.stderr
    report = json.loads((tmp_path / "runs" / "yard-0" / "report.json").read_text(encoding="utf-8"))
    assert report["evaluation"]["sources"][0]["found"]
    assert report["collisions"] == 0


def test_measured_beam_is_wider_than_data_sheet() -> None:
    widths_deg = [np.degrees(half_power_width(FOLDER / name)) for name in ("helix.csv", "helix_measured.csv")]
    assert widths_deg[1] / widths_deg[0] == pytest.approx(13 / 12, abs=0.02)


def half_power_width(path: Path) -> float:
    """Compute the full width at half power, radians."""
    pattern = read_pattern(path)
    off_rad = np.linspace(0.0, np.pi / 2, 2001)
    gain = pattern.gain_and_slope(off_rad)[0]
    return float(2.0 * np.interp(-np.sqrt(0.5), -gain / gain[0], off_rad))


@pytest.mark.slow
def test_wrong_data_sheet_increases_position_error() -> None:
    scenario = load_scenario(FOLDER / "yard.toml")
    array = scenario.model_dump() | {"array": scenario.array.model_dump() | {"true_pattern": None}}
    as_in_data_sheet = Scenario.model_validate(array)
    errors_m = [
        [make_report(run_mission(each, "seek", seed), 0.0).scores.matches[0].error_m for seed in (0, 1)]
        for each in (as_in_data_sheet, scenario)
    ]
    assert min(errors_m[1]) > 1.5 * max(errors_m[0])
