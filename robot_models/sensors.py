"""Sensors that are added to each robot when a world is built: lidar, contact sensors on the hull, antenna elements."""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums and spec elements.

from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from dirmusic.arrays import FloatArray
from pdpatrol.robot_models.description.robot_description import RobotDescription

FLOOR_CONTYPE = 1
"""Contact bit of the floor, which wheels and casters touch."""

OBSTACLE_CONTYPE = 2
"""Contact bit of equipment and fence, with which the robot's hull collides."""

LIDAR_BEAMS = 36
"""Number of beams of the planar lidar. They are evenly spaced and counted counter-clockwise; the first points ahead."""

LIDAR_RANGE_M = 12.0
"""Maximum range of the lidar (assumed; typical of a small time-of-flight scanner)."""

LIDAR_PERIOD_S = 0.1
"""Time between lidar scans and between commands. Contacts are stored for the same time. It is a multiple of the physics
step."""

MAX_ELEMENTS = 16
"""Maximum number of antenna elements of a robot."""


def describe_lidar(robot: RobotDescription) -> dict[str, float]:
    """Describe the lidar as plain data: number, start, height and range of its beams, and time between scans."""
    return {
        "n_beams": LIDAR_BEAMS,
        "start_m": robot.lidar_start_m,
        "height_m": robot.lidar_height_m,
        "range_m": LIDAR_RANGE_M,
        "period_s": LIDAR_PERIOD_S,
    }


def add_lidar(spec: mujoco.MjSpec, robot: RobotDescription) -> None:
    """Add lidar beams around the base of a robot; they are read in the last physics step of each `LIDAR_PERIOD_S`."""
    ring = mujoco.MjSpec.from_string(
        f"""<mujoco>
          <compiler angle="degree"/>
          <default><site group="4" size="0.006" rgba="0.9 0.2 0.2 1"/></default>
          <worldbody>
            <replicate count="{LIDAR_BEAMS}" euler="0 0 {360 / LIDAR_BEAMS!r}" sep="_">
              <site name="beam" pos="{robot.lidar_start_m!r} 0 {robot.lidar_height_m!r}" zaxis="1 0 0"/>
            </replicate>
          </worldbody>
        </mujoco>"""
    )
    spec.attach(ring, frame=spec.body("base").add_frame(), prefix="lidar/")
    for beam in range(LIDAR_BEAMS):
        spec.add_sensor(
            name=f"lidar_{beam:02d}",
            type=mujoco.mjtSensor.mjSENS_RANGEFINDER,
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            objname=f"lidar/beam_{beam:02d}",
            intprm=[1 << mujoco.mjtRayDataField.mjRAYDATA_DIST.value, 0, 0],
            interval=[LIDAR_PERIOD_S, round(-1.5 * spec.option.timestep, 9)],
            nsample=1,
        )


def add_contact_sensors(spec: mujoco.MjSpec) -> None:
    """Add a sensor to each geom of a robot's hull that stores up to 6 contacts per physics step of `LIDAR_PERIOD_S`."""
    fields = (mujoco.mjtConDataField.mjCONDATA_FOUND, mujoco.mjtConDataField.mjCONDATA_POS)
    found_and_position = sum(1 << field.value for field in fields)
    for number, geom in enumerate([geom for geom in spec.geoms if geom.conaffinity & OBSTACLE_CONTYPE]):
        geom.name = geom.name or f"part_{number}"
        spec.add_sensor(
            name=f"hull/{geom.name}",
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=mujoco.mjtObj.mjOBJ_GEOM,
            objname=geom.name,
            intprm=[found_and_position, 0, 6],
            nsample=round(LIDAR_PERIOD_S / spec.option.timestep),
        )


class AntennaElements(NamedTuple):
    """Antenna elements in the array frame, which is the robot's base frame: x forward, y left, z up from the floor.

    Attributes:
        positions_m: Position of each element, shape (n_elements, 3).
        azimuth_rad: Azimuth of each boresight, counter-clockwise from x, shape (n_elements,).
        elevation_rad: Elevation of each boresight, shape (n_elements,).
    """

    positions_m: FloatArray
    azimuth_rad: FloatArray
    elevation_rad: FloatArray


def attach_elements(spec: mujoco.MjSpec, elements: AntennaElements) -> None:
    """Attach a helix per element to the robot's base, with sites `element_1` to `element_n`, x along the boresight."""
    base = spec.body("base")
    helix = mujoco.MjSpec.from_file(str(Path(__file__).parent / "antenna" / "helix.xml"))
    angles_rad = np.column_stack([elements.azimuth_rad, -elements.elevation_rad])
    quaternions = Rotation.from_euler("ZY", angles_rad).as_quat(scalar_first=True)
    for k, (position_m, quaternion) in enumerate(zip(elements.positions_m, quaternions, strict=True), start=1):
        spec.attach(helix.copy(), frame=base.add_frame(pos=position_m, quat=quaternion), prefix=f"helix_{k}/")
        spec.site(f"helix_{k}/element").name = f"element_{k}"
