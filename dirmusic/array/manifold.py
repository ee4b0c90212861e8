"""Gain of every element towards any azimuth: what steering vectors are to phase arrays."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
from dirmusic.compiled import Held

FloatArray = NDArray[np.float64]

SEARCH_STEP_RAD = np.radians(2.0)
SEARCH_AZIMUTHS_RAD = np.arange(180) * SEARCH_STEP_RAD
"""Where peaks are looked for before they are refined: fine against any lobe wide enough to be used in a ring."""


def nearest_search_azimuth(azimuth_rad: FloatArray) -> NDArray[np.intp]:
    """Number of the one of `SEARCH_AZIMUTHS_RAD` that is nearest to each azimuth, of its shape."""
    return np.rint(azimuth_rad / SEARCH_STEP_RAD).astype(np.intp) % SEARCH_AZIMUTHS_RAD.size


BLIND_SLOPE = 0.01
"""A manifold that turns by less than this per radian everywhere is blind: 1 % of gain would be a radian."""


class ManifoldTable(NamedTuple):
    """A manifold as compiled loops read it; azimuths are even steps once round from 0.

    Attributes:
        gain: Shape (TABLE_SIZE, n_elements).
        slope: Per radian, shape (TABLE_SIZE, n_elements).
        unit_pairs: Products of the unit gains of elements (0, 0), (1, 0), (1, 1), (2, 0) ... towards
            `SEARCH_AZIMUTHS_RAD`, shape (n_elements (n_elements + 1) / 2, n_azimuths).
    """

    gain: FloatArray
    slope: FloatArray
    unit_pairs: FloatArray


def ring_boresights_rad(n_elements: int) -> FloatArray:
    """Boresights of a uniform ring, +90 - 360 k / n degrees: element 1 points left, the next further clockwise."""
    return np.pi / 2 - 2 * np.pi * np.arange(n_elements) / n_elements


class GainManifold:
    """The gain array manifold that the estimator believes in.

    Args:
        pattern: Gain of each element over the angle off its boresight.
        boresights_rad: Azimuth of each element's boresight, array frame, shape (n_elements,), n_elements >= 2.
        boresight_elevations_rad: Elevation of each element's boresight, in [-pi/2, pi/2], shape (n_elements,); zero for
            a level element.
        gain_factors: Known factor on each element's gain, shape (n_elements,), positive; one where nothing is known.
        gain_offsets: Known addition to each element's gain, in units of gain, shape (n_elements,); zero where nothing
            is known. Both come from a calibration, and `ElementErrors.correct` sets them.
        elevation_rad: Elevation at which sources are taken to be, in [-pi/2, pi/2].

    Attributes:
        search_gain: Gains towards `SEARCH_AZIMUTHS_RAD`, shape (n_elements, n_azimuths), kept because every estimate
            starts there; `search_slope` their slopes per radian, `search_unit_gain` the gains scaled to unit norm.

    Raises:
        ValueError: If a vector is not finite or not of shape (n_elements,), or the array cannot tell directions apart
            because its gains hardly change with azimuth.

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
        elevation_rad: float = 0.0,
    ) -> None:
        boresights = np.array(boresights_rad, dtype=np.float64)
        if boresights.ndim != 1 or boresights.size < 2 or not np.isfinite(boresights).all():
            raise ValueError(
                f"`boresights_rad` must be finite with shape (n_elements,), n_elements >= 2, got {boresights_rad!r}. "
                "One element alone leaves no noise subspace, so it has no bearing."
            )
        vectors = boresight_elevations_rad, gain_factors, gain_offsets
        tilts, factors, offsets = (np.array(x, dtype=np.float64) for x in vectors)
        names = "boresight_elevations_rad", "gain_factors", "gain_offsets"
        for name, values in zip(names, (tilts, factors, offsets), strict=True):
            if values.shape not in ((), boresights.shape) or not np.isfinite(values).all():
                raise ValueError(f"`{name}` must be finite with shape {boresights.shape}, got {values!r}")
        if not np.all(factors > 0):
            raise ValueError(f"`gain_factors` must be positive, got {factors!r}; a dead element is left out by `take`")
        if not np.all(np.abs(tilts) <= np.pi / 2):
            raise ValueError(f"`boresight_elevations_rad` must be in [-pi/2, pi/2], got {tilts!r}")
        if not abs(elevation_rad) <= np.pi / 2:
            raise ValueError(f"`elevation_rad` must be in [-pi/2, pi/2], got {elevation_rad!r}")
        self._taken: dict[tuple[int, ...], GainManifold] = {}
        self.pattern = pattern
        self.elevation_rad = elevation_rad
        self.boresights_rad = boresights
        self.boresight_elevations_rad = np.array(np.broadcast_to(tilts, boresights.shape))
        self.gain_factors = np.array(np.broadcast_to(factors, boresights.shape))
        self.gain_offsets = np.array(np.broadcast_to(offsets, boresights.shape))
        for array in (self.boresights_rad, self.boresight_elevations_rad, self.gain_factors, self.gain_offsets):
            array.setflags(write=False)
        self._is_in_plane = elevation_rad == 0.0 and not self.boresight_elevations_rad.any()
        gain, slope = self.gain_and_slope(SEARCH_AZIMUTHS_RAD)
        unit = gain / np.linalg.norm(gain, axis=0)
        self.search_gain, self.search_slope, self.search_unit_gain = gain, slope, unit
        for array in (gain, slope, unit):
            array.setflags(write=False)
        if not np.linalg.norm(np.roll(unit, -1, axis=1) - unit, axis=0).max() > BLIND_SLOPE * SEARCH_STEP_RAD:
            raise ValueError(
                "`pattern` is flat: the ratios of the gains do not change with azimuth, so strengths hold no direction"
            )

    @classmethod
    def ring(cls, n_elements: int = 6, pattern: GainPattern | None = None) -> Self:
        """A uniform ring with the boresights of `ring_boresights_rad`."""
        return cls(pattern or GaussianPattern(), ring_boresights_rad(n_elements))

    def take(self, elements: Sequence[int] | NDArray[np.intp] | NDArray[np.bool_]) -> GainManifold:
        """The manifold of some elements alone, by index or mask: a four-channel receiver, or dead channels left out."""
        chosen = np.arange(self.n_elements)[np.asarray(elements)]
        key = tuple(chosen.tolist())
        if key not in self._taken:  # channels are left out again and again to see which is at fault
            self._taken[key] = GainManifold(
                self.pattern,
                self.boresights_rad[chosen],
                boresight_elevations_rad=self.boresight_elevations_rad[chosen],
                gain_factors=self.gain_factors[chosen],
                gain_offsets=self.gain_offsets[chosen],
                elevation_rad=self.elevation_rad,
            )
        return self._taken[key]

    def at_elevation(self, elevation_rad: float) -> GainManifold:
        """The manifold of sources that are known to be seen at one elevation; by default they are level.

        In the plane, a source at 20 / 30 / 45 degrees of elevation is off by 0.7 / 1.6 / 3.6 degrees of azimuth, rms.
        """
        return GainManifold(
            self.pattern,
            self.boresights_rad,
            boresight_elevations_rad=self.boresight_elevations_rad,
            gain_factors=self.gain_factors,
            gain_offsets=self.gain_offsets,
            elevation_rad=elevation_rad,
        )

    @property
    def n_elements(self) -> int:
        """Number of elements."""
        return self.boresights_rad.size

    @cached_property
    def table(self) -> ManifoldTable:
        """What estimates look up."""
        gain, slope = self.gain_and_slope(2 * np.pi / TABLE_SIZE * np.arange(TABLE_SIZE))
        first, second = np.tril_indices(self.n_elements)
        pairs = self.search_unit_gain[first] * self.search_unit_gain[second]
        table = ManifoldTable(np.ascontiguousarray(gain.T), np.ascontiguousarray(slope.T), pairs)
        for array in table:
            array.setflags(write=False)
        return table

    @cached_property
    def held_table(self) -> Held[ManifoldTable]:
        """The same for compiled functions that are called often."""
        return Held(self.table)

    @cached_property
    def pattern_table(self) -> PatternTable:
        """The pattern as compiled loops look it up."""
        return tabulate(self.pattern)

    def gain(self, azimuth_rad: ArrayLike) -> FloatArray:
        """Gains towards array-frame azimuths of any shape; shape (n_elements, *azimuth.shape), unitless."""
        return self.gain_and_slope(azimuth_rad)[0]

    def derivative(self, azimuth_rad: ArrayLike) -> FloatArray:
        """Slopes of the gains per radian of azimuth; shape (n_elements, *azimuth.shape)."""
        return self.gain_and_slope(azimuth_rad)[1]

    def gain_and_slope(self, azimuth_rad: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Gains and their slopes per radian, each of shape (n_elements, *azimuth.shape)."""
        azimuth = np.asarray(azimuth_rad, dtype=np.float64)
        per_element = (-1, *(1,) * azimuth.ndim)
        return self.element_response(azimuth - self.boresights_rad.reshape(per_element), per_element)

    def element_response(
        self, off_boresight_rad: FloatArray, per_element: tuple[int, ...] = (-1,)
    ) -> tuple[FloatArray, FloatArray]:
        """Gain and slope of each element towards an azimuth of its own, as for a source close by.

        Args:
            off_boresight_rad: Azimuth off each boresight, a shape that broadcasts with (n_elements,) reshaped to
                `per_element`.
            per_element: Where the element axis is; (-1,) is the last.
        """
        if self._is_in_plane:
            gain, slope = self.pattern.gain_and_slope(off_boresight_rad)
        else:
            tilt = self.boresight_elevations_rad.reshape(per_element)
            gain, slope, _ = gain_in_space(self.pattern, off_boresight_rad, self.elevation_rad, tilt)
        factors, offsets = self.gain_factors.reshape(per_element), self.gain_offsets.reshape(per_element)
        return factors * gain + offsets, factors * slope

    def response_in_space(self, off_boresight_rad: FloatArray, elevation_rad: FloatArray) -> SpatialGain:
        """Gain of each element and its slopes towards directions of their own; the element axis is the last.

        Args:
            off_boresight_rad: Azimuth off each boresight, shape (..., n_elements).
            elevation_rad: Elevation of each direction; broadcasts with `off_boresight_rad`. `self.elevation_rad` does
                not count here.
        """
        gain, by_azimuth, by_elevation = gain_in_space(
            self.pattern, off_boresight_rad, elevation_rad, self.boresight_elevations_rad
        )
        factors = self.gain_factors
        return SpatialGain(factors * gain + self.gain_offsets, factors * by_azimuth, factors * by_elevation)


FAR_APART_RAD = np.radians(20.0)
"""Directions nearer to each other than this may well be alike: what noise makes of them is the bound's matter."""

LEAST_CONTRAST_RAD = np.radians(1.0)
"""Unit gains that differ by less are taken for the same (assumed): 1 degree is 2 % of the strengths, less than the
elements of one array differ by. Rings have 5 degrees and more, two elements hundredths of one."""


class Ambiguity(NamedTuple):
    """The two directions far apart that an array can tell apart least.

    Attributes:
        contrast_rad: Angle between their gains as vectors.
        first_rad: The one azimuth, array frame, in [0, 2 pi).
        second_rad: The other azimuth.
    """

    contrast_rad: float
    first_rad: float
    second_rad: float

    @property
    def is_harmless(self) -> bool:
        """Whether the array tells all directions apart."""
        return self.contrast_rad >= LEAST_CONTRAST_RAD


def worst_ambiguity(manifold: GainManifold) -> Ambiguity:
    """The pair of azimuths, at least `FAR_APART_RAD` from each other, whose gains have the most alike ratios."""
    unit_gain = manifold.search_unit_gain
    likeness: FloatArray = unit_gain.T @ unit_gain
    apart_rad = np.abs(difference(SEARCH_AZIMUTHS_RAD[:, np.newaxis], SEARCH_AZIMUTHS_RAD))
    likeness[apart_rad < FAR_APART_RAD - 1e-9] = -1.0
    first, second = divmod(int(likeness.argmax()), SEARCH_AZIMUTHS_RAD.size)
    contrast = float(np.linalg.norm(unit_gain[:, first] - unit_gain[:, second]))
    return Ambiguity(
        contrast_rad=float(2 * np.arcsin(0.5 * contrast)),
        first_rad=float(SEARCH_AZIMUTHS_RAD[first]),
        second_rad=float(SEARCH_AZIMUTHS_RAD[second]),
    )
