"""What a robot believes of its motion, in compiled loops over the robots. Angles come out unwrapped."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled

FloatArray = NDArray[np.float64]


@compiled
def believed_poses(
    true_pose: FloatArray, error: FloatArray, kept: float, std: FloatArray, normal: FloatArray
) -> FloatArray:
    """Poses with a first-order Gauss-Markov error; all of shape (n_robots, 3), but `std` (3,).

    Args:
        true_pose: x m, y m, yaw rad.
        error: Of the last reading, NaN before the first; becomes that of this one.
        kept: Share of the error that lasts until now.
        std: Of the error.
        normal: Standard normal draws.
    """
    believed, renewed = np.empty(true_pose.shape), np.sqrt(1.0 - kept * kept)
    for r in range(len(true_pose)):
        for i in range(3):
            if np.isnan(error[r, i]):
                error[r, i] = std[i] * normal[r, i]
            else:
                error[r, i] = kept * error[r, i] + renewed * std[i] * normal[r, i]
            believed[r, i] = true_pose[r, i] + error[r, i]
    return believed


@compiled
def reckon(pose: FloatArray, rolled_m: FloatArray, turned_rad: FloatArray) -> FloatArray:
    """Poses (n_robots, 3) after arcs: paths rolled and angles turned, shape (n_robots,) each."""
    moved = np.empty(pose.shape)
    for r in range(len(pose)):
        along = pose[r, 2] + 0.5 * turned_rad[r]
        moved[r, 0] = pose[r, 0] + rolled_m[r] * np.cos(along)
        moved[r, 1] = pose[r, 1] + rolled_m[r] * np.sin(along)
        moved[r, 2] = pose[r, 2] + turned_rad[r]
    return moved
