"""trend.json and trend.html."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pdpatrol.missions.atomic_file import write_text
from pdpatrol.missions.campaign.inspection import Inspection
from pdpatrol.missions.campaign.records import Trend
from pdpatrol.missions.campaign.trend_page import trend_page


def trend_text(trend: Trend) -> str:
    """The text of trend.json."""
    return trend.model_dump_json(indent=1, by_alias=True) + "\n"


def write_trend(trend: Trend, inspections: Sequence[Inspection], folder: Path) -> tuple[str, ...]:
    """Write the files of a trend, each whole; their names.

    Raises:
        OSError: If one cannot be written.
    """
    write_text(folder / "trend.json", trend_text(trend))
    write_text(folder / "trend.html", trend_page(trend, inspections))
    return ("trend.json", "trend.html")
