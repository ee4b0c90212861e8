"""trend.html: what became of the discharges of a yard, one page for A4."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from markupsafe import Markup

from pdpatrol.missions.campaign.figures import Mark, draw_levels, draw_plan, draw_rates, mark_of
from pdpatrol.missions.campaign.inspection import Inspection
from pdpatrol.missions.campaign.records import Discharge, Observation, Trend
from pdpatrol.missions.campaign.words import last_known, rate_slope_in_words, slope_in_words, what_became
from pdpatrol.missions.report.page import embed, render


class Section(NamedTuple):
    """What the page shows of one discharge.

    Attributes:
        discharge: As of the trend.
        mark: Colour and shape of what became of it.
        what: The same in words.
        known: Last inspection that tells its level.
        level_slope: In words, with its interval, dB a week.
        rate_slope: In words, with its interval, per cent a week.
        levels: The picture; None where no inspection tells any level.
        rates: The picture; None for data from the field.
    """

    discharge: Discharge
    mark: Mark
    what: str
    known: Observation | None
    level_slope: tuple[str, str]
    rate_slope: tuple[str, str]
    levels: Markup | None
    rates: Markup | None


def trend_page(trend: Trend, inspections: Sequence[Inspection]) -> str:
    """The page of a campaign.

    Args:
        trend: As `make_trend` made it.
        inspections: Of which it did.
    """
    return render(
        "trend.html",
        title="Partial discharge trend",
        subject=f"{trend.scenario}, {trend.dates[0]} to {trend.dates[-1]}",
        trend=trend,
        summary=_summary(trend),
        sections=[_section(discharge) for discharge in trend.discharges],
        plan=embed(draw_plan(trend, inspections), "Plan of the yard with what became of each discharge"),
    )


def _section(discharge: Discharge) -> Section:
    known = last_known(discharge)
    title = f"of discharge {discharge.number} against date, with 99 % intervals"
    return Section(
        discharge=discharge,
        mark=mark_of(discharge),
        what=what_became(discharge),
        known=known,
        level_slope=slope_in_words(discharge.level),
        rate_slope=rate_slope_in_words(discharge.rate),
        levels=embed(draw_levels(discharge), f"Level {title}") if known else None,
        rates=embed(draw_rates(discharge), f"Rate {title}") if known and known.rate_hz else None,
    )


def _summary(trend: Trend) -> str:
    """Such as `2 discharges: 1 grown, 1 constant.`."""
    n = len(trend.discharges)
    if n == 0:
        return f"No discharge was found in {len(trend.dates)} inspections."
    counts = Counter(mark_of(discharge) for discharge in trend.discharges)
    told = ", ".join(f"{count} {mark.label}" for mark, count in counts.items())
    return f"{n} discharge{'s' if n > 1 else ''} in {len(trend.dates)} inspections: {told}."
