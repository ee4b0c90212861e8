"""From commands to wheel speeds, in a compiled loop over the robots."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_models.compiled import compiled

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


class Drive(NamedTuple):
    """The driven wheels; a row is a wheel.

    Attributes:
        joint: Column of its angle among the joint positions, shape (n_wheels,).
        actuator: Column of its motor among the actuators, shape (n_wheels,).
        side: 0 on the left, 1 on the right, shape (n_wheels,).
        side_share: One over the number of wheels on its side, shape (n_wheels,).
        resistance_ohm: Of its motor, shape (n_wheels,); 0 where the file gives no such data.
        constant_nmpa: Torque constant of its motor, shape (n_wheels,).
    """

    joint: IntArray
    actuator: IntArray
    side: IntArray
    side_share: FloatArray
    resistance_ohm: FloatArray
    constant_nmpa: FloatArray


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
    """State of the feedback of the gyro; a row is a robot. `command` changes it in place.

    Attributes:
        gyro_radps: Live view of the yaw rate by the gyro, shape (n,).
        rims_mps: Speeds that the rims of the left and right wheels can have come to by now, shape (n, 2).
        added_radps: What is added to a commanded yaw rate for what the wheels lose by skidding, shape (n,).
    """

    gyro_radps: FloatArray
    rims_mps: FloatArray
    added_radps: FloatArray


@compiled
def command(
    v_mps: FloatArray,
    yaw_rate_radps: FloatArray,
    rows: IntArray,
    period_s: float,
    steering: tuple[float, ...],
    drive: tuple[Any, ...],
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
        drive: A plain `Drive`.
        feedback: A plain `YawFeedback`.
        control_radps: Becomes the speeds, shape (n, n_actuators).

    Returns:
        False, and nothing is set, if any command of any robot is not finite.
    """
    if not (np.isfinite(v_mps).all() and np.isfinite(yaw_rate_radps).all()):
        return False
    most_v_mps, most_yaw_rate_radps, half_track_m, wheel_radius_m, most_mps2, gain = steering
    _, actuator, side, _, _, _ = drive
    gyro_radps, rims_mps, added_radps = feedback
    for r in rows:
        v = min(max(v_mps[r], -most_v_mps), most_v_mps)
        turn = min(max(yaw_rate_radps[r], -most_yaw_rate_radps), most_yaw_rate_radps)
        if gain > 0.0:
            missed = 0.5 * (rims_mps[r, 1] - rims_mps[r, 0]) / half_track_m - gyro_radps[r]
            added = added_radps[r] + gain * period_s * missed
            added = min(max(added, -most_yaw_rate_radps), most_yaw_rate_radps)
            added_radps[r] = 0.0 if v == 0.0 and turn == 0.0 else added
            for s in range(2):
                change = v + (s - 0.5) * 2.0 * turn * half_track_m - rims_mps[r, s]
                rims_mps[r, s] += min(max(change, -most_mps2 * period_s), most_mps2 * period_s)
            turn += added_radps[r]
        rim = turn * half_track_m
        for k in range(actuator.size):
            control_radps[r, actuator[k]] = (v - rim if side[k] == 0 else v + rim) / wheel_radius_m
    return True
