"""Pose sensor, odometry and battery of the robots."""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import wrapped
from dirmusic.compiled import compiled
from pdpatrol.envs.scenario.robot import BatteryConfig, OdometryConfig, PoseSensorConfig
from pdpatrol.robot_models.readings import MOTOR_POWER, POSE, WHEEL_ANGLES

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

N_DRAWS = 4
"""Standard normal draws per robot and step: x, y and yaw of the pose sensor, and the gyro."""


class MotionState(NamedTuple):
    """State of the sensors of motion, with a row for each robot. The kernels change it in place.

    Attributes:
        n_steps: Steps since the start, shape (n_robots,).
        time_s: Time since the start, shape (n_robots,).
        pose: Believed x m, y m, yaw in (-pi, pi], shape (n_robots, 3).
        pose_error: Error of the last reading of the pose sensor, NaN before the first, shape (n_robots, 3).
        odometry: Pose by wheels and gyro alone, shape (n_robots, 3).
        wheels_rad: Angles of the left and the right wheel at the last step, shape (n_robots, 2).
        yaw_rad: True heading at the last step, shape (n_robots,).
        metres_per_radian: Believed path per angle of the wheels, shape (n_robots,).
        gyro_bias_radps: Shape (n_robots,).
        used_wh: Energy taken from the battery, shape (n_robots,).
        battery: Remaining share of its capacity, in [0, 1], shape (n_robots,).
    """

    n_steps: FloatArray
    time_s: FloatArray
    pose: FloatArray
    pose_error: FloatArray
    odometry: FloatArray
    wheels_rad: FloatArray
    yaw_rad: FloatArray
    metres_per_radian: FloatArray
    gyro_bias_radps: FloatArray
    used_wh: FloatArray
    battery: FloatArray

    @classmethod
    def zeros(cls, n_robots: int) -> Self:
        """Make the state of robots that have not been started."""
        shapes = {"pose": (3,), "pose_error": (3,), "odometry": (3,), "wheels_rad": (2,)}
        return cls(*(np.zeros((n_robots, *shapes.get(field, ()))) for field in cls._fields))

    def draw_odometry(self, row: int, config: OdometryConfig, wheel_radius_m: float, rng: np.random.Generator) -> None:
        """Draw the odometry errors of one robot."""
        scale, bias = rng.standard_normal(2)
        self.metres_per_radian[row] = wheel_radius_m * (1.0 + config.wheel_radius_error * scale)
        self.gyro_bias_radps[row] = np.radians(config.gyro_bias_deg_per_min) / 60.0 * bias


class SensorParameters(NamedTuple):
    """Parameters of the sensors of motion.

    Attributes:
        pose_std: Standard deviations of the pose sensor's error in x, y and yaw, shape (3,).
        pose_correlation: Correlation of its errors in successive steps.
        gyro_noise_rad: Standard deviation of the gyro noise per step.
        idle_w: Constant load of the battery.
        capacity_wh: Capacity of the battery.
        step_s: Length of a step.
    """

    pose_std: FloatArray
    pose_correlation: float
    gyro_noise_rad: float
    idle_w: float
    capacity_wh: float
    step_s: float

    @classmethod
    def of(cls, pose_sensor: PoseSensorConfig, odometry: OdometryConfig, battery: BatteryConfig, step_s: float) -> Self:
        """Make the parameters for steps of one length from tables of a scenario."""
        std_m, std_rad = pose_sensor.position_std_m, math.radians(pose_sensor.heading_std_deg)
        return cls(
            pose_std=np.array([std_m, std_m, std_rad]),
            pose_correlation=math.exp(-step_s / pose_sensor.correlation_s),
            gyro_noise_rad=math.radians(odometry.gyro_noise_deg_per_sqrt_min) / 60.0**0.5 * step_s**0.5,
            idle_w=battery.idle_w,
            capacity_wh=battery.capacity_wh,
            step_s=step_s,
        )


