"""Conversion of velocity commands to wheel speeds, in a compiled loop over the robots."""

from __future__ import annotations

import numpy as np

from dirmusic.arrays import FloatArray, IntArray
from dirmusic.compiled import compiled


@compiled
def command(
    v_mps: FloatArray,
    yaw_rate_radps: FloatArray,
    rows: IntArray,
    period_s: float,
    steering: tuple[float, float, float, float, float, float],
    wheels: tuple[IntArray, IntArray],
    feedback: tuple[FloatArray, FloatArray, FloatArray],
    control_radps: FloatArray,
) -> bool:
    """Set the wheel speeds for velocity commands, which are clipped to the limits.

    For robots with skidding wheels, a set point approaches the command no faster than the wheel rims can accelerate.
    When the robot slows down, the speed has priority, so that the robot stops within the same distance as on a straight
    path; otherwise the yaw rate has priority.

    Args:
        v_mps: Forward speeds, shape (n,).
        yaw_rate_radps: Yaw rates, shape (n,).
        rows: Rows of the robots to command.
        period_s: Time since the last command.
        steering: Maximum speed, maximum yaw rate, half of `RobotDescription.turning_track_m`, rolling radius of the
            wheels, maximum acceleration of the wheel rims, and gain of the integrating gyro feedback, 1/s, which is 0
            without feedback.
        wheels: Actuator column and side of each driven wheel, see `readings.read`.
        feedback: Yaw rates measured by the gyro, shape (n,); and the state, which is updated: set points of speed and
            yaw rate, shape (n, 2), and corrections of the yaw rates for skidding wheels, shape (n,).
        control_radps: Receives the wheel speeds, shape (n, n_actuators).

    Returns:
        False, with nothing changed, if any command of any robot is not finite; otherwise True.
    """
    if not (np.isfinite(v_mps).all() and np.isfinite(yaw_rate_radps).all()):
        return False
    most_v_mps, most_yaw_rate_radps, half_track_m, radius_m, acceleration_mps2, gain = steering
    (actuator, side), (gyro_radps, set_point, added_radps) = wheels, feedback
    for r in rows:
        v = float(min(max(v_mps[r], -most_v_mps), most_v_mps))
        turn = float(min(max(yaw_rate_radps[r], -most_yaw_rate_radps), most_yaw_rate_radps))
        if gain > 0.0:
            added = added_radps[r] + gain * period_s * (set_point[r, 1] - gyro_radps[r])
            change_mps = acceleration_mps2 * period_s
            v_change, turn_change = v - set_point[r, 0], half_track_m * (turn - set_point[r, 1])
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
            added_radps[r] = 0.0 if is_at_rest else min(max(added, -most_yaw_rate_radps), most_yaw_rate_radps)
            v, turn = set_point[r, 0], set_point[r, 1] + added_radps[r]
        rim = turn * half_track_m
        for k in range(actuator.size):
            speed_mps = v - rim if side[k] == 0 else v + rim
            control_radps[r, actuator[k]] = speed_mps / radius_m
    return True
