"""Helpers of the tests of the environments."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from pdpatrol.envs import Scenario
from pdpatrol.envs.scenario import SHIPPED

STAND = np.zeros(2, dtype=np.float32)
"""Action of a robot that stands still."""


def drive(speed: float, turn: float) -> np.ndarray:
    """Return the action for these fractions of the robot's top speed and yaw rate."""
    return np.array([speed, turn], dtype=np.float32)


def to_be_planned(scenario: Scenario) -> Scenario:
    """Return the scenario without waypoints, so that missions plan them."""
    return scenario.model_copy(update={"route": scenario.route.model_copy(update={"waypoints_m": "planned"})})


def write_yard(
    folder: Path, tables: str = "", *changes: tuple[str, str], name: str = "one_source", to: str = "yard"
) -> Path:
    """Write a shipped scenario to a folder, with some of its text replaced and tables added."""
    text = replaced((SHIPPED / f"{name}.toml").read_text(encoding="utf-8"), changes)
    file = folder / f"{to}.toml"
    file.write_text(f"{text}\n{tables}\n", encoding="utf-8")
    return file


def replaced(text: str, changes: Iterable[tuple[str, str]]) -> str:
    """Replace parts of a text that it must have."""
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


def listed(result: Any) -> Any:  # noqa: ANN401 - any result of an environment
    """Convert tuples and object arrays in a result to lists, so that results can be compared."""
    if isinstance(result, dict):
        return {key: listed(value) for key, value in result.items()}
    if isinstance(result, tuple) or (isinstance(result, np.ndarray) and result.dtype == np.object_):
        return [listed(each) for each in result]
    return result
