"""What one mission, and what many of one variant, came to."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from envs import Scenario
from missions.record.bearing_error import bearing_rmse
from missions.record.mission_log import MissionLog
from missions.record.report import make_report

FloatArray = NDArray[np.float64]

CONFIDENCE = 0.95
RESAMPLES = 2000
"""Bootstrap resamples behind an interval."""


class MissionScore(NamedTuple):
    """One mission, scored against the truth.

    Attributes:
        bearing_rmse_rad: Root mean square error of the bearings that were taken in sight of the source; NaN if there
            were none, or if several sources make it unknown which one a bearing is of.
        n_sources: Sources in the yard.
        n_found: Of the sources, those with a confirmed finding within the cut-off.
        errors_m: Distances of those findings from their sources, shape (n_found,).
        confirmed_s: When they were confirmed, shape (n_found,).
        false_findings: Confirmed findings without a source.
    """

    bearing_rmse_rad: float
    n_sources: int
    n_found: int
    errors_m: tuple[float, ...]
    confirmed_s: tuple[float, ...]
    false_findings: int


class Interval(NamedTuple):
    """A figure with its 95 % interval; NaN where there is nothing to take it from."""

    value: float
    low: float
    high: float


class Score(NamedTuple):
    """Many missions of one variant.

    Attributes:
        bearing_rmse_deg: Root mean square over the missions.
        found: Share of all sources that were found.
        error_m: Median distance of the findings from their sources.
        confirmed_s: Median time until a source was confirmed.
        false_findings: In all missions together.
    """

    bearing_rmse_deg: Interval
    found: Interval
    error_m: Interval
    confirmed_s: Interval
    false_findings: int


def score_mission(log: MissionLog, scenario: Scenario) -> MissionScore:
    """Score a mission whose log holds the truth."""
    report = make_report(log, 0.0)
    found = [source for source in report["evaluation"]["sources"] if source["found"]]
    confirmed_s = {finding["id"]: finding["fixed_s"] for finding in report["findings"]}
    return MissionScore(
        bearing_rmse_rad=bearing_rmse(log, scenario),
        n_sources=len(report["evaluation"]["sources"]),
        n_found=len(found),
        errors_m=tuple(source["error_m"] for source in found),
        confirmed_s=tuple(confirmed_s[source["finding_id"]] for source in found),
        false_findings=report["evaluation"]["false_findings"],
    )


def summarise(missions: Sequence[MissionScore]) -> Score:
    """Figures of many missions, with intervals: Wilson's for the share, bootstrap over missions for the others."""
    n_sources, n_found = (sum(getattr(mission, name) for mission in missions) for name in ("n_sources", "n_found"))
    rmse_deg = np.degrees([mission.bearing_rmse_rad for mission in missions])
    return Score(
        bearing_rmse_deg=bootstrap_interval(rmse_deg[np.isfinite(rmse_deg)], _root_mean_square),
        found=share_interval(n_found, n_sources),
        error_m=bootstrap_interval(np.array([error for mission in missions for error in mission.errors_m]), np.median),
        confirmed_s=bootstrap_interval(
            np.array([at_s for mission in missions for at_s in mission.confirmed_s]), np.median
        ),
        false_findings=sum(mission.false_findings for mission in missions),
    )


def _root_mean_square(values: FloatArray, axis: int = -1) -> FloatArray:
    return np.sqrt(np.mean(np.square(values), axis=axis))


def share_interval(count: int, total: int) -> Interval:
    """A share with Wilson's interval."""
    from scipy.stats import binomtest

    if not total:
        return Interval(np.nan, np.nan, np.nan)
    low, high = binomtest(count, total).proportion_ci(CONFIDENCE, method="wilson")
    return Interval(count / total, float(low), float(high))


def bootstrap_interval(values: FloatArray, statistic: Callable[..., Any]) -> Interval:
    """A statistic of values, shape (n,), with its percentile bootstrap interval; none below two values."""
    from scipy.stats import bootstrap

    if values.size < 2:
        value = float(values[0]) if values.size else np.nan
        return Interval(value, np.nan, np.nan)
    low, high = bootstrap(
        (values,), statistic, n_resamples=RESAMPLES, confidence_level=CONFIDENCE, method="percentile", rng=0
    ).confidence_interval
    return Interval(float(statistic(values)), float(low), float(high))


def as_json(score: Score) -> dict[str, Any]:
    """A score as plain data, without NaN."""
    return json.loads(json.dumps(score._asdict()).replace("NaN", "null"))


def from_json(data: Mapping[str, Any]) -> Score:
    """A score from plain data, as `as_json` gives it, whatever else it holds."""
    intervals = {
        name: Interval(*(np.nan if value is None else value for value in data[name]))
        for name in ("bearing_rmse_deg", "found", "error_m", "confirmed_s")
    }
    return Score(**intervals, false_findings=data["false_findings"])
