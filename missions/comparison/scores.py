"""What one mission, and what many of one variant, came to."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from envs import Scenario
from missions.record.bearing_error import bearing_rmse
from missions.record.mission_log import MissionLog
from missions.record.report import make_report
from missions.sweep.results.intervals import Interval, bootstrap_interval, root_mean_square, share_interval


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
        bearing_rmse_deg=bootstrap_interval(rmse_deg[np.isfinite(rmse_deg)], root_mean_square),
        found=share_interval(n_found, n_sources),
        error_m=bootstrap_interval(np.array([error for mission in missions for error in mission.errors_m]), np.median),
        confirmed_s=bootstrap_interval(
            np.array([at_s for mission in missions for at_s in mission.confirmed_s]), np.median
        ),
        false_findings=sum(mission.false_findings for mission in missions),
    )


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
