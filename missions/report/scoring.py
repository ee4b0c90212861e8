"""Scores of a mission against the truth: findings at the end, confirmations seen live, and all-clears."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from dirmusic.arrays import BoolArray, FloatArray
from dirmusic.locating.finding import log_density
from pdpatrol.envs.scenario.sources import SourceConfig
from pdpatrol.missions.planning.confirmation_probability import WINDOW_S
from pdpatrol.missions.record.log_contents import known_yard, true_yard
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.which_site import true_place
from pdpatrol.missions.report.encounters import encounters
from pdpatrol.missions.report.records import FindingRecord, ScoredSource, Scores, SiteInspections, SourceMatch

CUT_OFF_M = 2.0
"""Findings farther than this from every source are false; also the cut-off of OSPA."""

RIGHT_M = 1.0
"""Horizontal distance from a source within which a finding counts as right while the mission runs."""

WRONG_S = 2.0
"""Total time, in seconds, beyond which a finding shown as confirmed at a wrong place counts as a wrong confirmation."""

NEAR_M = 8.0
"""Horizontal distance within which a source must be active to make an all-clear false. Assumed."""

LEAST_PROBABILITY = 1e-6
"""Smallest probability in the log score of the site. Assumed; otherwise one probability of zero makes means infinite.
"""


def score_mission(
    log: MissionLog,
    findings: Sequence[FindingRecord],
    places: Mapping[int, Mapping[str, float]],
    inspection: SiteInspections | None,
) -> Scores | None:
    """Score a mission against the truth.

    Args:
        log: Log of the mission.
        findings: Confirmed findings at the end.
        places: Result of `site_probabilities` by id of the finding.
        inspection: Result of `inspect_sites`; None if it is not known.

    Returns:
        The scores; None if the truth is not known.
    """
    yard, known = true_yard(log), known_yard(log)
    if yard is None or known is None or "truth" not in log.meta:
        return None
    truths = log.meta["truth"]["sources"]
    configs = [SourceConfig.model_validate(config, strict=False) for config in log.meta["scenario"]["sources"]]
    true_m = np.array([source["position_m"] for source in truths]).reshape(-1, 3)
    found_m = np.array([finding.position_m for finding in findings]).reshape(-1, 3)
    partner, ospa_m = pair_findings(found_m, true_m)
    live = _score_live(log, true_m, np.array([_activity_s(config)[0] for config in configs]))
    sources: list[ScoredSource] = []
    for i, truth in enumerate(truths):
        site = true_place(yard, known, true_m[i])
        finding = findings[partner[i]] if i in partner else None
        sources.append(
            ScoredSource(
                name=truth["name"],
                true_position_m=tuple(true_m[i].tolist()),
                true_site=site,
                found=finding is not None,
                confirmed_s=live.confirmed_s[i],
                match=finding and _match(finding, true_m[i], places[finding.id], site),
            )
        )
    false_all_clears = None
    if inspection is not None:
        time_s, certified = log.column("step", "time_s"), inspection.names("inspected")
        away_m = np.linalg.norm(log.column("step", "true_pose")[:, np.newaxis, :2] - true_m[:, :2], axis=-1)
        is_missed = [not (np.linalg.norm((found_m - place_m)[:, :2], axis=-1) <= RIGHT_M).any() for place_m in true_m]
        false_all_clears = tuple(
            source.true_site
            for k, (source, truth, config) in enumerate(zip(sources, truths, configs, strict=True))
            if is_missed[k]
            and source.true_site in certified
            and _is_excluded(truth, config, time_s, away_m[:, k] <= NEAR_M, inspection)
        )
    return Scores(
        sources=tuple(sources),
        false_findings=len(findings) - len(partner),
        ospa_m=ospa_m,
        confirmations=live.n_confirmations,
        wrong_confirmations=live.n_wrong,
        wrong_s=live.wrong_s,
        false_all_clears=false_all_clears,
        moving=encounters(log),
    )


def pair_findings(found_m: FloatArray, true_m: FloatArray) -> tuple[dict[int, int], float]:
    """Pair findings and sources one to one by smallest total horizontal distance, with a cut-off of 2 m.

    Args:
        found_m: Positions of the findings, shape (n_findings, 3).
        true_m: Positions of the sources, shape (n_sources, 3).

    Returns:
        Index of the finding by that of the source, for each pair; and the OSPA distance with c = 2 m and p = 1: the
        mean over the larger set of the paired distances, where each unpaired member counts 2 m.

    References:
        Schuhmacher, Vo and Vo, "A consistent metric for performance evaluation of multi-object filters", 2008.
    """
    distance_m = np.linalg.norm((true_m[:, np.newaxis] - found_m)[..., :2], axis=-1)
    cost_m = np.minimum(distance_m, CUT_OFF_M)
    pairs = linear_sum_assignment(cost_m)
    total_m = cost_m[pairs].sum() + CUT_OFF_M * abs(len(found_m) - len(true_m))
    partner = {i: j for i, j in np.transpose(pairs).tolist() if distance_m[i, j] < CUT_OFF_M}
    return partner, float(total_m / max(len(found_m), len(true_m), 1))


def _match(finding: FindingRecord, true_m: FloatArray, places: Mapping[str, float], site: str) -> SourceMatch:
    """Compare a finding with its source.

    Log scores are minus the logarithm of the stated density at the true position, and of the stated probability of the
    true site (Gneiting and Raftery, "Strictly proper scoring rules, prediction, and estimation", 2007, section 4.1).
    """
    offset_m, covariance_m2 = finding.position_m - true_m, np.array(finding.covariance_m2)
    d2_2d, d2_3d = (float(offset_m[:n] @ np.linalg.solve(covariance_m2[:n, :n], offset_m[:n])) for n in (2, 3))
    return SourceMatch(
        finding_id=finding.id,
        error_m=float(np.hypot(*offset_m[:2])),
        height_error_m=float(offset_m[2]),
        mahalanobis2_2d=d2_2d,
        mahalanobis2_3d=d2_3d,
        log_score=-float(log_density(true_m, finding.position_m, covariance_m2)),
        right_site=site == next(iter(places)),
        site_log_score=-float(np.log(max(places.get(site, 0.0), LEAST_PROBABILITY))),
    )


class LiveScores(NamedTuple):
    """Scores of the confirmations that were shown while the mission ran.

    Attributes:
        n_confirmations: Number of findings that were confirmed at any time.
        n_wrong: Number of those that were shown as confirmed at a wrong place for more than `WRONG_S`.
        wrong_s: Total time for which findings were shown as confirmed at a wrong place.
        confirmed_s: For each source, the time at which a confirmed finding was first right and nearer to it than to any
            other source; None if never.
    """

    n_confirmations: int
    n_wrong: int
    wrong_s: float
    confirmed_s: list[float | None]


def _score_live(log: MissionLog, true_m: FloatArray, begin_s: FloatArray) -> LiveScores:
    """Score the findings shown as confirmed at any time; each row of the log holds until the next of its finding.

    A place is wrong if it is more than 1 m horizontally from every source that has been active until then.

    Args:
        log: Log of the mission.
        true_m: Positions of the sources, shape (n_sources, 3).
        begin_s: Times at which the sources become active, shape (n_sources,).
    """
    time_s, table = log.column("step", "time_s"), log.table("finding")
    order = np.lexsort((table["step"], table["id"]))
    number, shown_s = table["id"][order], time_s[table["step"][order]]
    is_last = np.append(number[1:] != number[:-1], True)[: number.size]
    until_s = np.where(is_last, time_s.max(initial=0.0), np.roll(shown_s, -1))
    own = table["state"][order] == "confirmed"
    number, shown_s, until_s, place_m = number[own], shown_s[own], until_s[own], table["position_m"][order][own]
    distance_m = np.linalg.norm((place_m[:, np.newaxis] - true_m)[..., :2], axis=-1)
    distance_m[shown_s[:, np.newaxis] < begin_s] = np.inf
    names, index = np.unique(number, return_inverse=True)
    is_right = distance_m <= RIGHT_M
    wrong_s = np.bincount(index, (until_s - shown_s) * ~is_right.any(axis=1), names.size)
    is_nearest = distance_m == distance_m.min(axis=1, initial=np.inf, keepdims=True)
    first_s = np.where(is_right & is_nearest, shown_s[:, np.newaxis], np.inf).min(axis=0, initial=np.inf)
    return LiveScores(
        n_confirmations=names.size,
        n_wrong=int((wrong_s > WRONG_S).sum()),
        wrong_s=float(wrong_s.sum()),
        confirmed_s=[float(first) if np.isfinite(first) else None for first in first_s],
    )


def _activity_s(config: SourceConfig) -> tuple[float, float]:
    """Return start and end of the activity of a source, without its pauses."""
    begin_s, end_s = config.active_s or (0.0, np.inf)
    if config.n_shots is not None:
        begin_s = max(begin_s, config.first_shot_s)
        end_s = min(end_s, config.first_shot_s + config.n_shots / config.pulse_rate_hz)
    return begin_s, end_s


def _is_excluded(
    truth: Mapping[str, Any], config: SourceConfig, time_s: FloatArray, is_near: BoolArray, inspection: SiteInspections
) -> bool:
    """Return whether an all-clear states that a source is not there.

    That is so if, averaged over the time for which the robot was near, it emits pulses of at least the stated level at
    least at the stated rate. Sources whose pauses are longer than a window are not meant, because they may pause then.

    Args:
        truth: The source as drawn.
        config: The source in the scenario.
        time_s: Times of all steps, shape (n_steps,).
        is_near: True for steps at which the robot was near, shape (n_steps,); without any, all count.
        inspection: The level and rate.
    """
    begin_s, end_s = _activity_s(config)
    start_db, drift_db = 20.0 * np.log10(truth["amplitude_v"]), config.drift_db_per_min * time_s / 60.0
    true_db, true_hz = np.full(time_s.shape, start_db), np.full(time_s.shape, truth["pulse_rate_hz"])
    for change in config.changes or ():
        later = time_s >= change.at_s
        if change.amplitude_db is not None:
            true_db[later] = start_db + change.amplitude_db
        if change.pulse_rate_hz is not None:
            true_hz[later] = change.pulse_rate_hz
    on_s, off_s = config.duty_s or (1.0, 0.0)
    is_strong = (time_s >= begin_s) & (time_s < end_s) & (true_db + drift_db >= inspection.level_db - 1e-9)
    mean_hz = (true_hz * is_strong)[is_near if is_near.any() else slice(None)].mean() * on_s / (on_s + off_s)
    return bool(off_s <= WINDOW_S and mean_hz >= inspection.rate_hz - 1e-9)
