"""Scenario table of nature: true values that may differ from the beliefs of the robot."""

from math import radians
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from dirmusic.arrays import FloatArray
from pdpatrol.envs.scenario.moving import MOST_MOVING, MovingConfig
from pdpatrol.envs.scenario.robot import (
    BatteryConfig,
    Capacity,
    CorrelationTime,
    EnergyPerMetre,
    MetreError,
    PoseSensorConfig,
    Power,
)
from pdpatrol.sensing import TrueArrayConfig, TrueReceiverConfig
from pdpatrol.sensing.quantities import AngleError, Config, Degree

Offset = Annotated[float, Field(ge=-10.0, le=10.0)]
"""Constant error of a position, metres."""

PerMinute = Annotated[float, Field(ge=0.0, le=600.0)]
"""Mean number of events per minute, at most one per control step."""


class TruePoseConfig(Config):
    """True errors of the pose sensor; keys that are absent have the believed values, which are 0 for a bias.

    A reading is the true pose, in the frame of the localisation, with the bias and a correlated error. Jumps and
    dropouts come at random times, as Poisson processes.
    """

    position_std_m: MetreError | None = None
    """True standard deviation of the position, along x and along y."""
    heading_std_deg: AngleError | None = None
    """True standard deviation of the heading."""
    correlation_s: CorrelationTime | None = None
    """True time in which the correlation of the errors falls to 1/e."""
    position_bias_m: tuple[Offset, Offset] = (0.0, 0.0)
    """Constant error, robot frame: forward and left, as of a lidar that is mounted elsewhere than stated."""
    heading_bias_deg: Degree = 0.0
    """Constant error of the heading, counter-clockwise."""
    frame_offset_m: tuple[Offset, Offset] = (0.0, 0.0)
    """Displacement of the frame of the localisation against the map, east and north: added to every position."""
    frame_rotation_deg: Degree = 0.0
    """Rotation of that frame about the dock, counter-clockwise, before the displacement."""

    jumps_per_min: PerMinute = 0.0
    """Mean number of jumps of the pose per minute."""
    jump_std_m: MetreError = 0.0
    """Standard deviation by which the error jumps along x and along y. It then decays with the correlation time, as
    when a scan is matched to the wrong place and the localisation recovers."""
    jump_std_deg: AngleError = 0.0
    """Standard deviation by which the heading jumps."""
    dropouts_per_min: PerMinute = 0.0
    """Mean number of dropouts per minute."""
    dropout_s: Annotated[float, Field(ge=0.0, le=86_400.0)] = 0.0
    """Duration of each dropout, during which the pose is dead-reckoned by wheels and gyro."""

    def applied_to(self, believed: PoseSensorConfig) -> PoseSensorConfig:
        """Return the believed pose sensor with the true deviations and correlation time."""
        own = self.model_dump(include=set(PoseSensorConfig.model_fields), exclude_none=True)
        return believed.model_copy(update=own)

    @property
    def jump_std(self) -> FloatArray:
        """Standard deviations of a jump in x m, y m and yaw rad."""
        return np.array([self.jump_std_m, self.jump_std_m, radians(self.jump_std_deg)])

    @model_validator(mode="after")
    def _check_events(self) -> Self:
        for rate, sizes in (("jumps_per_min", ("jump_std_m", "jump_std_deg")), ("dropouts_per_min", ("dropout_s",))):
            if (getattr(self, rate) > 0.0) != any(getattr(self, size) > 0.0 for size in sizes):
                raise ValueError(f"{rate}, {' or '.join(sizes)}: must be given together")
        return self

    @property
    def bias(self) -> FloatArray:
        """Constant error: forward m, left m, yaw rad."""
        return np.array([*self.position_bias_m, radians(self.heading_bias_deg)])

    @property
    def frame(self) -> FloatArray:
        """Displacement and rotation of the localisation's frame: x m, y m, yaw rad."""
        return np.array([*self.frame_offset_m, radians(self.frame_rotation_deg)])


class TrueBatteryConfig(Config):
    """True battery, loads and charger; keys that are absent have the believed values.

    The robot reads the true state of charge.
    """

    capacity_wh: Capacity | None = None
    """True energy of the full battery."""
    idle_w: Power | None = None
    """True constant load."""
    drive_j_per_m: EnergyPerMetre | None = None
    """True energy per metre against rolling resistance."""
    charge_w: Power | None = None
    """True power into the battery at the dock."""

    def applied_to(self, believed: BatteryConfig) -> BatteryConfig:
        """Return the believed battery with the true values."""
        return believed.model_copy(update=self.model_dump(exclude_none=True))


class NatureConfig(Config):
    """True values that differ from the believed ones; by default only the drawn errors differ.

    Physics, radio and scores use the true values. The estimator, Locator, planner, policies and report use the believed
    values: the tables of the same names outside `[nature]`.
    """

    array: TrueArrayConfig = TrueArrayConfig()
    pose_sensor: TruePoseConfig = TruePoseConfig()
    battery: TrueBatteryConfig = TrueBatteryConfig()
    receiver: TrueReceiverConfig = TrueReceiverConfig()
    moving: tuple[MovingConfig, ...] = Field(default=(), max_length=MOST_MOVING)
    """People and vehicles, which the robot meets without knowing of them."""
