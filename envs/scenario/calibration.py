"""Calibrations: what missions have learned of the errors of one array, as a file that the next mission takes up."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError, model_validator

from dirmusic import ArrayModel, InputFileError
from dirmusic.array.element_errors import N_KINDS, EstimatedErrors
from dirmusic.locating.locator import Learned
from pdpatrol.envs.scenario.base import Config, read_toml
from pdpatrol.envs.scenario.faults import fault_lines, shown
from pdpatrol.sensing.quantities import PLAIN_ZERO

FloatArray = NDArray[np.float64]

MOST_ELEMENTS = 32
"""Of an array: as many channels as field data may have."""

Number = Annotated[float, Field(ge=-1000.0, le=1000.0), PLAIN_ZERO]
Numbers = Annotated[tuple[Number, ...], Field(max_length=N_KINDS * MOST_ELEMENTS)]
Spread = Annotated[float, Field(ge=0.0, le=1000.0), PLAIN_ZERO]
Total = Annotated[int, Field(ge=1, le=10**12)]

FORMAT = "pdpatrol calibration 1"

LEAST_EIGENVALUE = -1e-9
"""Eigenvalues of a covariance over the largest may be so much below zero: digits are finite."""


class CalibratedArray(Config, frozen=True):
    """Which array a calibration is of: its data sheet, and the number of this very one."""

    serial_number: int | None = Field(default=None, ge=0, le=2**63 - 1)
    """As of `sensing.ArrayConfig`; none in data from the field."""
    boresights_deg: Annotated[Numbers, Field(min_length=1, max_length=MOST_ELEMENTS)]
    boresight_elevations_deg: Numbers
    positions_m: tuple[tuple[Number, Number, Number], ...] = Field(max_length=MOST_ELEMENTS)
    pattern_sha256: str = Field(pattern=r"^[0-9a-f]{64}$", max_length=64)
    """Of the gain of an element at each whole degree off its boresight, to six decimals."""
    gain_error: Spread
    pointing_error_deg: Spread
    offset_error: Spread
    """Standard deviation, in units of gain."""
    pattern_error: Spread

    @classmethod
    def of(cls, array: ArrayModel, serial_number: int | None) -> Self:
        """The identity of an array."""
        manifold, spread = array.manifold, array.spread
        off_rad = np.radians(np.arange(-180.0, 180.0))
        pattern = np.round(manifold.pattern(off_rad), 6).tolist()
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
    """Errors of the elements: the likeliest, and how sure they are; all as of `dirmusic.ElementErrors`."""

    gain: Annotated[Numbers, Field(min_length=1, max_length=MOST_ELEMENTS)]
    pointing_rad: Numbers
    offset: Numbers
    covariance: tuple[Numbers, ...] = Field(max_length=N_KINDS * MOST_ELEMENTS)
    """Lower triangle, row by row, of the gain errors, then the pointing errors, then the offsets."""

    @model_validator(mode="after")
    def _is_a_covariance(self) -> Self:
        n = len(self.gain)
        for name in ("pointing_rad", "offset"):
            if len(getattr(self, name)) != n:
                raise ValueError(f"{name}: got {len(getattr(self, name))} numbers; allowed are {n}, as of gain")
        if [len(row) for row in self.covariance] != list(range(1, N_KINDS * n + 1)):
            raise ValueError(f"covariance: allowed are {N_KINDS * n} rows, of 1, 2, 3 and so on numbers")
        eigenvalues = np.linalg.eigvalsh(self.estimated().covariance)
        if eigenvalues[0] < LEAST_EIGENVALUE * eigenvalues[-1]:
            raise ValueError(f"covariance: has the eigenvalue {eigenvalues[0]:.3g}; allowed are none below 0")
        return self

    @classmethod
    def of(cls, errors: EstimatedErrors) -> Self:
        """The same as plain numbers."""
        return cls(
            gain=tuple(errors.mean.gain.tolist()),
            pointing_rad=tuple(errors.mean.pointing_rad.tolist()),
            offset=tuple(errors.mean.offset.tolist()),
            covariance=tuple(tuple(row[: i + 1]) for i, row in enumerate(errors.covariance.tolist())),
        )

    def estimated(self) -> EstimatedErrors:
        """The same as arrays."""
        n = len(self.gain)
        lower = np.zeros((N_KINDS * n, N_KINDS * n))
        for i, row in enumerate(self.covariance):
            lower[i, : i + 1] = row
        covariance = lower + np.tril(lower, -1).T
        return EstimatedErrors.of_states(np.array([*self.gain, *self.pointing_rad, *self.offset]), covariance, n)


class ArrayCalibration(Config, frozen=True):
    """What missions have learned of the errors of one array."""

    format: Literal["pdpatrol calibration 1"]
    mission: str = Field(max_length=1024, pattern=r"^[^\x00]*$")
    """The last one behind it."""
    n_missions: Total
    n_pulses: Total
    """Of all missions, those that the fits made use of."""
    array: CalibratedArray
    errors: CalibratedErrors

    @model_validator(mode="after")
    def _is_of_the_array(self) -> Self:
        n = len(self.array.boresights_deg)
        if len(self.errors.gain) != n:
            raise ValueError(
                f"errors.gain: got {len(self.errors.gain)} numbers; allowed are {n}, one for each boresight"
            )
        return self

    @classmethod
    def after(cls, mission: str, learned: Learned, array: CalibratedArray, before: Self | None) -> Self:
        """That which a mission leaves to the next.

        Args:
            mission: Its name.
            learned: What it has learned.
            array: Of which.
            before: The one that it took up and did not contradict.
        """
        return cls(
            format=FORMAT,
            mission=mission,
            n_missions=1 + (before.n_missions if before else 0),
            n_pulses=learned.n_pulses + (before.n_pulses if before else 0),
            array=array,
            errors=CalibratedErrors.of(learned.errors),
        )

    def faults(self, array: CalibratedArray) -> list[str]:
        """What tells another array from the one of this calibration, in one line; nothing if it is the same."""
        mine, other = self.array.model_dump(), array.model_dump()
        differing = [f"{key} {_shown(mine[key])}, here {_shown(other[key])}" for key in mine if mine[key] != other[key]]
        if not differing:
            return []
        return [f"is of another array: {'; '.join(differing)}; allowed is a calibration of this array"]

    def taken_up_by(self, array: ArrayModel) -> ArrayModel:
        """The array of a mission that makes use of this calibration: its errors are known but for their drift."""
        return replace(array, errors=self.errors.estimated().drifted(array.spread))

    def as_toml(self) -> str:
        """The text of its file."""
        array = {key: value for key, value in self.array.model_dump().items() if value is not None}
        head = {key: value for key, value in self.model_dump().items() if key not in ("array", "errors")}
        errors = self.errors
        return "\n".join(
            [
                "# What pulses have shown of the errors of one array; `pdpatrol run --calibration` takes it up.",
                *(f"{key} = {_as_toml(value)}" for key, value in head.items()),
                "",
                "[array] # of which it is: data sheet, and standard deviations of what real arrays are off by",
                *(f"{key} = {_as_toml(value)}" for key, value in array.items()),
                "",
                "[errors] # by element",
                f"gain = {_as_toml(errors.gain)} # relative",
                f"pointing_rad = {_as_toml(errors.pointing_rad)} # boresights, counter-clockwise of the nominal ones",
                f"offset = {_as_toml(errors.offset)} # additions to the gain, in units of gain",
                "# lower triangle: gains, then pointings, then offsets, in the squares and products of their units",
                "covariance = [",
                *(f"  {_as_toml(row)}," for row in errors.covariance),
                "]",
                "",
            ]
        )


def read_calibration(path: Path) -> ArrayCalibration:
    """The calibration in a file.

    Raises:
        InputFileError: With a line for each fault, if it cannot be read or holds no calibration.
    """
    table = read_toml(path, "a calibration.toml")
    if table.get("format") != FORMAT:
        raise InputFileError([f"{path}: format: got {shown(table.get('format', 'none'))}; allowed is {FORMAT!r}"])
    try:
        return restore_calibration(table)
    except ValidationError as error:
        raise InputFileError([f"{path}: {fault}" for fault in fault_lines(error, ArrayCalibration)]) from None
    except ValueError:  # whole numbers of more digits than Python writes
        raise InputFileError([f"{path}: numbers or tables that no mission writes; give a calibration.toml"]) from None


def restore_calibration(data: Mapping[str, Any]) -> ArrayCalibration:
    """A calibration from plain data: of its file, or that `model_dump(mode="json")` made of it.

    Raises:
        ValidationError: If it is none.
    """
    return ArrayCalibration.model_validate_json(json.dumps(data, default=str))


def _rounded(values: FloatArray) -> Numbers:
    return tuple(np.round(values, 6).tolist())


def _as_toml(value: Any) -> str:  # noqa: ANN401 - a text, a number, or arrays of them
    if isinstance(value, tuple):
        return f"[{', '.join(map(_as_toml, value))}]"
    return json.dumps(value, ensure_ascii=False)


def _shown(value: Any) -> str:  # noqa: ANN401 - any field of `CalibratedArray`
    return "none" if value is None else f"{value!s:.40}"
