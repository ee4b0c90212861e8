"""The ring of helical antennas: where the elements sit and look, and how this robot's differ from the data sheet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, NonNegativeFloat, PositiveFloat

from dirmusic import GainManifold, GainPattern, GaussianPattern
from dirmusic.array.elevation import gain_in_space

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

    @property
    def n_elements(self) -> int:
        """Number of elements."""
        return self.boresights_rad.size

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
        towards = gain_in_space(self.pattern, azimuth_rad - self.boresights_rad, elevation_rad).gain
        return self.gain_factors * towards + self.gain_offsets


TABLE_SIZE = 3600
"""Steps of 0.1 degrees, between which a cubic is exact to 1e-10 wherever the pattern is smooth."""


class ArrayTable(NamedTuple):
    """The arrays of several robots, of one size and pattern, as compiled loops read them.

    Attributes:
        elements_m: Shape (n_robots, n_elements, 3), array frame.
        boresight_cos_sin: Shape (n_robots, n_elements, 2).
        gain_factors: Shape (n_robots, n_elements).
        gain_offsets: Shape (n_robots, n_elements).
        pattern_gain: Over the angle off boresight, `TABLE_SIZE` even steps once round from 0.
        pattern_slope: Its slope per step.
    """

    elements_m: FloatArray
    boresight_cos_sin: FloatArray
    gain_factors: FloatArray
    gain_offsets: FloatArray
    pattern_gain: FloatArray
    pattern_slope: FloatArray

    @classmethod
    def of(cls, arrays: Sequence[HelicalArray]) -> Self:
        """A row for each array."""
        n, n_elements, step_rad = len(arrays), arrays[0].boresights_rad.size, 2 * np.pi / TABLE_SIZE
        gain, slope = arrays[0].pattern.gain_and_slope(step_rad * np.arange(TABLE_SIZE))
        elements_m, cos_sin = np.empty((n, n_elements, 3)), np.empty((n, n_elements, 2))
        factors, offsets = np.empty((n, n_elements)), np.empty((n, n_elements))
        table = cls(elements_m, cos_sin, factors, offsets, gain, step_rad * slope)
        for row, array in enumerate(arrays):
            table.replace(row, array)
        return table

    def replace(self, row: int, array: HelicalArray) -> None:
        """Another array for one robot."""
        self.elements_m[row] = array.positions_m
        self.boresight_cos_sin[row] = np.stack([np.cos(array.boresights_rad), np.sin(array.boresights_rad)], axis=-1)
        self.gain_factors[row], self.gain_offsets[row] = array.gain_factors, array.gain_offsets


@cache
def _ring_boresights() -> FloatArray:
    return GainManifold.ring(RING_ELEMENTS).boresights_rad
