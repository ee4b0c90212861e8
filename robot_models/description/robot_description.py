"""Descriptions of robots: dimensions and limits."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic.arrays import FloatArray

SHIPPED = ("crawler", "inspector")
"""Names of the robots that come with the package."""


@dataclass(frozen=True, kw_only=True)
class RobotDescription:
    """Dimensions and limits of a robot.

    Attributes:
        name: Name of the robot's file, without the suffix.
        xml_path: MJCF file of the robot.
        home_qpos: Joint positions of the robot at rest at the world's origin, shape (n_positions,).
        wheel_radius_m: Rolling radius of the driven wheels.
        turning_track_m: Effective track width: the difference of the wheel speeds of the two sides divided by the yaw
            rate. It is larger than the wheel spacing if the wheels skid in turns.
        footprint_radius_m: Radius of the smallest circle, around the origin of the base, that contains all geoms that
            can collide.
        inner_radius_m: Radius of the largest circle around the same point within the robot's outline.
        height_m: Height of the highest point that can collide.
        max_speed_mps: Maximum speed that can be commanded, forward or backward.
        max_yaw_rate_radps: Maximum yaw rate that can be commanded.
        max_acceleration_mps2: Acceleration of the robot when it speeds up or brakes.
        yaw_rate_gain: Gain of the gyro feedback on the yaw rate, 1/s; 0 without feedback.
        lidar_start_m: Distance from the origin of the base to the start of the lidar's beams.
        lidar_height_m: Height of the beams above the floor.
    """

    name: str
    xml_path: Path
    home_qpos: tuple[float, ...]
    wheel_radius_m: float
    turning_track_m: float
    footprint_radius_m: float
    inner_radius_m: float
    height_m: float
    max_speed_mps: float
    max_yaw_rate_radps: float
    max_acceleration_mps2: float
    yaw_rate_gain: float
    lidar_start_m: float
    lidar_height_m: float

    @property
    def room_m(self) -> float:
        """Radius of free ground that the robot needs to turn on the spot, metres, with a margin of 5 cm (assumed)."""
        return self.footprint_radius_m + 0.05

    @property
    def limits(self) -> tuple[float, float]:
        """Maximum speed, m/s, and maximum yaw rate, rad/s."""
        return self.max_speed_mps, self.max_yaw_rate_radps

    def command_from_action(self, action: ArrayLike) -> FloatArray:
        """Convert actions, given as fractions of the limits, to speeds, m/s, and yaw rates, rad/s, shape (..., 2)."""
        return np.asarray(action, dtype=np.float64) * self.limits

    def action_from_command(self, command: ArrayLike) -> NDArray[np.float32]:
        """Convert speeds, m/s, and yaw rates, rad/s, to actions in [-1, 1], clipped to the limits, shape (..., 2)."""
        return np.clip(np.asarray(command, dtype=np.float64) / self.limits, -1.0, 1.0).astype(np.float32)


def is_path(model: str | Path) -> bool:
    """Return whether a robot is given by its file rather than by its name."""
    return Path(model).suffix == ".xml" or len(Path(model).parts) > 1


def xml_path(name: str) -> Path:
    """Return the MJCF file of a shipped robot."""
    return Path(__file__).parents[1] / name / f"{name}.xml"
