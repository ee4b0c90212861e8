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
"""Minimum and maximum number of elements. With two elements, most directions come in pairs that look alike; a robot
carries at most sixteen (assumed)."""

SHIPPED_PATTERNS = {name: Path(__file__).with_name("patterns") / f"{name}.csv" for name in ("helix", "helix_in_ring")}
"""Shipped patterns over all directions and frequencies, by name: a helix of four turns, alone and among its five
neighbours. `examples/antenna` computes them by the method of moments."""


class ElementConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """Boresight and position of one element."""

    azimuth_deg: Degree
    """Azimuth of the boresight, array frame, counter-clockwise from straight ahead."""
    elevation_deg: Elevation = 0.0
    """Elevation of the boresight."""
    position_m: tuple[ArrayCoordinate, ArrayCoordinate, MountingHeight] | None = None
    """Position, array frame: x forward, y left, z up from the ground. By default on the ring, at `azimuth_deg`."""


class ArrayConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """Data sheet of the array, and errors of real arrays.

    The elements are either an evenly spaced ring of `n_elements`, of which the first points to the left and the others
    follow clockwise, or those listed in `elements`.

    Errors are given as standard deviations and drawn once per array and element. Their defaults are assumed: 5 % of
    gain due to connectors and amplifiers, and 2 degrees of azimuth and 2 mm due to the mounting of a helix.
    `gain_offset` is the error model of the Dir-MUSIC paper: the half-width of uniformly distributed offsets of the
    gains.
    """

    n_elements: int | None = Field(default=None, ge=FEWEST_ELEMENTS, le=MOST_ELEMENTS)
    """Number of elements of the ring, 6 by default; None if the elements are listed."""
    elements: tuple[ElementConfig, ...] = Field(default=(), max_length=MOST_ELEMENTS)
    """List of all elements, instead of a ring."""
    ring_radius_m: ArrayMetre = 0.12
    height_m: ArrayMetre = 0.6
    pattern: FilePath | None = None
    """Pattern of every element in the data sheet, which direction finding uses: a file, or the name of a shipped
    pattern; by default eq. (1) of the Dir-MUSIC paper. If the pattern covers all directions and frequencies, direction
    finding uses its cut at elevation 0."""
    true_pattern: FilePath | None = None
    """True pattern of every element, in the plane or over all directions and frequencies; by default that of the data
    sheet."""
    gain_error: Share = 0.05
    pointing_error_deg: AngleError = 2.0
    position_error_m: PlacementError = 0.002
    gain_offset: Share = 0.0
    serial_number: int | None = Field(default=None, ge=0, le=2**63 - 1)
    """Serial number of one array built to this data sheet, which has the same errors in every mission. By default each
    mission draws a new array."""
    pattern_error: Share = 0.0
    """Standard deviation that the robot assumes for the difference between the true gain and the data sheet, relative
    to the largest gain. It applies in the plane and grows off it (`dirmusic.ElementSpread`). It does not change the
    simulated array, whose pattern is `true_pattern`. The computed helices need 0.02."""

    @property
    def n_channels(self) -> int:
        """Number of elements."""
        return len(self.elements) or self.n_elements or 6

    def nominal_elements(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return azimuths and elevations of the boresights, and positions, according to the data sheet, array frame.

        Returns:
            Arrays of shapes (n_elements,), (n_elements,) and (n_elements, 3), in radians, radians and metres.
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
    """Read a pattern file, given by path or shipped name; a file is read again only if it has changed."""
    path = str(SHIPPED_PATTERNS.get(path, path))
    try:
        version = Path(path).stat()
    except OSError:
        return read_any_pattern(path)  # raises an error that names the file
    return _read_version(path, version.st_mtime_ns, version.st_size)


@lru_cache(maxsize=16)
def _read_version(path: str, modified_ns: int, size: int) -> TabulatedPattern | SpatialPattern:
    return read_any_pattern(path)
