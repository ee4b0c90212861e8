"""Trend of the discharges of a yard over repeated inspections: which are new, grown, or gone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import norm, t
from statsmodels.regression.linear_model import WLS

from dirmusic.angles import aperture
from dirmusic.locating.finding import ellipse95
from dirmusic.locating.rules import LocatingRules
from pdpatrol.envs.scenario.base import weeks_between
from pdpatrol.missions.campaign.inspection import InspectionLog, LocatedFinding, join_findings, mean_position
from pdpatrol.missions.campaign.records import (
    LinearTrend,
    Observation,
    TrackedDischarge,
    Trend,
    TrendInterval,
    Verdict,
)
from pdpatrol.missions.campaign.source_level import NEAR_M, SourceLevel, floor_v, source_level, steps_near
from pdpatrol.missions.record.which_site import in_words, site_probabilities

FloatArray = NDArray[np.float64]

CONFIDENCE = 0.99
"""Confidence of intervals: with many sites and campaigns, one false alarm in twenty would be too many."""

MIN_DATES = 3
"""Smallest number of dates for a line with an interval."""

MIN_EXPECTED_PULSES = 50.0
"""Number of pulses that a discharge must have sent to places where they are detected for its site to count as
inspected. Assumed; 20 pulses confirm a finding, but not every pulse gives a bearing."""

MAX_CHANGE_DB_PER_WEEK = 3.0
"""Largest change per week that the interval of a constant discharge may include. Assumed; it is 12 dB in a month."""


def make_trend(inspections: Sequence[InspectionLog]) -> Trend:
    """Make the trend of a campaign.

    Args:
        inspections: At least one inspection, by date, all of one yard.
    """
    weeks = np.array([weeks_between(inspections[0].day, each.day) for each in inspections])
    floor = min(floor_v(each) for each in inspections)
    joined = join_findings([each.findings for each in inspections])
    discharges = sorted((_discharge(found, inspections, weeks, floor) for found in joined), key=_urgency)
    return Trend(
        scenario=str(inspections[0].log.meta["name"]),
        dates=tuple(each.day for each in inspections),
        runs=tuple(str(each.folder) for each in inspections),
        discharges=tuple(each.model_copy(update={"number": k}) for k, each in enumerate(discharges, start=1)),
    )


def _urgency(discharge: TrackedDischarge) -> tuple[bool, float]:
    """Return the sort key: discharges that are gone last, otherwise by growth, where a new one counts as growing."""
    growth = discharge.level.per_week.value if discharge.level else np.inf if discharge.status == "new" else 0.0
    return discharge.status == "gone", -growth


def _discharge(
    found: Mapping[int, LocatedFinding], inspections: Sequence[InspectionLog], weeks: FloatArray, floor: float
) -> TrackedDischarge:
    position_m, covariance_m2 = mean_position(found)
    levels = {k: source_level(inspections[k], found[k]) for k in sorted(found)}
    known = {k: level for k, level in levels.items() if level is not None}
    observations: list[Observation] = []
    for k, inspection in enumerate(inspections):
        is_absent = False
        if k not in found and known and np.isfinite(floor):
            nearest = known[min(known, key=lambda other: abs(other - k))]
            is_absent = _would_be_found(nearest, inspection, position_m, floor)
        observations.append(_observation(inspection, float(weeks[k]), found.get(k), levels.get(k), is_absent))
    level_db, level_std_db, rate_hz, log_rate_std = np.array([level[:4] for level in known.values()]).reshape(-1, 4).T
    at = weeks[list(known)]
    level = fit_line(at, level_db, level_std_db)
    presences = [each.presence for each in observations if each.presence != "not inspected"]
    yard = inspections[0].yard
    x, y, z = position_m.tolist()
    return TrackedDischarge(
        number=1,
        site="" if yard is None else in_words(site_probabilities(yard, position_m, covariance_m2)),
        position_m=(x, y, z),
        semi_major_m=ellipse95(covariance_m2[:2, :2]).semi_major_m,
        status="gone" if presences[-1] == "absent" else "new" if presences[0] == "absent" else "standing",
        verdict=_verdict(level),
        level=level,
        rate=None if inspections[0].is_field_data else fit_line(at, np.log(rate_hz), log_rate_std),
        observations=tuple(observations),
    )


def _would_be_found(level: SourceLevel, inspection: InspectionLog, position_m: FloatArray, floor: float) -> bool:
    """Return whether an inspection would have found a discharge of a given level and rate.

    This takes enough detected pulses from nearby, with lines of sight that spread as wide as confirmation requires.
    Field data cannot show it, because they contain only what triggered.
    """
    if inspection.is_field_data:
        return False
    near = steps_near(inspection, position_m)
    away_m = inspection.log.column("step", "pose")[near.step, :2] - position_m[:2]
    is_near = np.linalg.norm(away_m, axis=-1) <= NEAR_M
    is_detected = is_near & (level.level_db - near.loss_db >= 20 * np.log10(floor))
    if level.rate_hz * near.duration_s[is_detected].sum() < MIN_EXPECTED_PULSES:
        return False
    aspect_rad = np.arctan2(away_m[is_detected, 1], away_m[is_detected, 0])
    return bool(aperture(aspect_rad) >= LocatingRules().confirm_aperture_rad)


def _observation(
    inspection: InspectionLog, week: float, finding: LocatedFinding | None, level: SourceLevel | None, is_absent: bool
) -> Observation:
    z = float(norm.ppf(0.5 + 0.5 * CONFIDENCE))
    level_db = rate_hz = None
    if level:
        level_db = _interval(level.level_db, z * level.level_std_db)
        if not inspection.is_field_data:
            ratio = float(np.exp(min(z * level.log_rate_std, 20.0)))
            rate_hz = TrendInterval(value=level.rate_hz, lower=level.rate_hz / ratio, upper=level.rate_hz * ratio)
    return Observation(
        run=str(inspection.folder),
        date=inspection.day,
        week=week,
        presence="found" if finding else "absent" if is_absent else "not inspected",
        finding_id=finding.id if finding else None,
        is_confirmed=finding is not None and finding.is_confirmed,
        level_db=level_db,
        rate_hz=rate_hz,
        n_pulses=level.n_pulses if level else 0,
        n_looks=level.n_looks if level else 0,
    )


def _interval(value: float, half_width: float) -> TrendInterval:
    return TrendInterval(value=value, lower=value - half_width, upper=value + half_width)


def _verdict(level: LinearTrend | None) -> Verdict:
    if level is None:
        return "too few dates"
    slope = level.per_week
    if slope.lower > 0.0:
        return "grown"
    if slope.upper < 0.0:
        return "declined"
    return "constant" if max(-slope.lower, slope.upper) <= MAX_CHANGE_DB_PER_WEEK else "not clear"


def fit_line(week: FloatArray, value: FloatArray, std: FloatArray) -> LinearTrend | None:
    r"""Fit a line through values that have individual standard deviations and a common scatter.

    Inspections differ by more than the standard deviation :math:`s_i` of each. The scatter :math:`\tau` between them is
    the one for which the residuals have their expected size (Paule and Mandel 1982, J. Res. NBS 87),

    .. math:: \sum_i \frac{(y_i - a - b t_i)^2}{s_i^2 + \tau^2} = n - 2,

    or 0 if they are smaller. Because few residuals determine :math:`\tau` poorly, the interval of the slope takes the
    quantile of Student's t with n - 2 degrees of freedom.

    Args:
        week: Times, shape (n,).
        value: Values, shape (n,).
        std: Standard deviations of the values, > 0, shape (n,).

    Returns:
        The line with the interval of its slope; None for fewer than `MIN_DATES` different times.
    """
    if np.unique(week).size < MIN_DATES:
        return None
    design, n_free = np.column_stack([np.ones(week.size), week]), week.size - 2

    def fit_with(scatter2: float) -> Any:  # noqa: ANN401 - statsmodels wraps its results dynamically
        return WLS(value, design, weights=cast("Any", 1.0 / (std**2 + scatter2))).fit()

    def excess(scatter2: float) -> float:
        return float(np.square(fit_with(scatter2).wresid).sum()) - n_free

    largest = max(float(np.ptp(value)) ** 2, 1e-12) * week.size
    scatter2 = float(brentq(excess, 0.0, largest)) if excess(0.0) > 0.0 else 0.0  # pyright: ignore[reportArgumentType]
    fit = fit_with(scatter2)
    slope_std = float(np.sqrt(fit.normalized_cov_params[1, 1]))
    half_width = float(t.ppf(0.5 + 0.5 * CONFIDENCE, n_free)) * slope_std
    at_start, slope = fit.params.tolist()
    return LinearTrend(per_week=_interval(slope, half_width), at_start=at_start, scatter=float(np.sqrt(scatter2)))
