"""Findings, their 95 % ellipses and phase-resolved patterns, the likelihood on the ground, status text and events."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import rerun as rr

from dirmusic.locating.finding import ellipse95, outline95
from pdpatrol.missions.record.events import Phase
from pdpatrol.missions.record.finding_pulses import phase_patterns
from pdpatrol.missions.record.log_contents import grid_of
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.which_site import percent
from pdpatrol.missions.recording.scene import LogBin, at_steps, labels_3d, set_step
from pdpatrol.missions.report.make_report import findings_at
from pdpatrol.missions.report.records import Report
from pdpatrol.missions.report.wording import existence_text, kind_text, phase_text, site_text

COLOURS = {
    "candidate": 0xFFB228FF,
    "confirmed": 0x3CDC6EFF,
    "outside": 0x9696A0FF,
}
"""Colours of findings by state."""

UNITS_PER_DB, SPAN_DB = 4.0, 30
"""Scale of the level axis of a pattern, which points down, and half its range in dB. The phase axis is in degrees."""


def name_of(state: str, number: int) -> str:
    """Return the display name of a finding."""
    return f"{'finding' if state == 'confirmed' else state} {number}"


def draw_findings(stream: rr.RecordingStream, part: LogBin) -> None:
    """Draw the last row of each finding in a bin, and the last likelihood."""
    finding, likelihood = part.tables["finding"], part.tables["likelihood"]
    for row in {number: row for row, number in enumerate(finding["id"].tolist())}.values():
        set_step(stream, part.log, int(finding["step"][row]))
        _draw_finding(stream, {name: column[row] for name, column in finding.items()})
    if likelihood["step"].size:
        set_step(stream, part.log, int(likelihood["step"][-1]))
        _draw_likelihood(stream, part.log.meta, likelihood["log_likelihood"][-1])


def _draw_finding(stream: rr.RecordingStream, finding: Mapping[str, Any]) -> None:
    state, number = finding["state"], finding["id"]
    path = f"world/findings/{number}"
    if state == "dropped":
        stream.log(path, rr.Clear(recursive=True))
        return
    position_m, covariance_m2 = finding["position_m"], finding["covariance_m2"][:2, :2]
    label = f"{name_of(state, number)}: exists {percent(finding['existence'])}"
    label += ", possibly two" * bool(finding["possibly_two"])
    stream.log(path, labels_3d({label: position_m}, 0.2, COLOURS[state]))
    semi_major_m = ellipse95(covariance_m2).semi_major_m
    outline_m = np.column_stack([outline95(position_m[:2], covariance_m2, 33), np.full(33, 0.1)])
    lines = [outline_m] if semi_major_m <= 15.0 else []  # a larger ellipse would hide the yard
    stream.log(f"{path}/ellipse", rr.LineStrips3D(lines, colors=COLOURS[state], radii=0.05))
    stream.log(f"plots/uncertainty/{number}", rr.Scalars(semi_major_m))


def _draw_likelihood(stream: rr.RecordingStream, meta: Mapping[str, Any], log_likelihood: np.ndarray) -> None:
    """Draw the likelihood of the grid cells as a texture on the ground."""
    grid = grid_of(meta)
    peak = max(log_likelihood.max(), 50.0)  # 50 corresponds to about ten pulses from ten different places
    share = np.square(np.clip(log_likelihood.reshape(grid.shape) / peak, 0.0, 1.0))
    unlikely, likely = np.array([64, 70, 72]), np.array([235, 140, 60])
    inner = 0.5 + np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * (np.array(grid.shape) - 1)  # beyond, textures repeat
    texture = unlikely + share.T[::-1, :, np.newaxis] * (likely - unlikely)  # north first
    stream.log(
        "world/likelihood",
        rr.Mesh3D(
            vertex_positions=np.column_stack([grid.corner_m + grid.cell_m * inner, np.zeros(4)]),
            vertex_texcoords=np.abs(inner / grid.shape - [0, 1]),  # v points down
            triangle_indices=[[0, 1, 2], [0, 2, 3]],
            albedo_texture=np.round(texture).astype(np.uint8),
        ),
    )


def draw_phase_patterns(stream: rr.RecordingStream, log: MissionLog, report: Report) -> None:
    """Draw the phase-resolved pattern of each finding of a finished mission: pulses at their times, kind at the end."""
    (patterns, _), reach = phase_patterns(log), UNITS_PER_DB * SPAN_DB
    records = [record for record in (*report.findings, *report.candidates) if record.id in patterns]
    if not records:
        return
    level_db = np.concatenate([patterns[record.id][0].level_db for record in records])
    middle_db = 10 * round(float(np.median(level_db)) / 10)
    phase_deg = np.arange(0.0, 361.0, 5.0)
    sine = np.column_stack([phase_deg, -0.8 * reach * np.sin(np.radians(phase_deg))])
    frame = [[0, -reach], [0, reach], [360, reach], [360, -reach], [0, -reach]]
    lines = rr.LineStrips2D([sine, [[0, 0], [360, 0]], frame], colors=0x404648FF, radii=0.6)
    stream.log("phase_pattern/axes", lines, static=True)
    marks = {f"{x}°": [x, reach + 9.0] for x in range(0, 361, 90)}
    marks |= {f"{middle_db + db} dBV": [-22.0, -UNITS_PER_DB * db] for db in range(10 - SPAN_DB, SPAN_DB, 10)}
    labels = rr.Points2D(list(marks.values()), labels=list(marks), colors=0xFFFFFFFF, radii=0.1, show_labels=True)
    stream.log("phase_pattern/marks", labels, static=True)
    for order, record in enumerate(records):
        (pulses, _), path = patterns[record.id], f"phase_pattern/{record.id}"
        colour = (0x5AC8FFFF, 0xFFB228FF, 0x3CDC6EFF, 0xE66EDCFF, 0xF0E66EFF)[order % 5]
        steps, counts = np.unique(log.column("pulse", "step")[pulses.pulse], return_counts=True)
        places = np.column_stack([np.degrees(pulses.phase_rad) % 360.0, UNITS_PER_DB * (middle_db - pulses.level_db)])
        stream.log(path, rr.Points2D.from_fields(colors=colour, radii=1.2), static=True)
        points = rr.Points2D.columns(positions=places).partition(counts)
        stream.send_columns(path, at_steps(log, steps), points)
        row, column = divmod(order, 2)  # names are in two columns above the frame
        place = [90.0 + 180.0 * column, -reach - 18.0 * (row + 1.5)]
        text = f"{name_of(record.state, record.id)}: {kind_text(record)}"
        stream.log(f"{path}/kind", rr.Points2D(place, labels=text, colors=colour, radii=4.0, show_labels=True))


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
    header = ["| | site | kind | 95 % within | exists |", "|---|---|---|---|---|"]
    lines += header if report.findings else ["No findings."]
    for finding in report.findings:
        name, site = name_of(finding.state, finding.id), site_text(finding)
        size, exists = f"{finding.ellipse95.semi_major_m:.2f} m", existence_text(finding)
        lines.append(f"| **{name}** | {site} | {kind_text(finding)} | {size} | {exists} |")
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
