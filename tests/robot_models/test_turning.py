"""Turning test on the floor: robots that skid, and servos that are unstable, are distinguished."""

import re
from pathlib import Path

import pytest

from dirmusic.input_file import InputFileError
from pdpatrol.envs.plausibility import plausibility
from pdpatrol.envs.scenario import load_scenario
from pdpatrol.robot_models.description.robot_file import load_robot
from pdpatrol.robot_models.turning import turning_doubt
from tests.robot_models.one_robot import Edited, OneRobot

RUNNER = Path(__file__).parents[2] / "examples" / "own_robot" / "runner.xml"


def test_shipped_and_example_robots_turn_as_commanded(shipped: OneRobot) -> None:
    assert turning_doubt(shipped.robot) is None
    assert turning_doubt(load_robot(RUNNER)) is None


def test_skidding_robot_is_one_line_that_names_the_remedies(edited: Edited) -> None:
    """Without gyro and with rigid friction, the crawler reaches little more than half of the commanded yaw rate."""
    rigid, free = ('impratio="0.003"', 'impratio="1"'), ('"yaw_rate_gain" data="3"', '"yaw_rate_gain" data="0"')
    path = edited(rigid, free)
    line = turning_doubt(load_robot(path))
    assert line is not None
    assert f"robot.model: {path}: {line}" in plausibility(load_scenario("one_source", {"robot.model": str(path)}))
    reached, commanded = map(float, re.findall(r"([\d.]+) of ([\d.]+)", line)[0])
    assert 0.0 < reached < 0.7 * commanded
    assert all(remedy in line for remedy in ("yaw_rate_gain", "friction", "impratio"))


def test_unstable_servo_is_not_called_slow(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    text = RUNNER.read_text(encoding="utf-8").replace('armature="0.02"', "")
    assert "<dcmotor name" in text
    path.write_text(text.replace("<dcmotor name", '<velocity kv="100" name'), encoding="utf-8")
    with pytest.raises(InputFileError, match="the servos of the wheels must be stable") as refused:
        load_robot(path)
    assert len(refused.value.faults) == 1
