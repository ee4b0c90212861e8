"""Array of helical antennas: its configuration, the nominal array of the data sheet, and arrays as built."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator
from scipy.spatial.transform import Rotation

from dirmusic import GainManifold, GainPattern, GaussianPattern, InputFileError
from dirmusic.array.manifold import check_azimuths_differ, ring_boresights_rad
from dirmusic.array.pattern import gain_in_space
from dirmusic.array.pattern_file import read_any_pattern
from dirmusic.array.spatial_pattern import SpatialPattern, halves
from dirmusic.arrays import FloatArray
from pdpatrol.sensing.array.beam_width import scaled_beam
from pdpatrol.sensing.nature.pulses import FREQUENCY_HZ
from pdpatrol.sensing.quantities import (
    SPEED_OF_LIGHT_MPS,
    AngleError,
    ArrayCoordinate,
    ArrayMetre,
    Config,
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


class ElementConfig(Config):
    """Boresight and position of one element."""

    azimuth_deg: Degree
    """Azimuth of the boresight, array frame, counter-clockwise from straight ahead."""
    elevation_deg: Elevation = 0.0
    """Elevation of the boresight."""
    position_m: tuple[ArrayCoordinate, ArrayCoordinate, MountingHeight] | None = None
    """Position, array frame: x forward, y left, z up from the ground. By default on the ring, at `azimuth_deg`."""


class ArrayConfig(Config):
    """Data sheet of the array, and the spread of real arrays around it, as the robot believes them.

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
    """Radius of the ring of elements."""
    height_m: ArrayMetre = 0.6
    """Height of the elements above the ground."""
    pattern: FilePath | None = None
    """Pattern of every element in the data sheet, which direction finding uses: a file, or the name of a shipped
    pattern; by default eq. (1) of the Dir-MUSIC paper. If the pattern covers all directions and frequencies, direction
    finding uses its cut at elevation 0."""
    gain_error: Share = 0.05
    """Relative standard deviation of the gain of an element."""
    pointing_error_deg: AngleError = 2.0
    """Standard deviation of the azimuth of a boresight."""
    position_error_m: PlacementError = 0.002
    """Standard deviation of the position of an element, along each axis."""
    gain_offset: Share = 0.0
    """Half-width of a uniform error that is added to each gain."""
    serial_number: int | None = Field(default=None, ge=0, le=2**63 - 1)
    """Serial number of one array built to this data sheet, which has the same errors in every mission. By default each
    mission draws a new array."""
    pattern_error: Share = 0.0
    """Standard deviation that the robot assumes for the difference between the true gain and the data sheet, relative
    to the largest gain. It applies in the plane and grows off it. It does not change the simulated array, which is that
    of `[nature.array]`. The computed helices need 0.02."""

    @property
    def n_channels(self) -> int:
        """Number of elements."""
        return len(self.elements) or self.n_elements or 6

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        if self.elements and self.n_elements is not None:
            raise ValueError(f"n_elements: must not be given with a list of elements, got {self.n_elements}")
        if self.n_channels < FEWEST_ELEMENTS:
            raise ValueError(f"elements: must be {FEWEST_ELEMENTS} to {MOST_ELEMENTS}, got {self.n_channels}")
        _check_pattern(self.pattern)
        array, key = HelicalArray.nominal(self), "elements" if self.elements else "pattern"
        apart_m = np.linalg.norm(array.positions_m[:, np.newaxis] - array.positions_m, axis=-1)
        if same := np.argwhere(np.triu(apart_m < 1e-3, 1)).tolist():
            raise ValueError(f"elements.{same[0][1]}.position_m: must differ from that of elements.{same[0][0]}")
        try:
            check_azimuths_differ(array.manifold())
        except ValueError as error:
            raise ValueError(f"{key}: {error}") from error
        return self


