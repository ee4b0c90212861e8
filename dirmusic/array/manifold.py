"""Gain manifold: gain of every element towards any azimuth, like the steering vectors of a phased array."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from dirmusic.angles import difference
from dirmusic.array.pattern import (
    TABLE_SIZE,
    GainPattern,
    GaussianPattern,
    PatternTable,
    SpatialGain,
    gain_in_space,
    tabulate,
)
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.compiled import Held

SEARCH_STEP_RAD = np.radians(2.0)
SEARCH_AZIMUTHS_RAD = np.arange(180) * SEARCH_STEP_RAD
"""Grid for the coarse peak search, before refinement; its step is small compared with a lobe of a ring's element."""


def nearest_search_azimuth(azimuth_rad: FloatArray) -> IntArray:
    """Return the index of the nearest of `SEARCH_AZIMUTHS_RAD` for each azimuth."""
    return np.rint(azimuth_rad / SEARCH_STEP_RAD).astype(np.intp) % SEARCH_AZIMUTHS_RAD.size


class ManifoldTable(NamedTuple):
    """Manifold for compiled kernels, tabulated in equal steps of azimuth from 0.

    Attributes:
        gain: Gains, shape (TABLE_SIZE, n_elements).
        slope: Slopes of the gains per radian, shape (TABLE_SIZE, n_elements).
        unit_pairs: Products of the unit gains of elements (0, 0), (1, 0), (1, 1), (2, 0) ... towards
            `SEARCH_AZIMUTHS_RAD`, shape (n_elements (n_elements + 1) / 2, n_azimuths).
    """

    gain: FloatArray
    slope: FloatArray
    unit_pairs: FloatArray


def ring_boresights_rad(n_elements: int) -> FloatArray:
    """Return the boresights of a uniform ring, 90 - 360 k / n degrees: element 1 points left, the next clockwise."""
    return np.pi / 2 - 2 * np.pi * np.arange(n_elements) / n_elements


