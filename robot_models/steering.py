"""From commands to wheel speeds, in a compiled loop over the robots."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


class Steering(NamedTuple):
    """How commands become wheel speeds.

    Attributes:
        max_speed_mps: Greatest speed either way.
        max_yaw_rate_radps: Greatest yaw rate either way.
        half_track_m: Half the track by which wheel speeds turn the robot.
        wheel_radius_m: Rolling radius.
        max_acceleration_mps2: With which the motors let the rims of the wheels follow.
        yaw_rate_gain: Of the integrating feedback of the gyro, 1/s; 0 for none.
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
        gyro_radps: Live view of the yaw rate by the gyro, shape (n,).
        set_point: Speed, m/s, and yaw rate, rad/s, that the robot should have come to by now, shape (n, 2).
        added_radps: What is added to the yaw rate for what the wheels lose by skidding, shape (n,).
    """

    gyro_radps: FloatArray
    set_point: FloatArray
    added_radps: FloatArray


@compiled
def close_yaw_rate(
    r: int, v_mps: float, yaw_rate_radps: float, period_s: float, steering: Steering, feedback: YawFeedback
) -> tuple[float, float]:
    """What to set the wheels to, so that a robot moves as commanded though its wheels skid.

    The set point approaches the command no faster than the rims of the wheels can follow: when the robot slows down,
    its speed comes first, so that it stops in as short a way as when it drives straight; otherwise its yaw rate.

    Args:
        r: Row of the robot.
        v_mps: Commanded.
        yaw_rate_radps: Commanded.
        period_s: Time since the last command.
        steering: Of all robots.
        feedback: Of all robots.

    Returns:
        Speed and yaw rate.
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
    stands = set_point[r, 0] == 0.0 and set_point[r, 1] == 0.0
    added_radps[r] = 0.0 if stands else min(max(added, -most), most)
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
    """Set the wheels' speeds for commands, within limits.

    Args:
        v_mps: Forward speeds, shape (n,).
        yaw_rate_radps: Shape (n,).
        rows: Which robots are commanded.
        period_s: Time since the last command.
        steering: A plain `Steering`.
        wheels: Of each driven wheel the column of its motor and its side, as of `readings.Drive`.
        feedback: A plain `YawFeedback`.
        control_radps: Becomes the speeds, shape (n, n_actuators).

    Returns:
        False, and nothing is set, if any command of any robot is not finite.
    """
    if not (np.isfinite(v_mps).all() and np.isfinite(yaw_rate_radps).all()):
        return False
    limits, (actuator, side) = Steering(*steering), wheels
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
