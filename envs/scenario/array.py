"""Antenna array: scenario table, data sheet, and calibrations that one mission passes on to the next."""

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, ValidationError, model_validator

from dirmusic import ArrayModel, ElementSpread, InputFileError
from dirmusic.array.element_errors import N_KINDS, UNEXPLAINED, EstimatedErrors
from pdpatrol.envs.scenario.base import Number, as_tuples, error_lines, read_toml
from pdpatrol.sensing import ArrayConfig, HelicalArray
from pdpatrol.sensing.quantities import Config


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
        band_manifolds=nominal.band_manifolds(band_edges_hz),
    )


MAX_ELEMENTS = 32
"""Largest number of elements of a calibrated array; the same limit applies to field data."""

Numbers = Annotated[tuple[Number, ...], Field(max_length=N_KINDS * MAX_ELEMENTS)]
Total = Annotated[int, Field(ge=1, le=10**12)]


def data_sheet_sha256(array: ArrayModel) -> str:
    """Return a digest of the data sheet: directions, positions, element pattern and spread, to six decimals."""
    manifold, spread = array.manifold, array.spread
    cuts = [cut for cut in (manifold.pattern, manifold.pattern.vertical) if cut is not None]
    numbers = np.concatenate(
        [
            manifold.boresights_rad,
            manifold.boresight_elevations_rad,
            array.positions_m.ravel(),
            *(cut(np.radians(np.arange(-180.0, 180.0))) for cut in cuts),
            [spread.gain, spread.pointing_rad, spread.offset, spread.pattern],
        ]
    )
    return hashlib.sha256((np.round(numbers, 6) + 0.0).tobytes()).hexdigest()  # -0.0 becomes 0.0


class ArrayCalibration(Config):
    """Errors of one array, as estimated by the missions so far, and their covariance."""

    format: Literal["pdpatrol calibration 2"] = "pdpatrol calibration 2"
    mission: str = Field(max_length=1024, pattern=r"^[^\x00]*$")
    """Name of the last mission."""
    n_missions: Total
    n_pulses: Total
    """Number of pulses that the fits of all missions used."""
    serial_number: int | None = Field(default=None, ge=0, le=2**63 - 1)
    """Serial number of the array as in `sensing.ArrayConfig`; None for field data."""
    data_sheet_sha256: str = Field(max_length=64)
    """Digest of the array's data sheet, see `data_sheet_sha256`."""
    gain: Annotated[Numbers, Field(min_length=1, max_length=MAX_ELEMENTS)]
    pointing_rad: Numbers
    offset: Numbers
    covariance: tuple[Numbers, ...] = Field(max_length=N_KINDS * MAX_ELEMENTS)
    """Row by row, of gain errors, then pointing errors, then offsets."""

    @model_validator(mode="after")
    def _check_shapes(self) -> Self:
        n = len(self.gain)
        if not len(self.pointing_rad) == len(self.offset) == n:
            raise ValueError(f"pointing_rad, offset: must have {n} numbers each, as gain has")
        if [len(row) for row in self.covariance] != [N_KINDS * n] * (N_KINDS * n):
            raise ValueError(f"covariance: must have {N_KINDS * n} rows of as many numbers")
        covariance = np.array(self.covariance)
        eigenvalues = np.linalg.eigvalsh(covariance)
        if not np.array_equal(covariance, covariance.T) or eigenvalues[0] < -1e-9 * eigenvalues[-1]:  # for rounding
            raise ValueError("covariance: must be symmetric and positive semi-definite")
        return self

    @classmethod
    def after(
        cls,
        mission: str,
        errors: EstimatedErrors,
        n_pulses: int,
        array: ArrayModel,
        serial_number: int | None,
        before: Self | None,
    ) -> Self:
        """Make the calibration that a mission passes on to the next one.

        Args:
            mission: Name of the mission.
            errors: Errors that the mission estimated.
            n_pulses: Number of its pulses that were used.
            array: The array.
            serial_number: Its serial number.
            before: Calibration that the mission started from; None without one, or if the mission contradicted it.
        """
        mean, covariance = errors.mean, errors.covariance
        return cls(
            mission=mission,
            n_missions=1 + (before.n_missions if before else 0),
            n_pulses=n_pulses + (before.n_pulses if before else 0),
            serial_number=serial_number,
            data_sheet_sha256=data_sheet_sha256(array),
            gain=tuple(mean.gain.tolist()),
            pointing_rad=tuple(mean.pointing_rad.tolist()),
            offset=tuple(mean.offset.tolist()),
            covariance=as_tuples((np.tril(covariance) + np.tril(covariance, -1).T).tolist()),
        )

    def errors(self) -> EstimatedErrors:
        """Return the errors and their covariance as arrays."""
        state = np.array([*self.gain, *self.pointing_rad, *self.offset])
        return EstimatedErrors.of_states(state, np.array(self.covariance), len(self.gain))

    def mismatch(self, array: ArrayModel, serial_number: int | None) -> str | None:
        """Describe in one line how an array differs from the calibrated one; None if it is the same."""
        found = (self.serial_number, self.data_sheet_sha256, len(self.gain))
        wanted = (serial_number, data_sheet_sha256(array), array.manifold.n_elements)
        if found == wanted:
            return None
        text = "serial number {}, data sheet {:.12}, {} elements"
        return f"must be a calibration of this array: {text.format(*wanted)}; got {text.format(*found)}"

    def applied_to(self, array: ArrayModel) -> ArrayModel:
        """Return the array with the estimated errors, whose covariance allows for drift since the calibration."""
        return replace(array, errors=self.errors().drifted(array.spread))


def read_calibration(path: Path) -> ArrayCalibration:
    """Read a calibration file.

    Raises:
        InputFileError: If the file cannot be read or is not a calibration, with one line per error.
    """
    table = read_toml(path)
    try:
        return ArrayCalibration.model_validate(as_tuples({"format": None, **table}))
    except ValidationError as error:
        raise InputFileError([f"{path}: {line}" for line in error_lines(error, ArrayCalibration)]) from None
