"""Pseudo-spectra over time: an image with time to the right, bearing upwards, and the heading of the robot."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from dirmusic.angles import wrap
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording.bins import LogBin, labels_2d, set_step

FloatArray = NDArray[np.float64]

N_AZIMUTHS = 180
AZIMUTHS_RAD = 2.0 * np.pi / N_AZIMUTHS * np.arange(N_AZIMUTHS)
"""Azimuths at which pseudo-spectra are computed."""

WIDTH, HEIGHT = 480.0, 180.0
"""Size of the image, which spans the mission and all bearings."""

TILE_BINS = 10
"""Bins of each tile by which the image grows."""

HEAT = np.array([(24, 28, 34), (88, 38, 92), (200, 70, 60), (250, 170, 60), (255, 250, 190)])
"""Colour map from zero to the peak, in even steps."""


def pseudo_spectra(strengths_v: FloatArray, unit_gain: FloatArray) -> FloatArray:
    """Return the pseudo-spectrum of each pulse by eq. (13) to (15) of the Dir-MUSIC paper, largest value 1.

    Args:
        strengths_v: Strengths at the elements, shape (n, n_elements).
        unit_gain: Gains at `AZIMUTHS_RAD`, normalised at each azimuth, shape (n_elements, N_AZIMUTHS).
    """
    norm = np.maximum(np.linalg.norm(strengths_v, axis=-1, keepdims=True), np.finfo(float).tiny)
    value = 1.0 / (1.001 - np.square(strengths_v / norm @ unit_gain))
    return value / value.max(axis=-1, keepdims=True)


def draw_spectra(
    stream: rr.RecordingStream,
    part: LogBin,
    unit_gain: FloatArray,
    bin_steps: int,
    end_s: float,
    *,
    is_last: bool,
) -> None:
    """Draw the heading of a bin and, when a tile is complete, the mean spectra of its bins in the world frame."""
    log, tile_steps = part.log, TILE_BINS * bin_steps
    if part.end > part.first_step:
        set_step(stream, log, part.end - 1)
        row = max(part.first_step - 1, 0)
        time_s, yaw_rad = log.column("step", "time_s", row, part.end), log.column("step", "pose", row, part.end)[:, 2]
        line = np.column_stack([WIDTH * time_s / end_s, _height(wrap(yaw_rad))])
        pieces = np.split(line, np.flatnonzero(np.abs(np.diff(line[:, 1])) > 0.5 * HEIGHT) + 1)  # at +-180 degrees
        stream.log("spectra/heading", rr.LineStrips2D(pieces, colors=[0x2896FFFF], radii=[0.7]))
    if part.end and (is_last or part.end % tile_steps == 0):
        _draw_tile(stream, log, (part.end - 1) // tile_steps * tile_steps, part.end, unit_gain, bin_steps, end_s)


def _draw_tile(
    stream: rr.RecordingStream,
    log: MissionLog,
    first: int,
    end: int,
    unit_gain: FloatArray,
    bin_steps: int,
    end_s: float,
) -> None:
    """Draw the spectra of the steps from `first` up to `end`."""
    pulse = log.table("pulse", log.rows_before("pulse", first), log.rows_before("pulse", end))
    credible = pulse["is_credible"]
    row = pulse["step"][credible] - first
    yaw_rad = log.column("step", "pose", first, end)[row, 2]
    azimuth_rad = AZIMUTHS_RAD - yaw_rad[:, np.newaxis]  # in the frame of the array
    nearest = np.round(azimuth_rad / AZIMUTHS_RAD[1]).astype(np.intp) % N_AZIMUTHS
    spectrum = np.take_along_axis(pseudo_spectra(pulse["strengths_v"][credible], unit_gain), nearest, axis=-1)
    columns = np.zeros((-(-(end - first) // bin_steps), N_AZIMUTHS))
    np.add.at(columns, row // bin_steps, spectrum)
    columns /= np.maximum(np.bincount(row // bin_steps, minlength=len(columns)), 1)[:, np.newaxis]
    image = np.roll(columns, N_AZIMUTHS // 2, axis=1)[:, ::-1].T  # from 180 degrees at the top to -180
    colours = np.stack([np.interp(image, np.linspace(0.0, 1.0, len(HEAT)), channel) for channel in HEAT.T], axis=-1)
    time_s = np.append(0.0, log.column("step", "time_s", 0, end))
    left, right = WIDTH * time_s[[first, end]] / end_s
    scale = [max(right - left, 1e-6) / len(columns), HEIGHT / N_AZIMUTHS, 1.0]
    path = f"spectra/{first // (TILE_BINS * bin_steps)}"
    stream.log(path, rr.Transform3D(translation=[left, 0.0, 0.0], scale=scale), static=True)
    set_step(stream, log, end - 1)
    stream.log(path, rr.Image(np.round(colours).astype(np.uint8)))


def draw_spectra_axes(stream: rr.RecordingStream, end_s: float) -> None:
    """Draw the frame, with bearings on the left and times below."""
    steps_s = (1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600)
    step_s = next((step for step in steps_s if step >= end_s / 6), end_s / 6)
    bearings = {"180°": 180, "north 90°": 90, "east 0°": 0, "south -90°": -90, "-180°": -180}
    heights = {name: float(_height(np.radians(degrees))) for name, degrees in bearings.items()}
    marks = {name: [-4.0, y] for name, y in heights.items()}
    marks |= {f"{t:g} s": [WIDTH * t / end_s, HEIGHT + 10.0] for t in np.arange(0.0, end_s + 1e-6, step_s)}
    stream.log("spectra/axes/marks", labels_2d(marks), static=True)
    lines = [[[0.0, y], [WIDTH, y]] for y in heights.values()] + [[[x, 0.0], [x, HEIGHT]] for x in (0.0, WIDTH)]
    stream.log("spectra/axes/lines", rr.LineStrips2D(lines, colors=[0x404648FF], radii=[0.4]), static=True)


def _height(bearing_rad: FloatArray | float) -> FloatArray:
    """Return the y coordinate of a bearing in [-pi, pi]; y points down in the image."""
    return np.asarray(HEIGHT * (0.5 - np.asarray(bearing_rad) / (2.0 * np.pi)))
