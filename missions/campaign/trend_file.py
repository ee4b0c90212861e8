"""trend.json and trend.html."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from missions.campaign.inspection import Inspection
from missions.campaign.records import Trend
from missions.whole_file import write_whole


def trend_text(trend: Trend) -> str:
    """The text of trend.json."""
    return trend.model_dump_json(by_alias=True, indent=1) + "\n"


def write_trend(trend: Trend, inspections: Sequence[Inspection], folder: Path) -> None:
    """Write both files, each whole.

    Raises:
        OSError: If one cannot be written.
    """
    write_whole(folder / "trend.json", trend_text(trend))
