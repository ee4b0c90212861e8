"""What the robot knows of itself, as a scenario file says it: pose sensor, odometry, lidar, battery."""

from __future__ import annotations

from math import radians
from typing import Annotated

from pydantic import Field

from dirmusic import PoseError
from pdpatrol.envs.scenario.base import Config
from pdpatrol.sensing.quantities import PLAIN_ZERO, Share

MetreError = Annotated[float, Field(ge=0.0, le=10.0), PLAIN_ZERO]
DegreeError = Annotated[float, Field(ge=0.0, le=180.0), PLAIN_ZERO]
GyroError = Annotated[float, Field(ge=0.0, le=3600.0), PLAIN_ZERO]
"""Degrees per minute, or per its square root; 60 degrees a second is a broken gyro."""
Correlation = Annotated[float, Field(ge=0.01, le=86_400.0), PLAIN_ZERO]
"""Seconds, from a tenth of a step of control to a day."""
WattHour = Annotated[float, Field(ge=0.01, le=1e6), PLAIN_ZERO]
Watt = Annotated[float, Field(ge=0.001, le=1e6), PLAIN_ZERO]
"""All bounds of these are assumed: no robot is beyond them."""


class PoseSensorConfig(Config, frozen=True):
    """Standard deviations of the pose and how long its error lasts; defaults assumed, as of a lidar in a known map."""

    position_std_m: MetreError = 0.05
    heading_std_deg: DegreeError = 0.5
    correlation_s: Correlation = 5.0

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

    wheel_radius_error: Share = 0.001
    """Share by which the wheels are larger or smaller than the robot believes, drawn once."""
    gyro_bias_deg_per_min: GyroError = 0.05
    """Drawn once: what is left after the gyro was zeroed at the dock."""
    gyro_noise_deg_per_sqrt_min: GyroError = 0.1
    """Angle random walk."""


class LidarConfig(Config, frozen=True):
    """Standard deviation of a range; the default is assumed, as of a small time-of-flight scanner."""

    range_std_m: MetreError = 0.02


class BatteryConfig(Config, frozen=True):
    """What the battery holds, and what takes from it all the time.

    The defaults are assumed: a 24 V, 20 Ah pack, and a fast digitiser with its computer.
    """

    capacity_wh: WattHour = 480.0
    idle_w: Watt = 80.0
