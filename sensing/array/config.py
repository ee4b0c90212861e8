"""Configuration of the array: positions and boresights of its elements, their pattern, and errors of real arrays."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Self

import numpy as np
from pydantic import BaseModel, Field, model_validator

from dirmusic import GainManifold, GainPattern, GaussianPattern, InputFileError, TabulatedPattern
from dirmusic.array.manifold import ambiguous_azimuths, ring_boresights_rad
from dirmusic.array.pattern_file import read_any_pattern
from dirmusic.array.spatial_pattern import SpatialPattern
from dirmusic.arrays import FloatArray
from pdpatrol.sensing.quantities import (
    AngleError,
    ArrayCoordinate,
    ArrayMetre,
    Degree,
    Elevation,
    FilePath,
    MountingHeight,
    PlacementError,
    Share,
)

FEWEST_ELEMENTS, MOST_ELEMENTS = 3, 16
"""Numbers of elements: two receive most directions in pairs alike, and a robot carries at most sixteen."""

SHIPPED_PATTERNS = {name: Path(__file__).with_name("patterns") / f"{name}.csv" for name in ("helix", "helix_in_ring")}
"""Patterns over all directions and frequencies by name: a helix of four turns by the method of moments, alone and among
its five neighbours; `examples/antenna` computes them."""


class ElementConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """Boresight and position of one element."""

    azimuth_deg: Degree
    """Azimuth of the boresight, array frame, counter-clockwise from straight ahead."""
    elevation_deg: Elevation = 0.0
    """Elevation of the boresight."""
    position_m: tuple[ArrayCoordinate, ArrayCoordinate, MountingHeight] | None = None
    """Position, array frame: x forward, y left, z up from the ground. By default on the ring, at the azimuth."""


class ArrayConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """Data sheet of the array, and errors of real arrays.

    The elements are an even ring of `n_elements`, of which the first points to the left and the others follow
    clockwise, or those of a list.

    The errors are standard deviations, drawn once per array and element. Their defaults are assumed: 5 % of gain from
    connectors and amplifiers, 2 degrees of azimuth and 2 mm from the mounting of a helix. `gain_offset` is that of the
    Dir-MUSIC paper: the half width of uniform additions to the gains.
    """

    n_elements: int | None = Field(default=None, ge=FEWEST_ELEMENTS, le=MOST_ELEMENTS)
    """Elements of the ring, 6 by default; None with a list of elements."""
    elements: tuple[ElementConfig, ...] = Field(default=(), max_length=MOST_ELEMENTS)
    """List of all elements, instead of a ring."""
    ring_radius_m: ArrayMetre = 0.12
    height_m: ArrayMetre = 0.6
    pattern: FilePath | None = None
    """Pattern of every element in the data sheet, which direction finding uses: a file, or the name of a shipped one.
    By default eq. (1) of the Dir-MUSIC paper. Of a pattern over all directions and frequencies it uses the cut at
    elevation 0."""
    true_pattern: FilePath | None = None
    """True pattern of every element, in the plane or over all directions and frequencies; by default that of the data
    sheet."""
    gain_error: Share = 0.05
    pointing_error_deg: AngleError = 2.0
    position_error_m: PlacementError = 0.002
    gain_offset: Share = 0.0
    serial_number: int | None = Field(default=None, ge=0, le=2**63 - 1)
    """Number of one array that was built by this data sheet, with the same errors in every mission. By default each
    mission has another array."""
    pattern_error: Share = 0.0
    """Deviation of the true gain in any direction from the pattern of the data sheet, over the largest gain, as the
    robot assumes it: a standard deviation in the plane, and more off it (`dirmusic.ElementSpread`). Nothing is drawn by
    it; the deviation itself is that of `true_pattern`. The computed helices need 0.02."""

    @property
    def n_channels(self) -> int:
        """Number of elements."""
        return len(self.elements) or self.n_elements or 6

    def nominal_elements(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return azimuths and elevations of the boresights, and positions, as in the data sheet, array frame.

        Returns:
            Shapes (n_elements,), (n_elements,) and (n_elements, 3), radians and metres.
        """
        boresights, tilts = ring_boresights_rad(self.n_channels), np.zeros(self.n_channels)
        if self.elements:
            boresights = np.radians([element.azimuth_deg for element in self.elements])
            tilts = np.radians([element.elevation_deg for element in self.elements])
        ring = self.ring_radius_m * np.stack([np.cos(boresights), np.sin(boresights)], axis=-1)
        positions_m = np.column_stack([ring, np.full(self.n_channels, self.height_m)])
        for k, element in enumerate(self.elements):
            if element.position_m is not None:
                positions_m[k] = element.position_m
        return boresights, tilts, positions_m

    def nominal_pattern(self) -> GainPattern | SpatialPattern:
        """Return the pattern of the data sheet.

        Raises:
            InputFileError: If its file has become invalid.
        """
        return GaussianPattern() if self.pattern is None else _read_pattern(self.pattern)

    def real_pattern(self) -> GainPattern | SpatialPattern:
        """Return the true pattern of the elements.

        Raises:
            InputFileError: If its file has become invalid.
        """
        return self.nominal_pattern() if self.true_pattern is None else _read_pattern(self.true_pattern)

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        if self.elements and self.n_elements is not None:
            raise ValueError(f"n_elements: must not be given with a list of elements, got {self.n_elements}")
        if self.n_channels < FEWEST_ELEMENTS:
            raise ValueError(f"elements: must be {FEWEST_ELEMENTS} to {MOST_ELEMENTS}, got {self.n_channels}")
        for key, path in (("pattern", self.pattern), ("true_pattern", self.true_pattern)):
            try:
                if path is not None:
                    _read_pattern(path)
            except InputFileError as error:
                raise ValueError("\n".join(f"{key}: {each}" for each in error.faults)) from error
        boresights_rad, elevations_rad, positions_m = self.nominal_elements()
        apart_m = np.linalg.norm(positions_m[:, np.newaxis] - positions_m, axis=-1)
        if same := np.argwhere(np.triu(apart_m < 1e-3, 1)).tolist():
            raise ValueError(f"elements.{same[0][1]}.position_m: must differ from that of elements.{same[0][0]}")
        key, pattern = "elements" if self.elements else "pattern", self.nominal_pattern()
        cut = pattern.cut() if isinstance(pattern, SpatialPattern) else pattern
        try:
            manifold = GainManifold(cut, boresights_rad, boresight_elevations_rad=elevations_rad)
        except ValueError as error:
            raise ValueError(f"{key}: {error}") from error
        if alike := ambiguous_azimuths(manifold):
            first, second = np.degrees(alike)
            raise ValueError(
                f"{key}: must distinguish all azimuths, but receives {first:.0f} and {second:.0f} degrees alike"
            )
        return self


def _read_pattern(path: str) -> TabulatedPattern | SpatialPattern:
    """Read the pattern of a file or a shipped name; a file is read again only if it has changed."""
    path = str(SHIPPED_PATTERNS.get(path, path))
    try:
        version = Path(path).stat()
    except OSError:
        return read_any_pattern(path)  # raises a clear error
    return _read_version(path, version.st_mtime_ns, version.st_size)


@lru_cache(maxsize=16)
def _read_version(path: str, modified_ns: int, size: int) -> TabulatedPattern | SpatialPattern:
    return read_any_pattern(path)
