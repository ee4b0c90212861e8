"""The `[array]` table of a scenario file: settings of the array, with paths of files that start at the scenario."""

from __future__ import annotations

from typing import Annotated, Any, cast

from pydantic import BeforeValidator, ValidationInfo

from envs.scenario.base import beside_the_scenario
from sensing import ArrayConfig
from sensing.array.config import SHIPPED_PATTERNS

PATTERN_KEYS = ("pattern", "true_pattern")


def _start_at_the_scenario(table: object, info: ValidationInfo) -> object:
    if not isinstance(table, dict):
        return table
    table = cast("dict[str, Any]", table)
    named = {key: table[key] for key in PATTERN_KEYS if isinstance(table.get(key), str)}
    paths = {key: path for key, path in named.items() if path not in SHIPPED_PATTERNS}
    return {**table, **{key: beside_the_scenario(path, info) for key, path in paths.items()}}


ArraySection = Annotated[ArrayConfig, BeforeValidator(_start_at_the_scenario)]
"""An `ArrayConfig` whose relative paths start at the scenario's file."""
