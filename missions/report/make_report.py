"""Conversion of a mission log to its report."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dirmusic.locating.finding import ellipse95
from dirmusic.pulses.phase_resolved import PhasePattern
from pdpatrol.envs.scenario.severity import default_severity
from pdpatrol.missions.driving.site_map import distances_along
from pdpatrol.missions.record.events import EventKind
from pdpatrol.missions.record.finding_pulses import FindingPulses, finding_pulses, phase_patterns
from pdpatrol.missions.record.log_contents import known_yard, map_of, survey_of
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.which_site import site_probabilities
from pdpatrol.missions.report.array_check import check_array
from pdpatrol.missions.report.assessment import assess, asset_at
from pdpatrol.missions.report.records import (
    Charge,
    DischargeKind,
    FindingRecord,
    PulseCounts,
    Report,
    SiteInspections,
    Strength,
    Waypoints,
)
from pdpatrol.missions.report.scoring import score_mission
from pdpatrol.missions.report.settings import survey_record

PHASE_STEP_DEG, LEVEL_STEP_DB = 10.0, 2.0
"""Bins of the phase-resolved pattern."""

CLOCK_NOTE = "mains frequency: {:+.4f} Hz from the receiver's reference; the phases of the pulses are corrected"


def make_report(log: MissionLog, wall_time_s: float, inspection: SiteInspections | None = None) -> Report:
    """Make the report of a mission; its evaluation alone uses the truth.

    Args:
        log: Log of a finished or killed mission.
        wall_time_s: Computing time; the only figure that differs between two runs with the same seed.
        inspection: Result of `inspect_sites`; None to omit the section.
    """
    step, events, (patterns, offset_hz) = log.table("step"), log.table("event"), phase_patterns(log)
    found, places = _findings(log, patterns)
    findings = tuple(finding for finding in found if finding.state == "confirmed")
    time_s, battery = step["time_s"], step["battery"][-1:]
    return Report(
        schema=9,
        scenario=log.meta["name"],
        seed=log.meta["seed"],
        policy=log.meta["policy"],
        date=log.meta.get("date"),
        survey=survey_record(log),
        versions=log.meta.get("versions", {}),
        ending=(None, *_events(events, "end", column="subject"))[-1],
        sim_time_s=float(np.ptp(time_s) if "field_data" in log.meta else time_s.max(initial=0.0)),
        wall_time_s=wall_time_s,
        distance_m=float(distances_along(step["pose"])[-1]),
        battery_left=float(battery[0]) if np.isfinite(battery).any() else None,
        charges=_charges(events, step),
        collisions=len(_events(events, "contact")),
        waypoints=_waypoints(log),
        n_bearings=log.n_rows("bearing"),
        pulses=count_pulses(log),
        channel_faults=_events(events, "channel fault"),
        calibration=_events(events, "calibration"),
        array=check_array(log),
        notes=(
            *_events(events, "note", "frame", "rejected", "error"),
            *_pose_notes(log),
            *([CLOCK_NOTE.format(offset_hz)] if offset_hz else []),
        ),
        findings=findings,
        candidates=tuple(finding for finding in found if finding.state != "confirmed"),
        inspection=inspection,
        evaluation=score_mission(log, findings, places, inspection),
    )


def count_pulses(log: MissionLog) -> PulseCounts:
    """Count the pulses of a mission by association; a killed mission has no associations."""
    owner, n_detected, n_used = log.column("association", "finding"), log.n_rows("pulse"), log.n_rows("bearing")
    is_known = owner.size == n_used
    return PulseCounts(
        detected=n_detected,
        rejected=n_detected - n_used,
        of_findings=int((owner > 0).sum()) if is_known else None,
        unexplained=int((owner == 0).sum()) if is_known else None,
    )


def findings_at(log: MissionLog, end: int, *states: str) -> dict[str, NDArray[Any]]:
    """Return the rows of the findings that were in one of the states just before step `end`.

    The log has a row for every finding at each step at which any of them changed.
    """
    stop = log.rows_before("finding", end)
    last_step = log.column("finding", "step", stop - 1, stop).max(initial=0)
    table = log.table("finding", log.rows_before("finding", int(last_step)), stop)
    own = np.isin(table["state"], states)
    return {column: values[own] for column, values in table.items()}


def _events(events: dict[str, NDArray[Any]], *kinds: EventKind, column: str = "text") -> tuple[Any, ...]:
    """Return one column of the events of some kinds."""
    return tuple(events[column][np.isin(events["kind"], kinds)].tolist())


def _pose_notes(log: MissionLog) -> list[str]:
    """Return a note if the scans of the lidar show that poses are worse than believed."""
    if not log.n_rows("frame"):
        return []
    position_m, heading_rad = log.column("frame", "pose_std")[-1].tolist()
    believed = log.meta["scenario"]["pose_sensor"]
    believed_m, believed_deg = believed["position_std_m"], believed["heading_std_deg"]
    if position_m == believed_m and heading_rad == math.radians(believed_deg):
        return []
    return [
        f"the scans of the lidar show worse poses than believed: deviations of {position_m:.2f} m and "
        f"{math.degrees(heading_rad):.1f} degrees, not {believed_m:.2f} m and {believed_deg:.1f} degrees; "
        "findings are located with the larger ones"
    ]


def _charges(events: dict[str, NDArray[Any]], step: dict[str, NDArray[Any]]) -> tuple[Charge, ...]:
    """Return the charges of the battery, one for each event of kind `returns to charge`."""
    charges = list[dict[str, Any]]()
    for kind, row in zip(events["kind"].tolist(), events["step"].tolist(), strict=True):
        if kind == "returns to charge":
            unknown = dict.fromkeys(("arrived_s", "battery_left", "continued_s"))
            charges.append({**unknown, "returned_s": step["time_s"][row]})
        elif kind == "charging":
            charges[-1] |= {"arrived_s": step["time_s"][row], "battery_left": step["battery"][row]}
        elif kind == "continues":
            charges[-1]["continued_s"] = step["time_s"][row]
    return tuple(map(Charge.model_validate, charges))


def _waypoints(log: MissionLog) -> Waypoints:
    events, n_waypoints = log.table("event"), len(log.meta.get("route", {}).get("waypoints_m", ()))
    visited, unreachable = (set(_events(events, kind, column="number")) for kind in ("waypoint", "unreachable"))
    missed = set(range(1, n_waypoints + 1)) - visited
    return Waypoints(
        visited=tuple(sorted(visited)), missed=tuple(sorted(missed)), unreachable=tuple(sorted(missed & unreachable))
    )


def _findings(
    log: MissionLog, patterns: Mapping[int, tuple[FindingPulses, PhasePattern]]
) -> tuple[list[FindingRecord], dict[int, dict[str, float]]]:
    """Return the findings at the end, sorted by id, and the probabilities of all places of each by id."""
    table = findings_at(log, log.n_rows("step"), "confirmed", "candidate", "outside")
    yard, pulses = known_yard(log), finding_pulses(log)
    severity, day = survey_of(log).severity or default_severity(), log.meta.get("date")
    found, places_of = list[FindingRecord](), dict[int, dict[str, float]]()
    for row in range(table["id"].size):
        finding = {column: values[row] for column, values in table.items() if column != "step"}
        number, position_m, covariance_m2 = int(finding["id"]), finding["position_m"], finding["covariance_m2"]
        is_outside = finding["state"] == "outside"
        places: dict[str, float] = {}
        if yard and not is_outside:
            places = site_probabilities(yard, position_m, covariance_m2, map_of(log).accuracy_m)
        places_of[number] = places
        aperture_deg, confirmed_s = float(np.degrees(finding.pop("aperture_rad"))), float(finding["confirmed_s"])
        level_db, strength = float(finding.pop("level_db")), None
        if number in pulses and pulses[number].time_s.size:
            # in field data, all pulses received at one place have the same time
            strength = _strength(pulses[number], level_db, aperture_deg, has_rate="field_data" not in log.meta)
        discharge = _discharge(*patterns[number]) if number in patterns else None
        is_confirmed = finding["state"] == "confirmed"
        shown = {
            "position_m": position_m.tolist(),
            "position_std_m": np.sqrt(np.diag(covariance_m2)).tolist(),
            "covariance_m2": covariance_m2.tolist(),
            "ellipse95": ellipse95(covariance_m2[:2, :2])._asdict(),
            "sites": [{"name": name, "probability": value} for name, value in places.items() if value >= 0.01],
            "asset": yard and asset_at(yard, places),
            "assessment": assess(severity, day, discharge, strength) if is_confirmed else None,
            "discharge": discharge,
            "strength": strength,
            "confirmed_s": confirmed_s if np.isfinite(confirmed_s) else None,
        }
        found.append(FindingRecord.model_validate(finding | shown))
    return found, places_of


def _strength(pulses: FindingPulses, level_db: float, aperture_deg: float, *, has_rate: bool) -> Strength:
    """Summarise the pulses of a finding, which has at least one; its level is that of the Locator."""
    duration_s = np.unique(np.floor(pulses.time_s)).size
    low_db, high_db = np.quantile(pulses.level_db, [0.1, 0.9]).tolist()
    return Strength(
        level_db=level_db if np.isfinite(level_db) else None,
        low_db=low_db,
        high_db=high_db,
        n_pulses=pulses.time_s.size,
        duration_s=duration_s,
        rate_per_s=pulses.time_s.size / duration_s if has_rate else None,
        nearest_m=float(pulses.range_m.min()),
        farthest_m=float(pulses.range_m.max()),
        aperture_deg=aperture_deg,
    )


def _discharge(pulses: FindingPulses, pattern: PhasePattern) -> DischargeKind:
    """Return the kind of a finding and its pattern; levels beyond 16 dB from the median are in the outer rows."""
    middle_db = LEVEL_STEP_DB * np.floor(np.median(pulses.level_db) / LEVEL_STEP_DB)
    level_db = np.clip(pulses.level_db, middle_db - 16.0, middle_db + 16.0 - 1e-9)
    lowest_db = LEVEL_STEP_DB * np.floor(level_db.min() / LEVEL_STEP_DB)
    counts, _, _ = np.histogram2d(
        level_db,
        np.degrees(pulses.phase_rad) % 360.0,
        (
            np.arange(lowest_db, level_db.max() + LEVEL_STEP_DB + 1e-9, LEVEL_STEP_DB),
            np.arange(0.0, 361.0, PHASE_STEP_DEG),
        ),
    )
    return DischargeKind.model_validate(
        {
            "kind": pattern.kind,
            "confidence": pattern.confidence,
            "shift_deg": float(np.degrees(pattern.shift_rad)),
            "phase_step_deg": PHASE_STEP_DEG,
            "lowest_db": lowest_db,
            "level_step_db": LEVEL_STEP_DB,
            "counts": counts.tolist(),
        }
    )
