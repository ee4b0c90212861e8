"""Status text, events and phases of the mission."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from dirmusic.locating.finding import ellipse95
from pdpatrol.envs.scenario.locating import LocatingConfig
from pdpatrol.missions.record.events import Phase
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.which_site import percent
from pdpatrol.missions.recording.bins import LogBin, set_step
from pdpatrol.missions.recording.findings import draw_label
from pdpatrol.missions.report.make_report import findings_at
from pdpatrol.missions.report.records import Report
from pdpatrol.missions.report.wording import kind_text, phase_text

PHASE_COLOURS = {
    "patrol": (70, 110, 160),
    "listen": (170, 150, 60),
    "seek": (200, 110, 30),
    "back off": (190, 60, 60),
    "return to dock": (80, 90, 100),
}
"""Colours of the built-in phases; others are violet."""


def draw_status(stream: rr.RecordingStream, part: LogBin) -> None:
    """Draw the events, phases and status text of a bin."""
    event = part.tables["event"]
    for step, kind, text in zip(event["step"].tolist(), event["kind"].tolist(), event["text"].tolist(), strict=True):
        set_step(stream, part.log, step)
        stream.log("mission/events", rr.TextLog(text, level=kind))
    for step in range(part.first_step, part.end):
        phases = _phases(part.log, max(step - 1, 0), step + 1)
        if step == 0 or phases[0] != phases[-1]:
            set_step(stream, part.log, step)
            stream.log("mission/phase", rr.StateChange(state=str(phases[-1])))
            known = dict.fromkeys(_phases(part.log, 0, part.end))
            values, labels = [str(phase) for phase in known], [phase_text(phase) for phase in known]
            colours = [PHASE_COLOURS.get(phase.name, (110, 80, 150)) for phase in known]
            style = rr.StateConfiguration(values=values, labels=labels, colors=colours)
            stream.log("mission/phase", style, static=True)
    if part.end > part.first_step:
        set_step(stream, part.log, part.end - 1)
        _draw_text(stream, _status_text(part.log, part.end))


def draw_outcome(stream: rr.RecordingStream, log: MissionLog, report: Report) -> None:
    """Draw the outcome of a mission and the sites of its findings."""
    set_step(stream, log, max(log.n_rows("step") - 1, 0))
    subject = "Mission" if "scenario" in log.meta else "Survey"
    lines = [f"### {subject} over after {report.sim_time_s:.0f} s: {report.ending or 'killed'}", ""]
    lines += ["| | site | kind | 95 % within |", "|---|---|---|---|"] if report.findings else ["No findings."]
    for finding in report.findings:
        place = f"{finding.sites[0].name}, {percent(finding.sites[0].probability)}" if finding.sites else ""
        name, size = f"**finding {finding.id}**", f"{finding.ellipse95.semi_major_m:.2f} m"
        lines.append(f"| {name} | {_escaped(place)} | {_escaped(kind_text(finding))} | {size} |")
        draw_label(stream, finding.id, np.array(finding.position_m), f"finding {finding.id}: {place}".rstrip(": "))
    _draw_text(stream, "\n".join(lines))


def _draw_text(stream: rr.RecordingStream, text: str) -> None:
    stream.log("mission/status", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))


def _phases(log: MissionLog, start: int, end: int) -> list[Phase]:
    names, targets = (log.column("step", column, start, end).tolist() for column in ("phase", "phase_target"))
    return [Phase(*phase) for phase in zip(names, targets, strict=True)]


def _status_text(log: MissionLog, end: int) -> str:
    """Describe the phase of a mission before step `end` and its findings, as Markdown."""
    (phase,), (pose,) = _phases(log, end - 1, end), log.column("step", "pose", end - 1, end)
    table = findings_at(log, end, "candidate", "confirmed", "outside")
    rows = {int(number): {name: column[k] for name, column in table.items()} for k, number in enumerate(table["id"])}
    waypoints_m = log.meta.get("route", {}).get("waypoints_m", ())
    doing = phase_text(phase)
    lines = [f"### {doing[:1].upper()}{_escaped(doing[1:])}", ""]
    if phase.name == "patrol" and 0 < phase.target <= len(waypoints_m):
        lines.append(f"{np.linalg.norm(waypoints_m[phase.target - 1] - pose[:2]):.0f} m away.")
    if phase.name == "seek" and phase.target in rows:
        lines.append(_needs_text(log.meta, rows[phase.target], pose))
    if rows:
        lines += ["", "| | place (m) | height | 95 % ellipse | aperture |", "|---|---|---|---|---|"]
    for number, row in sorted(rows.items())[-8:]:
        x, y, z = row["position_m"]
        name = f"**finding {number}**" if row["state"] == "confirmed" else f"candidate {number}"
        name += ", beyond the fence" if row["state"] == "outside" else ""
        aperture = f"{np.degrees(row['aperture_rad']):.0f}°"
        lines.append(f"| {name} | {x:.1f}, {y:.1f} | {z:.1f} m | {_size_text(_semi_major_m(row))} | {aperture} |")
    return "\n".join(lines)


def _needs_text(meta: Mapping[str, Any], row: Mapping[str, Any], pose: NDArray[np.float64]) -> str:
    """Describe the conditions that a candidate does not meet yet; with a locator of the user, only its distance."""
    distance = f"It is {np.linalg.norm(row['position_m'][:2] - pose[:2]):.0f} m away"
    locating = meta.get("scenario", {}).get("locating")
    if locating is None or locating.get("locator") is not None:
        return f"{distance}."
    rules = LocatingConfig.model_validate({**locating, "calibration": None}).rules()
    needs: list[str] = []
    missing_deg = np.degrees(rules.confirm_aperture_rad - row["aperture_rad"])
    if missing_deg > 0.0:
        needs.append(f"{np.ceil(missing_deg):.0f}° more aperture")
    if _semi_major_m(row) > rules.confirm_semi_major_m:
        needs.append(f"an ellipse of {rules.confirm_semi_major_m:g} m, now {_size_text(_semi_major_m(row))}")
    if needs:
        return f"{distance}. To be confirmed it needs {' and '.join(needs)}."
    return f"{distance} and located well enough; to be confirmed it must be detected from near by, in line of sight."


def _semi_major_m(row: Mapping[str, Any]) -> float:
    return ellipse95(row["covariance_m2"][:2, :2]).semi_major_m


def _size_text(length_m: float) -> str:
    """Return a length with two digits."""
    return "> 100 m" if length_m > 100.0 else f"{length_m:.2f} m" if length_m < 1.0 else f"{length_m:.2g} m"


def _escaped(text: str) -> str:
    """Escape a text for Markdown tables."""
    return text.replace("|", "\\|").replace("<", "&lt;").replace("_", "\\_")
