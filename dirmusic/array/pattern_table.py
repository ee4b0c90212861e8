"""The gain of an element as compiled loops read it: a table of its pattern in the plane, and directions in space."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.elevation import NEAR_AXIS
from dirmusic.array.pattern import GainPattern
from dirmusic.compiled import compiled
from dirmusic.kernels import cubic, cubic_slope

FloatArray = NDArray[np.float64]

TABLE_SIZE = 3600
"""Steps of 0.1 degrees, between which a cubic is exact to 1e-10 wherever the pattern is smooth."""

STEP_RAD = 2 * np.pi / TABLE_SIZE


class PatternTable(NamedTuple):
    """Gain in the plane over the angle off boresight, even steps once round from 0, each of shape (TABLE_SIZE,).

    Attributes:
        gain: The gain.
        slope: Slope of the gain per step.
    """

    gain: FloatArray
    slope: FloatArray


def tabulate(pattern: GainPattern) -> PatternTable:
    """The table of a pattern."""
    gain, slope = pattern.gain_and_slope(STEP_RAD * np.arange(TABLE_SIZE))
    return PatternTable(np.ascontiguousarray(gain), STEP_RAD * slope)


@compiled
def pattern_gain(pattern: PatternTable, off_boresight_rad: float) -> float:
    """Gain in the plane between the steps of the table."""
    at = off_boresight_rad / STEP_RAD
    low = np.floor(at)
    i = int(low) % TABLE_SIZE
    j = (i + 1) % TABLE_SIZE
    return cubic(at - low, pattern.gain[i], pattern.gain[j], pattern.slope[i], pattern.slope[j])


@compiled
def pattern_gain_and_slope(pattern: PatternTable, off_boresight_rad: float) -> tuple[float, float]:
    """Gain in the plane and its slope per radian, between the steps of the table."""
    at = off_boresight_rad / STEP_RAD
    low = np.floor(at)
    i = int(low) % TABLE_SIZE
    j = (i + 1) % TABLE_SIZE
    share, start, end = at - low, pattern.gain[i], pattern.gain[j]
    slope = cubic_slope(share, start, end, pattern.slope[i], pattern.slope[j])
    return cubic(share, start, end, pattern.slope[i], pattern.slope[j]), slope / STEP_RAD


class GainInDirection(NamedTuple):
    """Gain towards a direction in space, and its slopes per radian."""

    gain: float
    by_azimuth: float
    by_elevation: float


class Boresight(NamedTuple):
    """Direction of a boresight."""

    cos_azimuth: float
    sin_azimuth: float
    cos_elevation: float
    sin_elevation: float


def as_boresights(azimuth_rad: FloatArray, elevation_rad: FloatArray) -> FloatArray:
    """Fields of `Boresight`, shape (n_elements, 4), of boresights with azimuths and elevations (n_elements,)."""
    return np.stack([f(angle) for angle in (azimuth_rad, elevation_rad) for f in (np.cos, np.sin)], axis=-1)


@compiled
def gain_towards(pattern: PatternTable, boresight: Boresight, x: float, y: float, z: float) -> float:
    """Gain of an element along a vector of any length: `elevation.gain_in_space`.

    Args:
        pattern: Of the element, in the plane.
        boresight: Of the element.
        x: Component of the vector in the frame of the boresight, as y and z; z is up.
        y: As said.
        z: As said.
    """
    level = boresight.cos_azimuth * x + boresight.sin_azimuth * y
    left = boresight.cos_azimuth * y - boresight.sin_azimuth * x
    ahead = boresight.cos_elevation * level + boresight.sin_elevation * z
    up = boresight.cos_elevation * z - boresight.sin_elevation * level
    sin_psi = np.sqrt(left * left + up * up)
    psi = np.arctan2(sin_psi, ahead)
    half_roll = 0.5 * left / max(sin_psi, NEAR_AXIS)
    return (0.5 + half_roll) * pattern_gain(pattern, psi) + (0.5 - half_roll) * pattern_gain(pattern, -psi)


@compiled
def gain_and_slopes_towards(
    pattern: PatternTable, boresight: Boresight, x: float, y: float, z: float
) -> GainInDirection:
    """Gain along a vector of length 1 and its slopes by azimuth and elevation; arguments as of `gain_towards`."""
    sideways = max(math.hypot(x, y), NEAR_AXIS)
    level = boresight.cos_azimuth * x + boresight.sin_azimuth * y
    left = boresight.cos_azimuth * y - boresight.sin_azimuth * x
    ahead = boresight.cos_elevation * level + boresight.sin_elevation * z
    up = boresight.cos_elevation * z - boresight.sin_elevation * level
    sin_psi = math.sqrt(left * left + up * up)
    psi = math.atan2(sin_psi, ahead)
    to_left, slope_left = pattern_gain_and_slope(pattern, psi)
    to_right, slope_right = pattern_gain_and_slope(pattern, -psi)
    if sin_psi < NEAR_AXIS:
        cos_roll, psi_by_elevation, roll_by_azimuth, roll_by_elevation = 1.0, 0.0, 0.0, 0.0
    else:
        cos_roll = left / sin_psi
        psi_by_elevation = (
            boresight.cos_elevation * z * level / sideways - boresight.sin_elevation * sideways
        ) / sin_psi
        roll_by_azimuth = (level - boresight.cos_elevation * ahead * cos_roll * cos_roll) / sin_psi
        roll_by_elevation = -(z * left / sideways + cos_roll * ahead * psi_by_elevation) / sin_psi
    by_psi = 0.5 * ((1.0 + cos_roll) * slope_left - (1.0 - cos_roll) * slope_right)
    by_roll = 0.5 * (to_left - to_right)  # per change of cos_roll
    return GainInDirection(
        0.5 * ((1.0 + cos_roll) * to_left + (1.0 - cos_roll) * to_right),
        by_psi * boresight.cos_elevation * cos_roll + by_roll * roll_by_azimuth,
        by_psi * psi_by_elevation + by_roll * roll_by_elevation,
    )
