"""The strict loader of scenario files: every fault at once, each with file, key, what came and what is allowed."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from dirmusic import InputFileError
from pdpatrol.envs.scenario.base import FOLDER, MISSION_NAME, ScenarioError, read_toml
from pdpatrol.envs.scenario.faults import FORMS, fault_lines, on_one_line, shown
from pdpatrol.envs.scenario.scenario import Scenario
from pdpatrol.envs.scenario.suite import choose_yards, is_of_suite
from pdpatrol.robot_models.yard.quantities import MOST_LETTERS

SHIPPED = Path(__file__).parents[1] / "scenarios"

UNNAMED = "unnamed"
"""Stands in for a name while the rest of a file is checked."""


def shipped_scenarios() -> tuple[str, ...]:
    """Names of the scenarios that come with the package."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.toml")))


def load_scenario(scenario: str | Path | Scenario, settings: Mapping[str, Any] | None = None) -> Scenario:
    """A scenario by the name of a shipped one, from a TOML file, or as it is.

    Args:
        scenario: Name, `suite/LEVEL_NUMBER` for a yard of the suite, path, or the scenario itself.
        settings: Keys that are set before the file is checked, as `receiver.noise_v`, with their values.

    Raises:
        ScenarioError: If there is no such scenario or file, or the file has faults; all of them are listed.
    """
    if isinstance(scenario, Scenario):
        return scenario
    path = Path(scenario)
    if isinstance(scenario, str) and is_of_suite(scenario):
        path = _only_yard(scenario)
    elif path.suffix != ".toml" and path.name == str(scenario):
        if path.name not in shipped_scenarios():
            raise ScenarioError(
                [
                    f"{scenario}: no such scenario; known are {', '.join(shipped_scenarios())}, "
                    "or give a path ending in .toml"
                ]
            )
        path = SHIPPED / f"{scenario}.toml"
    data = _read(path)
    for key, value in (settings or {}).items():
        data = _with(data, key.split("."), _as_tuples(value))
    faults = [] if "name" in data else _stem_faults(path.stem)
    name = UNNAMED if faults else path.stem
    try:
        loaded = Scenario.model_validate({"name": name, **data}, context={FOLDER: path.absolute().parent})
    except ValidationError as error:
        faults += fault_lines(error, Scenario)
    else:
        if not faults:
            return loaded
    raise ScenarioError([on_one_line(f"{path}: {fault}") for fault in faults])


def _stem_faults(stem: str) -> list[str]:
    """What keeps the name of a file from being that of its scenario."""
    if len(stem) <= MOST_LETTERS and re.fullmatch(MISSION_NAME, stem):
        return []
    return [
        f"name: none given, and the name of the file, {shown(stem)}, is none for a folder of results; allowed is "
        f"{FORMS[MISSION_NAME]}, at most {MOST_LETTERS}"
    ]


def _only_yard(name: str) -> Path:
    yard, *others = choose_yards(name)
    if others:
        raise ScenarioError([f"{name}: {1 + len(others)} yards; allowed is one of them, as {yard.name}"])
    return yard.path


def restore_scenario(data: Mapping[str, Any]) -> Scenario:
    """A scenario from the plain data that `model_dump(mode="json")` made of it."""
    return Scenario.model_validate(_as_tuples(data))


def _read(path: Path) -> dict[str, Any]:
    try:
        table = read_toml(path, "a scenario, which is a TOML text file")
    except InputFileError as error:
        raise ScenarioError([on_one_line(fault) for fault in error.faults]) from None
    return {key: _as_tuples(value) for key, value in table.items()}


def _with(table: Mapping[str, Any], keys: list[str], value: Any) -> dict[str, Any]:  # noqa: ANN401 - as TOML
    """A table with one value set, in tables within it that are made where there are none."""
    first, *deeper = keys
    if not deeper:
        return {**table, first: value}
    inner = table.get(first, {})
    return {**table, first: _with(inner if isinstance(inner, Mapping) else {}, deeper, value)}


def _as_tuples(value: Any) -> Any:  # noqa: ANN401 - TOML holds values of many types
    """TOML arrays as tuples, which the strict models want."""
    if isinstance(value, list):
        return tuple(_as_tuples(item) for item in value)
    if isinstance(value, dict):
        return {key: _as_tuples(item) for key, item in value.items()}
    return value
