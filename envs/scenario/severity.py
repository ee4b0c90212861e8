"""Table that sorts findings into classes of severity, with an action for each kind of discharge."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, ValidationError, model_validator

from dirmusic import InputFileError
from pdpatrol.envs.scenario.base import as_tuples, error_lines, read_toml
from pdpatrol.sensing.quantities import PATH_PATTERN, Config, Share

DEFAULT = Path(__file__).with_name("severity.toml")
"""Table that counts if a survey names no other."""

Line = Annotated[str, Field(min_length=1, max_length=500, pattern=PATH_PATTERN)]
"""Text without line breaks."""

Days = Annotated[int, Field(ge=0, le=3650)]


class KindSeverity(Config):
    """Classes of a kind of discharge."""

    class_weak: Line
    """Class of a discharge below `strong_dbv`, or of unknown level."""
    class_strong: Line
    """Class of a discharge of `strong_dbv` or more."""
    meaning: Line
    """Usual cause of such a discharge."""
    action: Line
    """Action on site."""


class KindSeverities(Config):
    """Classes by kind of discharge."""

    corona: KindSeverity
    surface: KindSeverity
    void: KindSeverity
    floating: KindSeverity
    unknown: KindSeverity
    """Also for a kind of less than the least confidence."""


class SeverityTable(Config):
    """Rule by which a kind of discharge and its level determine a class, an action and the time until it is due."""

    title: Line
    """Name of the rule, which the report states."""
    least_confidence: Share
    """Least confidence of a kind; below it, the kind is unknown."""
    strong_dbv: Annotated[float, Field(ge=-100.0, le=60.0)]
    """Level from which a discharge is strong, dB relative to 1 V at 1 m."""
    limits: Line
    """What the rule does not cover, which the report states."""
    sources: tuple[Line, ...] = Field(default=(), max_length=20)
    """Where the rule comes from, which the report states."""
    classes: Mapping[Line, Days] = Field(min_length=1, max_length=20)
    """Days from the survey until the action of each class is due, from the least urgent class on."""
    kinds: KindSeverities

    @model_validator(mode="after")
    def _classes_are_known(self) -> Self:
        named = {
            f"kinds.{kind}.{key}": name
            for kind, row in self.kinds
            for key, name in (("class_weak", row.class_weak), ("class_strong", row.class_strong))
        }
        known = ", ".join(self.classes)
        if errors := [
            f"{key}: must be a class of [classes] ({known}), got `{name}`"
            for key, name in named.items()
            if name not in self.classes
        ]:
            raise ValueError("\n".join(errors))
        return self


def read_severity(path: Path) -> SeverityTable:
    """Read a table of severity.

    Raises:
        InputFileError: If the file cannot be read or has errors; all of them are listed.
    """
    table = read_toml(path)
    try:
        return SeverityTable.model_validate(as_tuples(table))
    except ValidationError as error:
        raise InputFileError([f"{path}: {line}" for line in error_lines(error, SeverityTable)]) from None


@cache
def default_severity() -> SeverityTable:
    """Return the table that counts if a survey names no other."""
    return read_severity(DEFAULT)
