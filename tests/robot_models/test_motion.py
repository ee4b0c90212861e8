"""Motion of robots: properties of all shipped robots, and of single ones."""
# pyright: reportAttributeAccessIssue=false

import math
import pickle

import mujoco
import numpy as np
import pytest

from pdpatrol.robot_models.description.robot_description import SHIPPED
from pdpatrol.robot_models.description.robot_file import load_robot
from pdpatrol.robot_models.robots import Robots
from pdpatrol.robot_models.yard.yard import Yard
from tests.robot_models.one_robot import ONE_ELEMENT, OneRobot

TRACKING = {"inspector": 0.01, "crawler": 0.03}
"""Tolerance of the speed reached, as a fraction of the command."""


def robots_of(model: str, n_robots: int = 1) -> Robots:
    return Robots(load_robot(model), Yard(size_m=(30.0, 30.0)), ONE_ELEMENT, n_robots)


def test_robot_reaches_the_commanded_speeds_without_bouncing(shipped: OneRobot) -> None:
    limits = np.array(shipped.robot.limits)
    for command in np.random.default_rng(3).uniform(-limits, limits, size=(100, 2)):
        v, yaw_rate = command.tolist()
        shipped.reset(15.0, 25.0, 0.0)
        shipped.drive_on(v, yaw_rate, 1.0)
        reached = []
        for _ in range(20):
            shipped.drive(v, yaw_rate, 0.05)
            reached.append(shipped.velocity())
            frame = shipped.robots.readings.world_from_base[0]
            assert abs(frame[2, 3]) < 1e-3
            assert np.hypot(*frame[2, :2]) < np.radians(0.5)
        tolerance = TRACKING[shipped.robot.name] * np.maximum(np.abs(command), 0.1 * limits)
        assert np.all(np.abs(np.mean(reached, axis=0) - command) < tolerance), command
    assert shipped.robots.n_warnings().tolist() == [0]


def test_pose_is_the_integral_of_the_velocity(shipped: OneRobot) -> None:
    shipped.reset(10.0, 10.0, 0.5)
    shipped.drive_on(0.5, 0.0, 1.0)
    start = shipped.pose()
    shipped.drive_on(0.5, 0.0, 2.0)
    expected = start + np.array([math.cos(0.5), math.sin(0.5), 0.0])
    np.testing.assert_allclose(shipped.pose(), expected, atol=2e-3)


def test_commands_beyond_the_limits_are_clipped(shipped: OneRobot) -> None:
    shipped.drive_on(5.0, 0.0, 2.0)
    assert shipped.velocity()[0] == pytest.approx(shipped.robot.max_speed_mps, rel=0.01)
    shipped.drive_on(0.0, -9.0, 3.0)
    assert shipped.velocity()[1] == pytest.approx(-shipped.robot.max_yaw_rate_radps, rel=0.01)


def test_speed_changes_within_the_acceleration_limit(shipped: OneRobot) -> None:
    for command in (0.8, -0.8, 0.0):
        for _ in range(20):
            before = shipped.velocity()[0]
            shipped.drive(command, 0.0, 0.05)
            assert abs(shipped.velocity()[0] - before) <= 1.1 * shipped.robot.max_acceleration_mps2 * 0.05


@pytest.mark.parametrize("turns", [(0.0, 0.0), (1.1, -1.1), (-0.6, 0.0)])
def test_stopping_distance_follows_from_the_limit(shipped: OneRobot, turns: tuple[float, float]) -> None:
    shipped.drive_on(0.8, turns[0], 2.0)
    start, v_mps = shipped.pose(), shipped.velocity()[0]
    shipped.drive_on(0.0, turns[1], 1.0)
    length_m = np.hypot(*(shipped.pose() - start)[:2])
    assert 0.0 < length_m <= 0.1 * v_mps + v_mps**2 / (2.0 * shipped.robot.max_acceleration_mps2)
    shipped.drive_on(0.0, 0.0, 1.0)
    stopped = shipped.pose()
    shipped.drive_on(0.0, 0.0, 5.0)
    np.testing.assert_allclose(shipped.pose(), stopped, atol=1e-4)


