"""Properties of the inspector alone: its wheels and casters on the floor, and its dimensions."""
# pyright: reportAttributeAccessIssue=false

import mujoco
import numpy as np
import pytest

from pdpatrol.robot_models.readings import WHEEL_ANGLES
from tests.robot_models.one_robot import OneRobot


def wheel_loads_n(inspector: OneRobot) -> np.ndarray:
    """Return the normal force of the floor on the left and the right wheel."""
    model, data, loads, force = inspector.model, inspector.data, np.zeros(2), np.zeros(6)
    mujoco.mj_forward(model, data)  # solves the contacts as they are now
    for index, geoms in enumerate(data.contact.geom.tolist()):
        for side, name in enumerate(("left_wheel", "right_wheel")):
            if model.geom(name).id in geoms:
                mujoco.mj_contactForce(model, data, index, force)
                loads[side] += force[0]
    return loads


def test_wheels_stay_on_the_floor_when_braking(inspector: OneRobot) -> None:
    """The casters carry little weight at rest, and never lift a wheel."""
    inspector.drive(0.0, 0.0, 1.0)
    weight_n = inspector.model.body_subtreemass[0] * 9.81
    assert wheel_loads_n(inspector).sum() > 0.9 * weight_n
    for command in [(0.8, 0.0), (-0.8, 0.0), (0.8, 1.5), (-0.8, -1.5), (0.0, 0.0)]:
        for _ in range(100):
            inspector.drive(*command, inspector.robots.step_s)
            assert wheel_loads_n(inspector).min() > 0.2 * weight_n


def test_wheels_do_not_slip_when_braking(inspector: OneRobot) -> None:
    radius_m, step_s = inspector.robot.wheel_radius_m, inspector.robots.step_s
    for v_mps in (0.8, -0.8, 0.0):
        for _ in range(60):
            turned, x_m = inspector.robots.readings.values[0, WHEEL_ANGLES].mean(), inspector.pose()[0]
            inspector.drive(v_mps, 0.0, step_s)
            turned = inspector.robots.readings.values[0, WHEEL_ANGLES].mean() - turned
            assert radius_m * turned / step_s == pytest.approx((inspector.pose()[0] - x_m) / step_s, abs=0.005)


def test_inspector_measures_are_those_of_its_readme(inspector: OneRobot) -> None:
    robot = inspector.robot
    assert robot.footprint_radius_m == robot.inner_radius_m == robot.lidar_start_m == 0.2
    assert (robot.wheel_radius_m, robot.turning_track_m) == (0.075, 0.32)
    assert (robot.max_speed_mps, robot.max_yaw_rate_radps, robot.max_acceleration_mps2) == (0.8, 1.5, 3.0)
    assert inspector.model.body_subtreemass[0] == pytest.approx(18.0)
