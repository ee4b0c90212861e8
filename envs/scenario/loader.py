"""The strict loader of scenario files: every fault at once, each with file, key, what came and what is allowed."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from envs.scenario.base import FOLDER, ScenarioError
from envs.scenario.scenario import Scenario
from envs.scenario.suite import choose_yards, is_of_suite

SHIPPED = Path(__file__).parents[1] / "scenarios"


NOT_A_KEY = ("box", "cylinder", "catalogue", "[key]", "[given]", "[planned]")
"""What pydantic puts into the place of a fault that is no part of the file: tags of unions, and keys of tables."""


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
    try:
        return Scenario.model_validate({"name": path.stem, **data}, context={FOLDER: path.absolute().parent})
    except ValidationError as error:
        raise ScenarioError(_faults(path, error)) from None


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
        text = path.read_bytes().decode("utf-8")
    except UnicodeDecodeError as error:
        raise ScenarioError([f"{path}: byte {error.start} is not UTF-8 text; a scenario is a TOML text file"]) from None
    except OSError as error:
        raise ScenarioError([f"{path}: cannot be read ({error.strerror}); give a TOML file"]) from None
    try:
        return {key: _as_tuples(value) for key, value in tomllib.loads(text).items()}
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise ScenarioError([f"{path}: not TOML: {error}"]) from None


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


def _faults(path: Path, error: ValidationError) -> list[str]:
    """One line per fault: file, key path, what came, what is allowed."""
    lines: list[str] = []
    for item in error.errors(include_url=False):
        parts = [str(part) for part in item["loc"] if part not in NOT_A_KEY]
        key = ".".join(parts)
        if item["type"] == "value_error":  # our own checks, each line `key: what came; allowed is ...`
            prefix = f"{key}." if key else ""
            lines += [
                f"{path}: {prefix}{line}" for line in str(item.get("ctx", {}).get("error", item["msg"])).splitlines()
            ]
        elif item["type"] == "missing":
            lines.append(f"{path}: {key}: missing; it is required")
        elif item["type"] == "extra_forbidden":
            known = _known_keys(item["loc"])
            lines.append(f"{path}: {key}: unknown key; allowed are {', '.join(known)}")
        else:
            came = repr(item["input"])
            came = came if len(came) <= 60 else came[:57] + "..."
            lines.append(f"{path}: {key}: got {came}; {item['msg'][0].lower()}{item['msg'][1:]}")
    return lines


def _known_keys(location: tuple[int | str, ...]) -> list[str]:
    """Fields of the model in which the last part of `location` is unknown."""
    model: Any = Scenario
    for part in location[:-1]:
        model = _step_into(model, part)
    fields: Mapping[str, Any] = getattr(model, "model_fields", {})
    return [name for name in fields if not (model is Scenario and name == "name")]


def _step_into(annotation: Any, part: int | str) -> Any:  # noqa: ANN401 - walks type annotations
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation.model_fields[str(part)].annotation
    options = [option for option in get_args(annotation) if option is not Ellipsis]
    for option in options:
        bare = [getattr(o, "__origin__", o) if hasattr(o, "__metadata__") else o for o in (option, *get_args(option))]
        inner = [o for o in bare if isinstance(o, type) and issubclass(o, BaseModel)]
        for model in inner:
            tag = model.model_fields.get("shape")
            if isinstance(part, int) or (tag is not None and part in get_args(tag.annotation)):
                return option if isinstance(part, int) else model
    deeper = [_step_into(option, part) for option in options if get_args(option)]
    return next((found for found in deeper if found is not None), None)
