"""Robots from files: what is read of them, and that a faulty one is refused line by line."""

from pathlib import Path

import numpy as np
import pytest

from pdpatrol.robot_models.description.library import SHIPPED, load_robot, xml_path
from pdpatrol.robot_models.description.robot_description import RobotFileError
from pdpatrol.robot_models.description.robot_file import read_robot
from tests.robot_models.one_robot import Edited, OneRobot

HOME = '<key name="home" qpos="0 0 -7.5437e-05 1 0 0 0 0 0 0 0"/>'
SHORT = (
    ('name="chassis" class="hull" type="box" size="0.325', 'name="chassis" class="hull" type="box" size="0.28'),
    ('pos="0.19 ', 'pos="0.15 '),
    ('pos="-0.19 ', 'pos="-0.15 '),
    ('"max_speed" data="0.8"', '"max_speed" data="0.5"'),
)
"""Changes that make a shorter, slower crawler."""


@pytest.mark.parametrize("name", SHIPPED)
def test_the_record_of_a_shipped_robot_is_what_is_measured_of_its_file(name: str) -> None:
    kept, measured = load_robot(name), read_robot(xml_path(name))
    assert kept.wheels == measured.wheels
    numbers = [field for field in vars(kept) if field not in ("name", "xml_path", "wheels")]
    for field in numbers:
        np.testing.assert_allclose(getattr(kept, field), getattr(measured, field), rtol=1e-9, atol=1e-12, err_msg=field)


def test_a_users_robot_is_measured_from_its_file_and_drives_as_fast_as_that_says(edited: Edited) -> None:
    own = OneRobot(edited(*SHORT))
    assert own.robot.name == "robot"
    assert own.robot.max_speed_mps == 0.5
    assert own.robot.footprint_radius_m == pytest.approx(np.hypot(0.28, 0.225), abs=1e-4)
    assert own.robot.turning_track_m == pytest.approx(0.37 + 4 * 0.15**2 / 0.37)
    own.drive_on(0.8, 0.0, 2.0)
    assert own.velocity()[0] == pytest.approx(0.5, rel=0.01)
    own.drive_on(0.2, 0.7, 3.0)
    np.testing.assert_allclose(own.velocity(), [0.2, 0.7], rtol=0.03)


def test_a_robot_without_a_keyframe_is_let_come_to_rest(edited: Edited) -> None:
    own = OneRobot(edited((HOME, "")))
    np.testing.assert_allclose(own.robot.home_qpos, load_robot("crawler").home_qpos, atol=1e-6)
    own.reset(7.0, 6.0, 1.0)
    own.drive_on(0.0, 0.0, 2.0)
    np.testing.assert_allclose(own.pose(), [7.0, 6.0, 1.0], atol=1e-5)


def test_actions_and_commands_are_each_others_inverse_and_actions_end_at_the_limits() -> None:
    robot = load_robot("crawler")
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 3, 2)).astype(np.float32)
    np.testing.assert_allclose(robot.action_from_command(robot.command_from_action(actions)), actions, atol=1e-7)
    np.testing.assert_allclose(robot.command_from_action([1.0, -1.0]), [robot.limits[0], -robot.limits[1]])
    np.testing.assert_array_equal(robot.action_from_command([9.0, -9.0]), [1.0, -1.0])
    with pytest.raises(ValueError, match=r"must have shape \(\.\.\., 2\), speed and yaw rate, got \(3,\)"):
        robot.command_from_action([0.1, 0.2, 0.3])


