"""Inspections to a trend: what is new, grown, gone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from dirmusic.angles import aperture
from dirmusic.locating.finding import ellipse95
from dirmusic.locating.rules import LocatingRules
from pdpatrol.envs.scenario.base import weeks_between
from pdpatrol.missions.campaign.inspection import Inspection, Located
from pdpatrol.missions.campaign.joining import Joined, join
from pdpatrol.missions.campaign.records import SCHEMA, Discharge, Interval, Line, Observation, Status, Trend, Verdict
from pdpatrol.missions.campaign.source_level import NEAR_M, SourceLevel, floor_v, looks_at, source_level
from pdpatrol.missions.campaign.trend_line import CONFIDENCE, TrendLine, fit_line
from pdpatrol.missions.record.which_site import in_words, site_probabilities

FloatArray = NDArray[np.float64]

LEAST_EXPECTED = 50.0
"""Pulses that a discharge would have sent to where they are detected, were it as before: with fewer, its site was not
inspected (assumed; 20 confirm a finding, and not all of them tell a direction)."""

WIDEST_DB_PER_WEEK = 3.0
"""An interval that reaches farther from zero, to either side, tells nothing of a discharge (assumed): 3 dB a week are
12 in a month."""

SIGMAS = float(norm.ppf(0.5 + 0.5 * CONFIDENCE))


def make_trend(inspections: Sequence[Inspection]) -> Trend:
    """The trend of a campaign.

    Args:
        inspections: At least one, by date, all of one yard.
    """
    weeks = np.array([weeks_between(inspections[0].day, each.day) for each in inspections])
    floor = min(floor_v(each) for each in inspections)
    joined = join([each.findings for each in inspections])
    discharges = [_discharge(each, inspections, weeks, floor) for each in joined]
    discharges.sort(key=_most_urgent_first)
    return Trend(
        schema=SCHEMA,
        scenario=str(inspections[0].log.meta["name"]),
        dates=tuple(each.day for each in inspections),
        runs=tuple(str(each.folder) for each in inspections),
        discharges=tuple(each.model_copy(update={"number": k}) for k, each in enumerate(discharges, start=1)),
    )


def _most_urgent_first(discharge: Discharge) -> tuple[bool, float]:
    """What is gone last, and else what grows most first; what is new and has no line yet stands before the rest."""
    growth = discharge.level.per_week.value if discharge.level else np.inf if discharge.status == "new" else 0.0
    return discharge.status == "gone", -growth


def _discharge(joined: Joined, inspections: Sequence[Inspection], weeks: FloatArray, floor: float) -> Discharge:
    levels = {number: source_level(inspections[number], finding) for number, finding in joined.found.items()}
    known = {number: level for number, level in levels.items() if level is not None}
    observations = tuple(
        _observation(
            inspection,
            float(weeks[k]),
            joined.found.get(k),
            levels.get(k),
            _is_absent(k, joined, known, inspection, floor),
        )
        for k, inspection in enumerate(inspections)
    )
    rows, has_rate = sorted(known), not inspections[0].is_of_the_field
    at = weeks[rows]
    level = fit_line(at, np.array([known[k].level_db for k in rows]), np.array([known[k].level_std_db for k in rows]))
    log_rate = np.log([known[k].rate_hz for k in rows])
    rate = fit_line(at, log_rate, np.array([known[k].log_rate_std for k in rows])) if has_rate else None
    yard = inspections[0].yard
    place_m, covariance_m2 = joined.position_m, joined.covariance_m2
    x, y, z = place_m.tolist()
    return Discharge(
        number=1,
        site="" if yard is None else in_words(site_probabilities(yard, place_m, covariance_m2)),
        position_m=(x, y, z),
        semi_major_m=ellipse95(covariance_m2[:2, :2]).semi_major_m,
        status=_status(observations),
        verdict=_verdict(level),
        level=_line(level),
        rate=_line(rate),
        observations=observations,
    )


def _is_absent(
    number: int, joined: Joined, known: dict[int, SourceLevel], inspection: Inspection, floor: float
) -> bool:
    """Whether an inspection would have found a discharge as it was in the nearest one that tells its level.

    That takes enough pulses from near by, and lines of sight that open as wide as confirmation wants. Data from the
    field never tell: they hold what triggered, and not where nothing did.
    """
    if number in joined.found or not known or not np.isfinite(floor) or inspection.is_of_the_field:
        return False
    as_it_was = known[min(known, key=lambda k: abs(k - number))]
    looks = looks_at(inspection, joined.position_m)
    away_m = inspection.log.column("step", "pose")[looks.step, :2] - joined.position_m[:2]
    is_near = np.linalg.norm(away_m, axis=-1) <= NEAR_M
    is_detected = is_near & (as_it_was.level_db - looks.loss_db >= 20 * np.log10(floor))
    if as_it_was.rate_hz * looks.duration_s[is_detected].sum() < LEAST_EXPECTED:
        return False
    aspect_rad = np.arctan2(away_m[is_detected, 1], away_m[is_detected, 0])
    return bool(aperture(aspect_rad) >= LocatingRules().confirm_aperture_rad)


def _observation(
    inspection: Inspection, week: float, finding: Located | None, level: SourceLevel | None, is_absent: bool
) -> Observation:
    return Observation(
        run=str(inspection.folder),
        date=inspection.day,
        week=week,
        presence="found" if finding else "absent" if is_absent else "not inspected",
        finding_id=finding.id if finding else None,
        is_confirmed=finding is not None and finding.is_confirmed,
        level_db=_interval(level.level_db, SIGMAS * level.level_std_db) if level else None,
        rate_hz=_ratio_interval(level.rate_hz, SIGMAS * level.log_rate_std)
        if level and not inspection.is_of_the_field
        else None,
        n_pulses=level.n_pulses if level else 0,
        n_looks=level.n_looks if level else 0,
    )


def _interval(value: float, half_width: float) -> Interval:
    return Interval(value=value, lower=value - half_width, upper=value + half_width)


def _ratio_interval(value: float, log_half_width: float) -> Interval:
    ratio = float(np.exp(min(log_half_width, 20.0)))
    return Interval(value=value, lower=value / ratio, upper=value * ratio)


def _line(line: TrendLine | None) -> Line | None:
    if line is None:
        return None
    return Line(per_week=_interval(line.slope, line.half_width), at_start=line.at_start, scatter=line.scatter)


def _verdict(line: TrendLine | None) -> Verdict:
    if line is None:
        return "too few dates"
    if line.lower > 0.0:
        return "grown"
    if line.upper < 0.0:
        return "declined"
    return "constant" if max(-line.lower, line.upper) <= WIDEST_DB_PER_WEEK else "not clear"


def _status(observations: Sequence[Observation]) -> Status:
    """By the first and the last inspection that tell whether it was there."""
    telling = [each.presence for each in observations if each.presence != "not inspected"]
    if telling[-1] == "absent":
        return "gone"
    return "new" if telling[0] == "absent" else "standing"
