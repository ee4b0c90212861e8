"""Candidates and findings with their 95 % ellipses, and the likelihood of a source on the ground."""

from __future__ import annotations

import numpy as np
import rerun as rr

from dirmusic.locating.finding import ellipse95, outline95
from pdpatrol.missions.recording.bins import LogBin, labels_3d, set_step
from pdpatrol.missions.report.make_report import likelihood_shares

COLOURS = {
    "candidate": (255, 178, 40),
    "confirmed": (60, 220, 110),
    "outside": (150, 150, 160),
    "ghost": (170, 120, 120),
}
"""Colours of findings by state; the ellipse of a film has the same."""


def draw_findings(stream: rr.RecordingStream, part: LogBin) -> None:
    """Draw the last row of each finding in a bin, and the last likelihood."""
    finding = part.tables["finding"]
    for row in {number: row for row, number in enumerate(finding["id"].tolist())}.values():
        _draw_finding(stream, part, row)
    if part.tables["likelihood"]["step"].size:
        _draw_likelihood(stream, part)


def _draw_finding(stream: rr.RecordingStream, part: LogBin, row: int) -> None:
    finding = {name: column[row] for name, column in part.tables["finding"].items()}
    state, path = str(finding["state"]), f"world/findings/{finding['id']}"
    set_step(stream, part.log, int(finding["step"]))
    if state == "dropped":
        stream.log(path, rr.Clear(recursive=True))
        return
    position_m, covariance_m2, colour = finding["position_m"], finding["covariance_m2"], COLOURS[state]
    stream.log(path, rr.Points3D([position_m], colors=[colour], radii=[0.2]))
    draw_label(
        stream, int(finding["id"]), position_m, f"{'finding' if state == 'confirmed' else state} {finding['id']}"
    )
    semi_major_m = ellipse95(covariance_m2[:2, :2]).semi_major_m
    lines = []
    if semi_major_m <= 15.0:  # a larger one would hide the yard
        outline_m = outline95(position_m[:2], covariance_m2[:2, :2], 33)
        half_m = 1.96 * np.sqrt(covariance_m2[2, 2])  # 95 % interval of the height
        x, y, z = position_m
        lines = [np.column_stack([outline_m, np.full(33, 0.1)]), [[x, y, max(z - half_m, 0.0)], [x, y, z + half_m]]]
    stream.log(f"{path}/ellipse", rr.LineStrips3D(lines, colors=[colour], radii=[0.05]))
    stream.log(f"plots/uncertainty/{finding['id']}", rr.Scalars(np.log10(semi_major_m)))


def draw_label(stream: rr.RecordingStream, number: int, position_m: np.ndarray, text: str) -> None:
    """Draw the label of a finding."""
    stream.log(f"world/findings/{number}/label", labels_3d({text: position_m}))


def _draw_likelihood(stream: rr.RecordingStream, part: LogBin) -> None:
    """Draw the likelihood as a texture of the ground."""
    grid, share = likelihood_shares(part.log.meta, part.tables["likelihood"]["log_likelihood"][-1])
    unlikely, likely = np.array([64, 70, 72]), np.array([235, 140, 60])
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    inner = 0.5 + corners * (np.array(grid.shape) - 1)  # between the centres of cells: textures repeat beyond
    share = share.T[::-1, :, np.newaxis]  # north first
    texture = np.round(unlikely + share * (likely - unlikely)).astype(np.uint8)
    set_step(stream, part.log, int(part.tables["likelihood"]["step"][-1]))
    stream.log(
        "world/likelihood",
        rr.Mesh3D(
            vertex_positions=np.column_stack([grid.corner_m + grid.cell_m * inner, np.zeros(4)]),
            vertex_texcoords=np.abs(inner / grid.shape - [0, 1]),  # v points down
            triangle_indices=[[0, 1, 2], [0, 2, 3]],
            albedo_texture=texture,
        ),
    )
