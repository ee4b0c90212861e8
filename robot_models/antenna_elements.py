"""Antenna elements of a robot: positions, boresights, and geoms in MuJoCo."""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums and spec elements.

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from dirmusic.arrays import FloatArray

MAX_ELEMENTS = 16
"""Maximum number of antenna elements of a robot."""


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
