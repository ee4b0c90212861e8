"""Which robot a mission is driven with, as a scenario file says it."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Annotated, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from pdpatrol.envs.scenario.base import Config, beside_the_scenario
from pdpatrol.robot_models.description.library import is_path, load_robot
from pdpatrol.robot_models.description.robot_description import RobotDescription, RobotFileError
from pdpatrol.sensing.quantities import FilePath


class RobotConfig(Config, frozen=True):
    """The robot, by the name of a shipped one or the path of an MJCF file; a relative path starts at the scenario."""

    model: FilePath = "inspector"
    max_speed_mps: Annotated[float, Field(ge=0.01, le=10.0)] | None = None
    """Greatest speed that it is driven at; its own limit, if left out."""

    @field_validator("model")
    @classmethod
    def _starts_at_the_scenario(cls, model: str, info: ValidationInfo) -> str:
        return beside_the_scenario(model, info) if is_path(model) else model

    @model_validator(mode="after")
    def _is_a_robot(self) -> Self:
        try:
            _ = self.description
        except RobotFileError as error:
            raise ValueError("\n".join(f"model: {fault}" for fault in error.faults)) from None
        fastest_mps = load_robot(self.model).max_speed_mps
        if self.max_speed_mps is not None and self.max_speed_mps > fastest_mps:
            raise ValueError(f"max_speed_mps: got {self.max_speed_mps:g}; allowed is at most its own {fastest_mps:g}")
        return self

    @cached_property
    def description(self) -> RobotDescription:
        """Its measures and limits."""
        robot = load_robot(self.model)
        return robot if self.max_speed_mps is None else replace(robot, max_speed_mps=self.max_speed_mps)
