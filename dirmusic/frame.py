"""Error of poses: displacement and rotation of their frame against the map, and deviations in it."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dirmusic.arrays import FloatArray
from dirmusic.locating.protocol import PoseError


def turned(vectors: FloatArray, angle_rad: ArrayLike = 0.5 * np.pi) -> FloatArray:
    """Rotate vectors (..., 2) counter-clockwise by angles (...), by default by 90 degrees."""
    cos, sin, x, y = np.cos(angle_rad), np.sin(angle_rad), vectors[..., 0], vectors[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


@dataclass(frozen=True, eq=False)
class FrameEstimate:
    r"""Estimated displacement and rotation of the localisation against the map, and its pose error.

    The localisation gives a place m of the map the coordinates :math:`c + R(\theta)(m - c) + o`.

    Attributes:
        pivot_m: Centre c of the rotation, shape (2,).
        offset: Displacement o and rotation :math:`\theta` by which poses are corrected, x m, y m, rad, shape (3,).
            Zeros while they are not.
        covariance: Mean square of the error that remains after the correction, shape (3, 3). If poses are not
            corrected, it includes the square of the estimated offset.
        pose_error: Error of poses in that frame.
    """

    pivot_m: FloatArray
    offset: FloatArray
    covariance: FloatArray
    pose_error: PoseError

    @property
    def is_applied(self) -> bool:
        """True if poses are corrected."""
        return bool(self.offset.any())

    def on_map(self, pose: FloatArray) -> FloatArray:
        """Return the pose on the map of a pose of the localisation, both x m, y m, yaw rad, shape (3,)."""
        x_m, y_m = (pose[:2] - self.pivot_m - self.offset[:2]).tolist()
        cos, sin = math.cos(self.offset[2]), math.sin(self.offset[2])
        turned_m = np.array([cos * x_m + sin * y_m, cos * y_m - sin * x_m])
        return np.append(self.pivot_m + turned_m, math.remainder(pose[2] - self.offset[2], 2.0 * math.pi))

    def covariance_at(self, places_m: FloatArray) -> FloatArray:
        """Return the covariance of the error of the frame at places (..., 2) of the map, shape (..., 2, 2).

        All poses and findings near a place share this error, so it does not decrease with the number of pulses.
        """
        return self._jacobian(places_m) @ self.covariance @ np.swapaxes(self._jacobian(places_m), -1, -2)

    def displacement_at(self, places_m: FloatArray) -> FloatArray:
        """Return the length of the correction at places (..., 2) of the map, shape (...), metres."""
        return np.linalg.norm(self._jacobian(places_m) @ self.offset, axis=-1)

    def _jacobian(self, places_m: FloatArray) -> FloatArray:
        """Return the derivative of coordinates by the offset, linearised for small rotations, shape (..., 2, 3)."""
        shift = np.broadcast_to(np.eye(2), (*places_m.shape[:-1], 2, 2))
        return np.concatenate([shift, turned(places_m - self.pivot_m)[..., np.newaxis]], axis=-1)
