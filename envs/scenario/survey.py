"""Scenario table `[survey]`: site, people, conditions, other surveys and rule of severity, for reports."""

import re
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, Field, TypeAdapter, WithJsonSchema

from pdpatrol.envs.scenario.base import Day, DayAsText
from pdpatrol.envs.scenario.severity import SeverityTable, read_severity
from pdpatrol.sensing.quantities import PATH_PATTERN, Config, FilePath

Text = Annotated[str, Field(min_length=1, max_length=200, pattern=PATH_PATTERN)]
"""One line of text."""

IS_DAY = re.compile(r"[0-9-]+")


def _check_previous(value: str) -> str:
    """Check a date, or return a path."""
    if IS_DAY.fullmatch(value):
        return TypeAdapter[str](Day).validate_python(value)
    if "/" not in value and not value.endswith(".html"):
        raise ValueError(f"must be a date, or the path of a report or its folder (./NAME), got {value!r:.60}")
    return value


def _read_severity(given: object) -> object:
    return read_severity(Path(given)) if isinstance(given, str) else given


class SurveyConfig(Config):
    """Statements of the report about the survey; all are optional, and none changes a mission."""

    site: Text | None = None
    """Name of the substation."""
    owner: Text | None = None
    """Owner of the equipment, to whom the report is addressed."""
    voltage: Text | None = None
    """Nominal voltages of the site, such as `110/20 kV`."""
    report_number: Text | None = None
    """Number of the report."""
    revision: Text | None = None
    """Revision of the report."""
    inspector: Text | None = None
    """Who made the survey, with qualification."""
    weather: Text | None = None
    """Weather, such as `12 C, 80 % humidity, dry for two days`."""
    load: Text | None = None
    """Load and operating state of the equipment during the survey."""
    background_noise: Text | None = None
    """Radio background as observed on site."""
    array_calibrated: Day | None = None
    """Date of the last calibration of the array in a laboratory."""
    previous_survey: Annotated[FilePath, DayAsText, AfterValidator(_check_previous)] | None = None
    """Date of the previous survey, or the path of its report or its folder."""
    next_survey: Day | None = None
    """Date planned for the next survey."""
    trend: FilePath | None = None
    """Path of the page that `pdpatrol trend` writes, or of its folder."""
    severity: Annotated[
        SeverityTable | None,
        BeforeValidator(_read_severity),
        WithJsonSchema({"type": "string", "maxLength": 1024, "pattern": PATH_PATTERN}),
    ] = None
    """Path of your own table of severity; by default `envs/scenario/severity.toml`."""