class GainManifold:
    """Gain manifold of an array, as the estimator knows it.

    Args:
        pattern: Pattern of each element.
        boresights_rad: Azimuth of each element's boresight, array frame, shape (n_elements,), n_elements >= 2.
        boresight_elevations_rad: Elevation of each element's boresight, in [-pi/2, pi/2], shape (n_elements,). Default:
            level.
        gain_factors: Known factor of each element's gain, shape (n_elements,), positive; see `ElementErrors.correct`.
        gain_offsets: Known offset added to each element's gain, in units of gain, shape (n_elements,).

    Attributes:
        search_gain: Gains towards `SEARCH_AZIMUTHS_RAD`, shape (n_elements, n_azimuths).
        search_slope: Slopes of these gains per radian.
        search_unit_gain: These gains scaled to unit norm.

    Raises:
        ValueError: If a vector is not finite or not of shape (n_elements,), or if the ratios of the gains hardly change
            with azimuth, so that the array cannot distinguish directions.

    References:
        Dir-MUSIC, eq. (6).
    """

    def __init__(
        self,
        pattern: GainPattern,
        boresights_rad: ArrayLike,
        *,
        boresight_elevations_rad: ArrayLike = 0.0,
        gain_factors: ArrayLike = 1.0,
        gain_offsets: ArrayLike = 0.0,
    ) -> None:
        boresights = np.array(boresights_rad, dtype=np.float64)
        if boresights.ndim != 1 or boresights.size < 2:
            raise ValueError(
                f"`boresights_rad` must have shape (n_elements,), n_elements >= 2, got {boresights_rad!r}. "
                "A direction needs at least two elements."
            )
        self.boresights_rad = boresights
        self.boresight_elevations_rad, self.gain_factors, self.gain_offsets = (
            np.full(boresights.shape, each, dtype=np.float64)
            for each in (boresight_elevations_rad, gain_factors, gain_offsets)
        )
        self._of_elements = {
            "boresights_rad": self.boresights_rad,
            "boresight_elevations_rad": self.boresight_elevations_rad,
            "gain_factors": self.gain_factors,
            "gain_offsets": self.gain_offsets,
        }
        for name, values in self._of_elements.items():
            values.setflags(write=False)
            if not np.isfinite(values).all():
                raise ValueError(f"`{name}` must be finite, got {values!r}")
        if not np.all(self.gain_factors > 0):
            raise ValueError(
                f"`gain_factors` must be positive, got {gain_factors!r}; use `take` to leave out a dead element"
            )
        if not np.all(np.abs(self.boresight_elevations_rad) <= np.pi / 2):
            raise ValueError(f"`boresight_elevations_rad` must be in [-pi/2, pi/2], got {boresight_elevations_rad!r}")
        self._taken: dict[tuple[int, ...], GainManifold] = {}
        self.pattern = pattern
        gain, slope = self.gain_and_slope(SEARCH_AZIMUTHS_RAD)
        unit = gain / np.linalg.norm(gain, axis=0)
        self.search_gain, self.search_slope, self.search_unit_gain = gain, slope, unit
        for array in (gain, slope, unit):
            array.setflags(write=False)
        if (
            not np.linalg.norm(np.roll(unit, -1, axis=1) - unit, axis=0).max() > 0.01 * SEARCH_STEP_RAD
        ):  # 1 % of gain per radian
            raise ValueError("`pattern` must not be flat: the ratios of the gains must change with azimuth")

    @classmethod
    def ring(cls, n_elements: int = 6, pattern: GainPattern | None = None) -> Self:
        """Make the manifold of a uniform ring; see `ring_boresights_rad`."""
        return cls(pattern or GaussianPattern(), ring_boresights_rad(n_elements))

    def replaced(self, **changes: ArrayLike) -> GainManifold:
        """Return a copy with other boresights, gain factors or offsets, given under their names in the constructor."""
        return GainManifold(self.pattern, **{**self._of_elements, **changes})

    def take(self, elements: Sequence[int] | IntArray | BoolArray) -> GainManifold:
        """Select elements by index or mask, for a receiver with fewer channels or to leave out faulty elements."""
        chosen = np.arange(self.n_elements)[np.asarray(elements)]
        key = tuple(chosen.tolist())
        if key not in self._taken:  # the channel monitor asks for the same subsets repeatedly
            self._taken[key] = self.replaced(**{name: each[chosen] for name, each in self._of_elements.items()})
        return self._taken[key]

    @property
    def n_elements(self) -> int:
        """Number of elements."""
        return self.boresights_rad.size

    @cached_property
    def table(self) -> ManifoldTable:
        """Table for compiled kernels."""
        gain, slope = self.gain_and_slope(2 * np.pi / TABLE_SIZE * np.arange(TABLE_SIZE))
        first, second = np.tril_indices(self.n_elements)
        pairs = self.search_unit_gain[first] * self.search_unit_gain[second]
        table = ManifoldTable(np.ascontiguousarray(gain.T), np.ascontiguousarray(slope.T), pairs)
        for array in table:
            array.setflags(write=False)
        return table

    @cached_property
    def held_table(self) -> Held[ManifoldTable]:
        """Table for compiled kernels that are called often."""
        return Held(self.table)

    @cached_property
    def pattern_table(self) -> PatternTable:
        """Pattern of the elements for compiled kernels."""
        return tabulate(self.pattern)

    def gain(self, azimuth_rad: ArrayLike) -> FloatArray:
        """Compute the gains towards array-frame azimuths of any shape; shape (n_elements, *azimuth.shape)."""
        return self.gain_and_slope(azimuth_rad)[0]

    def gain_and_slope(self, azimuth_rad: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Compute the gains and their slopes per radian, each of shape (n_elements, *azimuth.shape)."""
        azimuth = np.asarray(azimuth_rad, dtype=np.float64)
        boresights, tilts, factors, offsets = (
            each.reshape(-1, *(1,) * azimuth.ndim) for each in self._of_elements.values()
        )
        off_boresight_rad = azimuth - boresights
        if tilts.any():
            gain, slope, _ = gain_in_space(self.pattern, off_boresight_rad, 0.0, tilts)
        else:
            gain, slope = self.pattern.gain_and_slope(off_boresight_rad)
        return factors * gain + offsets, factors * slope

    def response_in_space(self, off_boresight_rad: FloatArray, elevation_rad: FloatArray) -> SpatialGain:
        """Compute the gain and slopes of each element, each in its own direction; elements on the last axis.

        Args:
            off_boresight_rad: Azimuth off each boresight, shape (..., n_elements).
            elevation_rad: Elevation of each direction; broadcasts with `off_boresight_rad`.
        """
        gain, by_azimuth, by_elevation = gain_in_space(
            self.pattern, off_boresight_rad, elevation_rad, self.boresight_elevations_rad
        )
        factors = self.gain_factors
        return SpatialGain(factors * gain + self.gain_offsets, factors * by_azimuth, factors * by_elevation)


FAR_APART_RAD = np.radians(20.0)
"""Smallest angle between two directions that count as ambiguous; confusing closer ones is part of the bearing error."""

LEAST_CONTRAST_RAD = np.radians(1.0)
"""Angle between unit gain vectors below which two directions are ambiguous. Assumed: 1 degree is 2 % of the strengths,
less than the spread of the elements. Rings have 5 degrees or more; two elements have hundredths of a degree."""


def check_azimuths_differ(manifold: GainManifold) -> None:
    """Check that an array distinguishes all azimuths that are far apart.

    Raises:
        ValueError: If the gains of two azimuths at least `FAR_APART_RAD` apart have so similar ratios that the angle
            between their gain vectors is below `LEAST_CONTRAST_RAD`.
    """
    unit_gain = manifold.search_unit_gain
    similarity: FloatArray = unit_gain.T @ unit_gain
    apart_rad = np.abs(difference(SEARCH_AZIMUTHS_RAD[:, np.newaxis], SEARCH_AZIMUTHS_RAD))
    similarity[apart_rad < FAR_APART_RAD - 1e-9] = -1.0
    alike = list(divmod(int(similarity.argmax()), SEARCH_AZIMUTHS_RAD.size))
    contrast_rad = 2 * np.arcsin(0.5 * np.linalg.norm(np.diff(unit_gain[:, alike])))
    if contrast_rad < LEAST_CONTRAST_RAD:
        first, second = np.degrees(SEARCH_AZIMUTHS_RAD[alike])
        raise ValueError(f"must distinguish all azimuths, but receives {first:.0f} and {second:.0f} degrees alike")
