"""What a robot is, as its MJCF file tells it: measures, limits, and its driven wheels. See `robot_models/README.md`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

SPARE_M = 0.05

LEFT, RIGHT = 0, 1
"""Sides of a robot, as indices."""


class RobotFileError(ValueError):
    """A robot that cannot be used.

    Attributes:
        faults: One line each: file, element, what came, what is allowed.
    """

    def __init__(self, faults: Sequence[str]) -> None:
        self.faults = tuple(faults)
        super().__init__("\n".join(self.faults))


class Wheel(NamedTuple):
    """A driven wheel.

    Attributes:
        joint: Name of the joint that it turns about.
        actuator: Name of the servo that sets its speed.
        side: `LEFT` or `RIGHT`.
    """

    joint: str
    actuator: str
    side: int


@dataclass(frozen=True, kw_only=True)
class RobotDescription:
    """Measures and limits of a robot.

    Attributes:
        name: That of its file, without the ending.
        xml_path: Its MJCF file.
        wheels: All driven wheels.
        home_qpos: Joint positions in which it stands at rest at the world's origin, shape (n_positions,).
        wheel_radius_m: Rolling radius of the driven wheels.
        track_m: Between the points that left and right wheels stand on.
        turning_track_m: The track by which wheel speeds turn the robot: larger where wheels have to skid.
        footprint_radius_m: Of the circle about the origin of the base that everything lies in that can touch.
        inner_radius_m: Of the largest such circle that lies within the robot's outline.
        height_m: Of everything that can touch, from the floor.
        max_speed_mps: Greatest forward or backward speed that can be commanded.
        max_yaw_rate_radps: Greatest yaw rate that can be commanded.
        max_acceleration_mps2: With which it speeds up and brakes.
        yaw_rate_gain: Of the feedback of the gyro on the yaw rate, 1/s; 0 for none.
        lidar_start_m: Distance from the origin of the base to where the beams of the lidar start.
        lidar_height_m: Of the beams, from the floor.
    """

    name: str
    xml_path: Path
    wheels: tuple[Wheel, ...]
    home_qpos: tuple[float, ...]
    wheel_radius_m: float
    track_m: float
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
        """Free ground that it needs around its middle to turn on the spot, metres: with 5 cm to spare (assumed)."""
        return self.footprint_radius_m + SPARE_M

    @property
    def limits(self) -> tuple[float, float]:
        """Greatest speed, m/s, and greatest yaw rate, rad/s."""
        return self.max_speed_mps, self.max_yaw_rate_radps

    @cached_property
    def _limits(self) -> FloatArray:
        return np.array(self.limits)

    def command_from_action(self, action: ArrayLike) -> FloatArray:
        """Speeds, m/s, and yaw rates, rad/s, shape (..., 2), of actions of that shape: shares of the limits.

        Raises:
            ValueError: If the last axis of `action` is not of length 2.
        """
        shares = np.asarray(action, dtype=np.float64)
        if shares.shape[-1:] != (2,):
            raise ValueError(f"`action` must have shape (..., 2), speed and yaw rate, got {shares.shape}")
        return shares * self._limits

    def action_from_command(self, command: ArrayLike) -> NDArray[np.float32]:
        """Actions in [-1, 1], shape (..., 2), of speeds, m/s, and yaw rates, rad/s, clipped to the limits."""
        return np.clip(np.asarray(command, dtype=np.float64) / self._limits, -1.0, 1.0).astype(np.float32)
