"""What all parts of a scenario file share."""

from __future__ import annotations

import re
import tomllib
from datetime import date
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, ValidationInfo

from dirmusic import InputFileError
from dirmusic.input_file import read_whole
from pdpatrol.robot_models.yard.quantities import MOST_LETTERS

MISSION_NAME = r"^[A-Za-z0-9][A-Za-z0-9_.-]*$"
MissionName = Annotated[str, Field(pattern=MISSION_NAME, max_length=MOST_LETTERS)]
"""Of a scenario. A folder is called by it: it is no path, and is printed as it is."""

SITE_CHOICE = r"^[a-z][a-z0-9_]*/([a-z][a-z0-9_]*|\*)$"
SiteChoice = Annotated[str, Field(pattern=SITE_CHOICE, max_length=2 * MOST_LETTERS + 1)]
"""`equipment/site`, or `equipment/*`."""

DAY = r"^20[0-9]{2}-[0-9]{2}-[0-9]{2}$"
DAYS_PER_WEEK = 7


def _as_text(value: object) -> object:
    """A date of TOML as text; of a date with a time the day counts, and all else is as it was."""
    return value.isoformat()[:10] if isinstance(value, date) else value


def is_day(text: str) -> bool:
    """Whether a text is a day of this century as 2026-03-02."""
    try:
        return re.fullmatch(DAY, text) is not None and bool(date.fromisoformat(text))
    except ValueError:
        return False


def _is_of_the_calendar(day: str) -> str:
    if not is_day(day):
        raise ValueError(f"got {day}; allowed is a day of the calendar")
    return day


Day = Annotated[str, Field(pattern=DAY, max_length=10), BeforeValidator(_as_text), AfterValidator(_is_of_the_calendar)]
"""As 2026-03-02, a date of TOML or text in quotes; kept as text, which is what logs and reports hold."""


def weeks_between(first: str, last: str) -> float:
    """Weeks from one day to another, both as `Day`; negative if the second comes before the first."""
    return (date.fromisoformat(last) - date.fromisoformat(first)).days / DAYS_PER_WEEK


MOST_BYTES = 4_000_000
"""Of a file: the largest yard that is allowed, written out, has less."""

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


def read_toml(path: Path, wanted: str) -> dict[str, Any]:
    """The table in a TOML file, with or without a byte order mark.

    Args:
        path: Of the file.
        wanted: What kind of file it should be, as a fault says it.

    Raises:
        InputFileError: If it cannot be read, is too large, no text or no TOML.
    """
    try:
        data = read_whole(path, MOST_BYTES)
    except InputFileError as error:
        raise InputFileError([f"{fault}; give {wanted}" for fault in error.faults]) from None
    try:
        return tomllib.loads(data.decode("utf-8").removeprefix("\ufeff"))
    except UnicodeDecodeError as error:
        raise InputFileError([f"{path}: byte {error.start} is not UTF-8 text; give {wanted}"]) from None
    except RecursionError:
        raise InputFileError([f"{path}: not TOML: tables or arrays are nested too deeply"]) from None
    except ValueError as error:  # TOMLDecodeError is one; a whole number of 5000 digits raises another
        why = str(error) if isinstance(error, tomllib.TOMLDecodeError) else "a whole number has thousands of digits"
        raise InputFileError([f"{path}: not TOML: {why}"]) from None
