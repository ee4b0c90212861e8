"""Scenario tables of the robot: its model, pose sensor, odometry, lidar and battery."""

from dataclasses import replace
from functools import cached_property
from math import exp, radians
from typing import Annotated, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from dirmusic import PoseError
from dirmusic.arrays import FloatArray
from pdpatrol.robot_models.description.robot_description import RobotDescription
from pdpatrol.robot_models.description.robot_file import load_robot
from pdpatrol.sensing.quantities import AngleError, Config, FilePath, Share

MetreError = Annotated[float, Field(ge=0.0, le=10.0)]
CorrelationTime = Annotated[float, Field(ge=0.01, le=86_400.0)]
GyroError = Annotated[float, Field(ge=0.0, le=3600.0)]
"""Degrees per minute for a bias; degrees per square root of a minute for an angle random walk."""


def _check_model(model: str) -> str:
    load_robot(model)  # lists the errors of the file
    return model


class RobotConfig(Config):
    """Robot model and speed limit."""

    model: Annotated[FilePath, AfterValidator(_check_model)] = "inspector"
    """Name of a shipped robot, or path of an MJCF file; a relative path starts at the folder of the scenario file."""
    max_speed_mps: Annotated[float, Field(ge=0.01, le=10.0)] | None = None
    """Maximum commanded speed; by default the limit of the robot model."""

    @model_validator(mode="after")
    def _check_speed(self) -> Self:
        limit_mps = load_robot(self.model).max_speed_mps
        if self.max_speed_mps is not None and self.max_speed_mps > limit_mps:
            raise ValueError(
                f"max_speed_mps: must be at most the limit of the robot, {limit_mps:g}, got {self.max_speed_mps:g}"
            )
        return self

    @cached_property
    def description(self) -> RobotDescription:
        """Dimensions and limits of the robot."""
        robot = load_robot(self.model)
        return robot if self.max_speed_mps is None else replace(robot, max_speed_mps=self.max_speed_mps)


class PoseSensorConfig(Config):
    """Pose error as the robot believes it: standard deviations and correlation time.

    Assumed; typical of lidar localisation in a map. True errors may differ; see `[nature.pose_sensor]`.
    """

    position_std_m: MetreError = 0.05
    """Standard deviation of the position, along x and along y."""
    heading_std_deg: AngleError = 0.5
    """Standard deviation of the heading."""
    correlation_s: CorrelationTime = 5.0
    """Time in which the correlation of the errors falls to 1/e."""
    frame_offset_std_m: Annotated[float, Field(ge=0.01, le=1.0)] = 0.3
    """Standard deviation, along x and along y, of the displacement of the localisation's frame against the map.

    Assumed, as its rotation: a frame aligned by hand with a drawing. Both matter little, because scans of the lidar
    determine the frame much better."""
    frame_rotation_std_deg: Annotated[float, Field(ge=0.01, le=3.0)] = 1.0
    """Standard deviation of the rotation of that frame about the dock."""

    @property
    def frame_std(self) -> FloatArray:
        """Standard deviations of the frame against the map: x m, y m and rotation rad, shape (3,)."""
        return np.array([self.frame_offset_std_m, self.frame_offset_std_m, radians(self.frame_rotation_std_deg)])

    @property
    def std(self) -> FloatArray:
        """Standard deviations of the error in x m, y m and yaw rad, shape (3,)."""
        return np.array([self.position_std_m, self.position_std_m, radians(self.heading_std_deg)])

    def correlation(self, step_s: float) -> float:
        """Return the correlation of two errors that are `step_s` apart in time."""
        return exp(-step_s / self.correlation_s)

    @property
    def pose_error(self) -> PoseError:
        """Pose error in the form that the Locator takes."""
        return PoseError(
            position_m=self.position_std_m,
            heading_rad=radians(self.heading_std_deg),
            correlation_s=self.correlation_s,
        )


class OdometryConfig(Config):
    """Standard deviations of the odometry errors. Assumed; typical of magnetic wheel encoders and a MEMS gyro."""

    wheel_radius_error: Share = 0.001
    """Relative error of the wheel radius, drawn once per mission."""
    gyro_bias_deg_per_min: GyroError = 0.05
    """Gyro bias that remains after zeroing at the dock, drawn once per mission."""
    gyro_noise_deg_per_sqrt_min: GyroError = 0.1
    """Angle random walk of the gyro."""


class LidarConfig(Config):
    """Standard deviation of a lidar range. Assumed; typical of a small time-of-flight scanner."""

    range_std_m: MetreError = 0.02
    """Standard deviation of a range."""


Capacity = Annotated[float, Field(ge=0.01, le=1e6)]
Power = Annotated[float, Field(ge=0.001, le=1e6)]
EnergyPerMetre = Annotated[float, Field(ge=0.0, le=1e5)]


class BatteryConfig(Config):
    """Battery, its loads and its charger as the robot believes them; see `[nature.battery]`.

    The motors of the simulation add what acceleration and skidding take: 0.3 W on patrols of the inspector, 9 W on
    those of the crawler. The robot measures the sum while it drives.
    """

    capacity_wh: Capacity = 480.0
    """Energy of the full battery. A sealed pack of 24 V and 20 Ah, as in the Clearpath Husky A200 (user manual)."""
    idle_w: Power = 80.0
    """Constant load. Assumed; a fast digitiser and a computer."""
    drive_j_per_m: EnergyPerMetre = 20.0
    """Energy per metre against rolling resistance, which the simulated floor lacks. Assumed: 18 kg on loose gravel with
    a rolling resistance coefficient of 0.06 (0.04 to 0.08, engineeringtoolbox.com, Rolling Resistance) and half of the
    energy lost in the drive. It matters little: 16 W at 0.8 m/s, a sixth of the total."""
    charge_w: Power = 240.0
    """Power into the battery while the robot stands at the dock, where the charger also carries the constant load.
    Assumed; half the capacity per hour, usual for lithium-ion cells."""
    reserve: Annotated[float, Field(ge=0.0, le=0.9)] = 0.2
    """State of charge with which the robot arrives at the dock when it returns to charge. Assumed."""
