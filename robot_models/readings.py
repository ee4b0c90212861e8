"""What can be read of robots in their physics, in one compiled loop over the robots."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

BEAMS_START_M = 0.2
"""Distance from the robot's middle to where the lidar's beams start: the sites `lidar_00` to `lidar_35` of the XML."""


class Physics(NamedTuple):
    """Live views of the physics; a row is a robot.

    Attributes:
        base: Position and wxyz quaternion of the base, shape (n, 7).
        base_velocity: Linear in the world frame, angular in the base's own, shape (n, 6).
        wheels: Angles of left and right wheel, shape (n, 2).
        torque_nm: Of the wheel motors, shape (n, 2).
        wheel_radps: Speeds of the wheels, shape (n, 2).
        beams_m: Ranges of the beams from where they start, negative where nothing is hit, shape (n, n_beams).
    """

    base: FloatArray
    base_velocity: FloatArray
    wheels: FloatArray
    torque_nm: FloatArray
    wheel_radps: FloatArray
    beams_m: FloatArray


class Motors(NamedTuple):
    """Data of the wheel motors, shape (2,) each: resistance in ohm, and torque constant in N m/A."""

    resistance_ohm: FloatArray
    constant_nmpa: FloatArray


@numba.njit(cache=True, error_model="numpy")  # pyright: ignore
def command(
    v_mps: FloatArray,
    yaw_rate_radps: FloatArray,
    most_v_mps: float,
    most_yaw_rate_radps: float,
    half_track_m: float,
    wheel_radius_m: float,
    control_radps: FloatArray,
) -> bool:
    """Set the wheels' speeds (n, 2) for commands (n,) within limits; False, and none is set, if one is not finite."""
    if not (np.isfinite(v_mps).all() and np.isfinite(yaw_rate_radps).all()):
        return False
    for r in range(len(control_radps)):
        v = min(max(v_mps[r], -most_v_mps), most_v_mps)
        rim = min(max(yaw_rate_radps[r], -most_yaw_rate_radps), most_yaw_rate_radps) * half_track_m
        control_radps[r, 0], control_radps[r, 1] = (v - rim) / wheel_radius_m, (v + rim) / wheel_radius_m
    return True


Touches = tuple[FloatArray, FloatArray, FloatArray]
"""What three sensors remember of contacts: (n_robots, n_steps, n_contacts, 4); found or not, and x, y, z. Those found
come first."""


@numba.njit(cache=True, error_model="numpy")  # pyright: ignore
def touching(touches: Touches) -> NDArray[np.intp]:
    """Robots that any contact is remembered of."""
    n_robots, n_steps = touches[0].shape[:2]
    rows, n = np.empty(n_robots, np.intp), 0
    for r in range(n_robots):
        n_found = 0
        for sensor in touches:
            for step in range(n_steps):
                n_found += sensor[r, step, 0, 0] > 0.0
        if n_found > 0:
            rows[n] = r
            n += 1
    return rows[:n]


@numba.njit(cache=True, error_model="numpy")  # pyright: ignore
def take_places(touches: Touches, row: int) -> FloatArray:
    """Where contacts are remembered of a robot, x and y to the centimetre, shape (n, 2); they are forgotten."""
    n_most = 0
    for sensor in touches:
        n_most += sensor.shape[1] * sensor.shape[2]
    places, n = np.empty((n_most, 2)), 0
    for sensor in touches:
        for step in range(sensor.shape[1]):
            for k in range(sensor.shape[2]):
                if sensor[row, step, k, 0] > 0.0:
                    places[n, 0], places[n, 1] = (
                        np.round(sensor[row, step, k, 1], 2),
                        np.round(sensor[row, step, k, 2], 2),
                    )
                    sensor[row, step, k, 0] = 0.0
                    n += 1
    return places[:n]


