"""Scenario tables of the bearing estimator and the Locator."""

from math import degrees, radians
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema, model_validator

from dirmusic import ESTIMATORS
from dirmusic.locating.rules import LocatingRules
from pdpatrol.envs.scenario.array import ArrayCalibration, read_calibration
from pdpatrol.sensing.quantities import PATH_PATTERN, Config, FilePath

RULES = LocatingRules()
"""Rules with their defaults."""

Metres = Annotated[float, Field(ge=0.0, le=10_000.0)]
Degrees = Annotated[float, Field(ge=0.0, le=360.0)]


def _default(value: float) -> Any:  # noqa: ANN401 - a field of pydantic
    """Return a field that defaults to None, with the default of the rule in its JSON Schema."""
    return Field(default=None, json_schema_extra={"default": value})


def _check_estimator(method: str) -> str:
    if method not in ESTIMATORS and ":" not in method:
        raise ValueError(f"no estimator `{method}`; available: {', '.join(ESTIMATORS)}")
    return method


class EstimatorConfig(Config):
    """Bearing estimator: a built-in one by name, or `my_file.py:MyEstimator` or `package.module:MyEstimator`."""

    method: Annotated[FilePath, AfterValidator(_check_estimator)] = "maximum_likelihood"
    """`maximum_likelihood`; `music`, the method of the paper; `sub_bands`, which needs `receiver.n_bands`; `strongest`,
    the boresight of the strongest element; or your own, `my_file.py:MyEstimator` or `package.module:MyEstimator`."""


def _read_calibration(given: object) -> object:
    return read_calibration(Path(given)) if isinstance(given, str) else given


class LocatingConfig(Config):
    """The Locator and its rules, those of `dirmusic.locating.rules` with angles in degrees."""

    refit_s: Annotated[float, Field(ge=0.01, le=86_400.0)] | None = _default(RULES.refit_s)
    """Time between fits."""
    refit_share: Annotated[float, Field(ge=0.0, le=1.0)] | None = _default(RULES.refit_share)
    """Time between fits as a share of the time since the first one, if that is longer."""
    max_pulses: Annotated[int, Field(ge=2, le=2000)] | None = _default(RULES.max_pulses)
    """Largest number of groups of pulses of one finding in a fit. The pulses of a group share a place, a heading and a
    direction."""
    max_std_deg: Degrees | None = _default(round(degrees(RULES.max_std_rad), 6))
    """Largest standard deviation of a direction that is used. False alarms from noise have a larger one."""
    confirm_probability: Annotated[float, Field(ge=0.0, le=1.0)] | None = _default(RULES.confirm_probability)
    """Smallest existence probability of a confirmed finding."""
    confirm_aperture_deg: Degrees | None = _default(round(degrees(RULES.confirm_aperture_rad), 6))
    """Smallest angle over which the lines of sight to a confirmed finding must spread."""
    confirm_semi_major_m: Metres | None = _default(RULES.confirm_semi_major_m)
    """Largest semi-major axis of the 95 % ellipse of a confirmed finding."""
    confirm_range_m: Metres | None = _default(RULES.confirm_range_m)
    """Horizontal distance within which routes and reports expect a source to be confirmed."""
    merge_m: Metres | None = _default(RULES.merge_m)
    """Distance within which two findings are merged."""
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
