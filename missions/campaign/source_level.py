"""Level and rate of a discharge in one inspection, with the effects of distance, gain and trigger removed."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from statsmodels.duration.survfunc import SurvfuncRight

from dirmusic.arrays import BoolArray, FloatArray
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.missions.campaign.inspection import InspectionLog, LocatedFinding
from pdpatrol.missions.record.finding_pulses import loss_db
from pdpatrol.sensing.radio.transmission import Sight

# The sensitivities below were measured for weak sources in synthetic surveys, where half of the pulses sent from 9 m
# away are not detected.

NEAR_M = 10.0
"""Largest distance at which pulses are used. Measured: reflections bias the level by up to 1 dB within 10 m and by up
to 4 dB beyond 15 m. Without reflections, levels change by less than 0.4 dB between 7 and 20 m."""

DEPTH_M, CLEAR_TRANSMISSION = 1.1, 10 ** (-3.0 / 20.0)
"""Depth in front of a position within which equipment is ignored, and least transmission of the direct path. Assumed; a
loss of up to 3 dB leaves the direct path the strongest one."""

SQUARE_M = 1.0
"""Side of the squares of ground within which all pulses fade alike. Assumed; levels change by less than 0.8 dB between
0.5 and 2 m, and their standard deviation by a factor of 0.6 to 3."""

COMPLETE_STD_RAD = np.radians(6.0)
"""Standard deviation of a bearing by noise, below which all pulses are strong enough to be detected and associated.
Assumed; levels change by less than 0.5 dB at 8 degrees, and by 1 dB at 4, where too few pulses remain."""

CLIPPED_SHARE = 0.05
"""Share of clipped pulses above which a square is not used, because locating discards clipped pulses. Assumed; a source
without clipped pulses is not affected."""

FADING_STD_DB = 2.0
"""Smallest standard deviation of the level in one square. Measured: 1 to 3 dB."""

ARRAY_STD_DB = 0.2
"""Standard deviation of the level due to gain errors of 5 % in each of six elements."""

MIN_AT_RISK = 0.1
"""Share of the pulses that must be comparable at a level for the product-limit estimate to start there. Assumed;
results do not change at 0.05, and levels of sources near the detection limit rise by 3 dB at 0.2."""


class SourceLevel(NamedTuple):
    """Level and rate of a discharge in one inspection.

    Attributes:
        level_db: Strength of the pulses at 1 m, dB relative to 1 V, interquartile mean. Close to the median, the level
            of a `Finding`, but from comparable pulses only: near, in sight, and above the trigger in all inspections.
        level_std_db: Standard deviation of the level due to fading and the errors of position and array gains.
        log_rate: Natural logarithm of the pulses per second; per pose for field data, whose waiting time is unknown.
        log_rate_std: Standard deviation of `log_rate`.
        n_pulses: Number of pulses used.
    """

    level_db: float
    level_std_db: float
    log_rate: float
    log_rate_std: float
    n_pulses: int


def _array_positions_m(inspection: InspectionLog, pose: FloatArray) -> FloatArray:
    return np.column_stack([pose[:, :2], np.full(len(pose), inspection.array_height_m)])


def floor_db(inspection: InspectionLog) -> float:
    """Estimate the strength above which all pulses were detected, dB relative to 1 V; infinite without pulses."""
    strength_v, std_rad = inspection.pulses[["strength_v", "std_rad"]].to_numpy().T
    if np.isnan(std_rad).all():
        return np.inf
    complete_v = np.nanmedian(std_rad * strength_v) / COMPLETE_STD_RAD
    return 20 * float(np.log10(max(complete_v, np.quantile(strength_v, 0.01))))


def steps_near(inspection: InspectionLog, position_m: FloatArray) -> pd.DataFrame:
    """Select the steps at which the robot is near a position and, according to the map, has a line of sight to it.

    Returns:
        Table indexed by step, with the columns `square`, number of the square of ground in order of the first visit;
        `duration_s`, 1 for field data; `loss_db`, as returned by the function of this name; and `aspect_rad`, direction
        from the position to the robot.
    """
    pose, duration_s = inspection.pose, np.diff(inspection.time_s, prepend=0.0)
    away_m = pose[:, :2] - position_m[:2]
    is_near = np.linalg.norm(away_m, axis=-1) <= NEAR_M
    if inspection.yard is not None:
        sight = Sight(surroundings_of(inspection.yard))
        is_near &= sight(_array_positions_m(inspection, pose), position_m, DEPTH_M) >= CLEAR_TRANSMISSION
    steps = pd.DataFrame(
        {
            "duration_s": 1.0 if inspection.is_field_data else duration_s,
            "aspect_rad": np.arctan2(away_m[:, 1], away_m[:, 0]),
            "loss_db": loss_db(inspection.manifold, inspection.array_height_m, position_m, pose),
        }
    )[is_near]
    squares = np.floor(pose[is_near, :2] / SQUARE_M).T
    return steps.assign(square=steps.groupby(list(squares), sort=False).ngroup())


def source_level(inspection: InspectionLog, finding: LocatedFinding) -> SourceLevel | None:
    """Estimate level and rate of a finding; None if too few of its pulses were received nearby in line of sight."""
    near: Any = steps_near(inspection, finding.position_m)  # pyright does not know the types of columns
    pulses: Any = inspection.pulses.join(near, on="step", how="inner")
    is_clipped = pulses.groupby("square")["is_clipped"].mean() > CLIPPED_SHARE
    unclipped = near[~near["square"].isin(is_clipped.index[is_clipped])]
    near = near if unclipped.empty else unclipped
    pulses = pulses[(pulses["finding"] == finding.id) & pulses["square"].isin(near["square"])]
    level_db = 20 * np.log10(pulses["strength_v"]) + pulses["loss_db"]
    pulses = pulses.assign(level_db=level_db, least_db=floor_db(inspection) + pulses["loss_db"])
    pulses = pulses[pulses["level_db"] >= pulses["least_db"]]
    if len(pulses) < 20:  # assumed; fewer give no reliable quantiles
        return None
    spent_s = near.groupby("square")["duration_s"].sum()
    squares = spent_s.index.to_list()

    def estimate(left_out: Sequence[int]) -> tuple[float, float]:
        """Estimate level and logarithm of the rate without some squares; each square has the same weight.

        The level is the interquartile mean of all levels: robust to outliers, unlike the mean, and continuous when one
        of two clusters gains a few pulses, unlike the median. The rate includes pulses that were not detected.
        """
        kept = pulses[~pulses["square"].isin(left_out)]
        if kept.empty:
            return np.nan, np.nan
        level_db, least_db = kept[["level_db", "least_db"]].to_numpy().T
        levels, share = product_limit(level_db, least_db, 1.0 / spent_s[kept["square"]].to_numpy())
        within = np.diff(np.clip(np.append(0.0, share.cumsum()), 0.25, 0.75))
        share_above = np.append(share[::-1].cumsum()[::-1], 0.0)
        seen_above = share_above[np.searchsorted(levels, least_db[level_db >= levels[0]])]
        n_pulses = (1.0 / np.maximum(seen_above, 1e-3)).sum()
        return float(within @ levels / within.sum()), float(np.log(n_pulses / spent_s.drop(left_out).sum()))

    level_db, log_rate = estimate([])
    fading_db = log_rate_std = 0.0
    if len(squares) > 1:
        # Assumed: 12 groups. With 24 the standard deviation of a level is 0.9 times as large, with 6 up to 2.8 times.
        jackknife = [estimate(group.tolist()) for group in np.array_split(squares, min(12, len(squares)))]
        fading_db, log_rate_std = np.sqrt((len(jackknife) - 1) * np.nanvar(jackknife, axis=0)).tolist()
    fading_db = max(fading_db, FADING_STD_DB / np.sqrt(len(squares)))
    position_db = _position_std_db(inspection, finding, inspection.pose[near.index])
    return SourceLevel(
        level_db=level_db,
        level_std_db=float(np.linalg.norm([fading_db, position_db, ARRAY_STD_DB])),
        log_rate=log_rate,
        log_rate_std=max(log_rate_std, 1.0 / np.sqrt(len(pulses))),
        n_pulses=len(pulses),
    )


def product_limit(level_db: FloatArray, least_db: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Estimate the distribution of levels that are observed only above individual bounds (left truncation).

    This is the product-limit estimator for truncated data (Lynden-Bell 1971, MNRAS 155), computed as the survival
    function with delayed entry. It starts above the levels of the lower half at which fewer than `MIN_AT_RISK` of the
    pulses are comparable.

    Args:
        level_db: Observed levels, shape (n,), n >= 1.
        least_db: Lowest level at which each would still have been observed, shape (n,).
        weight: Weight of each, independent of its level, shape (n,).

    Returns:
        Ascending levels and their probabilities, both of the same shape.
    """
    entry = np.nextafter(least_db, -np.inf)  # a level equal to its bound is observed

    def fit(rows: BoolArray) -> SurvfuncRight:
        return SurvfuncRight(level_db[rows], np.ones(rows.sum()), entry=entry[rows], freq_weights=weight[rows])

    survival = fit(np.ones(level_db.size, dtype=np.bool_))
    below = np.cumsum(survival.n_events) - survival.n_events
    too_few = (below < 0.5 * weight.sum()) & (survival.n_risk < MIN_AT_RISK * weight.sum())
    if too_few.any():
        survival = fit(level_db > survival.surv_times[too_few][-1])
    share = -np.diff(survival.surv_prob, prepend=1.0)
    return np.asarray(survival.surv_times, dtype=np.float64), share / share.sum()


def _position_std_db(inspection: InspectionLog, finding: LocatedFinding, pose: FloatArray) -> float:
    """Return the standard deviation of the level due to the position error, from shifts along the ellipsoid's axes."""
    variances, axes = np.linalg.eigh(finding.covariance_m2)
    shifts_m = (np.sqrt(np.maximum(variances, 0.0)) * axes).T
    here, *shifted = (
        loss_db(inspection.manifold, inspection.array_height_m, finding.position_m + shift_m, pose)
        for shift_m in (np.zeros(3), *shifts_m)
    )
    changes_db = [np.mean(each - here) for each in shifted]
    return float(np.linalg.norm(changes_db))
