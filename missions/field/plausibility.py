"""What poses look like that were written in other units: told, not refused, for it may be so."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LEAST_POSES = 4
"""Fewer say nothing of their units (assumed)."""

LEAST_TURN = 2.0
"""Headings that spread by less, in whatever unit, do not turn (assumed)."""

LARGEST_SITE_M = 1000.0
"""Surveys are no wider than this (assumed)."""

FASTEST_M_S = 30.0
"""Nothing that takes measurements on a site is as fast (assumed)."""


def doubts(time_s: FloatArray, pose: FloatArray) -> list[str]:
    """One line for each unit that does not look like what the table should have.

    Args:
        time_s: Shape (n,), not falling.
        pose: x m, y m, yaw rad as read, shape (n, 3).
    """
    found: list[str] = []
    if len(pose) < LEAST_POSES:
        return found
    yaw_deg, place_m = np.degrees(pose[:, 2]), pose[:, :2]
    is_within_a_turn = np.abs(yaw_deg).max() <= 2 * np.pi
    if is_within_a_turn and np.ptp(yaw_deg) > LEAST_TURN and np.unique(yaw_deg).size >= LEAST_POSES:
        found.append(
            f"yaw_deg: {yaw_deg.min():.3g} to {yaw_deg.max():.3g} in all rows looks like radians; taken as degrees"
        )
    size_m, step_s = float(np.ptp(place_m, axis=0).max()), np.diff(time_s)
    speed_m_s = np.linalg.norm(np.diff(place_m, axis=0), axis=-1)[step_s > 0] / step_s[step_s > 0]
    usual_m_s = float(np.median(speed_m_s[speed_m_s > 0])) if (speed_m_s > 0).any() else 0.0
    if size_m > LARGEST_SITE_M:
        found.append(f"x_m, y_m: {size_m:.0f} m from end to end looks like millimetres; taken as metres")
    elif usual_m_s > FASTEST_M_S:
        found.append(f"x_m, y_m: {usual_m_s:.0f} m/s from row to row looks like millimetres; taken as metres")
    return found