POSE, VELOCITY, WHEEL_ANGLES, MOTOR_POWER, LIDAR = slice(0, 3), slice(3, 5), slice(5, 7), 7, slice(8, None)
"""Columns of `Readings.values`."""


class Readings(NamedTuple):
    """What is read; a row is a robot.

    Attributes:
        values: All that follows but the frame, side by side: so it passes quickly into compiled loops.
        world_from_base: Frame of the base, on the floor under the middle of the axle, with tilt, shape (n, 4, 4).
    """

    values: FloatArray
    world_from_base: FloatArray

    @property
    def pose(self) -> FloatArray:
        """X m, y m and yaw in (-pi, pi], world frame, shape (n, 3)."""
        return self.values[:, POSE]

    @property
    def velocity(self) -> FloatArray:
        """Speed along the robot's own forward direction, m/s, and yaw rate, rad/s, shape (n, 2)."""
        return self.values[:, VELOCITY]

    @property
    def wheel_angles(self) -> FloatArray:
        """By how much left and right wheel have turned since the reset, radians, shape (n, 2)."""
        return self.values[:, WHEEL_ANGLES]

    @property
    def motor_power_w(self) -> FloatArray:
        """What the motors take: mechanical power and what heats the copper; never fed back; shape (n,)."""
        return self.values[:, MOTOR_POWER]

    @property
    def lidar_m(self) -> FloatArray:
        """Ranges from the robot's middle, at most the lidar's reach, shape (n, n_beams)."""
        return self.values[:, LIDAR]


@numba.njit(cache=True, error_model="numpy")  # pyright: ignore
def _read(live: tuple[FloatArray, ...], motors: tuple[FloatArray, ...], reach_m: float) -> tuple[FloatArray, ...]:
    physics, (resistance_ohm, constant_nmpa) = Physics(*live), motors
    n, n_beams = physics.beams_m.shape
    values, world_from_base = np.zeros((n, 8 + n_beams)), np.zeros((n, 4, 4))
    pose, velocity, wheel_angles = values[:, POSE], values[:, VELOCITY], values[:, WHEEL_ANGLES]
    motor_power_w, lidar_m = values[:, MOTOR_POWER], values[:, LIDAR]
    for r in range(n):
        w, x, y, z = physics.base[r, 3], physics.base[r, 4], physics.base[r, 5], physics.base[r, 6]
        frame = world_from_base[r]
        frame[0, 0], frame[0, 1], frame[0, 2] = w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)
        frame[1, 0], frame[1, 1], frame[1, 2] = 2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)
        frame[2, 0], frame[2, 1], frame[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z
        frame[3, 3] = 1.0
        yaw = np.arctan2(frame[1, 0], frame[0, 0])
        if yaw == -np.pi:
            yaw = np.pi
        for i in range(3):
            frame[i, 3] = physics.base[r, i]
        pose[r, 0], pose[r, 1], pose[r, 2] = frame[0, 3], frame[1, 3], yaw
        moving = physics.base_velocity[r]
        velocity[r, 0] = np.cos(yaw) * moving[0] + np.sin(yaw) * moving[1]
        velocity[r, 1] = moving[5]
        for side in range(2):
            wheel_angles[r, side] = physics.wheels[r, side]
            torque = physics.torque_nm[r, side]
            copper_w = (torque / constant_nmpa[side]) ** 2 * resistance_ohm[side]
            motor_power_w[r] += max(torque * physics.wheel_radps[r, side] + copper_w, 0.0)
        for beam in range(n_beams):
            range_m = physics.beams_m[r, beam] + BEAMS_START_M
            lidar_m[r, beam] = range_m if BEAMS_START_M <= range_m <= reach_m else reach_m
    return values, world_from_base


def reader(physics: Physics, motors: Motors, reach_m: float) -> Callable[[], Readings]:
    """A function that reads all robots anew."""
    live, constants = tuple(physics), tuple(motors)  # the types of plain tuples are known faster than those of named
    return lambda: Readings(*_read(live, constants, reach_m))
