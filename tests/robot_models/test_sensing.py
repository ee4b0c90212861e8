"""Readings of robots: frame, encoders, gyro, lidar, motor power."""
# pyright: reportAttributeAccessIssue=false

import mujoco
import numpy as np
import pytest

from pdpatrol.robot_models.description.robot_description import xml_path
from pdpatrol.robot_models.readings import LIDAR, MOTOR_POWER, WHEEL_ANGLES
from tests.robot_models.one_robot import YARD, Edited, OneRobot


def test_base_frame_is_the_pose(shipped: OneRobot) -> None:
    shipped.reset(5.0, 6.0, 0.4)
    frame = shipped.robots.readings.world_from_base[0]
    np.testing.assert_allclose(frame[:2, 3], [5.0, 6.0], atol=1e-9)
    np.testing.assert_allclose(frame[:2, 0], [np.cos(0.4), np.sin(0.4)], atol=1e-3)
    np.testing.assert_allclose(frame[:3, :3] @ frame[:3, :3].T, np.eye(3), atol=1e-12)


def test_encoders_agree_with_the_pose(shipped: OneRobot) -> None:
    """Wheels roll by the distance driven, and turn the robot by its turning track."""
    radius_m = shipped.robot.wheel_radius_m
    shipped.drive_on(0.6, 0.0, 5.0)
    shipped.drive_on(0.0, 0.0, 1.0)
    rolled_m = shipped.robots.readings.values[0, WHEEL_ANGLES] * radius_m
    np.testing.assert_allclose(rolled_m, shipped.pose()[0] - 10.0, rtol=0.005)
    shipped.reset(10.0, 10.0, 0.0)
    shipped.drive_on(0.0, 1.0, 2.5)
    shipped.drive_on(0.0, 0.0, 1.0)
    left, right = shipped.robots.readings.values[0, WHEEL_ANGLES]
    turned = (right - left) * radius_m / shipped.robot.turning_track_m
    assert turned == pytest.approx(shipped.pose()[2], rel={"inspector": 0.005, "crawler": 0.03}[shipped.robot.name])


def test_gyro_measures_the_yaw_rate(shipped: OneRobot) -> None:
    shipped.drive_on(0.0, 1.0, 3.0)
    shipped.drive(0.0, 1.0, shipped.robots.step_s)
    assert shipped.data.sensor("gyro").data[2] == pytest.approx(shipped.velocity()[1], rel=1e-4)


def test_lidar_measures_from_the_middle(shipped: OneRobot) -> None:
    shipped.reset(15.0, 10.0, 0.7)
    lidar_m = shipped.robots.readings.values[0, LIDAR]
    bearing = 0.7 + np.radians(10.0) * np.arange(lidar_m.size)
    met_m = np.array([15.0, 10.0]) + lidar_m[:, np.newaxis] * np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)
    seen = lidar_m < 12.0
    assert 3 <= seen.sum() < lidar_m.size
    np.testing.assert_allclose(YARD.clearance(met_m[seen]), 0.0, atol=1e-3)
    assert lidar_m[seen].min() > 3.9


def test_motor_power_grows_with_driving_and_skidding(shipped: OneRobot) -> None:
    power_w = []
    for v, yaw_rate in ((0.0, 0.0), (0.6, 0.0), (0.6, 1.0)):
        shipped.reset(10.0, 10.0, 0.0)
        shipped.drive_on(v, yaw_rate, 2.0)
        power_w.append(shipped.robots.readings.values[0, MOTOR_POWER])
    assert power_w[0] == pytest.approx(0.0, abs=1e-3)
    if shipped.robot.name == "crawler":
        assert power_w[2] > 10.0 * max(power_w[1], 1e-3)


def test_motors_without_data_have_mechanical_power(edited: Edited) -> None:
    plain = [('<dcmotor motorconst="1.2" resistance="0.5" input="vel" controller="0 0 10 18" ', '<velocity kv="10" ')]
    servo = OneRobot(edited(*plain, ("<dcmotor name", "<velocity name")))
    servo.drive_on(0.0, 1.0, 2.0)
    data = servo.data
    mechanical_w = float(data.actuator_force @ data.actuator_velocity)
    assert servo.robots.readings.values[0, MOTOR_POWER] == pytest.approx(mechanical_w, rel=0.02)
    assert mechanical_w > 5.0


def test_scene_of_the_inspector_runs_without_warnings() -> None:
    model = mujoco.MjModel.from_xml_path(str(xml_path("inspector").with_name("scene.xml")))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    mujoco.mj_step(model, data, round(1.0 / model.opt.timestep))
    assert sum(warning.number for warning in data.warning) == 0
    assert data.time == pytest.approx(1.0)
