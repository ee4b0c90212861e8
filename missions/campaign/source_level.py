"""Level and rate of a discharge in one inspection, with the effects of distance, gain and trigger removed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from statsmodels.duration.survfunc import SurvfuncRight

from dirmusic.locating.rules import AssignmentRules, CredibilityRules
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.missions.campaign.inspection import InspectionLog, LocatedFinding
from pdpatrol.sensing.radio.transmission import Sight

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

# The sensitivities below are those of weak sources in synthetic surveys, where half of the pulses from 9 m are missing.

NEAR_M = 10.0
"""Distance from which pulses are used. Measured: reflections bias the level by up to 1 dB within 10 m and by up to 4 dB
beyond 15 m. Without reflections, levels change by less than 0.4 dB between 7 and 20 m."""

NEAR_RATIO = 1.5
"""Distance from which pulses are used, over the least distance, where that is more than `NEAR_M`. Assumed; it only
matters for sources that the robot never approaches."""

LOOK_M = 1.0
"""Side of the squares of the ground within which pulses fade together. Assumed; levels change by less than 0.8 dB
between 0.5 and 2 m, and their standard deviation by a factor of 0.6 to 3."""

FLOOR_RATIO = 2.0
"""Strength from which all pulses are detected, over the weakest strength with a valid bearing. Assumed; levels
change by less than 0.5 dB at 1.5, and by 1 dB at 3, where too few pulses are left."""

CLIPPED_SHARE = 0.05
"""Share of clipped pulses above which a square is not used, because locating discards clipped pulses. Assumed; a source
without clipped pulses is not affected."""

MIN_PULSES = 20
"""Smallest number of pulses for a level; 20 pulses also confirm a finding."""

N_GROUPS = 12
"""Number of groups of squares in the jackknife. Assumed; with 24 the standard deviation of a level is 0.9 times as
large, with 6 up to 2.8 times."""

FADING_STD_DB = 2.0
"""Least standard deviation of the level in one square. Measured: 1 to 3 dB."""

ARRAY_STD_DB = 0.2
"""Standard deviation of the level by gain errors: 5 % in each of six elements."""

MIN_AT_RISK = 0.1
"""Share of the pulses that must be comparable at a level for the product-limit estimate to start there. Assumed;
nothing changes at 0.05, and levels of sources near the detection limit rise by 3 dB at 0.2."""

MIDDLE_HALF = (0.25, 0.75)
"""Quantiles between which levels are averaged: unlike the mean, robust to outliers, and unlike the median, continuous
when one of two clusters gains a few pulses."""


class SourceLevel(NamedTuple):
    """Level and rate of a discharge in one inspection.

    Attributes:
        level_db: Strength of the pulses at 1 m, dB over 1 V, mean of the middle half.
        level_std_db: Standard deviation of the level by fading, position and gains of the array.
        rate_hz: Pulses per second; pulses per pose for field data, where the waiting time is unknown.
        log_rate_std: Standard deviation of the natural logarithm of the rate.
        n_pulses: Number of pulses used.
        n_looks: Number of squares of the ground from which they were received.
    """

    level_db: float
    level_std_db: float
    rate_hz: float
    log_rate_std: float
    n_pulses: int
    n_looks: int


class NearSteps(NamedTuple):
    """Steps of an inspection with a place in line of sight and near.

    Attributes:
        step: Rows of the table `step`, shape (n,).
        look: Number of the square of the ground, in the order of the first visit, shape (n,).
        duration_s: Duration of each step, shape (n,); 1 for field data.
        loss_db: Loss by distance and gain, relative to a level at 1 m, shape (n,).
    """

    step: IntArray
    look: IntArray
    duration_s: FloatArray
    loss_db: FloatArray


def loss_db(inspection: InspectionLog, position_m: FloatArray, pose: FloatArray) -> FloatArray:
    """Compute the loss of strength by distance and gain, relative to 1 m.

    Args:
        inspection: Inspection with the array.
        position_m: Position of the source, world frame, shape (3,).
        pose: Poses of the robot, shape (n, 3).
    """
    path_m = position_m - np.column_stack([pose[:, :2], np.full(len(pose), inspection.array_height_m)])
    elevation_rad = np.arctan2(path_m[:, 2], np.linalg.norm(path_m[:, :2], axis=-1))
    azimuth_rad = np.arctan2(path_m[:, 1], path_m[:, 0]) - pose[:, 2]
    off_rad = azimuth_rad[:, np.newaxis] - inspection.manifold.boresights_rad
    gain = inspection.manifold.response_in_space(off_rad, elevation_rad[:, np.newaxis]).gain
    return 20 * np.log10(np.linalg.norm(path_m, axis=-1) / np.linalg.norm(gain, axis=-1))


def floor_v(inspection: InspectionLog) -> float:
    """Estimate the strength above which all pulses were detected; infinite without pulses."""
    bearing = inspection.log.table("bearing")
    if bearing["pulse"].size == 0:
        return np.inf
    strength_v = np.linalg.norm(inspection.log.column("pulse", "strengths_v"), axis=-1)
    weakest_v = float(np.median(bearing["std_rad"] * strength_v[bearing["pulse"]])) / CredibilityRules().max_std_rad
    return max(FLOOR_RATIO * weakest_v, float(np.quantile(strength_v, 0.01)))


def steps_near(inspection: InspectionLog, position_m: FloatArray) -> NearSteps:
    """Select the steps with a place in line of sight and near."""
    step = inspection.log.table("step")
    pose, time_s = step["pose"], step["time_s"]
    duration_s = np.ones(time_s.size) if inspection.is_field_data else np.diff(time_s, prepend=0.0)
    range_m = np.linalg.norm(pose[:, :2] - position_m[:2], axis=-1)
    in_sight = _is_in_sight(inspection, position_m, pose)
    near_m = max(NEAR_M, NEAR_RATIO * range_m[in_sight].min()) if in_sight.any() else 0.0
    rows = np.flatnonzero(in_sight & (range_m <= near_m))
    _, first, square = np.unique(np.floor(pose[rows, :2] / LOOK_M), axis=0, return_index=True, return_inverse=True)
    look = np.argsort(np.argsort(first))[np.asarray(square).ravel()]
    return NearSteps(rows, look, duration_s[rows], loss_db(inspection, position_m, pose[rows]))


def _is_in_sight(inspection: InspectionLog, position_m: FloatArray, pose: FloatArray) -> BoolArray:
    """Return whether a place is in line of sight by the map, shape (n,); True without a map."""
    if inspection.yard is None:
        return np.ones(len(pose), dtype=np.bool_)
    rules = AssignmentRules()
    places_m = np.column_stack([pose[:, :2], np.full(len(pose), inspection.array_height_m)])
    transmitted = Sight(surroundings_of(inspection.yard))(
        places_m, position_m, rules.surface_depth_m + rules.edge_margin_m
    )
    return transmitted >= 10 ** (-rules.clear_loss_db / 20)


def source_level(inspection: InspectionLog, finding: LocatedFinding) -> SourceLevel | None:
    """Estimate level and rate of a finding; None if too few of its pulses were received nearby in line of sight."""
    log = inspection.log
    near = _without_clipped(inspection, steps_near(inspection, finding.position_m))
    row_of_step = np.full(log.n_rows("step"), -1)
    row_of_step[near.step] = np.arange(near.step.size)
    association = log.table("association")
    pulse = association["pulse"][association["finding"] == finding.id]
    row = row_of_step[log.column("pulse", "step")[pulse]]
    pulse, row = pulse[row >= 0], row[row >= 0]
    strength_v = np.linalg.norm(log.column("pulse", "strengths_v")[pulse], axis=-1)
    level_db = 20 * np.log10(strength_v) + near.loss_db[row]
    min_level_db = 20 * np.log10(floor_v(inspection)) + near.loss_db[row]
    n_pulses = int((level_db >= min_level_db).sum())
    if n_pulses < MIN_PULSES:
        return None
    spent_s = np.bincount(near.look, near.duration_s)
    looks = np.unique(near.look)

    def estimate(left_out: IntArray) -> tuple[float, float]:
        """Estimate level and rate without some squares; each square has the same weight."""
        kept = ~np.isin(near.look[row], left_out)
        seconds = spent_s.sum() - spent_s[left_out].sum()
        weight = 1.0 / spent_s[near.look[row[kept]]]
        return _level_and_rate(level_db[kept], min_level_db[kept], weight, seconds)

    level, rate_hz = estimate(looks[:0])
    jackknife = np.array([estimate(group) for group in np.array_split(looks, min(N_GROUPS, looks.size))])
    level_spread_db, log_rate_spread = 0.0, 0.0
    if looks.size > 1:
        jackknife[:, 1] = np.log(np.maximum(jackknife[:, 1], 1e-9))
        variances = np.nanvar(jackknife, axis=0) * (len(jackknife) - 1)
        level_spread_db, log_rate_spread = np.sqrt(variances)
    fading_db = max(level_spread_db, FADING_STD_DB / np.sqrt(looks.size))
    position_db = _position_std_db(inspection, finding, log.column("step", "pose")[near.step])
    return SourceLevel(
        level_db=level,
        level_std_db=float(np.linalg.norm([fading_db, position_db, ARRAY_STD_DB])),
        rate_hz=rate_hz,
        log_rate_std=float(max(log_rate_spread, 1.0 / np.sqrt(n_pulses))),
        n_pulses=n_pulses,
        n_looks=looks.size,
    )


def _level_and_rate(
    level_db: FloatArray, min_level_db: FloatArray, weight: FloatArray, seconds: float
) -> tuple[float, float]:
    """Estimate the mean of the middle half of all levels, and the rate including pulses that were not detected."""
    levels, share = product_limit(level_db, min_level_db, weight)
    if levels.size == 0:
        return np.nan, np.nan
    within = np.diff(np.clip(np.append(0.0, share.cumsum()), *MIDDLE_HALF))
    seen_db = min_level_db[level_db >= np.maximum(min_level_db, levels[0])]
    share_above = np.append(share[::-1].cumsum()[::-1], 0.0)[np.searchsorted(levels, seen_db)]
    return float(within @ levels / within.sum()), float((1.0 / np.maximum(share_above, 1e-3)).sum() / seconds)


def product_limit(level_db: FloatArray, min_level_db: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Estimate the distribution of levels that are observed only above individual bounds (left truncation).

    This is the product-limit estimator for truncated data (Lynden-Bell 1971, MNRAS 155), computed as the survival
    function with delayed entry. It starts above the levels of the lower half at which fewer than `MIN_AT_RISK` of the
    pulses are comparable.

    Args:
        level_db: Observed levels, shape (n,).
        min_level_db: Least level that would have been observed in place of each, shape (n,).
        weight: Weight of each, shape (n,), independent of its level.

    Returns:
        Ascending levels and their probabilities, both of the same shape and empty without observations.
    """
    observed = level_db >= min_level_db
    level_db, min_level_db, weight = level_db[observed], min_level_db[observed], weight[observed]
    if level_db.size == 0:
        return level_db, weight
    survival = _survival(level_db, min_level_db, weight)
    below = np.cumsum(survival.n_events) - survival.n_events
    too_few = (below < 0.5 * weight.sum()) & (survival.n_risk < MIN_AT_RISK * weight.sum())
    if too_few.any():
        above = level_db > survival.surv_times[too_few][-1]
        if not above.any():
            return level_db[:0], weight[:0]
        survival = _survival(level_db[above], min_level_db[above], weight[above])
    share = -np.diff(survival.surv_prob, prepend=1.0)
    return np.asarray(survival.surv_times, dtype=np.float64), share / share.sum()