@pytest.mark.parametrize(
    ("changes", "lines"),
    [
        pytest.param(
            [('"left_wheel', '"wheel')],
            ["left_wheel: no such joint; allowed are one or more whose names are or begin with `left_wheel`"],
            id="no left wheel",
        ),
        pytest.param(
            [('size="0.11 0.03 0.11"', 'size="-0.11 0.03 0.11"')],
            ["refused by MuJoCo: size 0 must be positive in geom"],
            id="negative wheel radius",
        ),
        pytest.param(
            [('"max_speed" data="0.8"', '"max_speed" data="-0.8"')],
            ["max_speed: got -0.8; allowed is one number above 0"],
            id="negative speed",
        ),
        pytest.param(
            [('"max_yaw_rate" data="1.2"', '"max_yaw_rate" data="nan"')],
            ["max_yaw_rate: got nan; allowed is one number above 0"],
            id="speed that is no number",
        ),
        pytest.param(
            [('<gyro name="gyro" site="imu"/>', "")],
            ["gyro: no such sensor; allowed is a gyro at the site `imu`"],
            id="no gyro",
        ),
        pytest.param(
            [('name="base"', 'name="trunk"')],
            ["base: no such body", "trunk: lies below the world", "imu: a site of `trunk`", "lidar: a site of `trunk`"],
            id="no base",
        ),
        pytest.param(
            [("<worldbody>", '<worldbody><geom name="ground" type="plane" size="1 1 1"/>')],
            ["ground: lies in the world; allowed is the robot alone"],
            id="a floor of its own",
        ),
        pytest.param(
            [
                ('<numeric name="max_acceleration" data="2"/>', ""),
                ('"yaw_rate_gain" data="3"', '"yaw_rate_gain" data="-1"'),
            ],
            ["max_acceleration: missing", "yaw_rate_gain: got -1; allowed is one number of 0 or more"],
            id="two faults",
        ),
        pytest.param(
            [('conaffinity="2"', 'conaffinity="3"')],
            ["chassis, mast, head: conaffinity for floor and obstacles"],
            id="a hull that meets the floor",
        ),
        pytest.param(
            [('axis="0 1 0"', 'axis="0 -1 0"')],
            [f"{side}_wheel_{end}: axis 0 -1 0" for side in ("left", "right") for end in ("front", "rear")],
            id="wheels that drive backward",
        ),
        pytest.param(
            [('<geom name="left_wheel_rear"/>', '<geom name="left_wheel_rear" size="0.09 0.03 0.09"/>')],
            ["left_wheel_rear: radius 0.090 m beside 0.110 m", "left_wheel_rear: stands 0.020 m above the origin"],
            id="a small wheel",
        ),
        pytest.param(
            [('input="vel"', 'input="pos"'), ('ctrlrange="-20 20"', 'ctrlrange="-5 5"')],
            [
                f"{wheel}_{end}: {fault}"
                for wheel in ("left_wheel", "right_wheel")
                for end in ("front", "rear")
                for fault in ("turns its wheel at", "ctrlrange -5 5; allowed is at least -11.4 11.4")
            ],
            id="servos of positions, and too narrow",
        ),
        pytest.param(
            [('size="0.325 0.225 0.09"', 'size="0.325 0.15 0.09"')],
            ["hull: wheels or casters stick out of it by 0.06", "lidar: at 0.2 0 0.13; allowed is x from 0 to 0.150"],
            id="a hull that is too narrow",
        ),
        pytest.param(
            [('pos="0 0 0.6" mass="1.6"', 'pos="0 0 0.8" mass="1.6"'), ('timestep="0.01"', 'timestep="0.003"')],
            ["hull: 0.86 m high; allowed is up to 0.75 m", "option: timestep 0.003 s; allowed is a whole fraction"],
            id="too high, and out of step",
        ),
        pytest.param(
            [(HOME, ""), ('pos="0 0 0.6" mass="1.6"', 'pos="0.5 0 0.6" mass="30"')],
            ["home: not upright and at rest at the origin"],
            id="falls over by itself",
        ),
        pytest.param(
            [('<site name="imu"', '<site name="element_3"/><site name="imu"')],
            ["world: none can be built around the robot: repeated name 'element_3' in site"],
            id="a name that is taken",
        ),
    ],
)
def test_a_faulty_robot_is_refused_with_a_line_for_each_fault(
    changes: list[tuple[str, str]], lines: list[str], edited: Edited, capfd: pytest.CaptureFixture[str]
) -> None:
    path = edited(*changes)
    with pytest.raises(RobotFileError) as refused:
        load_robot(path)
    told = [line.removeprefix(f"{path}: ") for line in refused.value.faults]
    assert len(told) == len(lines), told
    for line, expected in zip(sorted(told), sorted(lines), strict=True):
        assert line.startswith(expected)
        assert "\n" not in line
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("this is not XML", "not MJCF: XML parse error"),
        ("", "not MJCF: ParseXML: empty file"),
        ("<mujoco><worldbody><geom siz='1'/></worldbody></mujoco>", "not MJCF: XML Error: Schema violation"),
    ],
)
def test_a_file_that_is_no_mjcf_is_refused_in_one_line(text: str, expected: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RobotFileError) as refused:
        load_robot(path)
    (line,) = refused.value.faults
    assert line.startswith(f"{path}: {expected}")


@pytest.mark.parametrize(
    ("model", "expected"),
    [
        ("walker", "walker: no such robot; known are crawler, inspector, or give a path of an MJCF file, in .xml"),
        ("nowhere.xml", "nowhere.xml: no such file; give an MJCF file"),
        ("robots/walker", "robots/walker: no such file; give an MJCF file"),
    ],
)
def test_a_robot_that_is_not_there_is_refused(model: str, expected: str) -> None:
    with pytest.raises(RobotFileError) as refused:
        load_robot(model)
    assert refused.value.faults == (expected,)
