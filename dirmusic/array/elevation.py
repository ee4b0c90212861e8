"""Gain in three dimensions, from a pattern measured in the plane of the array."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic.array.pattern import GainPattern

FloatArray = NDArray[np.float64]

NEAR_AXIS = 1e-9
"""Sine of the angle from the boresight below which the roll around it has no meaning."""


class SpatialGain(NamedTuple):
    """Gain towards directions in space, and its slopes per radian; all of one shape."""

    gain: FloatArray
    by_azimuth: FloatArray
    by_elevation: FloatArray


def gain_in_space(pattern: GainPattern, off_boresight_rad: ArrayLike, elevation_rad: ArrayLike) -> SpatialGain:
    r"""Gain of an element with a level boresight towards a direction in space.

    With :math:`\psi` the angle from the boresight and :math:`\phi` the roll around it, zero where the direction lies
    level to the left,

    .. math:: g(\psi, \phi) = \cos^2(\phi / 2) \, g(+\psi) + \sin^2(\phi / 2) \, g(-\psi)

    At zero elevation this is the pattern itself. That a helix has nearly the same pattern in all planes through its
    axis is assumed; the pattern is measured in one.

    Args:
        pattern: In the plane.
        off_boresight_rad: Azimuth of the direction less that of the boresight.
        elevation_rad: Of the direction, in [-pi/2, pi/2]; broadcasts with `off_boresight_rad`.

    Returns:
        Gain and slopes of the broadcast shape.
    """
    off, elevation = (np.asarray(a, dtype=np.float64) for a in (off_boresight_rad, elevation_rad))
    cos_off, sin_off, cos_up, sin_up = np.cos(off), np.sin(off), np.cos(elevation), np.sin(elevation)
    ahead, left = cos_up * cos_off, cos_up * sin_off
    sin_psi = np.sqrt(np.maximum(1.0 - np.square(ahead), 0.0))
    psi = np.arctan2(np.hypot(left, sin_up), ahead)
    on_axis = sin_psi < NEAR_AXIS
    across = np.where(on_axis, 1.0, sin_psi)
    cos_roll = np.where(on_axis, 1.0, left / across)
    (to_left, to_right), (slope_left, slope_right) = pattern.gain_and_slope(np.stack([psi, -psi]))
    gain = 0.5 * ((1 + cos_roll) * to_left + (1 - cos_roll) * to_right)
    by_psi = 0.5 * ((1 + cos_roll) * slope_left - (1 - cos_roll) * slope_right)
    by_roll = 0.5 * (to_left - to_right)  # per change of cos_roll
    roll_by_azimuth = np.where(on_axis, 0.0, ahead * (1.0 - np.square(cos_roll)) / across)
    psi_by_elevation = np.where(on_axis, 0.0, sin_up * cos_off / across)
    roll_by_elevation = np.where(on_axis, 0.0, -(sin_up * sin_off + cos_roll * ahead * psi_by_elevation) / across)
    return SpatialGain(
        gain, by_psi * cos_roll + by_roll * roll_by_azimuth, by_psi * psi_by_elevation + by_roll * roll_by_elevation
    )
