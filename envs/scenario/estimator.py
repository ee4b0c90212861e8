"""Who takes the bearings, as a scenario file says it."""

from __future__ import annotations

from typing import Self

from pydantic import ValidationInfo, field_validator, model_validator

from dirmusic import ESTIMATORS
from envs.scenario.base import Config, code_beside_the_scenario


class EstimatorConfig(Config, frozen=True):
    """The bearing estimator: a built-in one by name, or `my_file.py:MyEstimator`, `package.module:MyEstimator`."""

    method: str = "maximum_likelihood"

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
