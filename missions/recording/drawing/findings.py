"""Candidates and findings: points, 95 % ellipses, heights; and the likelihood over the yard on the ground."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.encodings import ImageFormat

from dirmusic.locating.finding import ellipse95, outline95
from pdpatrol.missions.record.array_description import described_grid
from pdpatrol.missions.recording import paths
from pdpatrol.missions.recording.drawing import palette
from pdpatrol.missions.recording.drawing.canvas import Canvas, Slice, Table

FloatArray = NDArray[np.float64]

OUTLINE_POINTS = 33
ON_GROUND_M = 0.1
"""Above ground, where ellipses are drawn."""

HEIGHT_SIGMAS = 1.96
"""Half the 95 % interval of a height."""

MAX_DRAWN_ELLIPSE_M = 15.0
"""A longer ellipse would hide the yard; its fix is drawn as a point until it shrinks."""

LEAST_PEAK = 50.0
"""Log-likelihood that is drawn lightest until there is more: of some ten pulses from as many places."""

UNIT_SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


class Findings:
    """Draws findings as they change.

    Args:
        canvas: What to draw on.
        meta: Of the log.
    """

    def __init__(self, canvas: Canvas, meta: Mapping[str, Any]) -> None:
        self._canvas = canvas
        self._meta = meta
        self._named: set[int] = set()

    def draw(self, part: Slice) -> None:
        """Draw the findings of a slice, and the likelihood over the yard."""
        finding = part.finding
        for row in np.flatnonzero(finding["state"] == "dropped"):
            self._clear(int(finding["id"][row]), finding["step"][[row]])
        alive = finding["state"] != "dropped"
        for number in np.unique(finding["id"][alive]).tolist():
            rows = np.flatnonzero(alive & (finding["id"] == number))
            self._draw_one(number, {name: column[rows] for name, column in finding.items()})
        if part.likelihood["step"].size:
            self._draw_likelihood(part.likelihood)

    def _draw_one(self, number: int, finding: Table) -> None:
        steps, n, place = finding["step"], finding["step"].size, finding["position_m"]
        path = paths.finding_path(number)
        words = [f"{'finding' if state == 'confirmed' else state} {number}" for state in finding["state"]]
        colour = np.array([palette.STATES[str(state)] for state in finding["state"]], dtype=np.uint8)
        self._canvas.columns(path, steps, rr.Points3D.columns(positions=place, colors=colour, radii=np.full(n, 0.2)))
        self._canvas.columns(f"{path}/label", steps, rr.Points3D.columns(positions=place, labels=words))
        covariance = finding["covariance_m2"]
        semi_major = np.array([ellipse95(one).semi_major_m for one in covariance[:, :2, :2]])
        drawn = semi_major <= MAX_DRAWN_ELLIPSE_M
        flat = zip(place[drawn, :2], covariance[drawn, :2, :2], strict=True)
        outlines = [outline95(position, one, OUTLINE_POINTS) for position, one in flat]
        strips = [np.column_stack([line, np.full(len(line), ON_GROUND_M)]) for line in outlines]
        self._draw_lines(f"{path}/ellipse", steps, strips, drawn, colour)
        half_m = HEIGHT_SIGMAS * np.sqrt(covariance[:, 2, 2])
        low, high = (np.column_stack([place[:, :2], place[:, 2] + side * half_m]) for side in (-1.0, 1.0))
        low[:, 2] = np.maximum(low[:, 2], 0.0)
        bars = [np.stack([bottom, top]) for bottom, top in zip(low[drawn], high[drawn], strict=True)]
        self._draw_lines(f"{path}/height", steps, bars, drawn, colour)
        plot = f"{paths.UNCERTAINTY}/{number}"
        if number not in self._named:
            self._named.add(number)
            style = rr.Points3D.from_fields(colors=[palette.NAME], radii=[0.01], show_labels=True)
            self._canvas.still(f"{path}/label", style)
            self._canvas.still(plot, rr.SeriesLines(names=[f"{number}"]))
        self._canvas.columns(plot, steps, rr.Scalars.columns(scalars=np.log10(semi_major)))

    def _draw_lines(
        self,
        path: str,
        steps: NDArray[Any],
        strips: list[FloatArray],
        drawn: NDArray[np.bool_],
        colour: NDArray[np.uint8],
    ) -> None:
        """One line at each of the steps where something is drawn, none at the others."""
        lines = rr.LineStrips3D.columns(strips=strips).partition(drawn.astype(int))
        tints = rr.LineStrips3D.columns(colors=colour, radii=np.full(len(steps), 0.05))
        self._canvas.columns(path, steps, [*lines, *tints])

    def _clear(self, number: int, step: NDArray[Any]) -> None:
        path = paths.finding_path(number)
        for part in (path, f"{path}/label"):
            self._canvas.columns(part, step, rr.Points3D.columns(positions=np.empty((0, 3))).partition([0]))
        for part in ("ellipse", "height"):
            self._canvas.columns(f"{path}/{part}", step, rr.LineStrips3D.columns(strips=[]).partition([0]))

    def _draw_likelihood(self, likelihood: Table) -> None:
        """As pictures on the ground: dark where none of the pulses point, light where most do."""
        grid = described_grid(self._meta["grid"])
        nx, ny = grid.shape
        value = likelihood["log_likelihood"].reshape(-1, nx, ny)
        peak = np.maximum(value.max(axis=(1, 2), keepdims=True), LEAST_PEAK)
        share = np.square(np.clip(value / peak, 0.0, 1.0)).swapaxes(1, 2)[:, ::-1, :, np.newaxis]  # from the far side
        ground, light = np.array(palette.GROUND), np.array(palette.LIKELY)
        pictures = np.round(ground + share * (light - ground)).astype(np.uint8)
        picture = ImageFormat(width=nx, height=ny, color_model="RGB", channel_datatype="U8")
        n, steps = len(pictures), likelihood["step"]
        textures = {
            "albedo_texture_buffer": [one.tobytes() for one in pictures],
            "albedo_texture_format": [picture] * n,
        }
        self._canvas.columns(paths.LIKELIHOOD, steps, rr.Mesh3D.columns(**textures))
        outer = 0.5 + UNIT_SQUARE * [nx - 1, ny - 1]  # from centre to centre: beyond, a picture repeats
        corners = np.tile(np.column_stack([grid.corner_m + grid.cell_m * outer, np.zeros(4)]), (n, 1))
        onto = np.tile(np.abs(outer / [nx, ny] - [0.0, 1.0]), (n, 1))  # rows of a picture go down
        square = rr.Mesh3D.columns(vertex_positions=corners, vertex_texcoords=onto).partition([4] * n)
        halves = rr.Mesh3D.columns(triangle_indices=np.tile([[0, 1, 2], [0, 2, 3]], (n, 1))).partition([2] * n)
        self._canvas.columns(paths.LIKELIHOOD, steps, [*square, *halves])
