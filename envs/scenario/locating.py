"""Scenario tables of the bearing estimator and the Locator."""

from dataclasses import fields
from math import radians
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema, create_model, model_validator

from dirmusic import ESTIMATORS
from dirmusic.locating.rules import LocatingRules
from pdpatrol.envs.scenario.array import ArrayCalibration, read_calibration
from pdpatrol.sensing.quantities import PATH_PATTERN, Config, FilePath

BOUNDS = {
    "refit_s": (0.01, 86_400.0),
    "max_pulses": (2, 2000),
    "max_std_deg": (0.0, 360.0),
    "confirm_probability": (0.0, 1.0),
    "confirm_aperture_deg": (0.0, 360.0),
    "confirm_semi_major_m": (0.0, 10_000.0),
    "confirm_range_m": (0.0, 10_000.0),
    "merge_m": (0.0, 10_000.0),
}
"""Minimum and maximum values of the rules of the Locator; angles in degrees."""


def _optional_rules() -> dict[str, Any]:
    """Define an optional key for each rule of the Locator: its type, its bounds, and None as the default."""
    keys = dict[str, Any]()
    for rule in fields(LocatingRules):
        key = rule.name.replace("_rad", "_deg")
        low, high = BOUNDS[key]
        keys[key] = type(rule.default) | None, Field(default=None, ge=low, le=high)
    return keys


OptionalRules = create_model("OptionalRules", __base__=Config, **_optional_rules())


def _check_estimator(method: str) -> str:
    if method not in ESTIMATORS and ":" not in method:
        raise ValueError(f"no estimator `{method}`; available: {', '.join(ESTIMATORS)}")
    return method


class EstimatorConfig(Config):
    """Bearing estimator: a built-in one by name, or `my_file.py:MyEstimator` or `package.module:MyEstimator`."""

    method: Annotated[FilePath, AfterValidator(_check_estimator)] = "maximum_likelihood"


def _read_calibration(given: object) -> object:
    return read_calibration(Path(given)) if isinstance(given, str) else given


class LocatingConfig(OptionalRules):
    """The Locator and its rules.

    `dirmusic.locating.rules` documents the rules and their defaults. Names are the same except that angles end in
    `_rad` there and in `_deg` here.
    """

    locator: FilePath | None = None
    """Your own Locator, `my_file.py:MyLocator` or `package.module:MyLocator`, with the interface of
    `dirmusic.locating.protocol.LocatorProtocol`."""
    calibration: Annotated[
        ArrayCalibration | None,
        BeforeValidator(_read_calibration),
        WithJsonSchema({"type": "string", "maxLength": 1024, "pattern": PATH_PATTERN}),
    ] = None
    """Path of a calibration file that an earlier mission with this array wrote."""

    @model_validator(mode="after")
    def _check_use_of_calibration(self) -> Self:
        if self.calibration is not None and self.locator is not None:
            raise ValueError(
                "calibration: must go with the built-in Locator, which alone estimates errors of the array"
            )
        return self

    def rules(self) -> LocatingRules:
        """Return the rules of the Locator, angles in radians, with defaults for rules that are not set."""
        given: dict[str, Any] = {
            key.replace("_deg", "_rad"): radians(value) if key.endswith("_deg") else value
            for key, value in self.model_dump(exclude={"locator", "calibration"}, exclude_none=True).items()
        }
        return LocatingRules(**given)
