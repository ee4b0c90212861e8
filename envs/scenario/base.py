"""What all parts of a scenario file share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, Field, ValidationInfo

from dirmusic import InputFileError

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]

FOLDER = "folder"
"""Key of the folder of the scenario file in the context that a scenario is validated with."""


class ScenarioError(InputFileError):
    """A scenario that cannot be used; one line per fault, each with file, key, what came and what is allowed."""


class Config(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """Frozen, strict, closed to unknown keys and to NaN."""


def beside_the_scenario(path: str, info: ValidationInfo) -> str:
    """A path that a scenario gives; a relative one starts at the scenario's file, or without one where the program is.

    Args:
        path: As it is written.
        info: What pydantic hands to a validator.
    """
    return str(Path((info.context or {}).get(FOLDER, "")) / path)


def code_beside_the_scenario(name: str, info: ValidationInfo) -> str:
    """The name of user's code: of `my_file.py:Name` the path as of `beside_the_scenario`, others as they are."""
    file, _, attribute = name.rpartition(":")
    return f"{beside_the_scenario(file, info)}:{attribute}" if file.endswith(".py") else name
