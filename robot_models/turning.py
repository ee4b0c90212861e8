"""Turning test: does a robot on the floor turn as fast as it is commanded?"""

from functools import cache
from typing import NamedTuple

import numpy as np

from pdpatrol.robot_models.description.robot_description import RobotDescription
from pdpatrol.robot_models.readings import VELOCITY
from pdpatrol.robot_models.robots import Robots
from pdpatrol.robot_models.sensors import LIDAR_PERIOD_S, AntennaElements
from pdpatrol.robot_models.yard.yard import Yard

SETTLE_S, MEASURE_S = 1.5, 1.0
"""Time to reach a commanded yaw rate, and time over which it is measured (assumed); the shipped robots need 0.3 s."""

TOLERANCE = 0.2
"""Relative deviation from the commanded yaw rate that is accepted. Assumed; the control of the path corrects smaller
ones."""


class Turn(NamedTuple):
    """Turn on the spot at a constant command.

    Attributes:
        commanded_radps: Commanded yaw rate.
        reached_radps: Mean yaw rate once the robot has had time to reach it.
        is_stable: False if MuJoCo warned of an unstable simulation.
    """

    commanded_radps: float
    reached_radps: float
    is_stable: bool


@cache
def turns_on_floor(robot: RobotDescription) -> tuple[Turn, ...]:
    """Drive a robot in turns on the spot, on the floor of an empty yard, at half and all of its maximum yaw rate.

    One robot at a time, because a mission then uses the same compiled functions.
    """
    return tuple(_turn(robot, share * robot.max_yaw_rate_radps) for share in (0.5, 1.0))


def _turn(robot: RobotDescription, commanded_radps: float) -> Turn:
    """Drive one turn on the spot from rest."""
    side_m = 4.0 * robot.room_m
    no_elements = AntennaElements(np.empty((0, 3)), np.empty(0), np.empty(0))
    robots = Robots(robot, Yard(size_m=(side_m, side_m)), no_elements)
    robots.reset([0], [0.5 * side_m, 0.5 * side_m, 0.0])
    rates_radps: list[float] = []
    for _ in range(round((SETTLE_S + MEASURE_S) / LIDAR_PERIOD_S)):
        robots.drive([0.0], [commanded_radps], LIDAR_PERIOD_S)
        rates_radps.append(robots.readings.values[0, VELOCITY][1])
    reached_radps = float(np.mean(rates_radps[-round(MEASURE_S / LIDAR_PERIOD_S) :]))
    return Turn(commanded_radps, reached_radps, is_stable=not robots.n_warnings().any())


def turning_doubt(robot: RobotDescription) -> str | None:
    """Return a line if a robot does not turn on the floor as it is commanded; None if it does."""
    turns = turns_on_floor(robot)
    if not all(turn.is_stable for turn in turns):
        return "the simulation is unstable in a turn on the floor; check timestep, masses and gains of the actuators"
    wrong = [turn for turn in turns if abs(turn.reached_radps / turn.commanded_radps - 1.0) > TOLERANCE]
    if not wrong:
        return None
    rates = " and ".join(f"{turn.reached_radps:.2f} of {turn.commanded_radps:.2g}" for turn in wrong)
    return (
        f"turns on the floor at {rates} rad/s that are commanded; wheels that skid need yaw_rate_gain (feedback of the "
        "gyro), less friction, or an impratio below 1 with elliptic cones"
    )
