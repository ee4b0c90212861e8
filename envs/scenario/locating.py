"""Tables of the bearing estimator and of the Locator."""

from __future__ import annotations

from dataclasses import fields
from math import radians
from pathlib import Path
from typing import Annotated, Any, Literal, Self, cast

from pydantic import Field, ValidationInfo, WithJsonSchema, field_validator, model_validator

from dirmusic import ESTIMATORS, InputFileError
from dirmusic.locating.rules import AssignmentRules, CredibilityRules, LocatingRules
from pdpatrol.envs.scenario.array import ArrayCalibration, read_calibration
from pdpatrol.envs.scenario.base import Config, resolve_path, resolve_user_code
from pdpatrol.sensing.quantities import PATH_PATTERN, PLAIN_ZERO, FilePath

Decibel = Annotated[float, Field(ge=0.0, le=100.0), PLAIN_ZERO]
Metre = Annotated[float, Field(ge=0.001, le=10_000.0)]
Second = Annotated[float, Field(ge=0.01, le=86_400.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0), PLAIN_ZERO]
Arc = Annotated[float, Field(ge=0.01, le=180.0)]
Count = Annotated[int, Field(ge=1, le=1_000_000)]


class EstimatorConfig(Config, frozen=True):
    """Bearing estimator: a built-in one by name, or `my_file.py:MyEstimator` or `package.module:MyEstimator`."""

    method: FilePath = "maximum_likelihood"

    @field_validator("method")
    @classmethod
    def _check_method(cls, method: str, info: ValidationInfo) -> str:
        if method not in ESTIMATORS and ":" not in method:
            raise ValueError(
                f"no estimator `{method}`; known are {', '.join(ESTIMATORS)}, or name your own as "
                "my_file.py:MyEstimator or package.module:MyEstimator"
            )
        return resolve_user_code(method, info)


class LocatingConfig(Config, frozen=True):
    """The Locator and its rules.

    `dirmusic.locating.rules` documents the rules and their defaults, under the same names with `_rad` for `_deg`.
    """

    solver: Literal["joint", "bearings"] = "joint"
    """Fit positions to the strengths, jointly with the errors of the array, or to bearings alone."""
    locator: FilePath | None = None
    """Your own Locator, `my_file.py:MyLocator` or `package.module:MyLocator`, with the interface of
    `dirmusic.locating.protocol.LocatorProtocol`."""
    calibration: Annotated[
        ArrayCalibration | None, WithJsonSchema({"type": "string", "maxLength": 1024, "pattern": PATH_PATTERN})
    ] = None
    """Path of a calibration that an earlier mission with this array has written."""

    max_std_deg: Arc | None = None
    misfit_factor: Annotated[float, Field(ge=0.001, le=1000.0)] | None = None
    misfit_floor: Share | None = None

    gate_sigmas: Annotated[float, Field(ge=0.01, le=20.0)] | None = None
    level_window_s: Second | None = None
    level_arc_deg: Annotated[float, Field(ge=0.01, le=360.0)] | None = None
    obstruction_db: Decibel | None = None
    direct_path_db: Decibel | None = None
    ghost_db: Decibel | None = None
    bias_arc_deg: Arc | None = None
    bias_db: Decibel | None = None
    sight_loss_db: Decibel | None = None
    clear_loss_db: Decibel | None = None
    surface_depth_m: Annotated[float, Field(ge=0.0, le=100.0), PLAIN_ZERO] | None = None
    edge_margin_m: Annotated[float, Field(ge=0.0, le=100.0), PLAIN_ZERO] | None = None
    detection_range_m: Metre | None = None

    initiation_pulses: Annotated[int, Field(ge=2, le=10_000)] | None = None
    initiation_s: Second | None = None
    initiation_arc_deg: Arc | None = None
    initiation_by_crossing: bool | None = None
    refit_s: Second | None = None
    max_pulses: Annotated[int, Field(ge=2, le=2000)] | None = None
    confirm_aperture_deg: Annotated[float, Field(ge=0.0, le=359.0), PLAIN_ZERO] | None = None
    confirm_semi_major_m: Metre | None = None
    confirm_range_m: Metre | None = None
    confirm_pulses: Count | None = None
    confirm_disagreement: Annotated[float, Field(ge=0.001, le=1000.0)] | None = None
    confirm_detection_rate: Share | None = None
    ghost_detection_rate: Share | None = None
    ghost_observed_s: Count | None = None
    ghost_silent_s: Count | None = None
    ghost_semi_major_m: Metre | None = None
    least_range_m: Metre | None = None
    merge_m: Metre | None = None

    @field_validator("locator")
    @classmethod
    def _check_locator(cls, locator: str | None, info: ValidationInfo) -> str | None:
        if locator is None:
            return None
        if ":" not in locator:
            raise ValueError(
                f"no Locator `{locator}`; name your own as my_file.py:MyLocator or package.module:MyLocator"
            )
        return resolve_user_code(locator, info)

    @model_validator(mode="before")
    @classmethod
    def _read_calibration(cls, given: object, info: ValidationInfo) -> object:
        table = cast("dict[str, Any]", given) if isinstance(given, dict) else {}
        path = table.get("calibration")
        if not isinstance(path, str):
            return given
        try:
            return {**table, "calibration": read_calibration(Path(resolve_path(path, info)))}
        except InputFileError as error:
            raise ValueError("\n".join(f"calibration: {fault}" for fault in error.faults)) from None

    @model_validator(mode="after")
    def _check_use_of_calibration(self) -> Self:
        if self.calibration is not None and (self.solver != "joint" or self.locator is not None):
            raise ValueError(
                'calibration: must go with solver = "joint" and the built-in Locator, which alone estimate errors of '
                "the array"
            )
        return self

    def rules(self) -> LocatingRules:
        """Return the rules of the Locator, angles in radians; rules that are not set have their defaults."""
        given: dict[str, Any] = {}
        for key, value in self.model_dump(exclude={"locator", "calibration"}, exclude_none=True).items():
            in_degrees = key.endswith("_deg")
            given[f"{key[:-4]}_rad" if in_degrees else key] = radians(value) if in_degrees else value

        def chosen(rules: type[CredibilityRules | AssignmentRules | LocatingRules]) -> dict[str, Any]:
            return {field.name: given[field.name] for field in fields(rules) if field.name in given}

        return LocatingRules(
            credibility=CredibilityRules(**chosen(CredibilityRules)),
            assignment=AssignmentRules(**chosen(AssignmentRules)),
            **chosen(LocatingRules),
        )
