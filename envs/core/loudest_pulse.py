"""The loudest pulse of each robot in a step: what an observation shows of many, and where the last bearing is from."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from pdpatrol.envs.core.progress import Progress

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]


class LoudestPulse(NamedTuple):
    """The loudest pulse of each robot; rows of those that detected nothing hold zeros.

    Attributes:
        level_v: Root of the energy in the usable channels, shape (n_robots,).
        strengths: Scaled to unit norm, 0 in channels that are not usable, shape (n_robots, n_elements).
        azimuth_rad: Direction, array frame, shape (n_robots,).
    """

    level_v: FloatArray
    strengths: FloatArray
    azimuth_rad: FloatArray


@compiled
def loudest_pulse(pulses: tuple[Any, ...], is_usable: BoolArray) -> LoudestPulse:
    """Of each robot the pulse with most energy in its usable channels.

    Args:
        pulses: Robot (n_pulses,), strengths (n_pulses, n_elements) and azimuths (n_pulses,).
        is_usable: Of each robot's channels, shape (n_robots, n_elements).
    """
    robot, strengths_v, azimuth_rad = pulses
    n_robots, n_elements = is_usable.shape
    loudest = LoudestPulse(np.zeros(n_robots), np.zeros((n_robots, n_elements)), np.zeros(n_robots))
    for k in range(robot.size):
        r, energy = robot[k], 0.0
        for e in range(n_elements):
            energy += is_usable[r, e] * strengths_v[k, e] * strengths_v[k, e]
        level_v = np.sqrt(energy)
        if level_v <= loudest.level_v[r]:
            continue
        loudest.level_v[r], loudest.azimuth_rad[r] = level_v, azimuth_rad[k]
        for e in range(n_elements):
            loudest.strengths[r, e] = is_usable[r, e] * strengths_v[k, e] / level_v
    return loudest


@compiled
def note_bearings(progress: Progress, loudest: LoudestPulse, pose: FloatArray) -> None:
    """Make the bearings of the loudest pulses the last ones, with the believed poses (n_robots, 3)."""
    for r in range(loudest.level_v.size):
        if loudest.level_v[r] > 0.0:
            bearing_rad = loudest.azimuth_rad[r] + pose[r, 2]
            progress.bearing[r, 0], progress.bearing[r, 1] = np.cos(bearing_rad), np.sin(bearing_rad)
            progress.bearing_age_s[r] = 0.0
