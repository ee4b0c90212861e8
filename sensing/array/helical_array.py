"""An array of helical antennas: the data sheet's, or one as it was really built."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from dirmusic import GainManifold, GainPattern
from dirmusic.array.pattern import gain_in_space
from dirmusic.array.spatial_pattern import SpatialPattern, halves
from pdpatrol.sensing.array.config import ArrayConfig
from pdpatrol.sensing.nature.pulse_shape import FREQUENCY_HZ

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class HelicalArray:
    """One array, in the array frame: x forward, y left, z up from the ground under the ring's centre.

    Attributes:
        pattern: Gain of every element, over the angle off its boresight or over all directions and frequencies.
        boresights_rad: Azimuth of each boresight, shape (n_elements,).
        boresight_elevations_rad: Elevation of each boresight, shape (n_elements,).
        positions_m: Where the elements sit, shape (n_elements, 3).
        gain_factors: Shape (n_elements,), unitless, one for the data sheet.
        gain_offsets: Additions to the gains, shape (n_elements,), unitless, zero for the data sheet.
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

    @classmethod
    def nominal(cls, config: ArrayConfig) -> Self:
        """The array of the data sheet: the only one that the estimator knows."""
        n = config.n_channels
        return cls(
            pattern=config.nominal_pattern(),
            **config.nominal_elements()._asdict(),
            gain_factors=np.ones(n),
            gain_offsets=np.zeros(n),
        )

    @classmethod
    def draw(cls, config: ArrayConfig, rng: np.random.Generator) -> Self:
        """An array as it was really built: the data sheet with its errors, and the pattern that is true.

        Args:
            config: Its data sheet.
            rng: Draws the errors of an array without serial number; one with a number always has the same.
        """
        rng = rng if config.serial_number is None else np.random.default_rng(config.serial_number)
        nominal, n = config.nominal_elements(), config.n_channels
        pointing = rng.normal(0.0, np.radians(config.pointing_error_deg), n)
        return cls(
            pattern=config.real_pattern(),
            boresights_rad=nominal.boresights_rad + pointing,
            boresight_elevations_rad=nominal.boresight_elevations_rad,
            positions_m=nominal.positions_m + rng.normal(0.0, config.position_error_m, (n, 3)),
            gain_factors=np.exp(rng.normal(0.0, config.gain_error, n)),
            gain_offsets=rng.uniform(-config.gain_offset, config.gain_offset, n),
        )

    @property
    def cut(self) -> GainPattern:
        """The pattern in the plane; of one over frequency, the root mean square over all its frequencies."""
        return self.pattern.cut() if isinstance(self.pattern, SpatialPattern) else self.pattern

    def manifold(self) -> GainManifold:
        """The far-field manifold of the elements' pattern and boresights; of the nominal array, what estimators use."""
        return GainManifold(self.cut, self.boresights_rad, boresight_elevations_rad=self.boresight_elevations_rad)

    def band_manifolds(self, edges_hz: Sequence[float]) -> tuple[GainManifold, ...]:
        """The manifolds of both halves of each sub-band; all the same where the pattern is one in the plane.

        Args:
            edges_hz: Of the sub-bands, rising, n_bands + 1 of them, or none.
        """
        if not isinstance(self.pattern, SpatialPattern):
            return (self.manifold(),) * (2 * (len(edges_hz) - 1))
        cuts = [self.pattern.cut(half) for half in halves(edges_hz)]
        tilts = self.boresight_elevations_rad
        return tuple(GainManifold(cut, self.boresights_rad, boresight_elevations_rad=tilts) for cut in cuts)

    def gain(
        self, azimuth_rad: FloatArray, elevation_rad: FloatArray, frequency_hz: float = FREQUENCY_HZ
    ) -> FloatArray:
        """Gain of element i towards its own direction i, array frame; all of shape (..., n_elements).

        Args:
            azimuth_rad: Of the directions.
            elevation_rad: Of the directions.
            frequency_hz: At which, by default that of the pulses; counts for patterns over frequency alone.
        """
        off_rad = azimuth_rad - self.boresights_rad
        if isinstance(self.pattern, SpatialPattern):
            own = off_boresight(off_rad, elevation_rad, self.boresight_elevations_rad)
            towards = self.pattern.gain(*own, frequency_hz)[0]
        else:
            towards = gain_in_space(self.pattern, off_rad, elevation_rad, self.boresight_elevations_rad).gain
        return self.gain_factors * towards + self.gain_offsets


def off_boresight(
    off_rad: FloatArray, elevation_rad: FloatArray, tilt_rad: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Azimuth and elevation in the frame of boresights that are raised by `tilt_rad`.

    Args:
        off_rad: Azimuth off the boresight's, shape (..., n_elements).
        elevation_rad: Same shape.
        tilt_rad: Elevation of each boresight, shape (n_elements,).
    """
    level, left, z = (
        np.cos(elevation_rad) * np.cos(off_rad),
        np.cos(elevation_rad) * np.sin(off_rad),
        np.sin(elevation_rad),
    )
    ahead, up = np.cos(tilt_rad) * level + np.sin(tilt_rad) * z, np.cos(tilt_rad) * z - np.sin(tilt_rad) * level
    return np.arctan2(left, ahead), np.arctan2(up, np.hypot(left, ahead))
