"""Trend of the discharges of a yard over repeated inspections: which are new, grown, or gone."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm, t

from dirmusic.angles import aperture
from dirmusic.arrays import FloatArray
from dirmusic.locating.finding import ellipse95
from dirmusic.locating.rules import LocatingRules
from pdpatrol.envs.scenario.base import weeks_between
from pdpatrol.missions.campaign.inspection import InspectionLog, LocatedFinding, join_findings, mean_position
from pdpatrol.missions.campaign.records import LinearTrend, Observation, TrackedDischarge, Trend, TrendInterval
from pdpatrol.missions.campaign.source_level import SourceLevel, floor_db, source_level, steps_near
from pdpatrol.missions.record.which_site import in_words, site_probabilities

UPPER_QUANTILE = 0.995
"""Quantile at the upper end of 99 % intervals; 95 % would give too many false alarms over many sites and campaigns."""

MIN_EXPECTED_PULSES = 50.0
"""Expected number of detectable pulses from which the site of a discharge counts as inspected. Assumed; 20 pulses
confirm a finding, but not every pulse gives a bearing."""

MAX_CHANGE_DB_PER_WEEK = 3.0
"""Largest change per week that the interval of a constant discharge may include. Assumed; equal to 12 dB in a month."""


def make_trend(inspections: Sequence[InspectionLog]) -> Trend:
    """Make the trend of a campaign.

    Args:
        inspections: Inspections of one yard in order of date, at least one.
    """
    weakest_db = min(floor_db(each) for each in inspections)
    joined = join_findings([each.findings for each in inspections])
    discharges = sorted((_discharge(found, inspections, weakest_db) for found in joined), key=_urgency)
    return Trend(
        scenario=inspections[0].name,
        dates=tuple(each.day for each in inspections),
        runs=tuple(str(each.folder) for each in inspections),
        discharges=tuple(each.model_copy(update={"number": k}) for k, each in enumerate(discharges, start=1)),
    )


def _urgency(discharge: TrackedDischarge) -> tuple[bool, float]:
    """Return the sort key: discharges that are gone last, otherwise by growth, where a new one counts as growing."""
    growth = discharge.level.per_week.value if discharge.level else np.inf if discharge.status == "new" else 0.0
    return discharge.status == "gone", -growth


def _discharge(
    found: Mapping[int, LocatedFinding], inspections: Sequence[InspectionLog], weakest_db: float
) -> TrackedDischarge:
    """Describe a discharge from its findings in some of the inspections.

    Args:
        found: Findings by the index of their inspection.
        inspections: All inspections.
        weakest_db: Strength above which the most sensitive inspection detected all pulses, dB relative to 1 V.
    """
    position_m, covariance_m2 = mean_position(found.values())
    levels = {k: level for k in sorted(found) if (level := source_level(inspections[k], found[k])) is not None}
    ratio = float(norm.ppf(UPPER_QUANTILE))  # half-width of the interval over the standard deviation
    observations = list[Observation]()
    for k, inspection in enumerate(inspections):
        finding, level, presence = found.get(k), levels.get(k), "found"
        if finding is None:
            nearest = min(levels, key=lambda other, k=k: abs(other - k), default=None)
            is_absent = nearest is not None and _would_be_found(levels[nearest], inspection, position_m, weakest_db)
            presence = "absent" if is_absent else "not inspected"
        observations.append(
            Observation(
                date=inspection.day,
                presence=presence,
                finding_id=finding.id if finding else None,
                is_confirmed=finding is not None and finding.state == "confirmed",
                level_db=level and _interval(level.level_db, ratio * level.level_std_db),
                rate_hz=None
                if level is None or inspection.is_field_data
                else _interval(level.log_rate, ratio * level.log_rate_std, math.exp),
                n_pulses=level.n_pulses if level else 0,
            )
        )
    week = np.array([weeks_between(inspections[0].day, inspections[k].day) for k in levels])
    level_db, level_std_db, log_rate, log_rate_std, _ = np.array(list(levels.values())).reshape(-1, 5).T
    level_line, verdict = fit_line(week, level_db, level_std_db), "too few dates"
    if level_line is not None:
        lower, upper = level_line.per_week.lower, level_line.per_week.upper
        is_constant = max(-lower, upper) <= MAX_CHANGE_DB_PER_WEEK
        verdict = "grown" if lower > 0 else "declined" if upper < 0 else "constant" if is_constant else "not clear"
    presences = [each.presence for each in observations if each.presence != "not inspected"]
    x, y, z = position_m.tolist()
    yard, site = inspections[0].yard, f"{x:.1f}, {y:.1f}, {z:.1f} m"
    if yard:
        site = in_words(site_probabilities(yard, position_m, covariance_m2, inspections[0].map_accuracy_m))
    return TrackedDischarge(
        number=1,
        site=site,
        position_m=(x, y, z),
        semi_major_m=ellipse95(covariance_m2[:2, :2]).semi_major_m,
        status="gone" if presences[-1] == "absent" else "new" if presences[0] == "absent" else "standing",
        verdict=verdict,
        level=level_line,
        rate=None if inspections[0].is_field_data else fit_line(week, log_rate, log_rate_std),
        observations=tuple(observations),
    )


def _would_be_found(level: SourceLevel, inspection: InspectionLog, position_m: FloatArray, weakest_db: float) -> bool:
    """Return whether an inspection would have found a discharge of a given level and rate.

    It would if enough of its pulses were detectable nearby, over the aperture that confirmation requires. Field data
    cannot show this, because they contain only poses at which a pulse triggered the receiver.
    """
    near: Any = steps_near(inspection, position_m)
    detecting = near[level.level_db - near["loss_db"] >= weakest_db]
    is_enough = math.exp(level.log_rate) * detecting["duration_s"].sum() >= MIN_EXPECTED_PULSES
    return bool(
        not inspection.is_field_data
        and is_enough
        and aperture(detecting["aspect_rad"]) >= LocatingRules().confirm_aperture_rad
    )


def _interval(value: float, half_width: float, scale: Callable[[float], float] = float) -> TrendInterval:
    """Make a symmetric interval, and convert its value and ends."""
    return TrendInterval(value=scale(value), lower=scale(value - half_width), upper=scale(value + half_width))


def fit_line(week: FloatArray, value: FloatArray, std: FloatArray) -> LinearTrend | None:
    r"""Fit a line through values that have individual standard deviations and a common scatter.

    Inspections differ by more than the standard deviation :math:`s_i` of each. The scatter :math:`\tau` between them is
    the one for which the residuals have their expected size (Paule and Mandel 1982, J. Res. NBS 87),

    .. math:: \sum_i \frac{(y_i - a - b t_i)^2}{s_i^2 + \tau^2} = n - 2,

    or 0 if the residuals are smaller than that. Because few residuals determine :math:`\tau` poorly, the interval of
    the slope takes the quantile of Student's t with n - 2 degrees of freedom.

    Args:
        week: Times, shape (n,).
        value: Values, shape (n,).
        std: Standard deviations of the values, > 0, shape (n,).

    Returns:
        The line with the interval of its slope; None for fewer than three different times.
    """
    if np.unique(week).size < 3:
        return None
    n_free = week.size - 2

    def excess(scatter2: float) -> float:
        weight = 1.0 / np.sqrt(std**2 + scatter2)
        line = np.polyfit(week, value, 1, w=weight)
        return float(np.square(weight * (value - np.polyval(line, week))).sum()) - n_free

    largest = max(float(np.ptp(value)) ** 2, 1e-12) * week.size
    scatter2 = float(brentq(excess, 0.0, largest)) if excess(0.0) > 0.0 else 0.0  # pyright: ignore[reportArgumentType]
    line, covariance = np.polyfit(week, value, 1, w=1.0 / np.sqrt(std**2 + scatter2), cov="unscaled")
    half_width = float(t.ppf(UPPER_QUANTILE, n_free) * np.sqrt(covariance[0, 0]))
    slope, at_start = line.tolist()
    return LinearTrend(per_week=_interval(slope, half_width), at_start=at_start, scatter=float(np.sqrt(scatter2)))
