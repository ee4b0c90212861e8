"""What the robot knows of itself, as a scenario file says it: pose sensor, odometry, lidar, battery."""

from __future__ import annotations

from math import radians

from pydantic import NonNegativeFloat, PositiveFloat

from dirmusic import PoseError
from envs.scenario.base import Config


class PoseSensorConfig(Config, frozen=True):
    """Standard deviations of the pose and how long its error lasts; defaults assumed, as of a lidar in a known map."""

    position_std_m: NonNegativeFloat = 0.05
    heading_std_deg: NonNegativeFloat = 0.5
    correlation_s: PositiveFloat = 5.0

    @property
    def pose_error(self) -> PoseError:
        """The same as the Locator takes it."""
        return PoseError(
            position_m=self.position_std_m,
            heading_rad=radians(self.heading_std_deg),
            correlation_s=self.correlation_s,
        )


class OdometryConfig(Config, frozen=True):
    """Standard deviations of what makes odometry drift; defaults assumed, as of magnetic encoders and a MEMS gyro."""

    wheel_radius_error: NonNegativeFloat = 0.001
    """Share by which the wheels are larger or smaller than the robot believes, drawn once."""
    gyro_bias_deg_per_min: NonNegativeFloat = 0.05
    """Drawn once: what is left after the gyro was zeroed at the dock."""
    gyro_noise_deg_per_sqrt_min: NonNegativeFloat = 0.1
    """Angle random walk."""


class LidarConfig(Config, frozen=True):
    """Standard deviation of a range; the default is assumed, as of a small time-of-flight scanner."""

    range_std_m: NonNegativeFloat = 0.02


class BatteryConfig(Config, frozen=True):
    """What the battery holds, and what takes from it all the time.

    The defaults are assumed: a 24 V, 20 Ah pack, and a fast digitiser with its computer.
    """

    capacity_wh: PositiveFloat = 480.0
    idle_w: PositiveFloat = 80.0
