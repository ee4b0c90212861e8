"""Pseudo-spectra over time: time to the right, bearing upwards, and the heading of the robot on it."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from dirmusic.angles import wrap
from pdpatrol.missions.recording import paths
from pdpatrol.missions.recording.drawing import palette
from pdpatrol.missions.recording.drawing.canvas import Canvas, Slice
from pdpatrol.missions.recording.drawing.pulses import AZIMUTH_STEP_RAD, N_AZIMUTHS, Spectra

FloatArray = NDArray[np.float64]

WIDTH, HEIGHT = 480.0, float(N_AZIMUTHS)
"""Of the picture, in its own units: from the start to the end of the mission, and once around."""

ROWS = N_AZIMUTHS // 2
"""Of pixels: two azimuths each."""

TILE_BINS = 10
"""The picture grows by tiles of so many bins."""

MOST_TILES = 120

COMPASS_DEG = (180, 90, 0, -90, -180)
"""Bearings that are marked, counter-clockwise from east."""

MARKS = 6
"""Times that are marked, about as many."""


class SpectraOverTime:
    """Draws the mean pseudo-spectrum of the credible pulses of each bin as a column of a picture, in the world frame.

    Args:
        canvas: What to draw on.
        end_s: When the mission ends at the latest; the picture is as long.
        bin_s: How long a bin lasts.
    """

    def __init__(self, canvas: Canvas, end_s: float, bin_s: float) -> None:
        self._canvas = canvas
        self._end_s = max(end_s, 1e-9)
        self._tile_bins = max(TILE_BINS, round(end_s / bin_s / MOST_TILES))
        self._columns: list[FloatArray] = []
        self._tile, self._tile_start_s = 0, 0.0
        self._end = (0, 0.0)
        self._heading: FloatArray | None = None
        canvas.still(paths.SPECTRA_HEADING, rr.LineStrips2D.from_fields(colors=[palette.HEADING], radii=[0.7]))
        self._draw_axes()

    def draw(self, part: Slice, spectra: Spectra) -> None:
        """Draw the bins of a slice as far as they fill tiles."""
        if not part.steps.size:
            return
        credible = spectra.is_credible
        turned = np.round(spectra.yaw_rad[credible] / AZIMUTH_STEP_RAD).astype(np.intp)
        source = (np.arange(N_AZIMUTHS) - turned[:, np.newaxis]) % N_AZIMUTHS
        in_world = np.take_along_axis(spectra.value[credible], source, axis=-1)
        ends, times = part.bin_ends, part.at("time_s", part.bin_ends)
        number = np.searchsorted(ends, spectra.end[credible])
        for k, end in enumerate(ends):
            own = in_world[number == k]
            self._columns.append(own.mean(axis=0) if own.size else np.zeros(N_AZIMUTHS))
            self._end = int(end), float(times[k])
            if len(self._columns) == self._tile_bins:
                self.finish()
        self._draw_heading(part, times)

    def finish(self) -> None:
        """Draw the last tile, which may be a shorter one."""
        if self._columns:
            self._draw_tile(*self._end)

    def _draw_tile(self, step: int, end_s: float) -> None:
        columns, start_s = np.stack(self._columns, axis=-1), self._tile_start_s
        self._columns, self._tile_start_s = [], end_s
        upwards = np.roll(columns, N_AZIMUTHS // 2, axis=0)[::-1]  # from 180 at the top to -180 degrees
        upwards = upwards.reshape(ROWS, 2, -1).max(axis=1)
        levels = np.linspace(0.0, 1.0, len(palette.HEAT))
        rgb = np.stack([np.interp(upwards, levels, channel) for channel in np.array(palette.HEAT).T], axis=-1)
        path = f"{paths.SPECTRA}/{self._tile}"
        self._tile += 1
        x = WIDTH * start_s / self._end_s
        scale = WIDTH * (end_s - start_s) / self._end_s / columns.shape[1]
        place = rr.Transform3D(translation=[x, 0.0, 0.0], scale=[max(scale, 1e-6), HEIGHT / ROWS, 1.0])
        self._canvas.still(path, place)
        picture = rr.Image.columns(
            buffer=[np.round(rgb).astype(np.uint8).tobytes()],
            format=[
                rr.components.ImageFormat(width=columns.shape[1], height=ROWS, color_model="RGB", channel_datatype="U8")
            ],
        )
        self._canvas.columns(path, np.array([step]), picture)

    def _draw_heading(self, part: Slice, times: FloatArray) -> None:
        yaw = wrap(part.at("pose", part.bin_ends)[:, 2])
        points = np.column_stack([WIDTH * times / self._end_s, _height(yaw)])
        before = np.vstack([points[0] if self._heading is None else self._heading, points[:-1]])
        self._heading = points[-1]
        jumps = np.abs(points[:, 1] - before[:, 1]) > 0.5 * HEIGHT  # from -180 to 180 degrees
        before[jumps] = points[jumps]
        strips = np.stack([before, points], axis=1).astype(np.float32)
        self._canvas.columns(paths.SPECTRA_HEADING, part.bin_ends, rr.LineStrips2D.columns(strips=strips))

    def _draw_axes(self) -> None:
        """Marks of bearings on the left, of times below."""
        step_s = _round_step(self._end_s / MARKS)
        times = np.arange(0.0, self._end_s + 1e-6, step_s)
        names = {90: "north 90", 0: "east 0", -90: "south -90"}
        marks = [[-4.0, float(_height(np.radians(degrees)))] for degrees in COMPASS_DEG]
        marks += [[WIDTH * float(t) / self._end_s, HEIGHT + 10.0] for t in times]
        labels = [f"{names.get(degrees, degrees)}°" for degrees in COMPASS_DEG] + [f"{t:g} s" for t in times]
        points = rr.Points2D(marks, labels=labels, radii=[0.1], colors=[palette.NAME], show_labels=True)
        self._canvas.still(f"{paths.SPECTRA_AXES}/marks", points)
        grid = [[[0.0, y], [WIDTH, y]] for y in (float(_height(np.radians(d))) for d in (90, 0, -90))]
        frame = [[0.0, 0.0], [WIDTH, 0.0], [WIDTH, HEIGHT], [0.0, HEIGHT], [0.0, 0.0]]
        lines = rr.LineStrips2D([frame, *grid], colors=[palette.GROUND], radii=[0.4])
        self._canvas.still(f"{paths.SPECTRA_AXES}/lines", lines)


def _height(bearing_rad: FloatArray | float) -> FloatArray:
    """Where a bearing in [-pi, pi] lies in the picture, whose y goes down."""
    return np.asarray(HEIGHT * (0.5 - np.asarray(bearing_rad) / (2.0 * np.pi)))


def _round_step(at_least: float) -> float:
    """The next of 1, 2, 5, 10, 20, 30 seconds, and of minutes likewise, and so on."""
    steps = (1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 18000, 36000)
    return float(next((step for step in steps if step >= at_least), 36000.0 * np.ceil(at_least / 36000.0)))
