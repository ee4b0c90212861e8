"""MissionLog to the report."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from dirmusic.locating.confirmation import LEVEL_QUANTILE
from dirmusic.locating.finding import ellipse95
from pdpatrol.missions.record.events import EventKind
from pdpatrol.missions.record.finding_pulses import FindingPulses, finding_pulses
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.phase_patterns import PhaseResolved, phase_patterns
from pdpatrol.missions.record.which_site import site_probabilities
from pdpatrol.missions.record.yard_of_log import known_yard, true_yard
from pdpatrol.missions.report.inspection import Inspected
from pdpatrol.missions.report.pulse_counts import pulse_counts
from pdpatrol.missions.report.records import (
    SCHEMA,
    DetectedFrom,
    Discharge,
    Ellipse,
    Evaluation,
    FindingRecord,
    Kind,
    PhaseHistogram,
    Report,
    Site,
    Strength,
    Waypoints,
)
from pdpatrol.missions.report.scoring import evaluate, true_sources
from pdpatrol.robot_models.yard.yard import Yard

FloatArray = NDArray[np.float64]

LEAST_TOLD = 0.01
"""Places where a finding is with a lesser probability are not in the report."""

PHASE_STEP_DEG, LEVEL_STEP_DB, MOST_LEVELS = 10.0, 2.0, 16
"""Bins of the phase-resolved pattern; what lies beyond so many levels is counted in the outer ones."""


def make_report(log: MissionLog, wall_time_s: float, inspected: Inspected | None = None) -> Report:
    """What an operator gets, and the evaluation beside it where the log holds the truth.

    Args:
        log: The mission, whole or cut short.
        wall_time_s: How long it took to run; the only figure that differs between two runs of one seed.
        inspected: What `inspected_sites` says of the log; None where nobody will read it.
    """
    step, events = log.table("step"), log.table("event")
    findings = _findings(log, "confirmed")
    return Report(
        schema=SCHEMA,
        scenario=log.meta["name"],
        seed=log.meta["seed"],
        policy=log.meta["policy"],
        date=log.meta.get("date"),
        versions=log.meta.get("versions", {}),
        ending=next(iter(_events(events, "end", "subject")[-1:]), None),
        sim_time_s=float(step["time_s"][-1]) if step["time_s"].size else 0.0,
        wall_time_s=wall_time_s,
        distance_m=float(driven_m(step)[-1]) if step["pose"].size else 0.0,
        battery_left=_if_known(step["battery"][-1]) if step["battery"].size else None,
        collisions=len(_events(events, "contact")),
        waypoints=_waypoints(log),
        n_bearings=log.n_rows("bearing"),
        pulses=pulse_counts(log),
        channel_faults=_events(events, "channel fault"),
        calibration=_events(events, "calibration"),
        notes=(*_events(events, "note"), *_events(events, "rejected"), *_events(events, "error")),
        findings=findings,
        candidates=_findings(log, "candidate", "outside"),
        inspection=None if inspected is None else inspected.record(),
        evaluation=_evaluation(log, findings),
    )


def _events(events: dict[str, NDArray[Any]], kind: EventKind, column: str = "text") -> tuple[Any, ...]:
    """Return one column of the events of a kind."""
    return tuple(events[column][events["kind"] == kind].tolist())


def _waypoints(log: MissionLog) -> Waypoints:
    events = log.table("event")
    visited = sorted(_events(events, "waypoint", "number"))
    n_waypoints = len(log.meta.get("route", {}).get("waypoints_m", ()))
    missed = [number for number in range(1, n_waypoints + 1) if number not in visited]
    given_up = _events(events, "unreachable", "number")
    unreachable = [number for number in missed if number in given_up]
    return Waypoints(visited=tuple(visited), missed=tuple(missed), unreachable=tuple(unreachable))


def _evaluation(log: MissionLog, findings: tuple[FindingRecord, ...]) -> Evaluation | None:
    if "truth" not in log.meta:
        return None
    yard = true_yard(log)
    sites_m = None if yard is None else np.array([yard.site_position(name) for name in yard.site_names()])
    return evaluate(findings, true_sources(log.meta["truth"]), None if sites_m is None else sites_m.reshape(-1, 3))


def _if_known(value: float) -> float | None:
    """A number, or None for NaN, which JSON does not have."""
    return float(value) if np.isfinite(value) else None


def driven_m(step: dict[str, NDArray[Any]]) -> FloatArray:
    """Length of the way up to each row of the table `step`, shape (n_steps,), metres; the true one if it is known."""
    path = step["true_pose"] if np.isfinite(step["true_pose"]).all() else step["pose"]
    return np.append(0.0, np.linalg.norm(np.diff(path[:, :2], axis=0), axis=-1).cumsum())


def _findings(log: MissionLog, *states: str) -> tuple[FindingRecord, ...]:
    """Findings in one of some states as they stood at the end, by id."""
    table = log.table("finding")
    if table["step"].size == 0:
        return ()
    last = np.flatnonzero((table["step"] == table["step"][-1]) & np.isin(table["state"], states))
    if last.size == 0:
        return ()
    yard, pulses, patterns = known_yard(log), finding_pulses(log), phase_patterns(log)
    rows = [{column: values[row] for column, values in table.items()} for row in last]
    found = [_finding(row, yard, pulses.get(int(row["id"])), patterns.get(int(row["id"]))) for row in rows]
    if "field_data" in log.meta:  # taken here and there: pulses of a place have one time
        found = [_without_rate(finding) for finding in found]
    return tuple(found)


def _without_rate(finding: FindingRecord) -> FindingRecord:
    if finding.strength is None:
        return finding
    return finding.model_copy(update={"strength": finding.strength.model_copy(update={"rate_per_s": None})})


def _finding(
    row: dict[str, Any], yard: Yard | None, own: FindingPulses | None, resolved: PhaseResolved | None
) -> FindingRecord:
    number, position_m, covariance_m2 = int(row["id"]), row["position_m"], row["covariance_m2"]
    return FindingRecord(
        id=number,
        state=row["state"],
        position_m=tuple(position_m.tolist()),
        position_std_m=tuple(np.sqrt(np.diag(covariance_m2)).tolist()),
        covariance_m2=tuple(tuple(line) for line in covariance_m2.tolist()),
        ellipse95=Ellipse(**ellipse95(covariance_m2[:2, :2])._asdict()),
        sites=() if row["state"] == "outside" else _sites(yard, position_m, covariance_m2),
        discharge=_discharge(resolved),
        strength=None if own is None or not own.time_s.size else _strength(own),
        detected_from=None if own is None or not own.time_s.size else _detected_from(own, float(row["aperture_rad"])),
        n_bearings=int(row["n_bearings"]),
        first_detected_s=float(row["first_detected_s"]),
        confirmed_s=_if_known(row["confirmed_s"]),
    )


def _sites(yard: Yard | None, position_m: FloatArray, covariance_m2: FloatArray) -> tuple[Site, ...]:
    """Where a finding may be, the likeliest place first; nothing without a map."""
    if yard is None:
        return ()
    places = site_probabilities(yard, position_m, covariance_m2)
    return tuple(Site(**place._asdict()) for place in places if place.probability >= LEAST_TOLD)


def _strength(pulses: FindingPulses) -> Strength:
    low, high, level = np.quantile(pulses.level_db, [0.1, 0.9, LEVEL_QUANTILE]).tolist()
    n_pulses = pulses.time_s.size
    return Strength(
        level_db=level, low_db=low, high_db=high, n_pulses=n_pulses, rate_per_s=n_pulses / _seconds_of(pulses)
    )


def _detected_from(pulses: FindingPulses, aperture_rad: float) -> DetectedFrom:
    return DetectedFrom(
        nearest_m=float(pulses.range_m.min()),
        farthest_m=float(pulses.range_m.max()),
        aperture_deg=float(np.degrees(aperture_rad)),
        duration_s=float(_seconds_of(pulses)),
    )


def _seconds_of(pulses: FindingPulses) -> int:
    """Whole seconds in which there were any."""
    return np.unique(np.floor(pulses.time_s)).size


def _discharge(resolved: PhaseResolved | None) -> Discharge | None:
    """The kind of discharge and the pattern that tells it; None without mains phase."""
    if resolved is None:
        return None
    found = resolved.pattern
    return Discharge(
        kind=cast("Kind", found.kind),
        confidence=found.confidence,
        shift_deg=float(np.degrees(found.shift_rad)),
        pattern=_histogram(resolved),
    )


def _histogram(resolved: PhaseResolved) -> PhaseHistogram:
    column = np.floor(np.mod(np.degrees(resolved.phase_rad), 360.0) / PHASE_STEP_DEG).astype(np.intp)
    level = np.floor(resolved.level_db / LEVEL_STEP_DB).astype(np.intp)
    middle = int(np.median(level))
    lowest, highest = max(level.min(), middle - MOST_LEVELS // 2), min(level.max(), middle + MOST_LEVELS // 2 - 1)
    row = np.clip(level, lowest, highest) - lowest
    n_columns = round(360.0 / PHASE_STEP_DEG)
    counts = np.zeros((row.max() + 1, n_columns), dtype=np.intp)
    np.add.at(counts, (row, np.minimum(column, n_columns - 1)), 1)
    return PhaseHistogram(
        phase_step_deg=PHASE_STEP_DEG,
        lowest_db=float(lowest * LEVEL_STEP_DB),
        level_step_db=LEVEL_STEP_DB,
        counts=tuple(map(tuple, counts.tolist())),
    )
