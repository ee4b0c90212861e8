"""Conversion of commands to wheel speeds, in a compiled loop over the robots."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


class SteeringLimits(NamedTuple):
    """Measures and limits of a robot by which commands are converted to wheel speeds.

    Attributes:
        max_speed_mps: Greatest speed in either direction.
        max_yaw_rate_radps: Greatest yaw rate in either direction.
        half_track_m: Half the track by which wheel speeds turn the robot.
        wheel_radius_m: Rolling radius.
        max_acceleration_mps2: Greatest acceleration of the rims of the wheels.
        yaw_rate_gain: Gain of the integrating feedback of the gyro, 1/s; 0 without feedback.
    """

    max_speed_mps: float
    max_yaw_rate_radps: float
    half_track_m: float
    wheel_radius_m: float
    max_acceleration_mps2: float
    yaw_rate_gain: float


class YawFeedback(NamedTuple):
    """State of the feedback of the gyro; a row is a robot. `close_yaw_rate` changes it in place.

    Attributes:
        gyro_radps: Yaw rate by the gyro, shape (n,).
        set_point: Current set point of speed, m/s, and yaw rate, rad/s, shape (n, 2).
        added_radps: Correction of the yaw rate for the skidding of the wheels, shape (n,).
    """

    gyro_radps: FloatArray
    set_point: FloatArray
    added_radps: FloatArray


@compiled
def close_yaw_rate(
    r: int, v_mps: float, yaw_rate_radps: float, period_s: float, steering: SteeringLimits, feedback: YawFeedback
) -> tuple[float, float]:
    """Return the speed and yaw rate for the wheels that make a robot with skidding wheels move as commanded.

    The set point approaches the command no faster than the rims of the wheels can follow: the speed first when the
    robot slows down, so that it stops within the same distance as on a straight path; otherwise the yaw rate first.

    Args:
        r: Row of the robot.
        v_mps: Commanded speed.
        yaw_rate_radps: Commanded yaw rate.
        period_s: Time since the last command.
        steering: Limits of all robots.
        feedback: State of all robots.
    """
    gyro_radps, set_point, added_radps = feedback
    half_track_m, most = steering.half_track_m, steering.max_yaw_rate_radps
    added = added_radps[r] + steering.yaw_rate_gain * period_s * (set_point[r, 1] - gyro_radps[r])
    change_mps = steering.max_acceleration_mps2 * period_s
    v_change, turn_change = v_mps - set_point[r, 0], half_track_m * (yaw_rate_radps - set_point[r, 1])
    if v_change * set_point[r, 0] < 0.0:
        v_change = min(max(v_change, -change_mps), change_mps)
        change_mps -= abs(v_change)
        turn_change = min(max(turn_change, -change_mps), change_mps)
    else:
        turn_change = min(max(turn_change, -change_mps), change_mps)
        change_mps -= abs(turn_change)
        v_change = min(max(v_change, -change_mps), change_mps)
    set_point[r, 0] += v_change
    set_point[r, 1] += turn_change / half_track_m
    is_at_rest = set_point[r, 0] == 0.0 and set_point[r, 1] == 0.0
    added_radps[r] = 0.0 if is_at_rest else min(max(added, -most), most)
    return set_point[r, 0], set_point[r, 1] + added_radps[r]


@compiled
def command(
    v_mps: FloatArray,
    yaw_rate_radps: FloatArray,
    rows: IntArray,
    period_s: float,
    steering: tuple[float, ...],
    wheels: tuple[IntArray, IntArray],
    feedback: tuple[FloatArray, ...],
    control_radps: FloatArray,
) -> bool:
    """Set the speeds of the wheels for commands, clipped to the limits.

    Args:
        v_mps: Forward speeds, shape (n,).
        yaw_rate_radps: Yaw rates, shape (n,).
        rows: Rows of the robots to be commanded.
        period_s: Time since the last command.
        steering: `SteeringLimits` as a plain tuple.
        wheels: Column of its motor and side of each driven wheel, see `readings.Drive`.
        feedback: `YawFeedback` as a plain tuple.
        control_radps: Filled with the speeds, shape (n, n_actuators).

    Returns:
        False, with nothing set, if any command of any robot is not finite.
    """
    if not (np.isfinite(v_mps).all() and np.isfinite(yaw_rate_radps).all()):
        return False
    limits, (actuator, side) = SteeringLimits(*steering), wheels
    most_v_mps, most_yaw_rate_radps = limits.max_speed_mps, limits.max_yaw_rate_radps
    for r in rows:
        v = float(min(max(v_mps[r], -most_v_mps), most_v_mps))
        turn = float(min(max(yaw_rate_radps[r], -most_yaw_rate_radps), most_yaw_rate_radps))
        if limits.yaw_rate_gain > 0.0:
            v, turn = close_yaw_rate(r, v, turn, period_s, limits, YawFeedback(*feedback))
        rim = turn * limits.half_track_m
        for k in range(actuator.size):
            speed_mps = v - rim if side[k] == 0 else v + rim
            control_radps[r, actuator[k]] = speed_mps / limits.wheel_radius_m
    return True
