"""Settings of the array: where its elements sit and point, their pattern, and how real arrays spread about that."""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple, Self, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, model_validator

from dirmusic import GainManifold, GainPattern, GaussianPattern, InputFileError, TabulatedPattern
from dirmusic.array.manifold import ring_boresights_rad, worst_ambiguity
from dirmusic.array.pattern_file import read_any_pattern
from dirmusic.array.spatial_pattern import SpatialPattern
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

FloatArray = NDArray[np.float64]

FEWEST_ELEMENTS, MOST_ELEMENTS = 3, 16
"""Elements of an array: two receive most directions in pairs; a robot carries no more than sixteen."""

USUAL_ELEMENTS = 6

SHIPPED_PATTERNS = {name: Path(__file__).with_name("patterns") / f"{name}.csv" for name in ("helix", "helix_in_ring")}
"""Patterns over all directions and frequencies that a name stands for: a helix of four turns by the method of moments,
alone and among its five neighbours; `examples/antenna` computes them."""

SAME_PLACE_M = 1e-3
"""Elements nearer to each other than this are in one place."""


class ElementConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """One element: where it points, and where it sits."""

    azimuth_deg: Degree
    """Of the boresight, array frame, counter-clockwise from straight ahead."""
    elevation_deg: Elevation = 0.0
    """Of the boresight, up from the horizontal."""
    position_m: tuple[ArrayCoordinate, ArrayCoordinate, MountingHeight] | None = None
    """Array frame: x forward, y left, z up from the ground. Left out, it is on the ring, towards the azimuth."""


class Elements(NamedTuple):
    """The elements of a data sheet, array frame.

    Attributes:
        boresights_rad: Azimuth of each boresight, shape (n_elements,).
        boresight_elevations_rad: Elevation of each boresight, shape (n_elements,).
        positions_m: Shape (n_elements, 3).
    """

    boresights_rad: FloatArray
    boresight_elevations_rad: FloatArray
    positions_m: FloatArray


class ArrayConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """Data sheet of the array, and the spread of real arrays about it.

    The elements are an even ring of `n_elements`, of which the first points to the left and the next further clockwise,
    or those of a list.

    The errors are standard deviations, drawn once per array and element; their defaults are assumed: 5 % of gain from
    connectors and amplifiers, 2 degrees of azimuth from how a helix sits on its plate, 2 mm from how it is mounted.
    `gain_offset` is another kind, that of the Dir-MUSIC paper: the half width of uniform additions to the gains.
    """

    n_elements: int | None = Field(default=None, ge=0, le=MOST_ELEMENTS)
    """Elements of the ring: 6, unless given otherwise; None where there is a list."""
    elements: tuple[ElementConfig, ...] = Field(default=(), max_length=MOST_ELEMENTS)
    """All elements, instead of a ring."""
    ring_radius_m: ArrayMetre = 0.12
    height_m: ArrayMetre = 0.6
    pattern: FilePath | None = None
    """File with the pattern of every element as the data sheet has it, which direction finding uses, or the name of a
    shipped one; eq. (1) of the Dir-MUSIC paper, if left out. Of a pattern over all directions and frequencies it uses
    the cut at elevation 0."""
    true_pattern: FilePath | None = None
    """The pattern that every element really has, in the plane or over all directions and frequencies; that of the data
    sheet, if left out."""
    gain_error: Share = 0.05
    pointing_error_deg: AngleError = 2.0
    position_error_m: PlacementError = 0.002
    gain_offset: Share = 0.0
    serial_number: int | None = Field(default=None, ge=0, le=2**63 - 1)
    """Which of the arrays that were built by this data sheet the robot carries: one number is one array, with the same
    errors whatever else a mission draws. Left out, each mission has another one."""
    pattern_error: Share = 0.0
    """By how much the gain in any one direction may differ from the data sheet's pattern, over its largest gain, as the
    robot believes: a standard deviation in the plane, and more off it (`dirmusic.ElementSpread`). Nothing is drawn by
    it: `true_pattern` says how it differs. The computed helices need 0.02."""

    @model_validator(mode="before")
    @classmethod
    def _is_a_ring_without_a_list(cls, given: object) -> object:
        if isinstance(given, dict):
            table = cast("dict[str, Any]", given)
            if not table.get("elements") and table.get("n_elements") is None:
                return {**table, "n_elements": USUAL_ELEMENTS}
        return cast("object", given)

    @property
    def n_channels(self) -> int:
        """How many elements there are."""
        return len(self.elements) or self.n_elements or 0

    def nominal_elements(self) -> Elements:
        """The elements of the data sheet."""
        boresights, tilts = ring_boresights_rad(self.n_channels), np.zeros(self.n_channels)
        if self.elements:
            boresights = np.radians([element.azimuth_deg for element in self.elements])
            tilts = np.radians([element.elevation_deg for element in self.elements])
        ring = self.ring_radius_m * np.stack([np.cos(boresights), np.sin(boresights)], axis=-1)
        positions_m = np.column_stack([ring, np.full(self.n_channels, self.height_m)])
        for k, element in enumerate(self.elements):
            if element.position_m is not None:
                positions_m[k] = element.position_m
        return Elements(boresights, tilts, positions_m)

    def nominal_pattern(self) -> GainPattern | SpatialPattern:
        """Pattern of the data sheet.

        Raises:
            InputFileError: If its file is no longer what it was.
        """
        return GaussianPattern() if self.pattern is None else _pattern(self.pattern)

    def real_pattern(self) -> GainPattern | SpatialPattern:
        """Pattern that the elements really have.

        Raises:
            InputFileError: If its file is no longer what it was.
        """
        return self.nominal_pattern() if self.true_pattern is None else _pattern(self.true_pattern)

    @model_validator(mode="after")
    def _tells_directions_apart(self) -> Self:
        faults = [*self._number_faults(), *self._pattern_faults()] or self._place_faults() or self._manifold_faults()
        if faults:
            raise ValueError("\n".join(faults))
        return self

    def _number_faults(self) -> list[str]:
        if self.elements and self.n_elements is not None:
            return [f"n_elements: got {self.n_elements} with a list of elements; allowed is one of the two"]
        n, key = self.n_channels, "elements" if self.elements else "n_elements"
        if FEWEST_ELEMENTS <= n <= MOST_ELEMENTS:
            return []
        why = ": two elements receive most directions in pairs" if n == 2 else ""
        return [f"{key}: got {n}; allowed are {FEWEST_ELEMENTS} to {MOST_ELEMENTS}{why}"]

    def _pattern_faults(self) -> list[str]:
        faults: list[str] = []
        for key, path in (("pattern", self.pattern), ("true_pattern", self.true_pattern)):
            try:
                if path is not None:
                    _pattern(path)
            except InputFileError as error:
                faults += [f"{key}: {fault}" for fault in error.faults]
        return faults

    def _place_faults(self) -> list[str]:
        places, faults = self.nominal_elements().positions_m, list[str]()
        for i in range(len(self.elements)):
            if places[i, 2] <= 0.0:
                faults.append(f"elements.{i}.position_m: got {_shown(places[i])}; allowed is a height above 0 m")
        for i, j in combinations(range(len(self.elements)), 2):
            if np.linalg.norm(places[j] - places[i]) < SAME_PLACE_M:
                taken = f"elements.{j}.position_m: {_shown(places[j])} is that of elements.{i}"
                faults.append(f"{taken}; allowed is a place of its own")
        return faults

    def _manifold_faults(self) -> list[str]:
        key, elements = "elements" if self.elements else "pattern", self.nominal_elements()
        try:
            pattern = self.nominal_pattern()
            manifold = GainManifold(
                pattern.cut() if isinstance(pattern, SpatialPattern) else pattern,
                elements.boresights_rad,
                boresight_elevations_rad=elements.boresight_elevations_rad,
            )
        except ValueError as error:
            return [f"{key}: {error}"]
        worst = worst_ambiguity(manifold)
        if worst.is_harmless:
            return []
        azimuths = f"{np.degrees(worst.first_rad):.0f} and {np.degrees(worst.second_rad):.0f} degrees"
        return [f"{key}: azimuths of {azimuths} are received alike; allowed is an array that tells them apart"]


def _shown(place_m: FloatArray) -> str:
    return f"({', '.join(f'{x:g}' for x in place_m)})"


def _pattern(path: str) -> TabulatedPattern | SpatialPattern:
    """The pattern in a file, or that of a name; read again only if the file has changed."""
    path = str(SHIPPED_PATTERNS.get(path, path))
    try:
        version = Path(path).stat()
    except OSError:
        return read_any_pattern(path)  # says what is wrong
    return _pattern_version(path, version.st_mtime_ns, version.st_size)


@lru_cache(maxsize=16)
def _pattern_version(path: str, modified_ns: int, size: int) -> TabulatedPattern | SpatialPattern:
    return read_any_pattern(path)