class TrueArrayConfig(Config):
    """True array, where it differs from the believed one; keys that are absent have the believed values."""

    pattern: FilePath | None = None
    """Pattern of every element, in the plane or over all directions and frequencies: a file, or the name of a shipped
    pattern."""
    beam_width_scale: Annotated[float, Field(ge=0.7, le=1.5)] = 1.0
    """Width of the beam relative to that of the pattern, in azimuth and elevation: 1.05 is 5 % wider."""
    gain_error: Share | None = None
    """Relative standard deviation from which the gain errors are drawn."""
    pointing_error_deg: AngleError | None = None
    """Standard deviation from which the errors of the boresights are drawn."""
    position_error_m: PlacementError | None = None
    """Standard deviation from which the errors of the positions are drawn."""
    gain_offset: Share | None = None
    """Half-width from which the offsets of the gains are drawn."""
    ring_radius_m: ArrayMetre | None = None
    """True radius of the ring."""
    mount_yaw_deg: Degree = 0.0
    """Rotation of the array about the vertical axis through the centre of the ring, counter-clockwise."""
    mount_tilt_deg: Annotated[float, Field(ge=-30.0, le=30.0)] = 0.0
    """Tilt of the array about its centre, after the yaw: the side towards `mount_tilt_azimuth_deg` is raised, the
    opposite side lowered."""
    mount_tilt_azimuth_deg: Degree = 0.0
    """Azimuth of the raised side, robot frame, counter-clockwise from straight ahead."""

    def applied_to(self, config: ArrayConfig) -> ArrayConfig:
        """Return the believed configuration with the true pattern, spread and radius."""
        own = self.model_dump(include=set(ArrayConfig.model_fields), exclude_none=True)
        return config.model_copy(update=own)

    @model_validator(mode="after")
    def _check_pattern_file(self) -> Self:
        if self.pattern is not None:
            _check_pattern(self.pattern)
        return self


AS_BELIEVED = TrueArrayConfig()
"""True array that differs from the data sheet by its drawn errors only."""


def _check_pattern(path: str | None) -> None:
    try:
        _pattern(path)
    except InputFileError as error:
        raise ValueError("\n".join(f"pattern: {each}" for each in error.faults)) from error


def _pattern(path: str | None) -> GainPattern | SpatialPattern:
    """Return eq. (1) of the Dir-MUSIC paper, or the pattern in a file, given by path or shipped name.

    A file is read again only if it has changed.
    """
    if path is None:
        return GaussianPattern()
    path = str(SHIPPED_PATTERNS.get(path, path))
    try:
        version = Path(path).stat()
    except OSError:
        return read_any_pattern(path)  # raises an error that names the file
    return _read_version(path, version.st_mtime_ns, version.st_size)