@compiled
def add_pose_error(
    true_pose: FloatArray, error: FloatArray, correlation: float, std: FloatArray, normal: FloatArray, pose: FloatArray
) -> None:
    """Add a first-order Gauss-Markov error to a pose; all arrays have shape (3,).

    Args:
        true_pose: x m, y m, yaw rad.
        error: Error of the last reading, NaN before the first; replaced by that of this reading.
        correlation: Correlation of the two errors.
        std: Standard deviations of the error.
        normal: Standard normal draws, at least three.
        pose: Receives the result, yaw in (-pi, pi].
    """
    innovation = np.sqrt(1.0 - correlation * correlation)
    for i in range(3):
        if np.isnan(error[i]):
            error[i] = std[i] * normal[i]
        else:
            error[i] = correlation * error[i] + innovation * std[i] * normal[i]
        pose[i] = true_pose[i] + error[i]
    pose[2] = wrapped(pose[2])


@compiled
def integrate_odometry(pose: FloatArray, turned_rad: float, metres_per_radian: float, turn_rad: float) -> None:
    """Move a pose (3,) along an arc.

    Args:
        pose: x m, y m, yaw in (-pi, pi]; replaced by the result.
        turned_rad: Sum of the angles by which both wheels have turned.
        metres_per_radian: Path per angle of the wheels.
        turn_rad: Change of heading.
    """
    path_m, along = 0.5 * turned_rad * metres_per_radian, pose[2] + 0.5 * turn_rad
    pose[0] += path_m * np.cos(along)
    pose[1] += path_m * np.sin(along)
    pose[2] = wrapped(pose[2] + turn_rad)


@compiled
def start_motion(
    motion: MotionState, sensors: SensorParameters, readings: FloatArray, normal: FloatArray, rows: IntArray
) -> None:
    """Start the sensors of some robots at the beginning of an episode; arguments as in `sense_motion`."""
    for r in rows:
        motion.pose_error[r] = np.nan
        motion.n_steps[r], motion.time_s[r], motion.used_wh[r], motion.battery[r] = 0.0, 0.0, 0.0, 1.0
        sense_pose(motion, sensors, readings[r], normal[r], r)
        motion.odometry[r] = motion.pose[r]


@compiled
def sense_motion(
    motion: MotionState, sensors: SensorParameters, readings: FloatArray, normal: FloatArray, rows: IntArray
) -> None:
    """Update the sensors of some robots after a step.

    Args:
        motion: State; updated.
        sensors: Parameters.
        readings: Values of `pdpatrol.robot_models.readings.Readings`, shape (n_robots, n_values).
        normal: Standard normal draws, shape (n_robots, N_DRAWS).
        rows: The robots.
    """
    hours = sensors.step_s / 3600.0
    true_pose, wheels_rad = readings[:, POSE], readings[:, WHEEL_ANGLES]
    motor_power_w = readings[:, MOTOR_POWER]
    for r in rows:
        turned_rad = wheels_rad[r, 0] - motion.wheels_rad[r, 0] + wheels_rad[r, 1] - motion.wheels_rad[r, 1]
        drift_rad = motion.gyro_bias_radps[r] * sensors.step_s + sensors.gyro_noise_rad * normal[r, 3]
        turn_rad = wrapped(true_pose[r, 2] - motion.yaw_rad[r]) + drift_rad
        metres_per_radian: float = motion.metres_per_radian[r]  # pyright: ignore[reportAssignmentType]
        integrate_odometry(motion.odometry[r], turned_rad, metres_per_radian, turn_rad)
        motion.used_wh[r] += (sensors.idle_w + motor_power_w[r]) * hours
        motion.n_steps[r] += 1
        motion.time_s[r] = motion.n_steps[r] * sensors.step_s
        motion.battery[r] = max(1.0 - motion.used_wh[r] / sensors.capacity_wh, 0.0)
        sense_pose(motion, sensors, readings[r], normal[r], r)


@compiled
def sense_pose(motion: MotionState, sensors: SensorParameters, reading: FloatArray, normal: FloatArray, r: int) -> None:
    """Read the pose sensor of robot `r`, and note where its wheels and heading are."""
    true_pose, wheels_rad = reading[POSE], reading[WHEEL_ANGLES]
    add_pose_error(true_pose, motion.pose_error[r], sensors.pose_correlation, sensors.pose_std, normal, motion.pose[r])
    motion.wheels_rad[r, 0], motion.wheels_rad[r, 1] = wheels_rad[0], wheels_rad[1]
    motion.yaw_rad[r] = true_pose[2]
