"""MissionLog to report.json and a printed table."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.box import SIMPLE_HEAD
from rich.table import Table
from scipy.optimize import linear_sum_assignment

from dirmusic.locating.ellipse import ellipse95, is_inside95
from missions.record.mission_log import MissionLog
from missions.record.phase_patterns import PhaseResolved, phase_patterns
from robot_models.yard.yard import Yard

FloatArray = NDArray[np.float64]

SCHEMA = 1

MOST_SHOWN = 200
"""Pulses of a finding whose phase and level the report holds at most; the log holds all."""

CUT_OFF_M = 2.0
"""A finding further than this from every source is a false one; also the cut-off of OSPA."""


def make_report(log: MissionLog, wall_time_s: float) -> dict[str, Any]:
    """All that report.json holds.

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
        "battery_left": _last(step["battery"]),
        "collisions": int((events["kind"] == "contact").sum()),
        "waypoints": {
            "visited": visited,
            "missed": missed,
            "unreachable": [number for number in missed if f"waypoint {number}" in given_up],
        },
        "n_bearings": log.n_rows("bearing"),
        "channel_faults": events["text"][events["kind"] == "channel fault"].tolist(),
        "findings": findings,
        "candidates": _findings(log, patterns, "candidate", "outside"),
    }
    if "truth" in log.meta:
        report["evaluation"] = evaluate(findings, log.meta["truth"]["sources"])
    return report


def _last(values: NDArray[np.float64]) -> float | None:
    """The last of a column; None if it is empty or not known."""
    return float(values[-1]) if values.size and np.isfinite(values[-1]) else None


def _distance(step: dict[str, NDArray[Any]]) -> float:
    path = step["true_pose"] if np.isfinite(step["true_pose"]).all() else step["pose"]
    return float(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=-1).sum())


def _findings(log: MissionLog, patterns: dict[int, PhaseResolved], *states: str) -> list[dict[str, Any]]:
    """Findings in one of some states as they stood at the end, by id."""
    table, time_s = log.table("finding"), log.column("step", "time_s")
    if table["step"].size == 0:
        return []
    yard = None
    if "scenario" in log.meta:
        yard = Yard.model_validate_json(json.dumps(log.meta["scenario"]["yard"]))
    last = np.flatnonzero((table["step"] == table["step"][-1]) & np.isin(table["state"], states))
    findings: list[dict[str, Any]] = []
    for row in last:
        confirmed = np.flatnonzero((table["id"] == table["id"][row]) & (table["state"] == "confirmed"))
        position, covariance = table["position_m"][row], table["covariance_m2"][row]
        findings.append(
            {
                "position_m": position.tolist(),
                "covariance_m2": covariance.tolist(),
                "ellipse95": ellipse95(covariance)._asdict(),
                "state": str(table["state"][row]),
                "discharge": _discharge(patterns.get(int(table["id"][row]))),
                "nearest_equipment": yard.nearest_equipment(position) if yard else None,
                "n_bearings": int(table["n_bearings"][row]),
                "first_detected_s": float(table["first_detected_s"][row]),
                "fixed_s": float(time_s[table["step"][confirmed[0]]]) if confirmed.size else None,
            }
        )
    return findings


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


def evaluate(findings: list[dict[str, Any]], sources: list[dict[str, Any]]) -> dict[str, Any]:
    """Score findings against the truth.

    Findings and sources are paired one to one by least total distance, with a cut-off of 2 m. OSPA has c = 2 m, p = 1:
    the mean over the larger set of the paired distances, each unpaired member counting 2 m.

    References:
        Schuhmacher, Vo and Vo, "A consistent metric for performance evaluation of multi-object filters", 2008.
    """
    found_m = np.array([f["position_m"] for f in findings]).reshape(-1, 2)
    true_m = np.array([s["position_m"][:2] for s in sources]).reshape(-1, 2)
    distance = np.linalg.norm(true_m[:, np.newaxis] - found_m, axis=-1)
    pairs = zip(*linear_sum_assignment(np.minimum(distance, CUT_OFF_M)), strict=True)
    partner = {int(i): int(j) for i, j in pairs if distance[i, j] < CUT_OFF_M}
    scored: list[dict[str, Any]] = []
    for i, source in enumerate(sources):
        j = partner.get(i)
        inside = None
        if j is not None:
            inside = is_inside95(found_m[j] - true_m[i], np.array(findings[j]["covariance_m2"]))
        scored.append(
            {
                "name": source["name"],
                "true_position_m": list(source["position_m"]),
                "found": j is not None,
                "error_m": None if j is None else float(distance[i, j]),
                "inside_ellipse95": inside,
            }
        )
    most = max(len(findings), len(sources))
    missed = most - len(partner)
    ospa = (sum(float(distance[i, j]) for i, j in partner.items()) + CUT_OFF_M * missed) / most if most else 0.0
    return {"sources": scored, "false_findings": len(findings) - len(partner), "ospa_m": ospa}


def findings_table(report: dict[str, Any]) -> Table:
    """What was found, for a terminal."""
    seed = "" if report["seed"] is None else f", seed {report['seed']}"
    sources = report.get("evaluation", {}).get("sources")
    columns: dict[str, Callable[[dict[str, Any]], str]] = {"fixed (s)": lambda finding: f"{finding['fixed_s']:.1f}"}
    if sources is not None:
        columns["error (m)"] = lambda finding: _error_of(finding, sources)
    return _table_of(report["findings"], f"Findings: {report['scenario']}{seed}", columns)


def candidates_table(report: dict[str, Any]) -> Table:
    """What was heard but not confirmed, for a terminal."""
    title = "Not confirmed: heard from too few sides, from too far away, or beyond the fence"
    return _table_of(report["candidates"], title, {"state": lambda finding: finding["state"]})


def _table_of(findings: list[dict[str, Any]], title: str, more: dict[str, Callable[[dict[str, Any]], str]]) -> Table:
    """Number, place, ellipse and pulses of each; equipment and kind where they are known; and more columns."""
    columns: dict[str, Callable[[dict[str, Any]], str]] = {
        "x, y (m)": lambda finding: "{:.2f}, {:.2f}".format(*finding["position_m"]),
        "95 % ellipse": lambda finding: "{semi_major_m:.2f} by {semi_minor_m:.2f}".format(**finding["ellipse95"]),
        "pulses": lambda finding: str(finding["n_bearings"]),
    }
    if any(finding["nearest_equipment"] for finding in findings):
        columns["nearest"] = lambda finding: finding["nearest_equipment"] or "-"
    if any(finding["discharge"] for finding in findings):
        columns["kind"] = _kind_of
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("#")
    columns |= more
    for heading in columns:
        is_word = heading in ("nearest", "kind", "state")
        table.add_column(
            heading, justify="left" if is_word else "right", overflow="fold", no_wrap=heading == "x, y (m)"
        )
    for number, finding in enumerate(findings, start=1):
        table.add_row(str(number), *(tell(finding) for tell in columns.values()))
    return table


def _kind_of(finding: dict[str, Any]) -> str:
    discharge = finding["discharge"]
    return f"{discharge['kind']} {100 * discharge['confidence']:.0f} %" if discharge else "-"


def _error_of(finding: dict[str, Any], sources: list[dict[str, Any]]) -> str:
    """Distance to the source that the finding is paired with, recognised by that very distance."""
    for source in sources:
        if source["found"]:
            error = float(np.hypot(*np.subtract(source["true_position_m"][:2], finding["position_m"])))
            if abs(error - source["error_m"]) < 1e-9:
                return f"{error:.2f}"
    return "false" if sources else "-"
