"""Loading of scenario files, with one line per error, and their JSON Schema."""

import ast
import inspect
import json
import re
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from dirmusic import InputFileError
from pdpatrol.envs.scenario.base import ScenarioError, as_tuples, error_lines, meant, parse_toml, read_toml
from pdpatrol.envs.scenario.scenario import Scenario
from pdpatrol.envs.scenario.suite import choose_yards, is_of_suite

SHIPPED = Path(__file__).parents[1] / "scenarios"
"""Folder of the scenarios that come with the package."""

FILE_KEYS = {
    "array": ("pattern",),
    "nature.array": ("pattern",),
    "estimator": ("method",),
    "locating": ("locator", "calibration"),
    "robot": ("model",),
    "survey": ("previous_survey", "trend", "severity"),
}
"""Keys that can name a file of the user, by table."""

IS_FILE = re.compile(r"/|\.py:|\.(csv|html|msi|pln|toml|xml)$", re.IGNORECASE)
"""Pattern found in paths of files, and not in the names of shipped or installed objects."""


def shipped_scenarios() -> tuple[str, ...]:
    """List the names of the scenarios that come with the package."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.toml")))


def load_scenario(scenario: str | Path | Scenario, settings: Mapping[str, Any] | None = None) -> Scenario:
    """Load a scenario by name or from a TOML file; return a `Scenario` unchanged.

    Args:
        scenario: Name of a shipped scenario, `suite/LEVEL_NUMBER` for a yard of the suite, path of a file that ends in
            .toml, or a `Scenario`.
        settings: Values that replace those of the file before it is checked, by keys such as `receiver.noise_v`.

    Raises:
        ScenarioError: If the scenario does not exist or has errors; all of them are listed.
    """
    if isinstance(scenario, Scenario):
        return scenario
    path = _path_of(scenario)
    try:
        data = read_toml(path)
    except InputFileError as error:
        raise ScenarioError(error.faults) from None
    for setting, value in (settings or {}).items():
        *tables, key = setting.split(".")
        inner = data
        for table in tables:
            if not isinstance(inner.get(table), dict):
                inner[table] = {}
            inner = inner[table]
        inner[key] = as_tuples(value)
    _make_paths_absolute(data, path.absolute().parent)
    return restore_scenario({"name": path.stem, **data}, f"{path}: ")


def check_content(content: bytes, path: Path) -> Scenario:
    """Load a scenario from the content of a file, before it is written to a path.

    Raises:
        InputFileError: If the content has errors; all of them are listed, without the name of the file.
    """
    data = parse_toml(content, path)
    _make_paths_absolute(data, path.absolute().parent)
    return restore_scenario({"name": path.stem, **data})


def _path_of(scenario: str | Path) -> Path:
    path = Path(scenario)
    if isinstance(scenario, str) and is_of_suite(scenario):
        yards = choose_yards(scenario)
        if len(yards) != 1:
            raise ScenarioError([f"{scenario}: must be one yard, such as {yards[0].name}, got {len(yards)}"])
        return yards[0].path
    if path.suffix == ".toml" or path.name != str(scenario):
        return path
    known = shipped_scenarios()
    if scenario not in known:
        hint = meant(known, str(scenario)) or f"; available: {', '.join(known)}, or give a path ending in .toml"
        raise ScenarioError([f"{scenario}: no such scenario{hint}"])
    return SHIPPED / f"{scenario}.toml"


def _make_paths_absolute(data: dict[str, Any], folder: Path) -> None:
    """Make paths in the data of a scenario file, which are relative to its folder, absolute."""
    for name, keys in FILE_KEYS.items():
        table: Any = data
        for part in name.split("."):
            table = table.get(part) if isinstance(table, dict) else None
        if not isinstance(table, dict):
            continue
        for key in keys:
            if isinstance(table.get(key), str) and IS_FILE.search(table[key]):
                table[key] = str(folder / table[key])


def restore_scenario(data: Mapping[str, Any], place: str = "") -> Scenario:
    """Create a scenario from the plain data that its `model_dump(mode="json")` returned.

    Args:
        data: The data.
        place: Start of each line of an error, such as the name of a file.

    Raises:
        ScenarioError: If the data has errors; all of them are listed.
    """
    try:
        return Scenario.model_validate(as_tuples(data))
    except ValidationError as error:
        raise ScenarioError([f"{place}{line}" for line in error_lines(error, Scenario, data)]) from None


def scenario_schema() -> dict[str, Any]:
    """Return the JSON Schema of scenario files, draft 2020-12.

    The schema covers every table, key, type, bound and description. Only `load_scenario` checks combinations of keys,
    and the contents of other files.
    """
    schema = Scenario.model_json_schema()
    schema["required"].remove("name")  # defaults to the name of the file
    models = {model.__name__: model for model in _subclasses(BaseModel)}
    for name, table in {"Scenario": schema, **schema["$defs"]}.items():
        texts = _docstrings_of_keys(models[name])
        for key, properties in table["properties"].items():
            if key in texts:
                properties["description"] = texts[key]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def schema_text() -> str:
    """Return the schema as the text of docs/schemas/scenario.schema.json."""
    return json.dumps(scenario_schema(), indent=2) + "\n"


def _subclasses(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    for each in model.__subclasses__():
        yield each
        yield from _subclasses(each)


def _docstrings_of_keys(model: type[BaseModel]) -> dict[str, str]:
    """Return the docstring of each key of a model and its bases.

    Pydantic can read them as well (`use_attribute_docstrings`), but does so at import, which takes 0.4 s.
    """
    texts = dict[str, str]()
    for base in reversed(model.__mro__):
        if not base.__module__.startswith("pdpatrol."):
            continue
        (definition,) = ast.parse(inspect.getsource(base)).body
        assert isinstance(definition, ast.ClassDef)
        for key, text in pairwise(definition.body):
            if isinstance(key, ast.AnnAssign) and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
                texts[ast.unparse(key.target)] = " ".join(str(text.value.value).split())
    return texts
