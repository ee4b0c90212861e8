"""Trend of the discharges of a yard over repeated inspections: which are new, grown, or gone."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

from dirmusic.angles import aperture
from dirmusic.arrays import FloatArray
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
from pdpatrol.missions.campaign.source_level import SourceLevel, floor_db, source_level, steps_near
from pdpatrol.missions.record.which_site import in_words, site_probabilities

UPPER_QUANTILE = 0.995
"""Quantile at the upper end of 99 % intervals; 95 % would give too many false alarms over many sites and campaigns."""

MIN_EXPECTED_PULSES = 50.0
"""Expected number of detectable pulses from which the site of a discharge counts as inspected. Assumed; 20 pulses
confirm a finding, but not every pulse gives a bearing."""

RELEVANT_DB_PER_WEEK = 1.0
"""Growth of the level that matters, by default: at 1 dB a week the amplitude doubles in six weeks. Assumed; no standard
states a limit. A discharge is constant only if its interval excludes growth and decline by this much (a test of
equivalence; Schuirmann 1987, J. Pharmacokinet. Biopharm. 15)."""

LEVEL_SCATTER_DB, RATE_SCATTER = 0.8, 0.15
"""Typical standard deviation between inspections of the level, and of the logarithm of the rate, in addition to that
of each value. Assumed: simulated campaigns scatter by 0.5 dB, and weather and voltage add to it. Matters with few
dates: at three, half the value makes intervals a quarter narrower."""

LOG_SCATTER_STD = 0.8
"""Standard deviation of the logarithm of the scatter between discharges. Assumed: 95 % lie within a factor of 5 of the
typical scatter, so that outliers widen the interval."""


def make_trend(inspections: Sequence[InspectionLog], relevant_db_per_week: float = RELEVANT_DB_PER_WEEK) -> Trend:
    """Make the trend of a campaign.

    Args:
        inspections: Inspections of one yard in order of date, at least one.
        relevant_db_per_week: Growth of the level that matters, > 0; a constant discharge excludes it.
    """
    weakest_db = min(floor_db(each) for each in inspections)
    joined = join_findings([each.findings for each in inspections])
    relevant_db = relevant_db_per_week
    discharges = sorted((_discharge(found, inspections, weakest_db, relevant_db) for found in joined), key=_urgency)
    return Trend(
        scenario=inspections[0].name,
        dates=tuple(each.day for each in inspections),
        runs=tuple(str(each.folder) for each in inspections),
        relevant_db_per_week=relevant_db_per_week,
        discharges=tuple(each.model_copy(update={"number": k}) for k, each in enumerate(discharges, start=1)),
    )


def _urgency(discharge: TrackedDischarge) -> tuple[bool, float]:
    """Return the sort key: discharges that are gone last, otherwise by growth, where a new one counts as growing."""
    growth = discharge.level.per_week.value if discharge.level else np.inf if discharge.status == "new" else 0.0
    return discharge.status == "gone", -growth


def _discharge(
    found: Mapping[int, LocatedFinding], inspections: Sequence[InspectionLog], weakest_db: float, relevant_db: float
) -> TrackedDischarge:
    """Describe a discharge from its findings in some of the inspections.

    Args:
        found: Findings by the index of their inspection.
        inspections: All inspections.
        weakest_db: Strength above which the most sensitive inspection detected all pulses, dB relative to 1 V.
        relevant_db: Growth per week that matters.
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
    level_line = fit_line(week, level_db, level_std_db, LEVEL_SCATTER_DB)
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
        verdict=judge(level_line, relevant_db),
        level=level_line,
        rate=None if inspections[0].is_field_data else fit_line(week, log_rate, log_rate_std, RATE_SCATTER),
        observations=tuple(observations),
    )


def judge(level: LinearTrend | None, relevant_db_per_week: float) -> Verdict:
    """Return the change of the level of a discharge; "constant" excludes growth and decline that matter."""
    if level is None:
        return "too few dates"
    lower, upper = level.per_week.lower, level.per_week.upper
    if lower > 0.0 or upper < 0.0:
        return "grown" if lower > 0.0 else "declined"
    return "constant" if max(-lower, upper) < relevant_db_per_week else "not known"


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


def fit_line(week: FloatArray, value: FloatArray, std: FloatArray, scatter: float) -> LinearTrend | None:
    r"""Fit a line through values that have individual standard deviations and a common scatter.

    Inspections differ by more than the standard deviation :math:`s_i` of each. The scatter :math:`\tau` between them
    has a log-normal prior, because few residuals determine it poorly. For each :math:`\tau`, the slope is normally
    distributed about that of the least squares with weights :math:`1 / (s_i^2 + \tau^2)`, and the likelihood of
    :math:`\tau`, integrated over the line, weighs these distributions (Gelman et al., Bayesian Data Analysis, 3rd ed.,
    section 5.4).

    Args:
        week: Times, shape (n,).
        value: Values, shape (n,).
        std: Standard deviations of the values, > 0, shape (n,).
        scatter: Median of the prior of the scatter.

    Returns:
        The line with the interval of its slope; None for fewer than three different times.
    """
    if np.unique(week).size < 3:
        return None
    off = np.linspace(-3.0, 3.5, 40)  # of the logarithm of the scatter from its median, in standard deviations
    scatters = scatter * np.exp(LOG_SCATTER_STD * off)[:, np.newaxis]
    weight = 1.0 / (np.square(std) + np.square(scatters))  # (40, n)
    total = weight.sum(axis=1)
    middle, mean = weight @ week / total, weight @ value / total
    since = week - middle[:, np.newaxis]
    information = (weight * np.square(since)).sum(axis=1)
    slope = (weight * since * value).sum(axis=1) / information
    residual = value - mean[:, np.newaxis] - slope[:, np.newaxis] * since
    log_likelihood = 0.5 * (np.log(weight) - weight * np.square(residual)).sum(axis=1) - 0.5 * np.log(
        total * information
    )
    share = np.exp(log_likelihood - log_likelihood.max() - 0.5 * np.square(off))
    share /= share.sum()
    slope_std, value_of_slope = 1.0 / np.sqrt(information), float(share @ slope)
    far = 10.0 * float(slope_std.max() + np.ptp(slope))

    def quantile(probability: float) -> float:
        def excess(at: float) -> float:
            return float(share @ norm.cdf(at, slope, slope_std)) - probability

        return float(brentq(excess, value_of_slope - far, value_of_slope + far))  # pyright: ignore[reportArgumentType]

    return LinearTrend(
        per_week=TrendInterval(
            value=value_of_slope, lower=quantile(1.0 - UPPER_QUANTILE), upper=quantile(UPPER_QUANTILE)
        ),
        at_start=float(share @ (mean - slope * middle)),
        scatter=float(share @ scatters[:, 0]),
    )
