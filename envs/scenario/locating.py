"""Who takes the bearings, and how discharges are located, as a scenario file says it."""

from __future__ import annotations

from dataclasses import fields
from math import radians
from pathlib import Path
from typing import Annotated, Any, Literal, Self, cast

from pydantic import Field, ValidationInfo, field_validator, model_validator

from dirmusic import ESTIMATORS, InputFileError
from dirmusic.locating.rules import AssignmentRules, CredibilityRules, LocatingRules
from pdpatrol.envs.scenario.base import Config, beside_the_scenario, code_beside_the_scenario
from pdpatrol.envs.scenario.calibration import ArrayCalibration, read_calibration
from pdpatrol.sensing.quantities import PLAIN_ZERO, FilePath

Decibel = Annotated[float, Field(ge=0.0, le=100.0), PLAIN_ZERO]
Metre = Annotated[float, Field(ge=0.001, le=10_000.0)]
Second = Annotated[float, Field(ge=0.01, le=86_400.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0), PLAIN_ZERO]
Arc = Annotated[float, Field(ge=0.01, le=180.0)]
Count = Annotated[int, Field(ge=1, le=1_000_000)]


class EstimatorConfig(Config, frozen=True):
    """The bearing estimator: a built-in one by name, or `my_file.py:MyEstimator`, `package.module:MyEstimator`."""

    method: FilePath = "maximum_likelihood"

    @field_validator("method")
    @classmethod
    def _starts_at_the_scenario(cls, method: str, info: ValidationInfo) -> str:
        return code_beside_the_scenario(method, info)

    @model_validator(mode="after")
    def _is_known_or_names_code(self) -> Self:
        if self.method not in ESTIMATORS and ":" not in self.method:
            raise ValueError(
                f"method: no estimator `{self.method}`; allowed are {', '.join(ESTIMATORS)}, or code of your own as "
                "my_file.py:MyEstimator or package.module:MyEstimator"
            )
        return self


class LocatingConfig(Config, frozen=True):
    """The Locator and its rules.

    A rule that is left out keeps its default, which `dirmusic.locating.rules` holds and explains, under the same name
    with `_rad` for `_deg`.
    """

    solver: Literal["joint", "bearings"] = "joint"
    """What positions are fitted to: strengths, with the errors of the array fitted along, or bearings alone."""
    locator: FilePath | None = None
    """A Locator of your own, `my_file.py:MyLocator` or `package.module:MyLocator`; its contract is
    `dirmusic.locating.protocol.LocatorProtocol`."""
    calibration: ArrayCalibration | None = None
    """What earlier missions have learned of this very array: a file that a mission has written."""

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

    birth_pulses: Annotated[int, Field(ge=2, le=10_000)] | None = None
    birth_s: Second | None = None
    birth_arc_deg: Arc | None = None
    birth_by_crossing: bool | None = None
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
    def _starts_at_the_scenario(cls, locator: str | None, info: ValidationInfo) -> str | None:
        return None if locator is None else code_beside_the_scenario(locator, info)

    @model_validator(mode="before")
    @classmethod
    def _reads_calibration(cls, given: object, info: ValidationInfo) -> object:
        table = cast("dict[str, Any]", given) if isinstance(given, dict) else {}
        path = table.get("calibration")
        if not isinstance(path, str):
            return given
        try:
            return {**table, "calibration": read_calibration(Path(beside_the_scenario(path, info)))}
        except InputFileError as error:
            raise ValueError("\n".join(f"calibration: {fault}" for fault in error.faults)) from None

    @model_validator(mode="after")
    def _makes_use_of_calibration(self) -> Self:
        if self.calibration is not None and (self.solver != "joint" or self.locator is not None):
            raise ValueError(
                'calibration: must go with solver = "joint" and the built-in Locator, which alone learn errors of the '
                "array"
            )
        return self

    @model_validator(mode="after")
    def _names_code(self) -> Self:
        if self.locator is not None and ":" not in self.locator:
            raise ValueError(
                f"locator: no Locator `{self.locator}`; allowed is code of your own as my_file.py:MyLocator or "
                "package.module:MyLocator"
            )
        return self

    def rules(self) -> LocatingRules:
        """The rules of the Locator, angles in radians; those that are not set are the defaults."""
        given: dict[str, Any] = {}
        for key, value in self.model_dump(exclude={"locator", "calibration"}, exclude_none=True).items():
            in_degrees = key.endswith("_deg")
            given[f"{key[:-4]}_rad" if in_degrees else key] = radians(value) if in_degrees else value
        return LocatingRules(
            credibility=CredibilityRules(**_fields_of(CredibilityRules, given)),
            assignment=AssignmentRules(**_fields_of(AssignmentRules, given)),
            **_fields_of(LocatingRules, given),
        )


def _fields_of(
    rules: type[CredibilityRules | AssignmentRules | LocatingRules], given: dict[str, Any]
) -> dict[str, Any]:
    """Those of the given values that are fields of some rules."""
    return {field.name: given[field.name] for field in fields(rules) if field.name in given}
