"""Readings of the simulated robots: poses, wheels, motors and lidar, in a compiled loop over the robots."""

from typing import Any, NamedTuple

import numpy as np

from dirmusic.arrays import FloatArray
from dirmusic.compiled import compiled

POSE, VELOCITY, WHEEL_ANGLES, MOTOR_POWER, UPRIGHT, LIDAR = slice(0, 3), slice(3, 5), slice(5, 7), 7, 8, slice(9, None)
"""Columns of `Readings.values`.

`POSE`: x m, y m and yaw in (-pi, pi], world frame. `VELOCITY`: forward speed, m/s, and yaw rate, rad/s. `WHEEL_ANGLES`:
mean angles of the left and the right wheels since the reset, radians. `MOTOR_POWER`: electrical power of the motors,
watts: mechanical power plus copper losses if the resistance is known, without recuperation. `UPRIGHT`: cosine of the
tilt of the base. `LIDAR`: ranges from the robot's middle, metres, limited to the maximum range of the lidar.
"""

LEAST_UPRIGHT = np.cos(np.radians(45.0))
"""Value of `UPRIGHT` below which a robot has fallen over. Assumed: a wheeled robot cannot recover from this tilt."""


class Readings(NamedTuple):
    """Readings of all robots; a row is a robot.

    Attributes:
        values: All readings except the frame, as columns of a single array, which is fast to pass to compiled loops.
        world_from_base: Frame of the base, including its tilt, shape (n, 4, 4). Its origin is on the floor under the
            middle of the axle.
    """

    values: FloatArray
    world_from_base: FloatArray

    @property
    def pose(self) -> FloatArray:
        """Position x m, y m and yaw in (-pi, pi], world frame, shape (n, 3)."""
        return self.values[:, POSE]


@compiled
def read(
    live: tuple[FloatArray, ...], drive: tuple[Any, ...], beams_start_m: float, reach_m: float
) -> tuple[FloatArray, FloatArray]:
    """Compute the fields of `Readings` of all robots.

    Args:
        live: Live views of the physics; a row is a robot. Position and wxyz quaternion of the base, shape (n, 7);
            linear velocity of the base in the world frame and angular velocity in the base frame, shape (n, 6); all
            joint positions; torques and speeds of all actuators; and ranges of the lidar beams from their start,
            negative without a hit.
        drive: Driven wheels; a row is a wheel: column of its angle among the joint positions; column of its motor among
            the actuators; side, 0 for left and 1 for right; reciprocal of the number of driven wheels on that side;
            resistance of the motor, ohm, 0 if the robot's file does not state it; torque constant, N m/A.
        beams_start_m: Distance from the robot's middle to the start of the lidar beams.
        reach_m: Maximum range of the lidar.
    """
    base, base_velocity, joints, torque_nm, actuator_radps, beams_m = live
    joint, actuator, side, side_share, resistance_ohm, constant_nmpa = drive
    n, n_beams = beams_m.shape
    values, world_from_base = np.zeros((n, 9 + n_beams)), np.zeros((n, 4, 4))
    pose, velocity, wheel_angles = values[:, POSE], values[:, VELOCITY], values[:, WHEEL_ANGLES]
    motor_power_w, lidar_m = values[:, MOTOR_POWER], values[:, LIDAR]
    for r in range(n):
        w, x, y, z = base[r, 3], base[r, 4], base[r, 5], base[r, 6]
        frame = world_from_base[r]
        frame[0, 0], frame[0, 1], frame[0, 2] = w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)
        frame[1, 0], frame[1, 1], frame[1, 2] = 2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)
        frame[2, 0], frame[2, 1], frame[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z
        frame[3, 3] = 1.0
        yaw = np.arctan2(frame[1, 0], frame[0, 0])
        if yaw == -np.pi:
            yaw = np.pi
        for i in range(3):
            frame[i, 3] = base[r, i]
        pose[r, 0], pose[r, 1], pose[r, 2] = frame[0, 3], frame[1, 3], yaw
        values[r, UPRIGHT] = frame[2, 2]
        moving = base_velocity[r]
        velocity[r, 0] = np.cos(yaw) * moving[0] + np.sin(yaw) * moving[1]
        velocity[r, 1] = moving[5]
        for k in range(joint.size):
            wheel_angles[r, side[k]] += side_share[k] * joints[r, joint[k]]
            torque = torque_nm[r, actuator[k]]
            copper_w = (torque / constant_nmpa[k]) ** 2 * resistance_ohm[k]
            motor_power_w[r] += max(torque * actuator_radps[r, actuator[k]] + copper_w, 0.0)
        for beam in range(n_beams):
            range_m = beams_m[r, beam] + beams_start_m
            lidar_m[r, beam] = range_m if beams_start_m <= range_m <= reach_m else reach_m
    return values, world_from_base
