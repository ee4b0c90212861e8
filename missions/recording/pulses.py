"""Pulses: bearings as rays and over time, the pseudo-spectrum as a ring around the robot, strengths of the elements."""

from __future__ import annotations

import numpy as np
import rerun as rr

from dirmusic import GainManifold
from dirmusic.arrays import FloatArray
from pdpatrol.missions.record.log_contents import described_manifold
from pdpatrol.missions.recording.bins import LogBin, at_steps, lines_3d

AZIMUTHS_RAD = np.radians(np.arange(0.0, 360.0, 2.0))
"""Azimuths at which pseudo-spectra are computed."""

ARRAY_HEIGHT_M = 0.6
"""Height above ground at which rays and rings are drawn; roughly that of the array."""

BEARING = 0xFFE86EFF


def draw_pulses(stream: rr.RecordingStream, part: LogBin) -> None:
    """Draw the bearings of a bin as rays and over time, the strongest pulse as a ring, and the median strengths."""
    bearing_rad, rows = part.tables["bearing"]["bearing_rad"], part.tables["bearing"]["pulse"] - part.first["pulse"]
    if not rows.size:
        for path in ("world/bearings", "world/spectrum"):
            stream.log(path, rr.Clear.flat())
        return
    step, strengths_v = part.tables["pulse"]["step"][rows], part.tables["pulse"]["strengths_v"][rows]
    pose = part.tables["step"]["pose"][step - part.first["step"]]
    start_m = np.column_stack([pose[:, :2], np.full(rows.size, ARRAY_HEIGHT_M)])
    ahead = np.column_stack([np.cos(bearing_rad), np.sin(bearing_rad), np.zeros(rows.size)])
    stream.log("world/bearings", lines_3d(np.stack([start_m, start_m + 25.0 * ahead], axis=1), BEARING, 1.0))
    strongest = int(np.linalg.norm(strengths_v, axis=-1).argmax())
    manifold = described_manifold(part.log.meta["array"])
    ring_m = _ring(pose[strongest], strengths_v[strongest], manifold)
    stream.log("world/spectrum", lines_3d([ring_m], 0x5ADCFFFF, 1.5))
    level_db = 20.0 * np.log10(np.maximum(np.median(strengths_v, axis=0), 1e-3))  # zeros: elements that face away
    stream.log("plots/strengths", rr.Scalars(level_db))
    degrees = rr.Scalars.columns(scalars=np.degrees(bearing_rad))
    stream.send_columns("plots/directions/bearing", at_steps(part.log, step), degrees)


def _ring(pose: FloatArray, strengths_v: FloatArray, manifold: GainManifold) -> FloatArray:
    """Return the pseudo-spectrum of a pulse as a closed line around a pose, radius 0.8 m at zero and 3 m at the peak.

    It follows eq. (13) to (15) of the Dir-MUSIC paper, with 1.001 for 1 so that the peak is not infinite.
    """
    gain = manifold.gain(AZIMUTHS_RAD)
    fit = strengths_v @ gain / (np.linalg.norm(strengths_v) * np.linalg.norm(gain, axis=0))
    spectrum = 1.0 / (1.001 - np.square(fit))
    angle = np.append(AZIMUTHS_RAD, 0.0) + pose[2]
    radius_m = 0.8 + 2.2 * np.append(spectrum, spectrum[0]) / spectrum.max()
    x, y = pose[0] + radius_m * np.cos(angle), pose[1] + radius_m * np.sin(angle)
    return np.column_stack([x, y, np.full(angle.size, ARRAY_HEIGHT_M)])
