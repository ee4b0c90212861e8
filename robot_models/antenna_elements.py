"""Antenna elements of a robot: positions, directions, and their geoms in MuJoCo."""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums and spec elements.

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple, Self

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

MAX_ELEMENTS = 16
"""Largest number of antenna elements of a robot."""


class AntennaElements(NamedTuple):
    """Antenna elements in the array frame: that of the robot's base, x forward, y left, z up from the floor.

    Attributes:
        positions_m: Shape (n_elements, 3).
        azimuth_rad: Azimuth of each boresight, counter-clockwise from x, shape (n_elements,).
        elevation_rad: Elevation of each boresight, shape (n_elements,).
    """

    positions_m: FloatArray
    azimuth_rad: FloatArray
    elevation_rad: FloatArray

    @classmethod
    def checked(cls, positions_m: ArrayLike, azimuth_rad: ArrayLike, elevation_rad: ArrayLike = 0.0) -> Self:
        """Check and convert 1 to `MAX_ELEMENTS` elements; the elevation may be common to all.

        Raises:
            ValueError: If shapes disagree, a value is not finite, or there are too many elements.
        """
        positions = np.array(positions_m, dtype=np.float64)
        if positions.ndim != 2 or positions.shape[1] != 3 or not 1 <= len(positions) <= MAX_ELEMENTS:
            raise ValueError(
                f"`positions_m` must have shape (n, 3) with n from 1 to {MAX_ELEMENTS}, got {positions.shape}"
            )
        azimuth, elevation = np.array(azimuth_rad, dtype=np.float64), np.array(elevation_rad, dtype=np.float64)
        if azimuth.shape != (len(positions),) or elevation.shape not in ((), azimuth.shape):
            raise ValueError(
                f"`azimuth_rad` and `elevation_rad` must have shape ({len(positions)},) to match `positions_m`, "
                f"got {azimuth.shape} and {elevation.shape}"
            )
        if not (np.isfinite(positions).all() and np.isfinite(azimuth).all() and np.isfinite(elevation).all()):
            raise ValueError("positions, azimuths and elevations of elements must be finite, got NaN or infinity")
        return cls(positions, azimuth, np.broadcast_to(elevation, azimuth.shape))


def attach_elements(spec: mujoco.MjSpec, elements: AntennaElements) -> None:
    """Attach a helix for each element to the robot's base, with sites `element_1` to `element_n`, x along boresight."""
    base = spec.body("base")
    helix = mujoco.MjSpec.from_file(str(Path(__file__).parent / "antenna" / "helix.xml"))
    for k, (position_m, azimuth, elevation) in enumerate(zip(*elements, strict=True), start=1):
        (cos_yaw, sin_yaw), (cos_pitch, sin_pitch) = _half_angle(azimuth), _half_angle(-elevation)
        frame = base.add_frame(
            pos=position_m, quat=[cos_yaw * cos_pitch, -sin_yaw * sin_pitch, cos_yaw * sin_pitch, sin_yaw * cos_pitch]
        )
        spec.attach(helix.copy(), frame=frame, prefix=f"helix_{k}/")
        spec.site(f"helix_{k}/element").name = f"element_{k}"


def _half_angle(angle_rad: float) -> tuple[float, float]:
    return float(np.cos(0.5 * angle_rad)), float(np.sin(0.5 * angle_rad))
