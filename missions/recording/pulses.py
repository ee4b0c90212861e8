"""Pulses: bearings as rays, the pseudo-spectrum as a ring around the robot, strengths of the elements."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from pdpatrol.missions.recording.bins import LogBin, lines_3d, set_step
from pdpatrol.missions.recording.spectra import AZIMUTHS_RAD, pseudo_spectra

FloatArray = NDArray[np.float64]

ARRAY_HEIGHT_M = 0.6
"""Height above ground at which rays and rings are drawn; roughly that of the array."""


def draw_pulses(stream: rr.RecordingStream, part: LogBin, unit_gain: FloatArray) -> None:
    """Draw all pulses of a bin as rays at their steps, and the strongest credible one as ring and darker ray.

    Args:
        stream: Recording to draw on.
        part: Bin to draw.
        unit_gain: See `pseudo_spectra`.
    """
    pulse, bearing_rad = part.tables["pulse"], part.tables["bearing"]["bearing_rad"]
    credible = part.tables["bearing"]["pulse"] - part.first_pulse
    rejected = np.setdiff1d(np.arange(pulse["step"].size), credible)
    spectrum = pseudo_spectra(pulse["strengths_v"], unit_gain)
    peak_rad = AZIMUTHS_RAD[spectrum.argmax(axis=-1)] + part.pose(pulse["step"])[:, 2]
    for step in np.unique(pulse["step"]).tolist():
        set_step(stream, part.log, step)
        for path, rows, towards_rad, length_m, colour, width in (
            ("world/bearings/new", credible, bearing_rad, 25.0, 0xFFE86EFF, 1.0),
            ("world/bearings/rejected", rejected, peak_rad[rejected], 6.0, 0x7D8087FF, 0.8),
        ):
            own = pulse["step"][rows] == step
            if own.any():
                stream.log(path, _rays(part.pose(step), towards_rad[own], length_m, colour, width))
    if not credible.size:
        return
    set_step(stream, part.log, part.end - 1)
    strengths_v = pulse["strengths_v"][credible]
    level_db = 20.0 * np.log10(np.maximum(np.median(strengths_v, axis=0), 1e-3))  # zeros: elements that face away
    stream.log("plots/strengths", rr.Scalars(level_db))
    strongest = int(np.linalg.norm(strengths_v, axis=-1).argmax())
    pose = part.pose(pulse["step"][credible[strongest]])
    ray = _rays(pose, bearing_rad[[strongest]], 25.0, 0x786E3AFF, 0.6)
    stream.log("world/bearings/past", ray)
    stream.log("plots/directions/bearing", rr.Scalars(np.degrees(bearing_rad[strongest])))
    if part.is_complete:  # the view shows the rings of the duration of a bin
        ring = _ring(pose, spectrum[credible[strongest]])
        stream.log("world/spectrum", lines_3d([ring], 0x5ADCFFFF, 1.5))


def _rays(pose: FloatArray, towards_rad: FloatArray, length_m: float, colour: int, width: float) -> rr.LineStrips3D:
    """Return rays from a pose in directions (n,) of the world frame."""
    start = np.array([*pose[:2], ARRAY_HEIGHT_M])
    ahead = np.column_stack([np.cos(towards_rad), np.sin(towards_rad), np.zeros(towards_rad.size)])
    rays = np.stack([np.broadcast_to(start, ahead.shape), start + length_m * ahead], axis=1)
    return lines_3d(rays.astype(np.float32), colour, width)


def _ring(pose: FloatArray, spectrum: FloatArray) -> FloatArray:
    """Return a pseudo-spectrum as a closed line around a pose, radius 0.8 m at zero and 3 m at the peak."""
    angle = np.append(AZIMUTHS_RAD, 0.0) + pose[2]
    radius_m = 0.8 + 2.2 * np.append(spectrum, spectrum[0])
    x, y = pose[0] + radius_m * np.cos(angle), pose[1] + radius_m * np.sin(angle)
    return np.column_stack([x, y, np.full(angle.size, ARRAY_HEIGHT_M)])
