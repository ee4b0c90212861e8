"""Camera that follows the robot, and comes nearer where equipment would hide the robot from it."""

from typing import Any

import numpy as np
import rerun as rr

from dirmusic.arrays import FloatArray
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.robot_models.yard.solids import YardSolids

BEHIND_M, ABOVE_M, DOWN_RAD = 4.2, 1.4, np.radians(14.0)
"""Place of the camera behind and above the middle of the robot, and how far below the horizon it looks."""

MIDDLE_M = 0.5
"""Height of the middle of the robot."""

LEAST_SHARE = 0.25
"""Smallest distance of the camera as a share of its usual distance; the robot then fills the picture."""

WINDOW_STEPS = 40
"""Steps, 4 s, over which the direction of the camera is the mean of the heading, and in which it moves away again."""

SPACING_M, CLEAR_M = 0.2, 0.15
"""Spacing of the points at which the line of sight is tested, and their smallest distance to equipment."""

BATCH_STEPS = 100
"""Steps that are tested together, with the equipment near them."""


def camera_moves(log: MissionLog, solids: YardSolids | None, first: int, end: int) -> Any:  # noqa: ANN401 - of Rerun
    """Return transforms of the camera for steps from `first` up to `end`; x right, y down, z forward.

    Args:
        log: Log of a mission.
        solids: What may hide the robot; None if unknown.
        first: First step.
        end: Step after the last one.
    """
    start = max(first - 2 * (WINDOW_STEPS - 1), 0)
    pose = log.column("step", "pose", start, end)
    total_rad, after = np.cumsum(np.append(0.0, np.unwrap(pose[:, 2]))), np.arange(1, len(pose) + 1)
    before = np.maximum(after - WINDOW_STEPS, 0)
    view_rad = (total_rad[after] - total_rad[before]) / (after - before)
    ahead = np.column_stack([np.cos(view_rad), np.sin(view_rad), np.zeros(view_rad.size)])
    middle_m = np.column_stack([pose[:, :2], np.full(len(pose), MIDDLE_M)])
    offset_m = [0.0, 0.0, ABOVE_M] - BEHIND_M * ahead
    share = np.ones(len(pose)) if solids is None else _eased(_free_share(middle_m, offset_m, solids))
    chosen = slice(first - start, None)
    ahead, place_m = ahead[chosen], (middle_m + share[:, np.newaxis] * offset_m)[chosen]
    forward = np.cos(DOWN_RAD) * ahead - [0.0, 0.0, np.sin(DOWN_RAD)]
    right = np.column_stack([ahead[:, 1], -ahead[:, 0], ahead[:, 2]])
    axes = np.stack([right, np.cross(forward, right), forward], axis=-1)
    return rr.Transform3D.columns(translation=place_m, mat3x3=axes)


def _free_share(middle_m: FloatArray, offset_m: FloatArray, solids: YardSolids) -> FloatArray:
    """Return how far the robot can be seen along each offset, as a share of the offset, at least `LEAST_SHARE`.

    Args:
        middle_m: Middle of the robot, shape (n_steps, 3), world frame.
        offset_m: From there to the camera, shape (n_steps, 3).
        solids: What may hide the robot.

    Returns:
        Shape (n_steps,).
    """
    reach_m = float(np.hypot(BEHIND_M, ABOVE_M))
    shares = np.linspace(0.0, 1.0, int(np.ceil(reach_m / SPACING_M)) + 1)
    shares = shares[shares > LEAST_SHARE]
    free = np.ones(len(middle_m))
    for begin in range(0, len(middle_m), BATCH_STEPS):
        batch = slice(begin, begin + BATCH_STEPS)
        centre_m = middle_m[batch].mean(axis=0)
        away_m = np.linalg.norm(middle_m[batch] - centre_m, axis=-1).max() + reach_m + CLEAR_M
        near = solids.take(solids.horizontal_distance(centre_m) < away_m)
        points_m = middle_m[batch, np.newaxis] + shares[:, np.newaxis] * offset_m[batch, np.newaxis]
        is_hidden = near.distance(points_m).min(axis=-1, initial=np.inf) < CLEAR_M
        before = np.append(LEAST_SHARE, shares[:-1])
        free[batch] = np.where(is_hidden.any(axis=-1), before[is_hidden.argmax(axis=-1)], 1.0)
    return free


def _eased(free: FloatArray) -> FloatArray:
    """Return shares (n_steps,) that are at most `free`, and rise from the least to one in `WINDOW_STEPS` steps."""
    rise = np.linspace(0.0, 1.0 - LEAST_SHARE, WINDOW_STEPS)[::-1]
    padded = np.append(np.ones(WINDOW_STEPS - 1), free)
    return np.minimum((np.lib.stride_tricks.sliding_window_view(padded, WINDOW_STEPS) + rise).min(axis=-1), 1.0)