def _survival(level_db: FloatArray, min_level_db: FloatArray, weight: FloatArray) -> SurvfuncRight:
    entry = np.nextafter(min_level_db, -np.inf)  # a level equal to its bound is observed
    return SurvfuncRight(level_db, np.ones(level_db.size), entry=entry, freq_weights=weight)


def _without_clipped(inspection: InspectionLog, near: NearSteps) -> NearSteps:
    """Remove squares with more than `CLIPPED_SHARE` clipped pulses, unless that removes all."""
    pulse, n_steps = inspection.log.table("pulse"), inspection.log.n_rows("step")
    n_pulses = np.bincount(pulse["step"], minlength=n_steps)[near.step]
    n_clipped = np.bincount(pulse["step"], pulse["is_clipped"], minlength=n_steps)[near.step]
    is_clipped = np.bincount(near.look, n_clipped) > CLIPPED_SHARE * np.bincount(near.look, n_pulses)
    kept = ~is_clipped[near.look]
    if not kept.any():
        return near
    return NearSteps(near.step[kept], near.look[kept], near.duration_s[kept], near.loss_db[kept])


def _position_std_db(inspection: InspectionLog, finding: LocatedFinding, pose: FloatArray) -> float:
    """Return the standard deviation of the level by the position, from shifts along the axes of its ellipsoid."""
    variances, axes = np.linalg.eigh(finding.covariance_m2)
    shifts_m = (np.sqrt(np.maximum(variances, 0.0)) * axes).T
    here = loss_db(inspection, finding.position_m, pose)
    changes_db = [np.mean(loss_db(inspection, finding.position_m + shift_m, pose) - here) for shift_m in shifts_m]
    return float(np.linalg.norm(changes_db))
