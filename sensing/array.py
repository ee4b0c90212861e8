"""The ring of helical antennas: where the elements sit and look, and how this robot's differ from the data sheet."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, NonNegativeFloat, PositiveFloat

from dirmusic import GainManifold, GainPattern, GaussianPattern
from dirmusic.elevation import gain_towards

FloatArray = NDArray[np.float64]

RING_ELEMENTS = 6


class ArrayConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """Data sheet of the array, and the spread of real arrays about it.

    `n_elements` is 6, or 4 for a four-channel receiver, which has elements 1 to 4 of the six.

    The errors are standard deviations, drawn once per mission and element; their defaults are assumed: 5 % of gain
    from connectors and amplifiers, 2 degrees from how a helix sits on its plate, 2 mm from how it is mounted.
    `gain_offset` is another kind, that of the Dir-MUSIC paper: the half width of uniform additions to the gains.
    """

    n_elements: Literal[4, 6] = 6
    ring_radius_m: PositiveFloat = 0.12
    height_m: PositiveFloat = 0.6
    gain_error: NonNegativeFloat = 0.05
    pointing_error_deg: NonNegativeFloat = 2.0
    position_error_m: NonNegativeFloat = 0.002
    gain_offset: NonNegativeFloat = 0.0


@dataclass(frozen=True, kw_only=True)
class HelicalArray:
    """One array, in the array frame: x forward, y left, z up from the ground under the ring's centre.

    Attributes:
        pattern: Gain of every element over the angle off its boresight.
        boresights_rad: Shape (n_elements,).
        positions_m: Shape (n_elements, 3).
        gain_factors: Shape (n_elements,), unitless, one for the data sheet.
        gain_offsets: Additions to the gains, shape (n_elements,), unitless, zero for the data sheet.
    """

    pattern: GainPattern
    boresights_rad: FloatArray
    positions_m: FloatArray
    gain_factors: FloatArray
    gain_offsets: FloatArray

    @classmethod
    def nominal(cls, config: ArrayConfig) -> Self:
        """The array of the data sheet: the only one that the estimator knows."""
        boresights = _ring_boresights()[: config.n_elements]
        ring = config.ring_radius_m * np.stack([np.cos(boresights), np.sin(boresights)], axis=-1)
        return cls(
            pattern=GaussianPattern(),
            boresights_rad=boresights,
            positions_m=np.column_stack([ring, np.full(config.n_elements, config.height_m)]),
            gain_factors=np.ones(config.n_elements),
            gain_offsets=np.zeros(config.n_elements),
        )

    @classmethod
    def draw(cls, config: ArrayConfig, rng: np.random.Generator) -> Self:
        """An array as it was really built: the data sheet with its errors."""
        nominal, n = cls.nominal(config), config.n_elements
        pointing = rng.normal(0.0, np.radians(config.pointing_error_deg), n)
        return cls(
            pattern=nominal.pattern,
            boresights_rad=nominal.boresights_rad + pointing,
            positions_m=nominal.positions_m + rng.normal(0.0, config.position_error_m, (n, 3)),
            gain_factors=np.exp(rng.normal(0.0, config.gain_error, n)),
            gain_offsets=rng.uniform(-config.gain_offset, config.gain_offset, n),
        )

    def manifold(self) -> GainManifold:
        """The far-field manifold of the elements' pattern and boresights; of the nominal array, what estimators use."""
        return GainManifold(self.pattern, self.boresights_rad)

    def gain(self, azimuth_rad: FloatArray, elevation_rad: FloatArray) -> FloatArray:
        """Gain of element i towards its own direction i, array frame; all of shape (..., n_elements)."""
        level = np.cos(elevation_rad)
        towards = (level * np.cos(azimuth_rad), level * np.sin(azimuth_rad), np.sin(elevation_rad))
        return self.gain_towards(np.stack(np.broadcast_arrays(*towards), axis=-1))

    def gain_towards(self, sight_m: FloatArray) -> FloatArray:
        """The same along vectors of shape (..., n_elements, 3)."""
        x, y, up = sight_m[..., 0], sight_m[..., 1], sight_m[..., 2]
        cos, sin = self._boresight_cos_sin
        gain = gain_towards(self.pattern, cos * x + sin * y, cos * y - sin * x, up)
        return self.gain_factors * gain + self.gain_offsets

    @cached_property
    def _boresight_cos_sin(self) -> tuple[FloatArray, FloatArray]:
        return np.cos(self.boresights_rad), np.sin(self.boresights_rad)


@cache
def _ring_boresights() -> FloatArray:
    return GainManifold.ring(RING_ELEMENTS).boresights_rad