@pytest.mark.parametrize("pose", [(3.0, 4.0, 0.0), (12.0, 2.0, 2.5), (5.0, 25.0, -3.0), (8.0, 8.0, math.pi)])
def test_robot_stays_at_rest_after_reset(shipped: OneRobot, pose: tuple[float, ...]) -> None:
    shipped.drive_on(0.8, 1.0, 0.5)
    shipped.reset(*pose)
    np.testing.assert_allclose(shipped.pose(), pose, atol=1e-12)
    assert shipped.data.time == 0.0
    assert not shipped.velocity().any()
    shipped.drive_on(0.0, 0.0, 3.0)
    np.testing.assert_allclose(shipped.pose(), pose, atol=1e-5)
    assert shipped.data.qpos[2] == pytest.approx(0.0, abs=1e-4)


def test_yaw_lies_above_minus_pi_and_up_to_pi(inspector: OneRobot) -> None:
    inspector.reset(10.0, 10.0, -math.pi)
    assert inspector.pose()[2] == pytest.approx(math.pi)
    inspector.reset(10.0, 10.0, 5.0)
    assert inspector.pose()[2] == pytest.approx(5.0 - 2.0 * math.pi)


def states(robots: Robots, row: int, commands: np.ndarray) -> np.ndarray:
    """Drive one robot by commands while the others drive at random, and return its states."""
    robots.reset([row], [(17.0, 9.0, 0.3)])
    others, found = np.random.default_rng(9).uniform(-0.5, 0.5, size=(len(commands), len(robots.is_touching), 2)), []
    for command, other in zip(commands, others, strict=True):
        other[row] = command
        robots.drive(other[:, 0], other[:, 1], 0.1)
        found.append(np.concatenate([robots.readings.values[row], robots.data(row).qpos, robots.data(row).qvel]))
    return np.array(found)


@pytest.mark.parametrize("name", SHIPPED)
def test_trajectory_is_identical_among_other_robots(name: str) -> None:
    commands = np.random.default_rng(5).uniform([0.0, -1.2], [0.8, 1.2], size=(40, 2))
    alone = robots_of(name)
    first = states(alone, 0, commands)
    assert np.array_equal(first, states(alone, 0, commands))
    assert np.array_equal(first, states(robots_of(name, 3), 1, commands))


@pytest.mark.parametrize("name", SHIPPED)
def test_pickled_robot_continues_identically(name: str) -> None:
    robots = robots_of(name)
    robots.reset([0], [(10.0, 10.0, 0.0)])
    for _ in range(7):
        robots.drive([0.6], [0.9], 0.1)
    copied = pickle.loads(pickle.dumps(robots))
    for which in (robots, copied):
        for _ in range(7):
            which.drive([0.2], [-1.0], 0.1)
    assert np.array_equal(robots.readings.values, copied.readings.values)


def test_robot_that_is_not_driven_keeps_its_state() -> None:
    robots, alone = robots_of("crawler", 2), robots_of("crawler")
    for row in (0, 0, 0, 0, 1, 1, 1, 0, 0):
        robots.drive([0.3, 0.3], [1.0, -1.0], 0.1, np.array([row]))
    for _ in range(3):
        alone.drive([0.3], [-1.0], 0.1)
    assert np.array_equal(robots.readings.values[1], alone.readings.values[0])


def test_returned_readings_do_not_change(inspector: OneRobot) -> None:
    values = inspector.robots.readings.values
    kept = values.copy()
    inspector.drive(0.8, 0.5, 0.5)
    assert np.array_equal(values, kept)


def test_reduced_physics_equals_the_full_world(shipped: OneRobot) -> None:
    whole, data = shipped.model, shipped.data
    assert whole.ngeom > shipped.robots.physics.ngeom + 40
    shipped.drive(0.7, 1.1, 0.5)
    data.ctrl[:] = shipped.data.ctrl
    mujoco.mj_step(whole, data, nstep=round(0.5 / shipped.robots.step_s))
    assert np.array_equal(data.qpos, shipped.data.qpos)
    assert np.array_equal(data.qvel, shipped.data.qvel)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((float("nan"), 0.0, 0.1), "must be finite"),
        ((0.1, float("inf"), 0.1), "must be finite"),
        ((0.1, 0.0, 0.0), "positive multiple of the physics step"),
        ((0.1, 0.0, 0.0123), "positive multiple of the physics step"),
    ],
)
def test_invalid_command_is_refused(inspector: OneRobot, arguments: tuple[float, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        inspector.drive(*arguments)


def test_pose_that_is_not_finite_is_refused(inspector: OneRobot) -> None:
    with pytest.raises(ValueError, match="`poses` must be finite"):
        inspector.reset(1.0, 1.0, float("nan"))
