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


def gain_in_space(
    pattern: GainPattern,
    off_boresight_rad: ArrayLike,
    elevation_rad: ArrayLike,
    boresight_elevation_rad: ArrayLike = 0.0,
) -> SpatialGain:
    r"""Gain of an element towards a direction in space.

    With :math:`\psi` the angle from the boresight and :math:`\phi` the roll around it, zero where the direction lies
    level to the left,

    .. math:: g(\psi, \phi) = \cos^2(\phi / 2) \, g(+\psi) + \sin^2(\phi / 2) \, g(-\psi)

    At zero elevation the gain of a level element is the pattern itself. That a helix has nearly the same pattern in all
    planes through its axis is assumed; the pattern is measured in one.

    Args:
        pattern: In the plane.
        off_boresight_rad: Azimuth of the direction less that of the boresight.
        elevation_rad: Elevation of the direction, in [-pi/2, pi/2]; broadcasts with `off_boresight_rad`.
        boresight_elevation_rad: Elevation of the boresight, in [-pi/2, pi/2]; broadcasts with the others.

    Returns:
        Gain and slopes of the broadcast shape.
    """
    off, elevation = (np.asarray(a, dtype=np.float64) for a in (off_boresight_rad, elevation_rad))
    tilt = np.asarray(boresight_elevation_rad, dtype=np.float64)
    cos_off, sin_off, cos_up, sin_up = np.cos(off), np.sin(off), np.cos(elevation), np.sin(elevation)
    level, left = cos_up * cos_off, cos_up * sin_off  # of the direction, seen from the boresight's azimuth
    ahead, up, ahead_by_elevation = level, sin_up, sin_up * cos_off  # seen from the boresight, the last one negative
    is_tilted = bool(tilt.any())
    cos_tilt, sin_tilt = np.cos(tilt), np.sin(tilt)
    if is_tilted:  # level elements need not pay for it
        ahead, up = cos_tilt * level + sin_tilt * sin_up, cos_tilt * sin_up - sin_tilt * level
        ahead_by_elevation = cos_tilt * ahead_by_elevation - sin_tilt * cos_up
    sin_psi = np.sqrt(np.maximum(1.0 - np.square(ahead), 0.0))
    psi = np.arctan2(np.hypot(left, up), ahead)
    on_axis = sin_psi < NEAR_AXIS
    across = np.where(on_axis, 1.0, sin_psi)
    cos_roll = np.where(on_axis, 1.0, left / across)
    (to_left, to_right), (slope_left, slope_right) = pattern.gain_and_slope(np.stack([psi, -psi]))
    gain = 0.5 * ((1 + cos_roll) * to_left + (1 - cos_roll) * to_right)
    by_psi = 0.5 * ((1 + cos_roll) * slope_left - (1 - cos_roll) * slope_right)
    by_roll = 0.5 * (to_left - to_right)  # per change of cos_roll
    psi_by_azimuth, left_by_azimuth = cos_roll, ahead * (1.0 - np.square(cos_roll))
    if is_tilted:
        psi_by_azimuth, left_by_azimuth = cos_tilt * cos_roll, level - cos_tilt * ahead * np.square(cos_roll)
    roll_by_azimuth = np.where(on_axis, 0.0, left_by_azimuth / across)
    psi_by_elevation = np.where(on_axis, 0.0, ahead_by_elevation / across)
    roll_by_elevation = np.where(on_axis, 0.0, -(sin_up * sin_off + cos_roll * ahead * psi_by_elevation) / across)
    by_azimuth = by_psi * psi_by_azimuth + by_roll * roll_by_azimuth
    return SpatialGain(gain, by_azimuth, by_psi * psi_by_elevation + by_roll * roll_by_elevation)
