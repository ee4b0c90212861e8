"""What became of a discharge, in words, for the terminal and the page."""

from __future__ import annotations

import math

from pdpatrol.missions.campaign.records import Discharge, Line, Observation

LEVEL = "strength 1 m away, dB over 1 V"


def what_became(discharge: Discharge) -> str:
    """Such as `new on 2026-03-16; grown`, or `constant within 0.6 dB a week`."""
    words = [_status(discharge), _verdict(discharge)]
    last = discharge.observations[-1]
    if last.presence == "not inspected":
        words.append(f"not inspected on {last.date}")
    return "; ".join(word for word in words if word)


def _status(discharge: Discharge) -> str:
    found = [each.date for each in discharge.observations if each.presence == "found"]
    if discharge.status == "new":
        return f"new on {found[0]}"
    if discharge.status == "gone":
        absent = [each.date for each in discharge.observations if each.presence == "absent" and each.date >= found[-1]]
        return f"gone since {absent[0]}"
    return ""


def _verdict(discharge: Discharge) -> str:
    if discharge.verdict == "constant" and discharge.level is not None:
        slope = discharge.level.per_week
        return f"constant within {max(-slope.lower, slope.upper):.1f} dB a week"
    if discharge.verdict == "too few dates" and discharge.status != "standing":
        return ""
    return "level not clear" if discharge.verdict == "not clear" else discharge.verdict


def slope_in_words(line: Line | None) -> tuple[str, str]:
    """Slope of a level and its interval, dB a week; dashes where there is no line."""
    if line is None:
        return "-", ""
    slope = line.per_week
    return f"{slope.value:+.2f}", f"{slope.lower:+.2f} to {slope.upper:+.2f}"


def rate_slope_in_words(line: Line | None) -> tuple[str, str]:
    """Change of a rate and its interval, per cent a week; dashes where there is no line."""
    if line is None:
        return "-", ""
    slope = line.per_week
    return _per_cent(slope.value), f"{_per_cent(slope.lower)} to {_per_cent(slope.upper)}"


def _per_cent(log_ratio: float) -> str:
    """A change with its sign; none has no sign."""
    change = round(100 * math.expm1(min(log_ratio, 10.0)))
    return f"{change:+d}" if change else "0"


def last_known(discharge: Discharge) -> Observation | None:
    """The last inspection that tells level and rate."""
    return next((each for each in reversed(discharge.observations) if each.level_db is not None), None)
