"""Status text and events of the mission."""

from __future__ import annotations

import numpy as np
import rerun as rr

from dirmusic.locating.finding import ellipse95
from pdpatrol.missions.record.events import Phase
from pdpatrol.missions.recording.bins import LogBin, labels_3d, set_step
from pdpatrol.missions.recording.findings import COLOURS, name_of
from pdpatrol.missions.report.make_report import findings_at
from pdpatrol.missions.report.records import Report
from pdpatrol.missions.report.wording import kind_text, phase_text, site_text


def draw_events(stream: rr.RecordingStream, part: LogBin) -> None:
    """List the events of a bin."""
    event = part.tables["event"]
    for step, kind, text in zip(event["step"].tolist(), event["kind"].tolist(), event["text"].tolist(), strict=True):
        set_step(stream, part.log, step)
        stream.log("mission/events", rr.TextLog(text, level=kind))


def draw_outcome(stream: rr.RecordingStream, report: Report) -> None:
    """Draw the outcome of a mission and the sites of its findings."""
    subject = "Mission" if report.policy else "Survey"
    lines = [f"### {subject} over after {report.sim_time_s:.0f} s: {report.ending or 'killed'}", ""]
    lines += ["| | site | kind | 95 % within |", "|---|---|---|---|"] if report.findings else ["No findings."]
    for finding in report.findings:
        name, site = name_of(finding.state, finding.id), site_text(finding)
        lines.append(f"| **{name}** | {site} | {kind_text(finding)} | {finding.ellipse95.semi_major_m:.2f} m |")
        label = f"{name}: {site}" if finding.sites else name
        marker = labels_3d({label: finding.position_m}, 0.2, COLOURS[finding.state])
        stream.log(f"world/findings/{finding.id}", marker)
    _draw_text(stream, lines)


def _draw_text(stream: rr.RecordingStream, lines: list[str]) -> None:
    """Show lines of Markdown as the status."""
    escaped = "\n".join(lines).replace("<", "&lt;").replace("_", "\\_")
    stream.log("mission/status", rr.TextDocument(escaped, media_type=rr.MediaType.MARKDOWN))


def draw_status(stream: rr.RecordingStream, part: LogBin) -> None:
    """Describe the phase of the mission and its findings at the end of a bin."""
    step = part.tables["step"]
    doing = phase_text(Phase(step["phase"][-1], step["phase_target"][-1]))
    table = findings_at(part.log, part.end, "candidate", "confirmed", "outside")
    lines = [f"### {doing[:1].upper()}{doing[1:]}", ""]
    if table["id"].size:
        lines += ["| | place (m) | height | 95 % ellipse | aperture |", "|---|---|---|---|---|"]
    for row in range(table["id"].size)[-8:]:
        x, y, z = table["position_m"][row]
        size_m = ellipse95(table["covariance_m2"][row, :2, :2]).semi_major_m
        size = f"{size_m:.2f} m" if size_m < 100.0 else "> 100 m"
        aperture = f"{np.degrees(table['aperture_rad'][row]):.0f}°"
        title = name_of(table["state"][row], table["id"][row])
        lines.append(f"| **{title}** | {x:.1f}, {y:.1f} | {z:.1f} m | {size} | {aperture} |")
    _draw_text(stream, lines)
