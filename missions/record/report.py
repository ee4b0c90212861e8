"""MissionLog to report.json."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dirmusic.locating.ellipse import ellipse95
from envs.scenario.map_section import MapConfig
from missions.record.mission_log import MissionLog
from missions.record.phase_patterns import PhaseResolved, phase_patterns
from missions.record.pulse_counts import pulse_counts
from missions.record.scoring import evaluate
from missions.record.which_site import site_probabilities
from robot_models.yard.yard import Yard

FloatArray = NDArray[np.float64]

SCHEMA = 3

LEAST_TOLD = 0.01
"""Places where a finding is with a lesser probability are not in the report."""

MOST_SHOWN = 200
"""Pulses of a finding whose phase and level the report holds at most; the log holds all."""


def make_report(log: MissionLog, wall_time_s: float) -> dict[str, Any]:
    """The content of report.json.

    Args:
        log: The mission, whole or cut short.
        wall_time_s: How long it took to run; the only figure that differs between two runs of one seed.

    Returns:
        What an operator gets, and `evaluation` beside it where the log holds the truth.
    """
    step, events = log.table("step"), log.table("event")
    visited = sorted(int(text) for text in events["text"][events["kind"] == "waypoint"])
    n_waypoints = len(log.meta.get("route", {}).get("waypoints_m", ()))
    missed = [number for number in range(1, n_waypoints + 1) if number not in visited]
    given_up = set(events["text"][events["kind"] == "unreachable"].tolist())
    patterns = phase_patterns(log)
    findings = _findings(log, patterns, "confirmed")
    report: dict[str, Any] = {
        "schema": SCHEMA,
        "scenario": log.meta["name"],
        "seed": log.meta["seed"],
        "policy": log.meta["policy"],
        "sim_time_s": float(step["time_s"][-1]) if step["time_s"].size else 0.0,
        "wall_time_s": wall_time_s,
        "distance_m": _distance(step),
        "battery_left": _if_known(step["battery"][-1]) if step["battery"].size else None,
        "collisions": int((events["kind"] == "contact").sum()),
        "waypoints": {
            "visited": visited,
            "missed": missed,
            "unreachable": [number for number in missed if f"waypoint {number}" in given_up],
        },
        "n_bearings": log.n_rows("bearing"),
        "pulses": pulse_counts(log),
        "channel_faults": events["text"][events["kind"] == "channel fault"].tolist(),
        "calibration": events["text"][events["kind"] == "calibration"].tolist(),
        "findings": findings,
        "candidates": _findings(log, patterns, "candidate", "outside"),
    }
    if "truth" in log.meta:
        report["evaluation"] = evaluate(findings, log.meta["truth"]["sources"], _true_sites_m(log))
    return report


def _true_sites_m(log: MissionLog) -> FloatArray | None:
    """Where discharges may sit in the yard as it is, shape (n_sites, 3); None where the log does not say."""
    if "scenario" not in log.meta:
        return None
    yard = Yard.model_validate_json(json.dumps(log.meta["scenario"]["yard"]))
    return np.array([yard.site_position(name) for name in yard.site_names()]).reshape(-1, 3)


def _if_known(value: float) -> float | None:
    """A number, or None for NaN, which JSON does not have."""
    return float(value) if np.isfinite(value) else None


def _distance(step: dict[str, NDArray[Any]]) -> float:
    return float(driven_m(step)[-1]) if step["pose"].size else 0.0


def driven_m(step: dict[str, NDArray[Any]]) -> FloatArray:
    """Length of the way up to each row of the table `step`, shape (n_steps,), metres; the true one if it is known."""
    path = step["true_pose"] if np.isfinite(step["true_pose"]).all() else step["pose"]
    return np.append(0.0, np.linalg.norm(np.diff(path[:, :2], axis=0), axis=-1).cumsum())


def _findings(log: MissionLog, patterns: dict[int, PhaseResolved], *states: str) -> list[dict[str, Any]]:
    """Findings in one of some states as they stood at the end, by id."""
    table = log.table("finding")
    if table["step"].size == 0:
        return []
    yard = _known_yard(log)
    last = np.flatnonzero((table["step"] == table["step"][-1]) & np.isin(table["state"], states))
    findings: list[dict[str, Any]] = []
    for row in last:
        position, covariance = table["position_m"][row], table["covariance_m2"][row]
        findings.append(
            {
                "id": int(table["id"][row]),
                "position_m": position.tolist(),
                "covariance_m2": covariance.tolist(),
                "ellipse95": ellipse95(covariance[:2, :2])._asdict(),
                "height_std_m": float(np.sqrt(covariance[2, 2])),
                "state": str(table["state"][row]),
                "discharge": _discharge(patterns.get(int(table["id"][row]))),
                "sites": _sites(yard, position, covariance),
                "n_bearings": int(table["n_bearings"][row]),
                "first_detected_s": float(table["first_detected_s"][row]),
                "fixed_s": _if_known(table["fixed_s"][row]),
            }
        )
    return findings


def _sites(yard: Yard | None, position_m: FloatArray, covariance_m2: FloatArray) -> list[dict[str, Any]]:
    """Where a finding may be, the likeliest place first; nothing without a map."""
    if yard is None:
        return []
    places = site_probabilities(yard, position_m, covariance_m2)
    return [place._asdict() for place in places if place.probability >= LEAST_TOLD]


def _known_yard(log: MissionLog) -> Yard | None:
    """The yard as the map of the mission has it; None for field data, which have no scenario."""
    scenario = log.meta.get("scenario")
    if scenario is None:
        return None
    of_map = MapConfig.model_validate_json(json.dumps(scenario.get("map", {})))
    return of_map.of(Yard.model_validate_json(json.dumps(scenario["yard"])))


def _discharge(resolved: PhaseResolved | None) -> dict[str, Any] | None:
    """The kind of discharge and the picture that tells it, thinned out; None without mains phase."""
    if resolved is None:
        return None
    some = np.unique(np.linspace(0, resolved.phase_rad.size - 1, MOST_SHOWN).astype(np.intp))
    return {
        "kind": resolved.pattern.kind,
        "confidence": resolved.pattern.confidence,
        "phase_deg": np.mod(np.round(np.degrees(resolved.phase_rad[some]), 1), 360.0).tolist(),
        "level_db": np.round(resolved.level_db[some], 2).tolist(),
    }
