"""Patterns whose beams are wider or narrower than those of a data sheet."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from dirmusic import GainPattern
from dirmusic.angles import wrap
from dirmusic.array.spatial_pattern import SpatialPattern
from dirmusic.arrays import FloatArray

KNEE_RAD = np.radians(120.0)
"""Angle off boresight up to which all angles are scaled. Beyond it, the angles are spread evenly up to 180 degrees.
Assumed; the gains of the shipped patterns are 7 to 14 dB below the largest there."""

GRID_STEP_RAD = np.radians(2.0)
"""Step of a resampled table. For the shipped patterns, cubics through it are accurate to 2e-5 of the largest gain."""


def _angle_of_narrow_beam(off_boresight_rad: ArrayLike, scale: float) -> tuple[FloatArray, FloatArray]:
    """Map an angle off the boresight of the scaled beam to that of the original beam, both in [-pi, pi].

    The map divides by `scale` up to `KNEE_RAD` and is linear from there to 180 degrees, which stays 180 degrees. It is
    odd, increasing and continuous, so that the pattern stays periodic.

    Returns:
        The angles and the slope of the map.
    """
    off, knee = wrap(off_boresight_rad), KNEE_RAD / scale
    mapped = np.interp(off, [-np.pi, -KNEE_RAD, KNEE_RAD, np.pi], [-np.pi, -knee, knee, np.pi])
    return mapped, np.where(np.abs(off) <= KNEE_RAD, 1.0 / scale, (np.pi - knee) / (np.pi - KNEE_RAD))


@dataclass(frozen=True)
class ScaledPattern(GainPattern):
    """Pattern in the plane with all angles off boresight scaled; see `scaled_beam`.

    Attributes:
        pattern: The original pattern.
        scale: Width of the beam relative to that of the original pattern.
    """

    pattern: GainPattern
    scale: float

    @property
    def vertical(self) -> GainPattern | None:
        """Gain in the vertical plane through the boresight; see `GainPattern`."""
        vertical = self.pattern.vertical
        return None if vertical is None else ScaledPattern(vertical, self.scale)

    def gain_and_slope(self, off_boresight_rad: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Compute the gain and its slope per radian; see `GainPattern`."""
        mapped, by_angle = _angle_of_narrow_beam(off_boresight_rad, self.scale)
        gain, slope = self.pattern.gain_and_slope(mapped)
        return gain, slope * by_angle


def scaled_beam(pattern: GainPattern | SpatialPattern, scale: float) -> GainPattern | SpatialPattern:
    """Make the beam of a pattern wider or narrower around its boresight, in azimuth and in elevation alike.

    The gain at an angle of `scale` times psi off the boresight is that of the original at psi, at the same roll around
    the boresight, up to 120 degrees off; behind, angles are spread evenly so that the gain at 180 degrees stays.

    Args:
        pattern: Pattern in the plane, or over all directions and frequencies.
        scale: Width of the beam relative to that of the original, in [0.7, 1.5]; 1 returns the pattern itself.
    """
    if scale == 1.0:
        return pattern
    return _scaled_table(pattern, scale) if isinstance(pattern, SpatialPattern) else ScaledPattern(pattern, scale)


@lru_cache(maxsize=4)  # each reset asks for the same one
def _scaled_table(pattern: SpatialPattern, scale: float) -> SpatialPattern:
    azimuth_rad = GRID_STEP_RAD * np.arange(180)
    elevation_rad = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 91)
    level = np.cos(elevation_rad)
    ahead, left = level * np.cos(azimuth_rad)[:, np.newaxis], level * np.sin(azimuth_rad)[:, np.newaxis]
    up = np.broadcast_to(np.sin(elevation_rad), left.shape)
    psi, _ = _angle_of_narrow_beam(np.arctan2(np.hypot(left, up), ahead), scale)
    roll = np.arctan2(up, left)
    ahead, left, up = np.cos(psi), np.sin(psi) * np.cos(roll), np.sin(psi) * np.sin(roll)
    gain = pattern.gain(np.arctan2(left, ahead), np.arctan2(up, np.hypot(left, ahead)), pattern.frequency_hz)
    return SpatialPattern(pattern.frequency_hz, azimuth_rad, elevation_rad, gain)
