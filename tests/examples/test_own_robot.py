"""The example of a user's robot does what its README says."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.envs.scenario.robot import RobotConfig
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.records import read_report
from pdpatrol.missions.runner import run_mission

pytestmark = pytest.mark.whole

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "examples" / "own_robot"
README = (FOLDER / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("file", ["runner.xml", "yard.toml"])
def test_files_have_at_most_sixty_lines(file: str) -> None:
    assert len((FOLDER / file).read_text(encoding="utf-8").splitlines()) <= 60


def test_readme_commands_find_the_source_sooner(tmp_path: Path) -> None:
    """The robot finds the source without collisions and is home sooner than the inspector."""
    commands = re.findall(r"^uv run pdpatrol (.*)$", README, flags=re.MULTILINE)
    assert len(commands) == 2
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    pdpatrol = str(Path(sys.executable).with_name("pdpatrol"))
    for command in commands:
        done = subprocess.run([pdpatrol, *command.split()], cwd=tmp_path, capture_output=True, text=True, timeout=180)
        assert done.returncode == 0, done.stderr
    report = read_report((tmp_path / "runs" / "yard-0" / "report.json").read_text(encoding="utf-8"))
    inspector = load_scenario(FOLDER / "yard.toml").model_copy(update={"robot": RobotConfig()})
    usual = make_report(run_mission(inspector, "seek", seed=0), 0.0)
    for one in (report, usual):
        assert one.collisions == 0
        assert len(one.findings) == 1
        assert one.scores.matches[0].error_m < 0.3
    assert report.sim_time_s < 0.9 * usual.sim_time_s


def test_errors_in_the_file_are_reported_before_the_start(tmp_path: Path) -> None:
    text = (FOLDER / "runner.xml").read_text(encoding="utf-8")
    broken = text.replace('"left_wheel"', '"wheel"').replace('"max_speed" data="1.2"', '"max_speed" data="-1"')
    (tmp_path / "runner.xml").write_text(broken, encoding="utf-8")
    (tmp_path / "yard.toml").write_text((FOLDER / "yard.toml").read_text(encoding="utf-8"), encoding="utf-8")
    pdpatrol = str(Path(sys.executable).with_name("pdpatrol"))
    done = subprocess.run([pdpatrol, "run", "yard.toml"], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert done.stdout == ""
    printed = done.stderr.replace("\n", " ")
    assert "Traceback" not in printed
    for error in ("wheels: must be hinges with names that begin with", "max_speed: must be one number above 0, got -1"):
        assert f"yard.toml: robot.model: {tmp_path / 'runner.xml'}: {error}" in printed
    assert sorted(path.name for path in tmp_path.iterdir()) == ["runner.xml", "yard.toml"]
