"""What one mission of a sweep came to: one row of a dataset."""

from __future__ import annotations

import json
from typing import Literal, NamedTuple

import numpy as np
import pyarrow as pa

from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.record.log_contents import bearing_rmse
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report, path_length_m
from pdpatrol.missions.sweep.plan import MissionJob

Status = Literal["finished", "failed", "hung", "out of memory", "died"]

SCHEMA = pa.schema(
    [
        pa.field("order", pa.int32()),
        pa.field("key", pa.string()),
        pa.field("suite", pa.string()),
        pa.field("level", pa.string()),
        pa.field("scenario", pa.string()),
        pa.field("scenario_digest", pa.string()),
        pa.field("policy", pa.string()),
        pa.field("settings", pa.string()),
        pa.field("seed", pa.int64()),
        pa.field("status", pa.string()),
        pa.field("error", pa.string()),
        pa.field("n_sources", pa.int32()),
        pa.field("n_found", pa.int32()),
        pa.field("false_findings", pa.int32()),
        pa.field("errors_m", pa.list_(pa.float64())),
        pa.field("height_errors_m", pa.list_(pa.float64())),
        pa.field("confirmed_s", pa.list_(pa.float64())),
        pa.field("n_in_ellipse", pa.int32()),
        pa.field("n_right_site", pa.int32()),
        pa.field("ospa_m", pa.float64()),
        pa.field("bearing_rmse_rad", pa.float64()),
        pa.field("distance_m", pa.float64()),
        pa.field("found_all_m", pa.float64()),
        pa.field("shortest_m", pa.float64()),
        pa.field("sim_time_s", pa.float64()),
        pa.field("contacts", pa.int32()),
        pa.field("waypoints_missed", pa.int32()),
        pa.field("wall_time_s", pa.float64()),
        pa.field("peak_memory_mb", pa.float64()),
    ]
)
"""Columns of a dataset, in the order of `MissionRow`."""

MEASURED = ("wall_time_s", "peak_memory_mb")
"""Columns that differ between two runs of one mission."""


class MissionRow(NamedTuple):
    """One mission of a sweep.

    Attributes:
        order: Its number in the sweep.
        key: As of `plan.MissionJob`.
        suite: Version and checksum of the suite; empty for any other scenario.
        level: Of the suite; empty for any other scenario.
        scenario: Its name.
        scenario_digest: SHA-256 of it with its settings; `scenarios.parquet` of the dataset holds it whole.
        policy: Who drove.
        settings: What the sweep set in the scenario, as JSON.
        seed: Of the mission.
        status: `finished`; `failed`, it raised; `hung`, it took longer than allowed; `out of memory`; or `died`, its
            process ended again and again. Whatever is not finished has no figures: None and 0.
        error: What went wrong, with the traceback; empty if nothing did.
        n_sources: Sources in the yard.
        n_found: Of the sources, those with a confirmed finding within the cut-off of
            `pdpatrol.missions.report.scoring`.
        false_findings: Confirmed findings without a source.
        errors_m: Distances of the paired findings from their sources, on plan.
        height_errors_m: How far the paired findings are above their sources.
        confirmed_s: When those were confirmed.
        n_in_ellipse: How many of the sources lie in the 95 % ellipse of their finding.
        n_right_site: How many of the found sources have the right site, as of `pdpatrol.missions.report.scoring`.
        ospa_m: Distance between findings and sources as sets, as of `pdpatrol.missions.report.scoring`.
        bearing_rmse_rad: Root mean square error of the bearings in sight of a single source; None if there were none.
        distance_m: Driven.
        found_all_m: Driven by the time when the last source was confirmed; None if one was not, or there are none.
        shortest_m: Shortest way from the dock to within the scenario's `standoff_m` of each source, as one would drive
            who knows them; None if there are none, or one cannot be come near to.
        sim_time_s: Simulated.
        contacts: How often the robot touched something.
        waypoints_missed: Waypoints that were not visited.
        wall_time_s: That the mission took.
        peak_memory_mb: Largest resident memory of its process so far.
    """

    order: int
    key: str
    suite: str
    level: str
    scenario: str
    scenario_digest: str
    policy: str
    settings: str
    seed: int
    status: Status
    error: str
    n_sources: int = 0
    n_found: int = 0
    false_findings: int = 0
    errors_m: tuple[float, ...] = ()
    height_errors_m: tuple[float, ...] = ()
    confirmed_s: tuple[float, ...] = ()
    n_in_ellipse: int = 0
    n_right_site: int = 0
    ospa_m: float | None = None
    bearing_rmse_rad: float | None = None
    distance_m: float | None = None
    found_all_m: float | None = None
    shortest_m: float | None = None
    sim_time_s: float | None = None
    contacts: int = 0
    waypoints_missed: int = 0
    wall_time_s: float | None = None
    peak_memory_mb: float | None = None

    @classmethod
    def of_failure(cls, job: MissionJob, status: Status, error: str) -> MissionRow:
        """A mission that came to nothing."""
        return cls(*_identity(job), status, error)

    @classmethod
    def of_log(cls, job: MissionJob, log: MissionLog, wall_time_s: float, peak_memory_mb: float) -> MissionRow:
        """A mission that ran to its end."""
        report = make_report(log, wall_time_s)
        evaluation, step = report.scores, log.table("step")
        sources, matches = evaluation.sources, evaluation.matches
        findings = {finding.id: finding for finding in report.findings}
        confirmed_s = tuple(at_s for match in matches if (at_s := findings[match.finding_id].confirmed_s) is not None)
        has_found_all = bool(sources) and len(matches) == len(sources)
        sources_m = [np.array(source.true_position_m[:2]) for source in sources]
        driven_m = path_length_m(step["true_pose"])
        shortest_m = SiteMap(job.scenario, job.scenario.yard).shortest_tour(sources_m, job.scenario.task.standoff_m)
        bearing_rmse_rad = bearing_rmse(log, job.scenario)
        return cls(
            *_identity(job),
            status="finished",
            error="",
            n_sources=len(sources),
            n_found=len(matches),
            false_findings=evaluation.false_findings,
            errors_m=tuple(match.error_m for match in matches),
            height_errors_m=tuple(match.height_error_m for match in matches),
            confirmed_s=confirmed_s,
            n_in_ellipse=sum(match.inside_ellipse95 for match in matches),
            n_right_site=sum(match.right_site for match in matches),
            ospa_m=evaluation.ospa_m,
            bearing_rmse_rad=bearing_rmse_rad if np.isfinite(bearing_rmse_rad) else None,
            distance_m=float(driven_m[-1]),
            found_all_m=float(np.interp(max(confirmed_s), step["time_s"], driven_m)) if has_found_all else None,
            shortest_m=shortest_m if sources and np.isfinite(shortest_m) else None,
            sim_time_s=report.sim_time_s,
            contacts=report.collisions,
            waypoints_missed=len(report.waypoints.missed),
            wall_time_s=wall_time_s,
            peak_memory_mb=peak_memory_mb,
        )


def _identity(job: MissionJob) -> tuple[int, str, str, str, str, str, str, str, int]:
    settings = json.dumps(dict(job.settings), sort_keys=True)
    named = job.suite, job.level, job.scenario.name, job.scenario_digest, job.policy
    return job.order, job.key, *named, settings, job.seed
