"""The examples of a user's array, estimator, policy and robot do what their READMEs state."""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dirmusic import ArrayModel, ElementSpread, GainManifold, PulseBatch, read_pattern
from dirmusic.angles import difference
from pdpatrol.envs import load_scenario
from pdpatrol.envs.scenario.robot import RobotConfig
from pdpatrol.envs.user_code import make_estimator
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.runner import run_mission

pytestmark = pytest.mark.whole

EXAMPLES = Path(__file__).parents[2] / "examples"
PDPATROL = str(Path(sys.executable).with_name("pdpatrol"))


def run(arguments: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([PDPATROL, *arguments], cwd=folder, capture_output=True, text=True, timeout=300)


@pytest.mark.parametrize("example", ["own_array", "own_estimator", "own_policy", "own_robot"])
def test_readme_commands_find_the_discharge(example: str, tmp_path: Path) -> None:
    """The last command is a mission; its robot collides with nothing and skips no waypoint."""
    (tmp_path / "examples").symlink_to(EXAMPLES)
    readme = (EXAMPLES / example / "README.md").read_text(encoding="utf-8")
    for command in re.findall(r"^uv run pdpatrol (.*)$", readme, flags=re.MULTILINE):
        done = run(command.split(), tmp_path)
        assert done.returncode == 0, done.stderr
    (file,) = (tmp_path / "runs").glob("*/report.json")
    report: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    assert report["evaluation"]["sources"][0]["found"]
    assert report["collisions"] == 0


@pytest.mark.parametrize(
    "file", [file for file in EXAMPLES.glob("own_*/*.*") if file.suffix != ".md"], ids=lambda file: file.name
)
def test_file_has_at_most_60_lines(file: Path) -> None:
    assert len(file.read_text(encoding="utf-8").splitlines()) <= 60


def half_power_width(path: Path) -> float:
    """Compute the full width at half power, radians."""
    off_rad = np.linspace(0.0, np.pi / 2, 2001)
    gain = read_pattern(path).gain_and_slope(off_rad)[0]
    return float(2.0 * np.interp(-np.sqrt(0.5), -gain / gain[0], off_rad))


def test_measured_beam_is_wider_than_data_sheet() -> None:
    stated, measured = (half_power_width(EXAMPLES / "own_array" / name) for name in ("helix.csv", "helix_measured.csv"))
    assert measured / stated == pytest.approx(13 / 12, abs=0.02)


@pytest.mark.slow
def test_wrong_data_sheet_is_named_and_hardly_moves_the_finding() -> None:
    """The beams of `yard.toml` are wider by a twelfth than its data sheet says."""
    scenario = load_scenario(EXAMPLES / "own_array" / "yard.toml")
    for seed in (0, 1):
        report = make_report(run_mission(scenario, "seek", seed), 0.0)
        assert report.scores.matches[0].error_m < 0.2
        assert report.array is not None
        assert any("wider than that of the data sheet" in text for text in report.array.contradictions)


@pytest.mark.parametrize("noise_v", [0.002, 0.01, 0.05])
def test_own_estimator_states_its_deviation(noise_v: float) -> None:
    method = load_scenario(EXAMPLES / "own_estimator" / "yard.toml").estimator.method
    array = ArrayModel(manifold=GainManifold.ring(6), positions_m=np.zeros((6, 3)), spread=ElementSpread())
    azimuth_rad = np.radians(np.arange(-179.5, 180.0, 0.5))
    gain = array.manifold.gain(azimuth_rad).T
    drawn_v = gain + noise_v * np.random.default_rng(0).standard_normal(gain.shape)
    pulses = PulseBatch.detected(np.zeros(azimuth_rad.size), np.maximum(drawn_v, 0.0), np.full(gain.shape, noise_v**2))
    found = make_estimator(method, array)(pulses, array)
    share = difference(found.azimuth_rad, azimuth_rad) / found.std_rad
    assert 0.7 < np.sqrt(np.square(share).mean()) < 1.3


def test_policy_circles_finding_and_returns_to_route() -> None:
    log = run_mission(load_scenario("one_source"), f"{EXAMPLES}/own_policy/my_policy.py:guarded", seed=1)
    phases, steps, states = log.column("step", "phase"), log.column("finding", "step"), log.column("finding", "state")
    circling = phases == "circle"
    assert circling[steps[states == "confirmed"][0] + 1 :].sum() > 50
    assert phases[-1] == "return to dock"
    away_m = log.column("step", "pose")[circling][:, :2] - log.column("finding", "position_m")[-1][:2]
    assert np.abs(np.diff(np.unwrap(np.arctan2(away_m[:, 1], away_m[:, 0])))).sum() > np.pi


def test_own_robot_is_home_sooner_than_the_inspector() -> None:
    scenario = load_scenario(EXAMPLES / "own_robot" / "yard.toml")
    inspector = scenario.model_copy(update={"robot": RobotConfig()})
    report, usual = (make_report(run_mission(each, "seek", seed=0), 0.0) for each in (scenario, inspector))
    for one in (report, usual):
        assert one.collisions == 0
        assert len(one.findings) == 1
        assert one.scores.matches[0].error_m < 0.3
    assert report.sim_time_s < 0.9 * usual.sim_time_s
