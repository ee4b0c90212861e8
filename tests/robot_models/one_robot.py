"""One robot alone in a small yard, for tests of motion, contacts and sensors."""
# pyright: reportAttributeAccessIssue=false

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

from pdpatrol.robot_models.description.robot_file import load_robot
from pdpatrol.robot_models.readings import VELOCITY
from pdpatrol.robot_models.robots import Robots
from pdpatrol.robot_models.sensors import AntennaElements
from pdpatrol.robot_models.yard.pieces import BoxEquipment, CylinderEquipment
from pdpatrol.robot_models.yard.yard import Yard

AZIMUTHS_RAD = np.radians([90.0, 30.0, -30.0, -90.0, -150.0, 150.0])
RING_M = np.column_stack([0.12 * np.cos(AZIMUTHS_RAD), 0.12 * np.sin(AZIMUTHS_RAD), np.full(6, 0.6)])
ONE_ELEMENT = AntennaElements(np.array([[0.0, 0.0, 0.6]]), np.zeros(1), np.zeros(1))
TANK = BoxEquipment(
    name="tank", kind="power_transformer", position_m=(20.0, 10.0), footprint_m=(2.0, 4.0), height_m=3.0, shape="box"
)
BUSHING = CylinderEquipment(
    name="bushing", kind="bushing", position_m=(10.0, 20.0), radius_m=0.3, height_m=2.5, shape="cylinder"
)
YARD = Yard(size_m=(30.0, 30.0), equipment=(TANK, BUSHING))


Edited = Callable[..., Path]
"""Function that writes the file of a user's robot: that of the crawler, with old text replaced by new in pairs."""


class OneRobot:
    """One robot alone in a yard with a tank (x from 19 to 21 m, y from 8 to 12 m) and a bushing."""

    def __init__(self, model: str | Path) -> None:
        self.robot = load_robot(model)
        self.robots = Robots(self.robot, YARD, AntennaElements(RING_M, AZIMUTHS_RAD, np.zeros(6)))
        self.reset(10.0, 10.0, 0.0)

    @property
    def model(self) -> mujoco.MjModel:
        return self.robots.model

    @property
    def data(self) -> mujoco.MjData:
        return self.robots.data()

    def reset(self, x_m: float, y_m: float, yaw_rad: float) -> None:
        self.robots.reset([0], [(x_m, y_m, yaw_rad)])

    def drive(self, v_mps: float, yaw_rate_radps: float, duration_s: float) -> None:
        self.robots.drive([v_mps], [yaw_rate_radps], duration_s)

    def drive_on(self, v_mps: float, yaw_rate_radps: float, duration_s: float) -> None:
        """Drive by control steps, like the environment."""
        for _ in range(round(duration_s / 0.1)):
            self.drive(v_mps, yaw_rate_radps, 0.1)

    def pose(self) -> np.ndarray:
        return self.robots.readings.pose[0]

    def velocity(self) -> np.ndarray:
        return self.robots.readings.values[0, VELOCITY]

    def touched(self) -> tuple[str, ...]:
        return self.robots.touched[0]
