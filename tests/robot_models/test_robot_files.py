"""Robots from files: their properties, and the errors of invalid files."""

import numpy as np
import pytest

from dirmusic.input_file import InputFileError
from pdpatrol.robot_models.description.robot_file import load_robot
from tests.robot_models.one_robot import Edited, OneRobot

HOME = '<key name="home" qpos="0 0 -7.5437e-05 1 0 0 0 0 0 0 0"/>'
SHORT = (
    ('name="chassis" class="hull" type="box" size="0.325', 'name="chassis" class="hull" type="box" size="0.28'),
    ('pos="0.19 ', 'pos="0.15 '),
    ('pos="-0.19 ', 'pos="-0.15 '),
    ('"max_speed" data="0.8"', '"max_speed" data="0.5"'),
)
"""Changes that make a shorter, slower crawler."""


def test_users_robot_drives_as_its_file_states(edited: Edited) -> None:
    own = OneRobot(edited(*SHORT))
    assert own.robot.name == "robot"
    assert own.robot.max_speed_mps == 0.5
    assert own.robot.footprint_radius_m == pytest.approx(np.hypot(0.28, 0.225), abs=1e-4)
    assert own.robot.turning_track_m == pytest.approx(0.37 + 4 * 0.15**2 / 0.37)
    own.drive_on(0.8, 0.0, 2.0)
    assert own.velocity()[0] == pytest.approx(0.5, rel=0.01)
    own.drive_on(0.2, 0.7, 3.0)
    np.testing.assert_allclose(own.velocity(), [0.2, 0.7], rtol=0.03)


def test_robot_without_keyframe_is_simulated_to_rest(edited: Edited) -> None:
    own = OneRobot(edited((HOME, "")))
    np.testing.assert_allclose(own.robot.home_qpos, load_robot("crawler").home_qpos, atol=1e-6)
    own.reset(7.0, 6.0, 1.0)
    own.drive_on(0.0, 0.0, 2.0)
    np.testing.assert_allclose(own.pose(), [7.0, 6.0, 1.0], atol=1e-5)


def test_actions_and_commands_are_inverse_and_clipped() -> None:
    robot = load_robot("crawler")
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 3, 2)).astype(np.float32)
    np.testing.assert_allclose(robot.action_from_command(robot.command_from_action(actions)), actions, atol=1e-7)
    np.testing.assert_allclose(robot.command_from_action([1.0, -1.0]), [robot.limits[0], -robot.limits[1]])
    np.testing.assert_array_equal(robot.action_from_command([9.0, -9.0]), [1.0, -1.0])


@pytest.mark.parametrize(
    ("changes", "lines"),
    [
        ([("<worldbody>", "<worldbody")], ["refused by MuJoCo: XML parse error"]),
        ([('"left_wheel', '"wheel')], ["wheels: must be hinges with names that begin with"]),
        ([('<gyro name="gyro" site="imu"/>', "")], ["refused by MuJoCo: Invalid name 'gyro'. Valid names: ["]),
        (
            [
                ('"max_yaw_rate" data="1.2"', '"max_yaw_rate" data="nan"'),
                ('"yaw_rate_gain" data="3"', '"yaw_rate_gain" data="-1"'),
            ],
            [
                "max_yaw_rate: must be one number above 0, got nan",
                "yaw_rate_gain: must be one number of 0 or more, got -1",
            ],
        ),
        (
            [("<worldbody>", '<worldbody><geom name="ground" type="plane" size="1 1 1"/>')],
            ["base: must be the only child of the world", "geoms: contype must be 0"],
        ),
        ([('axis="0 1 0"', 'axis="0 -1 0"')], ["wheels: axes must be 0 1 0"]),
        (
            [('<geom name="left_wheel_rear"/>', '<geom name="left_wheel_rear" size="0.09 0.03 0.09"/>')],
            ["wheels: must have one radius"],
        ),
        (
            [('input="vel"', 'input="pos"'), ('ctrlrange="-20 20"', 'ctrlrange="-5 5"')],
            ["actuators: must take the speed", "actuators: ctrlrange must hold -11.4 to 11.4"],
        ),
        (
            [('size="0.325 0.225 0.09"', 'size="0.325 0.15 0.09"')],
            ["hull: must cover wheels and casters", "lidar: must have x from 0 to 0.150"],
        ),
        (
            [('pos="0 0 0.6" mass="1.6"', 'pos="0 0 0.8" mass="1.6"'), ('timestep="0.01"', 'timestep="0.003"')],
            ["hull: must be at most 0.75 m high", "option: timestep must be a whole fraction of 0.1 s"],
        ),
        (
            [(HOME, ""), ('pos="0 0 0.6" mass="1.6"', 'pos="0.5 0 0.6" mass="30"')],
            ["home: the robot must stand by itself"],
        ),
        (
            [('<site name="imu"', '<site name="element_3"/><site name="imu"')],
            ["refused by MuJoCo: repeated name 'element_3' in site"],
        ),
    ],
)
def test_invalid_robot_is_refused_with_one_line_per_error(
    changes: list[tuple[str, str]], lines: list[str], edited: Edited, capfd: pytest.CaptureFixture[str]
) -> None:
    path = edited(*changes)
    with pytest.raises(InputFileError) as refused:
        load_robot(path)
    errors = [line.removeprefix(f"{path}: ") for line in refused.value.faults]
    assert len(errors) == len(lines), errors
    for line, expected in zip(sorted(errors), sorted(lines), strict=True):
        assert line.startswith(expected)
        assert "\n" not in line
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("model", "expected"),
    [
        ("", ": must be one of crawler, inspector, or the path of an MJCF file, in .xml"),
        ("walker", "walker: must be one of crawler, inspector, or the path of an MJCF file, in .xml"),
        ("nowhere.xml", "nowhere.xml: no such file; it must be an MJCF file"),
        ("robots/walker", "robots/walker: no such file; it must be an MJCF file"),
    ],
)
def test_missing_robot_is_refused(model: str, expected: str) -> None:
    with pytest.raises(InputFileError) as refused:
        load_robot(model)
    assert refused.value.faults == (expected,)
