"""Antenna array: scenario table, data sheet, and calibrations that one mission passes on to the next."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, Self, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, ValidationError, ValidationInfo, model_validator

from dirmusic import ArrayModel, ElementSpread, InputFileError
from dirmusic.array.element_errors import N_KINDS, UNEXPLAINED, EstimatedErrors
from dirmusic.locating.locator import Learned
from pdpatrol.envs.scenario.base import Config, as_tuples, error_lines, read_toml, resolve_path
from pdpatrol.sensing import ArrayConfig, HelicalArray
from pdpatrol.sensing.array.config import SHIPPED_PATTERNS
from pdpatrol.sensing.quantities import PLAIN_ZERO

FloatArray = NDArray[np.float64]


def _resolve_patterns(table: object, info: ValidationInfo) -> object:
    if not isinstance(table, dict):
        return table
    resolved = dict(cast("dict[str, Any]", table))
    for key in ("pattern", "true_pattern"):
        if isinstance(resolved.get(key), str) and resolved[key] not in SHIPPED_PATTERNS:
            resolved[key] = resolve_path(resolved[key], info)
    return resolved


ArraySection = Annotated[ArrayConfig, BeforeValidator(_resolve_patterns)]
"""Table `[array]`, in which paths are relative to the scenario file."""


def data_sheet(config: ArrayConfig, band_edges_hz: Sequence[float] = ()) -> ArrayModel:
    """Return the nominal array and the spread of real arrays around it.

    Args:
        config: Settings of the array.
        band_edges_hz: Ascending edges of the sub-bands that the receiver reads; empty without sub-bands.
    """
    nominal = HelicalArray.nominal(config)
    return ArrayModel(
        manifold=nominal.manifold(),
        positions_m=nominal.positions_m,
        spread=ElementSpread(
            gain=config.gain_error,
            pointing_rad=float(np.radians(config.pointing_error_deg)),
            offset=config.gain_offset / np.sqrt(3),
            pattern=config.pattern_error,
            unexplained=UNEXPLAINED,
        ),
        band_manifolds=nominal.band_manifolds(band_edges_hz) if len(band_edges_hz) else (),
    )


MAX_ELEMENTS = 32
"""Largest number of elements of a calibrated array; the same limit applies to field data."""

Number = Annotated[float, Field(ge=-1000.0, le=1000.0), PLAIN_ZERO]
Numbers = Annotated[tuple[Number, ...], Field(max_length=N_KINDS * MAX_ELEMENTS)]
Spread = Annotated[float, Field(ge=0.0, le=1000.0), PLAIN_ZERO]
Total = Annotated[int, Field(ge=1, le=10**12)]


class CalibratedArray(Config, frozen=True):
    """Identity of a calibrated array: its data sheet and its serial number."""

    serial_number: int | None = Field(default=None, ge=0, le=2**63 - 1)
    """Serial number, as in `sensing.ArrayConfig`; None for field data."""
    boresights_deg: Annotated[Numbers, Field(min_length=1, max_length=MAX_ELEMENTS)]
    boresight_elevations_deg: Numbers
    positions_m: tuple[tuple[Number, Number, Number], ...] = Field(max_length=MAX_ELEMENTS)
    pattern_sha256: str = Field(pattern=r"^[0-9a-f]{64}$", max_length=64)
    """SHA-256 of the element gain at each whole degree off boresight, rounded to six decimals."""
    gain_error: Spread
    pointing_error_deg: Spread
    offset_error: Spread
    """Standard deviation of the gain offsets, in units of gain."""
    pattern_error: Spread

    @classmethod
    def of(cls, array: ArrayModel, serial_number: int | None) -> Self:
        """Make the identity of an array."""
        manifold, spread = array.manifold, array.spread
        pattern = np.round(manifold.pattern(np.radians(np.arange(-180.0, 180.0))), 6).tolist()
        return cls(
            serial_number=serial_number,
            boresights_deg=_rounded(np.degrees(manifold.boresights_rad)),
            boresight_elevations_deg=_rounded(np.degrees(manifold.boresight_elevations_rad)),
            positions_m=tuple((x, y, z) for x, y, z in np.round(array.positions_m, 6).tolist()),
            pattern_sha256=hashlib.sha256(json.dumps(pattern).encode()).hexdigest(),
            gain_error=round(spread.gain, 9),
            pointing_error_deg=round(float(np.degrees(spread.pointing_rad)), 9),
            offset_error=round(spread.offset, 9),
            pattern_error=round(spread.pattern, 9),
        )


class CalibratedErrors(Config, frozen=True):
    """Estimated errors of the elements and their covariance, as in `dirmusic.ElementErrors`."""

    gain: Annotated[Numbers, Field(min_length=1, max_length=MAX_ELEMENTS)]
    pointing_rad: Numbers
    offset: Numbers
    covariance: tuple[Numbers, ...] = Field(max_length=N_KINDS * MAX_ELEMENTS)
    """Lower triangle, row by row, of gain errors, then pointing errors, then offsets."""

    @model_validator(mode="after")
    def _check_shapes(self) -> Self:
        n = len(self.gain)
        for name in ("pointing_rad", "offset"):
            if len(getattr(self, name)) != n:
                raise ValueError(f"{name}: must have {n} numbers, as gain has, got {len(getattr(self, name))}")
        if [len(row) for row in self.covariance] != list(range(1, N_KINDS * n + 1)):
            raise ValueError(f"covariance: must have {N_KINDS * n} rows of 1, 2, 3 and so on numbers")
        eigenvalues = np.linalg.eigvalsh(self.estimated().covariance)
        if eigenvalues[0] < -1e-9 * eigenvalues[-1]:  # allows for rounding in the file
            raise ValueError(f"covariance: must be positive semi-definite, got the eigenvalue {eigenvalues[0]:.3g}")
        return self

    @classmethod
    def of(cls, errors: EstimatedErrors) -> Self:
        """Convert arrays to plain numbers."""
        return cls(
            gain=tuple(errors.mean.gain.tolist()),
            pointing_rad=tuple(errors.mean.pointing_rad.tolist()),
            offset=tuple(errors.mean.offset.tolist()),
            covariance=tuple(tuple(row[: i + 1]) for i, row in enumerate(errors.covariance.tolist())),
        )

    def estimated(self) -> EstimatedErrors:
        """Convert plain numbers to arrays."""
        n = len(self.gain)
        lower = np.zeros((N_KINDS * n, N_KINDS * n))
        for i, row in enumerate(self.covariance):
            lower[i, : i + 1] = row
        covariance = lower + np.tril(lower, -1).T
        return EstimatedErrors.of_states(np.array([*self.gain, *self.pointing_rad, *self.offset]), covariance, n)


class ArrayCalibration(Config, frozen=True):
    """Errors of one array, as estimated by the missions so far."""

    format: Literal["pdpatrol calibration 1"] = "pdpatrol calibration 1"
    mission: str = Field(max_length=1024, pattern=r"^[^\x00]*$")
    """Name of the last mission."""
    n_missions: Total
    n_pulses: Total
    """Number of pulses that the fits of all missions used."""
    array: CalibratedArray
    errors: CalibratedErrors

    @model_validator(mode="after")
    def _check_size(self) -> Self:
        n = len(self.array.boresights_deg)
        if len(self.errors.gain) != n:
            raise ValueError(f"errors.gain: must have {n} numbers, one per boresight, got {len(self.errors.gain)}")
        return self

    @classmethod
    def after(cls, mission: str, learned: Learned, array: CalibratedArray, before: Self | None) -> Self:
        """Make the calibration that a mission passes on to the next one.

        Args:
            mission: Name of the mission.
            learned: Errors that the mission estimated.
            array: Identity of the array.
            before: Calibration that the mission started from; None without one, or if the mission contradicted it.
        """
        return cls(
            mission=mission,
            n_missions=1 + (before.n_missions if before else 0),
            n_pulses=learned.n_pulses + (before.n_pulses if before else 0),
            array=array,
            errors=CalibratedErrors.of(learned.errors),
        )

    def mismatch(self, array: CalibratedArray) -> str | None:
        """Describe in one line how an array differs from the calibrated one; None if it is the same."""
        mine, other = self.array.model_dump(), array.model_dump()
        differing = [f"{key} {mine[key]!s:.40}, here {other[key]!s:.40}" for key in mine if mine[key] != other[key]]
        return f"must be a calibration of this array, but differs in {'; '.join(differing)}" if differing else None

    def applied_to(self, array: ArrayModel) -> ArrayModel:
        """Return the array with the estimated errors, whose covariance allows for drift since the calibration."""
        return replace(array, errors=self.errors.estimated().drifted(array.spread))

    def as_toml(self) -> str:
        """Return the text of the calibration file."""
        tables = self.model_dump(mode="json", exclude_none=True)
        array, errors = tables.pop("array"), tables.pop("errors")

        def lines(table: dict[str, Any]) -> list[str]:
            return [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in table.items()]

        return "\n".join(
            [
                "# Errors of one array, estimated from pulses; `pdpatrol run --calibration` starts from them.",
                *lines(tables),
                "",
                "[array] # data sheet, and standard deviations of the errors of real arrays",
                *lines(array),
                "",
                "[errors] # by element; gain relative, offset in units of gain; covariance: lower triangle of all",
                *lines(errors),
                "",
            ]
        )


def read_calibration(path: Path) -> ArrayCalibration:
    """Read a calibration file.

    Raises:
        InputFileError: If the file cannot be read or is not a calibration, with one line per error.
    """
    table = read_toml(path, "a calibration.toml")
    if "format" not in table:
        raise InputFileError([f"{path}: format: is required; give a calibration.toml"])
    try:
        return restore_calibration(table)
    except ValidationError as error:
        raise InputFileError([f"{path}: {line}" for line in error_lines(error, ArrayCalibration)]) from None


def restore_calibration(data: Mapping[str, Any]) -> ArrayCalibration:
    """Make a calibration from plain data, as in its file or as made by `model_dump(mode="json")`.

    Raises:
        ValidationError: If the data is not a calibration.
    """
    return ArrayCalibration.model_validate(as_tuples(data))


def _rounded(values: FloatArray) -> Numbers:
    return tuple(np.round(values, 6).tolist())
