"""What robots add_pose_error of their motion and what it takes, in compiled loops over the robots."""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from dirmusic.kernels import wrapped
from pdpatrol.envs.scenario.robot import BatteryConfig, OdometryConfig, PoseSensorConfig
from pdpatrol.robot_models.readings import MOTOR_POWER, POSE, WHEEL_ANGLES

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

N_DRAWS = 4
"""Standard normal draws for each robot and step: x, y and yaw of the pose sensor, and the gyro."""


class Motion(NamedTuple):
    """What robots know of their motion; a row is a robot. Compiled loops change it in place.

    Attributes:
        n_steps: Steps since the start, shape (n_robots,).
        time_s: Time since the start, shape (n_robots,).
        pose: Believed: x m, y m, yaw in (-pi, pi], shape (n_robots, 3).
        pose_error: Of the pose sensor's last reading, NaN before the first, shape (n_robots, 3).
        odometry: Pose by wheels and gyro alone, shape (n_robots, 3).
        wheels_rad: Angles of left and right wheel at the last step, shape (n_robots, 2).
        yaw_rad: True heading at the last step, shape (n_robots,).
        metres_per_radian: Path that the robot believes in for each wheel's turn, shape (n_robots,).
        gyro_bias_radps: Shape (n_robots,).
        used_wh: Taken from the battery, shape (n_robots,).
        battery: Share that is left in it, in [0, 1], shape (n_robots,).
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
    def at_rest(cls, n_robots: int) -> Self:
        """Of robots that are yet to be started."""
        n = n_robots
        return cls(
            n_steps=np.zeros(n),
            time_s=np.zeros(n),
            pose=np.zeros((n, 3)),
            pose_error=np.full((n, 3), np.nan),
            odometry=np.zeros((n, 3)),
            wheels_rad=np.zeros((n, 2)),
            yaw_rad=np.zeros(n),
            metres_per_radian=np.zeros(n),
            gyro_bias_radps=np.zeros(n),
            used_wh=np.zeros(n),
            battery=np.ones(n),
        )

    def draw_odometry(self, row: int, config: OdometryConfig, wheel_radius_m: float, rng: np.random.Generator) -> None:
        """Give the odometry of one robot errors of its own."""
        scale, bias = rng.standard_normal(2)
        self.metres_per_radian[row] = wheel_radius_m * (1.0 + config.wheel_radius_error * scale)
        self.gyro_bias_radps[row] = np.radians(config.gyro_bias_deg_per_min) / 60.0 * bias


class SensorParameters(NamedTuple):
    """How the robots sense their motion.

    Attributes:
        pose_std: Standard deviations of the pose sensor's error on x, y and yaw, shape (3,).
        pose_kept: Share of it that lasts from one step to the next.
        gyro_noise_rad: Standard deviation of what the gyro's noise adds in a step.
        idle_w: Taken from the battery all the time.
        capacity_wh: Of the battery.
        step_s: Length of a step.
    """

    pose_std: FloatArray
    pose_kept: float
    gyro_noise_rad: float
    idle_w: float
    capacity_wh: float
    step_s: float

    @classmethod
    def of(cls, pose_sensor: PoseSensorConfig, odometry: OdometryConfig, battery: BatteryConfig, step_s: float) -> Self:
        """As configured, for steps of one length."""
        spread_m, spread_rad = pose_sensor.position_std_m, math.radians(pose_sensor.heading_std_deg)
        return cls(
            pose_std=np.array([spread_m, spread_m, spread_rad]),
            pose_kept=math.exp(-step_s / pose_sensor.correlation_s),
            gyro_noise_rad=math.radians(odometry.gyro_noise_deg_per_sqrt_min) / 60.0**0.5 * step_s**0.5,
            idle_w=battery.idle_w,
            capacity_wh=battery.capacity_wh,
            step_s=step_s,
        )


@compiled
def add_pose_error(
    true_pose: FloatArray, error: FloatArray, kept: float, std: FloatArray, normal: FloatArray, believed: FloatArray
) -> None:
    """A pose with a first-order Gauss-Markov error, yaw in (-pi, pi]; all of shape (3,).

    Args:
        true_pose: x m, y m, yaw rad.
        error: Of the last reading, NaN before the first; becomes that of this one.
        kept: Share of the error that lasts until now.
        std: Of the error.
        normal: Standard normal draws, at least three.
        believed: Becomes the result.
    """
    renewed = np.sqrt(1.0 - kept * kept)
    for i in range(3):
        if np.isnan(error[i]):
            error[i] = std[i] * normal[i]
        else:
            error[i] = kept * error[i] + renewed * std[i] * normal[i]
        believed[i] = true_pose[i] + error[i]
    believed[2] = wrapped(believed[2])


@compiled
def integrate_odometry(pose: FloatArray, turned_rad: float, metres_per_radian: float, turn_rad: float) -> None:
    """Move a pose by odometry (3,) on along an arc, yaw in (-pi, pi].

    Args:
        pose: x m, y m, yaw rad.
        turned_rad: By how much both wheels have turned together.
        metres_per_radian: Path that the robot believes in for each wheel's turn.
        turn_rad: Change of heading by the gyro.
    """
    rolled_m, along = 0.5 * turned_rad * metres_per_radian, pose[2] + 0.5 * turn_rad
    pose[0] += rolled_m * np.cos(along)
    pose[1] += rolled_m * np.sin(along)
    pose[2] = wrapped(pose[2] + turn_rad)


class StepInputs(NamedTuple):
    """What a step brought; a row is a robot.

    Attributes:
        readings: The values of `pdpatrol.robot_models.readings.Readings`, shape (n_robots, n_values).
        normal: Standard normal draws, shape (n_robots, N_DRAWS).
        sources_m: Where the sources are, world frame, shape (n_robots, n_sources, 2).
        is_touching: Who touched something, shape (n_robots,).
        is_reset: Reset mask: whose episode has just begun, so that no time has passed, shape (n_robots,).
        is_idle: Idle mask: who takes no step, and nothing changes, shape (n_robots,).
    """

    readings: FloatArray
    normal: FloatArray
    sources_m: FloatArray
    is_touching: BoolArray
    is_reset: BoolArray
    is_idle: BoolArray


@compiled
def move(motion: Motion, sensors: SensorParameters, inputs: StepInputs) -> None:
    """Sense what a step has brought: the change of yaw is an ideal gyro's integral, with its drift on top."""
    hours = sensors.step_s / 3600.0
    true_pose, wheels_rad = inputs.readings[:, POSE], inputs.readings[:, WHEEL_ANGLES]
    motor_power_w = inputs.readings[:, MOTOR_POWER]
    for r in range(len(true_pose)):
        if inputs.is_idle[r]:
            continue
        is_reset, normal = inputs.is_reset[r], inputs.normal[r]
        if is_reset:
            motion.pose_error[r] = np.nan
        add_pose_error(true_pose[r], motion.pose_error[r], sensors.pose_kept, sensors.pose_std, normal, motion.pose[r])
        if is_reset:
            for i in range(3):
                motion.odometry[r, i] = motion.pose[r, i]
            motion.used_wh[r], motion.n_steps[r] = 0.0, 0
        else:
            both = wheels_rad[r, 0] - motion.wheels_rad[r, 0] + wheels_rad[r, 1] - motion.wheels_rad[r, 1]
            drift_rad = motion.gyro_bias_radps[r] * sensors.step_s + sensors.gyro_noise_rad * normal[3]
            turn_rad = wrapped(true_pose[r, 2] - motion.yaw_rad[r]) + drift_rad
            integrate_odometry(motion.odometry[r], both, motion.metres_per_radian[r], turn_rad)
            motion.used_wh[r] += (sensors.idle_w + motor_power_w[r]) * hours
            motion.n_steps[r] += 1
        motion.time_s[r] = motion.n_steps[r] * sensors.step_s
        motion.battery[r] = max(1.0 - motion.used_wh[r] / sensors.capacity_wh, 0.0)
        motion.wheels_rad[r, 0], motion.wheels_rad[r, 1] = wheels_rad[r, 0], wheels_rad[r, 1]
        motion.yaw_rad[r] = true_pose[r, 2]
