"""Array of helical antennas: the nominal array of the data sheet, or an array as built."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from dirmusic import GainManifold, GainPattern
from dirmusic.array.pattern import gain_in_space
from dirmusic.array.spatial_pattern import SpatialPattern, halves
from dirmusic.arrays import FloatArray
from pdpatrol.sensing.array.config import ArrayConfig
from pdpatrol.sensing.nature.pulses import FREQUENCY_HZ
from pdpatrol.sensing.quantities import SPEED_OF_LIGHT_MPS


@dataclass(frozen=True, kw_only=True)
class HelicalArray:
    """One array, in the array frame: x forward, y left, z up from the ground under the centre of the ring.

    Attributes:
        pattern: Gain of every element, over the angle off its boresight or over all directions and frequencies.
        boresights_rad: Azimuth of each boresight, shape (n_elements,).
        boresight_elevations_rad: Elevation of each boresight, shape (n_elements,).
        positions_m: Positions of the elements, shape (n_elements, 3).
        gain_factors: Factors of the gains, shape (n_elements,); 1 for the data sheet.
        gain_offsets: Offsets added to the gains, shape (n_elements,); 0 for the data sheet.
    """

    pattern: GainPattern | SpatialPattern
    boresights_rad: FloatArray
    boresight_elevations_rad: FloatArray
    positions_m: FloatArray
    gain_factors: FloatArray
    gain_offsets: FloatArray

    @property
    def n_elements(self) -> int:
        """Number of elements."""
        return self.boresights_rad.size

    @property
    def aperture_m(self) -> float:
        """Larger of the width and the height of the array, about the largest difference of path lengths."""
        width_m = 2 * float(np.linalg.norm(self.positions_m[:, :2], axis=-1).max())
        return max(width_m, float(np.ptp(self.positions_m[:, 2])))

    @classmethod
    def nominal(cls, config: ArrayConfig) -> Self:
        """Create the nominal array of the data sheet, the only one that the estimator knows."""
        boresights_rad, elevations_rad, positions_m = config.nominal_elements()
        return cls(
            pattern=config.nominal_pattern(),
            boresights_rad=boresights_rad,
            boresight_elevations_rad=elevations_rad,
            positions_m=positions_m,
            gain_factors=np.ones(config.n_channels),
            gain_offsets=np.zeros(config.n_channels),
        )

    @classmethod
    def draw(cls, config: ArrayConfig, rng: np.random.Generator) -> Self:
        """Draw an array as built: the data sheet with errors, and the true pattern.

        Args:
            config: Configuration with the data sheet.
            rng: Generator of the errors. It is not used if the array has a serial number, which determines its errors.
        """
        rng = rng if config.serial_number is None else np.random.default_rng(config.serial_number)
        nominal, n = cls.nominal(config), config.n_channels
        return replace(
            nominal,
            pattern=config.real_pattern(),
            boresights_rad=nominal.boresights_rad + rng.normal(0.0, np.radians(config.pointing_error_deg), n),
            positions_m=nominal.positions_m + rng.normal(0.0, config.position_error_m, (n, 3)),
            gain_factors=np.exp(rng.normal(0.0, config.gain_error, n)),
            gain_offsets=rng.uniform(-config.gain_offset, config.gain_offset, n),
        )

    @property
    def cut(self) -> GainPattern:
        """Pattern in the plane; if the pattern depends on frequency, its rms over all frequencies."""
        return self.pattern.cut() if isinstance(self.pattern, SpatialPattern) else self.pattern

    def manifold(self) -> GainManifold:
        """Return the far-field manifold of the array; estimators use that of the nominal array."""
        return self._manifold_of(self.cut)

    def band_manifolds(self, edges_hz: Sequence[float]) -> tuple[GainManifold, ...]:
        """Return the manifolds of both halves of each sub-band; for a pattern in the plane, they are all equal.

        Args:
            edges_hz: Edges of the sub-bands, ascending, n_bands + 1 values, or empty.
        """
        if not isinstance(self.pattern, SpatialPattern):
            return (self.manifold(),) * (2 * (len(edges_hz) - 1))
        return tuple(self._manifold_of(self.pattern.cut(half)) for half in halves(edges_hz))

    def _manifold_of(self, cut: GainPattern) -> GainManifold:
        return GainManifold(cut, self.boresights_rad, boresight_elevations_rad=self.boresight_elevations_rad)

    def gain(
        self, azimuth_rad: FloatArray, elevation_rad: FloatArray, frequency_hz: float = FREQUENCY_HZ
    ) -> FloatArray:
        """Return the gain of each element in its own direction: that of element i in direction i, array frame.

        Args:
            azimuth_rad: Azimuths of the directions, shape (..., n_elements).
            elevation_rad: Elevations of the directions, same shape.
            frequency_hz: Frequency, on which only some patterns depend.

        Returns:
            Gains, same shape.
        """
        off_rad, tilt_rad = azimuth_rad - self.boresights_rad, self.boresight_elevations_rad
        if isinstance(self.pattern, SpatialPattern):
            forward, left = (np.cos(elevation_rad) * turn for turn in (np.cos(off_rad), np.sin(off_rad)))
            ahead = np.cos(tilt_rad) * forward + np.sin(tilt_rad) * np.sin(elevation_rad)
            up = np.cos(tilt_rad) * np.sin(elevation_rad) - np.sin(tilt_rad) * forward
            above_rad = np.arctan2(up, np.hypot(left, ahead))
            gain = self.pattern.gain(np.arctan2(left, ahead), above_rad, frequency_hz)[0]
        else:
            gain = gain_in_space(self.pattern, off_rad, elevation_rad, tilt_rad).gain
        return self.gain_factors * gain + self.gain_offsets

    def free_space_response(self, source_m: FloatArray, world_from_array: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return relative amplitudes and travel times of direct waves in free space.

        Amplitudes are relative to that of a unit-gain antenna 1 m from the source.

        Args:
            source_m: Positions of sources, shape (..., 3), world frame.
            world_from_array: Pose of the array, shape (4, 4).

        Returns:
            Amplitudes and travel times, both of shape (..., n_elements).
        """
        in_array_m = (source_m - world_from_array[:3, 3]) @ world_from_array[:3, :3]
        sight = in_array_m[..., np.newaxis, :] - self.positions_m
        range_m = np.linalg.norm(sight, axis=-1)
        azimuth_rad, elevation_rad = np.arctan2(sight[..., 1], sight[..., 0]), np.arcsin(sight[..., 2] / range_m)
        return self.gain(azimuth_rad, elevation_rad) / range_m, range_m / SPEED_OF_LIGHT_MPS
