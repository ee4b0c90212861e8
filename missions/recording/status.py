"""Status text, events and phases of the mission."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import rerun as rr

from dirmusic.locating.finding import ellipse95
from pdpatrol.missions.record.events import Phase
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording.bins import LogBin, set_step
from pdpatrol.missions.recording.findings import draw_label, name_of
from pdpatrol.missions.report.make_report import findings_at
from pdpatrol.missions.report.records import Report
from pdpatrol.missions.report.wording import PHASES, kind_text, phase_text, site_text


def draw_phases(stream: rr.RecordingStream) -> None:
    """Set names and colours of the phases of built-in policies."""
    colours = {
        "patrol": (70, 110, 160),
        "seek": (200, 110, 30),
        "listen": (170, 150, 60),
        "return to dock": (80, 90, 100),
        "back off": (190, 60, 60),
        "random": (110, 80, 150),
        "field": (70, 110, 160),
    }
    labels = [PHASES[name] for name in colours]
    style = rr.StateConfiguration(values=list(colours), labels=labels, colors=list(colours.values()))
    stream.log("mission/phase", style, static=True)


def draw_status(stream: rr.RecordingStream, part: LogBin) -> None:
    """Draw the events, phases and status text of a bin."""
    event, first, end = part.tables["event"], part.first["step"], part.end
    for step, kind, text in zip(event["step"].tolist(), event["kind"].tolist(), event["text"].tolist(), strict=True):
        set_step(stream, part.log, step)
        stream.log("mission/events", rr.TextLog(text, level=kind))
    last = part.log.column("step", "phase", first - 1, first).tolist() if first else [""]
    for step, (before, phase) in enumerate(pairwise([*last, *part.tables["step"]["phase"].tolist()]), start=first):
        if phase != before:
            set_step(stream, part.log, step)
            stream.log("mission/phase", rr.StateChange(state=phase))
    if end > first:
        set_step(stream, part.log, end - 1)
        _draw_text(stream, _status_text(part.log, end))


def draw_outcome(stream: rr.RecordingStream, log: MissionLog, report: Report) -> None:
    """Draw the outcome of a mission and the sites of its findings."""
    set_step(stream, log, max(log.n_rows("step") - 1, 0))
    subject = "Mission" if "scenario" in log.meta else "Survey"
    lines = [f"### {subject} over after {report.sim_time_s:.0f} s: {report.ending or 'killed'}", ""]
    lines += ["| | site | kind | 95 % within |", "|---|---|---|---|"] if report.findings else ["No findings."]
    for finding in report.findings:
        name, site = name_of(finding.state, finding.id), site_text(finding)
        lines.append(f"| **{name}** | {site} | {kind_text(finding)} | {finding.ellipse95.semi_major_m:.2f} m |")
        draw_label(stream, finding.id, finding.position_m, f"{name}: {site}" if finding.sites else name)
    _draw_text(stream, "\n".join(lines))


def _draw_text(stream: rr.RecordingStream, text: str) -> None:
    escaped = text.replace("<", "&lt;").replace("_", "\\_")
    stream.log("mission/status", rr.TextDocument(escaped, media_type=rr.MediaType.MARKDOWN))


def _status_text(log: MissionLog, end: int) -> str:
    """Describe the phase of a mission before step `end` and its findings, as Markdown."""
    (name,), (target,) = (log.column("step", column, end - 1, end).tolist() for column in ("phase", "phase_target"))
    doing, table = phase_text(Phase(name, target)), findings_at(log, end, "candidate", "confirmed", "outside")
    lines = [f"### {doing[:1].upper()}{doing[1:]}", ""]
    if table["id"].size:
        lines += ["| | place (m) | height | 95 % ellipse | aperture |", "|---|---|---|---|---|"]
    for row in range(table["id"].size)[-8:]:
        x, y, z = table["position_m"][row]
        size_m = ellipse95(table["covariance_m2"][row, :2, :2]).semi_major_m
        size = f"{size_m:.2f} m" if size_m < 100.0 else "> 100 m"
        aperture = f"{np.degrees(table['aperture_rad'][row]):.0f}°"
        title = name_of(str(table["state"][row]), int(table["id"][row]))
        lines.append(f"| **{title}** | {x:.1f}, {y:.1f} | {z:.1f} m | {size} | {aperture} |")
    return "\n".join(lines)
