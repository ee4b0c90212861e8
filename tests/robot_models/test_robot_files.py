"""Robots from files: their measures, and the errors of invalid files."""

from pathlib import Path

import numpy as np
import pytest

from pdpatrol.robot_models.description.robot_description import SHIPPED, RobotFileError, xml_path
from pdpatrol.robot_models.description.robot_file import load_robot, read_robot
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
def test_record_of_shipped_robot_equals_its_measures(name: str) -> None:
    kept, measured = load_robot(name), read_robot(xml_path(name))
    assert kept.wheels == measured.wheels
    numbers = [field for field in vars(kept) if field not in ("name", "xml_path", "wheels")]
    for field in numbers:
        np.testing.assert_allclose(getattr(kept, field), getattr(measured, field), rtol=1e-9, atol=1e-12, err_msg=field)


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
    with pytest.raises(ValueError, match=r"must have shape \(\.\.\., 2\), speed and yaw rate, got \(3,\)"):
        robot.command_from_action([0.1, 0.2, 0.3])


@pytest.mark.parametrize(
    ("changes", "lines"),
    [
        ([('"left_wheel', '"wheel')], ["left_wheel: no such joint"]),
        ([('size="0.11 0.03 0.11"', 'size="-0.11 0.03 0.11"')], ["refused by MuJoCo: size 0 must be positive in geom"]),
        (
            [('"max_yaw_rate" data="1.2"', '"max_yaw_rate" data="nan"')],
            ["max_yaw_rate: must be one number above 0, got nan"],
        ),
        ([('<gyro name="gyro" site="imu"/>', "")], ["gyro: must be a gyro at the site `imu`, got no sensor"]),
        (
            [('name="base"', 'name="trunk"')],
            ["base: no such body", "trunk: only `base` may be", "imu: must be a site of", "lidar: must be a site of"],
        ),
        (
            [("<worldbody>", '<worldbody><geom name="ground" type="plane" size="1 1 1"/>')],
            ["ground: must not be a child of the world"],
        ),
        (
            [
                ('<numeric name="max_acceleration" data="2"/>', ""),
                ('"yaw_rate_gain" data="3"', '"yaw_rate_gain" data="-1"'),
            ],
            ["max_acceleration: missing", "yaw_rate_gain: must be one number of 0 or more, got -1"],
        ),
        ([('conaffinity="2"', 'conaffinity="3"')], ["chassis, mast, head: conaffinity must be 1"]),
        (
            [('axis="0 1 0"', 'axis="0 -1 0"')],
            [f"{side}_wheel_{end}: axis must be 0 1 0" for side in ("left", "right") for end in ("front", "rear")],
        ),
        (
            [('<geom name="left_wheel_rear"/>', '<geom name="left_wheel_rear" size="0.09 0.03 0.09"/>')],
            ["left_wheel_rear: radius must be that of", "left_wheel_rear: must stand at the height"],
        ),
        (
            [('input="vel"', 'input="pos"'), ('ctrlrange="-20 20"', 'ctrlrange="-5 5"')],
            [
                f"{side}_wheel_{end}: {error}"
                for side in ("left", "right")
                for end in ("front", "rear")
                for error in ("must be a servo", "ctrlrange must hold -11.4 to 11.4")
            ],
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
            ["world: cannot be built around the robot: repeated name 'element_3' in site"],
        ),
    ],
)
def test_invalid_robot_is_refused_with_one_line_per_error(
    changes: list[tuple[str, str]], lines: list[str], edited: Edited, capfd: pytest.CaptureFixture[str]
) -> None:
    path = edited(*changes)
    with pytest.raises(RobotFileError) as refused:
        load_robot(path)
    errors = [line.removeprefix(f"{path}: ") for line in refused.value.faults]
    assert len(errors) == len(lines), errors
    for line, expected in zip(sorted(errors), sorted(lines), strict=True):
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
def test_file_without_mjcf_is_refused_in_one_line(text: str, expected: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RobotFileError) as refused:
        load_robot(path)
    (line,) = refused.value.faults
    assert line.startswith(f"{path}: {expected}")


@pytest.mark.parametrize(
    ("model", "expected"),
    [
        ("walker", "walker: must be one of crawler, inspector, or the path of an MJCF file, in .xml"),
        ("nowhere.xml", "nowhere.xml: no such file; it must be an MJCF file"),
        ("robots/walker", "robots/walker: no such file; it must be an MJCF file"),
    ],
)
def test_missing_robot_is_refused(model: str, expected: str) -> None:
    with pytest.raises(RobotFileError) as refused:
        load_robot(model)
    assert refused.value.faults == (expected,)
