"""Findings, their 95 % ellipses and phase-resolved patterns, and the likelihood on the ground."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import rerun as rr

from dirmusic.locating.finding import ellipse95, outline95
from pdpatrol.missions.record.finding_pulses import phase_patterns
from pdpatrol.missions.record.log_contents import grid_of
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording.motion import LogBin, at_steps, set_step
from pdpatrol.missions.recording.palette import PALETTE
from pdpatrol.missions.recording.scene import confirm_m, labels_3d
from pdpatrol.missions.report.records import FindingRecord, Report

UNITS_PER_DB, SPAN_DB = 4.0, 30
"""Scale of the level axis of a pattern, which points down, and half its range in dB. The phase axis is in degrees."""


def label_of_finding(state: str, number: int) -> str:
    """Return the label of a finding, or of a candidate or source beyond the fence, in plan and pattern."""
    return f"{number}" if state == "confirmed" else f"{number}?"


def draw_styles(stream: rr.RecordingStream, numbers: Iterable[int]) -> None:
    """Set the colours of candidates and findings in the plot of their ellipses."""
    for number in numbers:
        style = rr.SeriesLines(colors=PALETTE.of_finding(number), widths=1.5, names=str(number))
        stream.log(f"plots/uncertainty/{number}", style, static=True)


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
    state, number = finding["state"], int(finding["id"])
    path, colour, is_confirmed = f"world/findings/{number}", PALETTE.of_finding(number), state == "confirmed"
    if state == "dropped":
        stream.log(path, rr.Clear(recursive=True))
        return
    position_m, covariance_m2 = finding["position_m"], finding["covariance_m2"][:2, :2]
    stream.log(path, rr.Points3D([position_m], colors=colour, radii=0.25 if is_confirmed else 0.15))
    stream.log(f"{path}/label", labels_3d({label_of_finding(state, number): position_m}))
    semi_major_m = ellipse95(covariance_m2).semi_major_m
    outline_m = np.column_stack([outline95(position_m[:2], covariance_m2, 33), np.full(33, 0.1)])
    lines = [outline_m] if semi_major_m <= 15.0 else []  # a larger ellipse would hide the yard
    stream.log(f"{path}/ellipse", rr.LineStrips3D(lines, colors=colour, radii=0.1 if is_confirmed else 0.04))
    stream.log(f"plots/uncertainty/{number}", rr.Scalars(semi_major_m))


def _draw_likelihood(stream: rr.RecordingStream, meta: Mapping[str, Any], log_likelihood: np.ndarray) -> None:
    """Draw the likelihood of the grid cells as a texture on the ground."""
    grid = grid_of(meta)
    peak = max(log_likelihood.max(), 50.0)  # 50 corresponds to about ten pulses from ten different places
    share = np.square(np.clip(log_likelihood.reshape(grid.shape) / peak, 0.0, 1.0))
    unlikely, likely = (
        np.array([colour >> 24, colour >> 16 & 255, colour >> 8 & 255]) for colour in (PALETTE.ground, PALETTE.likely)
    )
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


def draw_limit(stream: rr.RecordingStream, part: LogBin) -> None:
    """Draw the size of the ellipse below which a finding may be confirmed, at the end of a bin."""
    stream.log("plots/uncertainty/limit", rr.Scalars(confirm_m(part.log.meta)))


def draw_phase_patterns(stream: rr.RecordingStream, log: MissionLog, report: Report) -> None:
    """Draw the phase-resolved pattern of each finding of a finished mission: pulses at their times, kind at the end."""
    patterns, _ = phase_patterns(log)
    records = [record for record in (*report.findings, *report.candidates) if record.id in patterns]
    if not records:
        return
    level_db = np.concatenate([patterns[record.id][0].level_db for record in records])
    middle_db = 10 * round(float(np.median(level_db)) / 10)
    _draw_pattern_axes(stream, middle_db)
    for order, record in enumerate(records):
        (pulses, _), path = patterns[record.id], f"phase_pattern/{record.id}"
        steps, counts = np.unique(log.column("pulse", "step")[pulses.pulse], return_counts=True)
        places = np.column_stack([np.degrees(pulses.phase_rad) % 360.0, UNITS_PER_DB * (middle_db - pulses.level_db)])
        style = rr.Points2D.from_fields(colors=PALETTE.of_finding(record.id), radii=1.2)
        stream.log(path, style, static=True)
        points = rr.Points2D.columns(positions=places).partition(counts)
        stream.send_columns(path, at_steps(log, steps), points)
        set_step(stream, log, log.last_step)
        _draw_kind(stream, record, order)


def _draw_pattern_axes(stream: rr.RecordingStream, middle_db: int) -> None:
    """Draw frame, sine of the mains and axes around a level, dBV at 1 m."""
    reach, phase_deg = UNITS_PER_DB * SPAN_DB, np.arange(0.0, 361.0, 5.0)
    sine = np.column_stack([phase_deg, -0.8 * reach * np.sin(np.radians(phase_deg))])
    frame = [[0, -reach], [0, reach], [360, reach], [360, -reach], [0, -reach]]
    lines = rr.LineStrips2D([sine, [[0, 0], [360, 0]], frame], colors=PALETTE.line, radii=0.6)
    stream.log("phase_pattern/axes", lines, static=True)
    marks = {f"{x}°": [x, reach + 5.0] for x in range(0, 361, 90)}
    marks |= {f"{middle_db + db} dBV": [-44.0, -UNITS_PER_DB * db - 9.0] for db in range(10 - SPAN_DB, SPAN_DB, 10)}
    labels = rr.Points2D(list(marks.values()), labels=list(marks), colors=PALETTE.label, radii=0.1, show_labels=True)
    stream.log("phase_pattern/marks", labels, static=True)


def _draw_kind(stream: rr.RecordingStream, record: FindingRecord, order: int) -> None:
    """Name a finding and its kind above the frame of the pattern, in two columns; a window of 1280 pixels is enough."""
    row, column = divmod(order, 2)
    x, y = 90.0 + 180.0 * column, -UNITS_PER_DB * SPAN_DB - 36.0 * (row + 1.1)
    path, colour = f"phase_pattern/{record.id}/kind", PALETTE.of_finding(record.id)
    stream.log(path, rr.Points2D([x, y], colors=colour, radii=4.0))
    kind = "not known" if record.discharge is None else record.discharge.kind
    text = f"{label_of_finding(record.state, record.id)} {kind}"
    stream.log(f"{path}/label", rr.Points2D([x, y], labels=text, colors=PALETTE.label, radii=0.1, show_labels=True))
