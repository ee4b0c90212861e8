"""What robots believe of their motion and what it takes, in compiled loops over the robots."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from dirmusic.fitting import wrapped

FloatArray = NDArray[np.float64]


@compiled
def believed_poses(
    true_pose: FloatArray, error: FloatArray, kept: float, std: FloatArray, normal: FloatArray
) -> FloatArray:
    """Poses with a first-order Gauss-Markov error, yaw in (-pi, pi]; all of shape (n_robots, 3), but `std` (3,).

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
        believed[r, 2] = wrapped(believed[r, 2])
    return believed


@compiled
def reckon(
    pose: FloatArray,
    wheels_rad: FloatArray,
    wheels_before_rad: FloatArray,
    yaw_rad: FloatArray,
    yaw_before_rad: FloatArray,
    metres_per_radian: FloatArray,
    bias_rad: FloatArray,
    noise_rad: float,
    normal: FloatArray,
) -> FloatArray:
    """Poses (n_robots, 3) after arcs, yaw in (-pi, pi].

    Args:
        pose: Before.
        wheels_rad: Angles of left and right wheel now, shape (n_robots, 2).
        wheels_before_rad: And before.
        yaw_rad: True heading now, shape (n_robots,): its change is an ideal gyro's integral.
        yaw_before_rad: And before.
        metres_per_radian: Path that the robot believes in for each wheel's turn, shape (n_robots,).
        bias_rad: By how much the gyro's bias turns it meanwhile, shape (n_robots,).
        noise_rad: Standard deviation of what its noise adds.
        normal: Standard normal draws, shape (n_robots,).
    """
    moved = np.empty(pose.shape)
    for r in range(len(pose)):
        turned = wheels_rad[r, 0] - wheels_before_rad[r, 0] + wheels_rad[r, 1] - wheels_before_rad[r, 1]
        rolled_m = 0.5 * turned * metres_per_radian[r]
        turn = wrapped(yaw_rad[r] - yaw_before_rad[r]) + bias_rad[r] + noise_rad * normal[r]
        along = pose[r, 2] + 0.5 * turn
        moved[r, 0] = pose[r, 0] + rolled_m * np.cos(along)
        moved[r, 1] = pose[r, 1] + rolled_m * np.sin(along)
        moved[r, 2] = wrapped(pose[r, 2] + turn)
    return moved


@compiled
def drain(used_wh: FloatArray, left: FloatArray, capacity_wh: float, power_w: FloatArray, hours: float) -> None:
    """Take power (n_robots,) from batteries for a while; `used_wh` and the share that is `left`, in [0, 1], change."""
    for r in range(used_wh.size):
        used_wh[r] += power_w[r] * hours
        left[r] = max(1.0 - used_wh[r] / capacity_wh, 0.0)