@lru_cache(maxsize=16)
def _read_version(path: str, modified_ns: int, size: int) -> GainPattern | SpatialPattern:
    return read_any_pattern(path)


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
        """Create the nominal array of the data sheet, the only one that the estimator knows.

        Raises:
            InputFileError: If the file of its pattern has become invalid.
        """
        elements, n = config.elements, config.n_channels
        boresights_rad, elevations_rad = ring_boresights_rad(n), np.zeros(n)
        if elements:
            boresights_rad = np.radians([element.azimuth_deg for element in elements])
            elevations_rad = np.radians([element.elevation_deg for element in elements])
        x, y = config.ring_radius_m * np.cos(boresights_rad), config.ring_radius_m * np.sin(boresights_rad)
        positions_m = np.column_stack([x, y, np.full(n, config.height_m)])
        for k, element in enumerate(elements):
            if element.position_m is not None:
                positions_m[k] = element.position_m
        return cls(
            pattern=_pattern(config.pattern),
            boresights_rad=boresights_rad,
            boresight_elevations_rad=elevations_rad,
            positions_m=positions_m,
            gain_factors=np.ones(n),
            gain_offsets=np.zeros(n),
        )

    @classmethod
    def draw(cls, config: ArrayConfig, rng: np.random.Generator, true: TrueArrayConfig = AS_BELIEVED) -> Self:
        """Draw an array as built and mounted: the data sheet with drawn errors and the true deviations.

        Args:
            config: Configuration with the data sheet.
            rng: Generator of the errors. It is not used if the array has a serial number, which determines its errors.
            true: True array, where it differs from the configuration.
        """
        rng = rng if config.serial_number is None else np.random.default_rng(config.serial_number)
        config, n = true.applied_to(config), config.n_channels
        nominal = cls.nominal(config)
        array = replace(
            nominal,
            pattern=scaled_beam(nominal.pattern, true.beam_width_scale),
            boresights_rad=nominal.boresights_rad + rng.normal(0.0, np.radians(config.pointing_error_deg), n),
            positions_m=nominal.positions_m + rng.normal(0.0, config.position_error_m, (n, 3)),
            gain_factors=np.exp(rng.normal(0.0, config.gain_error, n)),
            gain_offsets=rng.uniform(-config.gain_offset, config.gain_offset, n),
        )
        return array.mounted(true)

    def mounted(self, true: TrueArrayConfig) -> Self:
        """Return the array turned about the vertical axis and then tilted about its centre, as it is really mounted.

        Assumed: the roll of an element about its own boresight, at most the tilt, does not matter. For a tilt of 5
        degrees it would change the gains of the shipped patterns by 0.7 % of the largest rms, and by 3 % at most; each
        element has a gain error of 5 %.
        """
        yaw_rad, tilt_rad, tilt_azimuth_rad = np.radians(
            [true.mount_yaw_deg, true.mount_tilt_deg, true.mount_tilt_azimuth_deg]
        )
        if yaw_rad == 0.0 and tilt_rad == 0.0:
            return self
        axis = np.array([np.sin(tilt_azimuth_rad), -np.cos(tilt_azimuth_rad), 0.0])
        turn = Rotation.from_rotvec(tilt_rad * axis) * Rotation.from_rotvec([0.0, 0.0, yaw_rad])
        level = np.cos(self.boresight_elevations_rad)
        x, y = level * np.cos(self.boresights_rad), level * np.sin(self.boresights_rad)
        x, y, z = turn.apply(np.column_stack([x, y, np.sin(self.boresight_elevations_rad)])).T
        centre_m = np.array([0.0, 0.0, self.positions_m[:, 2].mean()])
        return replace(
            self,
            boresights_rad=np.arctan2(y, x),
            boresight_elevations_rad=np.arctan2(z, np.hypot(x, y)),
            positions_m=centre_m + turn.apply(self.positions_m - centre_m),
        )

    def cut(self, band_hz: tuple[float, float] | None = None) -> GainPattern:
        """Return the pattern in the plane; if it depends on frequency, its rms over a band, by default all."""
        return self.pattern.cut(band_hz) if isinstance(self.pattern, SpatialPattern) else self.pattern

    def manifold(self, band_hz: tuple[float, float] | None = None) -> GainManifold:
        """Return the far-field manifold in a band, as in `cut`; estimators use that of the nominal array."""
        pattern = self.cut(band_hz)
        return GainManifold(pattern, self.boresights_rad, boresight_elevations_rad=self.boresight_elevations_rad)

    def band_manifolds(self, edges_hz: Sequence[float]) -> tuple[GainManifold, ...]:
        """Return the manifolds of both halves of each sub-band; for a pattern in the plane, they are all equal.

        Args:
            edges_hz: Edges of the sub-bands, ascending, n_bands + 1 values, or empty.
        """
        return tuple(self.manifold(half) for half in halves(edges_hz))

    def gain(
        self, azimuth_rad: FloatArray, elevation_rad: FloatArray, frequency_hz: float = FREQUENCY_HZ
    ) -> FloatArray:
        """Return the gain of each element in its own direction: that of element i in direction i, array frame.

        Args:
            azimuth_rad: Azimuths of the directions, shape (..., n_elements).
            elevation_rad: Elevations of the directions; broadcast with the azimuths.
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
