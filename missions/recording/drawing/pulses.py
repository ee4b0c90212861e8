"""What the robot receives: rays of pulses, the ring of the pseudo-spectrum, strengths and directions over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from dirmusic import GainManifold
from dirmusic.angles import wrap
from pdpatrol.missions.recording import paths
from pdpatrol.missions.recording.drawing import palette
from pdpatrol.missions.recording.drawing.canvas import Canvas, Slice

FloatArray = NDArray[np.float64]

RAY_M, REJECTED_RAY_M = 25.0, 6.0
ANTENNA_HEIGHT_M = 0.6
"""Above ground, where rays and rings are drawn: about that of the array."""

N_AZIMUTHS = 180
AZIMUTH_STEP_RAD = 2.0 * np.pi / N_AZIMUTHS
AZIMUTHS_RAD = AZIMUTH_STEP_RAD * np.arange(N_AZIMUTHS)
"""At which pseudo-spectra are drawn."""

RING_STRIDE = 4
"""Every so many azimuths are on the ring, and its peak."""

RING_RADIUS_M = (0.8, 3.0)
"""Where the pseudo-spectrum is 0 and where it is 1."""

QUIETEST_DBV = -60.0
"""Strengths below are drawn here: noise, and elements that look away."""


@dataclass(frozen=True, kw_only=True)
class Spectra:
    """Pseudo-spectra of the pulses of a slice, each by itself, with the array of the data sheet.

    Attributes:
        step: Of each pulse, shape (n,).
        end: Last step of its bin, shape (n,).
        yaw_rad: Of the robot when it came, shape (n,).
        is_credible: Shape (n,).
        value: At `AZIMUTHS_RAD` in the frame of the array, the largest 1, shape (n, N_AZIMUTHS).
        peak_rad: Azimuth of the peak, by a parabola through its highest three values, shape (n,).
    """

    step: NDArray[np.intp]
    end: NDArray[np.intp]
    yaw_rad: FloatArray
    is_credible: NDArray[np.bool_]
    value: FloatArray
    peak_rad: FloatArray


class Pulses:
    """Draws pulses as they come.

    Args:
        canvas: What to draw on.
        manifold: Of the array, as the data sheet has it.
    """

    def __init__(self, canvas: Canvas, manifold: GainManifold) -> None:
        self._canvas = canvas
        gain = manifold.gain(AZIMUTHS_RAD)
        self._unit_gain = gain / np.linalg.norm(gain, axis=0)
        styles = {
            paths.NEW_BEARINGS: (palette.NEW_BEARING, 1.0),
            paths.PAST_BEARINGS: (palette.PAST_BEARING, 0.6),
            paths.REJECTED: (palette.REJECTED, 0.8),
            paths.SPECTRUM: (palette.SPECTRUM, 1.5),
        }
        for path, (colour, width) in styles.items():
            canvas.still(path, rr.LineStrips3D.from_fields(colors=[colour], radii=rr.Radius.ui_points([width])))
        elements = range(manifold.n_elements)
        names = [f"element {element + 1}" for element in elements]
        colours = [palette.ELEMENTS[element % len(palette.ELEMENTS)] for element in elements]
        canvas.still(paths.STRENGTHS, rr.SeriesLines(names=names, colors=colours, widths=[1.5]))
        for name, colour, size in (("bearing", palette.NEW_BEARING, 2.0), ("heading", palette.HEADING, 1.5)):
            style = rr.SeriesPoints(names=[name], colors=[colour], marker_sizes=[size])
            canvas.still(f"{paths.DIRECTIONS}/{name}", style)

    def spectra(self, part: Slice) -> Spectra:
        """Of the pulses of a slice, by eq. (13) to (15) of the Dir-MUSIC paper for one pulse."""
        strengths, step = part.pulse["strengths_v"], part.pulse["step"]
        norm = np.maximum(np.linalg.norm(strengths, axis=-1, keepdims=True), np.finfo(float).tiny)
        fit = np.square(strengths / norm @ self._unit_gain)
        value = 1.0 / (1.001 - fit)
        at = fit.argmax(axis=-1)
        low, middle, high = (fit[np.arange(len(fit)), (at + k) % N_AZIMUTHS] for k in (-1, 0, 1))
        bend = np.minimum(low - 2.0 * middle + high, -np.finfo(float).tiny)
        offset = np.clip(0.5 * (low - high) / bend, -0.5, 0.5)
        return Spectra(
            step=step,
            end=part.bin_end(step),
            yaw_rad=part.at("pose", step)[:, 2],
            is_credible=part.pulse["is_credible"],
            value=value / value.max(axis=-1, keepdims=True),
            peak_rad=AZIMUTH_STEP_RAD * (at + offset),
        )

    def draw(self, part: Slice, spectra: Spectra) -> None:
        """Draw the pulses of a slice."""
        pulse, bearing_rad = part.pulse, part.bearing["bearing_rad"]
        row = part.bearing["pulse"] - part.first_pulse
        self._draw_rays(part, paths.NEW_BEARINGS, pulse["step"][row], bearing_rad, RAY_M)
        rejected = np.setdiff1d(np.arange(pulse["step"].size), row)
        towards = spectra.peak_rad[rejected] + spectra.yaw_rad[rejected]
        self._draw_rays(part, paths.REJECTED, pulse["step"][rejected], towards, REJECTED_RAY_M)
        heading_deg = np.degrees(wrap(part.at("pose", part.bin_ends)[:, 2]))
        self._canvas.columns(f"{paths.DIRECTIONS}/heading", part.bin_ends, rr.Scalars.columns(scalars=heading_deg))
        if row.size:
            self._draw_bins(part, spectra, row)

    def _draw_bins(self, part: Slice, spectra: Spectra, row: NDArray[np.intp]) -> None:
        """For each bin in which something credible came: ring and bearing of the loudest pulse, median strengths."""
        strengths, end = part.pulse["strengths_v"][row], spectra.end[row]
        ends, bins = np.unique(end, return_inverse=True)
        decibel = 20.0 * np.log10(np.maximum(strengths, 10 ** (QUIETEST_DBV / 20)))
        medians = np.stack([np.median(decibel[bins == k], axis=0) for k in range(ends.size)])
        lines = rr.Scalars.columns(scalars=medians.ravel()).partition([medians.shape[1]] * ends.size)
        self._canvas.columns(paths.STRENGTHS, ends, lines)
        order = np.lexsort((np.linalg.norm(strengths, axis=-1), bins))
        loudest = order[np.searchsorted(bins[order], np.arange(ends.size), side="right") - 1]
        step, bearing_rad = spectra.step[row[loudest]], part.bearing["bearing_rad"][loudest]
        self._draw_rays(part, paths.PAST_BEARINGS, step, bearing_rad, RAY_M)
        degrees = rr.Scalars.columns(scalars=np.degrees(bearing_rad))
        self._canvas.columns(f"{paths.DIRECTIONS}/bearing", ends, degrees)
        whole = (ends + 1) % part.bin_steps == 0  # the ring of a shorter one would be seen beside the one before
        ends, loudest, step = ends[whole], loudest[whole], step[whole]
        rings = _rings(spectra.value[row[loudest]], spectra.peak_rad[row[loudest]])
        pose = part.at("pose", step)
        cos, sin = (turn(pose[:, 2, np.newaxis]) for turn in (np.cos, np.sin))
        x, y = rings[..., 0], rings[..., 1]
        in_world = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1) + pose[:, np.newaxis, :2]
        height = np.full((*in_world.shape[:2], 1), ANTENNA_HEIGHT_M)
        strips = np.concatenate([in_world, height], axis=-1).astype(np.float32)
        self._canvas.columns(paths.SPECTRUM, ends, rr.LineStrips3D.columns(strips=strips))

    def _draw_rays(
        self, part: Slice, path: str, steps: NDArray[np.intp], towards_rad: FloatArray, length_m: float
    ) -> None:
        """A ray for each pulse, from where the robot was; towards_rad in the world frame."""
        if not steps.size:
            return
        start = np.column_stack([part.at("pose", steps)[:, :2], np.full(steps.size, ANTENNA_HEIGHT_M)])
        ahead = np.column_stack([np.cos(towards_rad), np.sin(towards_rad), np.zeros(steps.size)])
        rays = np.stack([start, start + length_m * ahead], axis=1).astype(np.float32)
        at, counts = np.unique(steps, return_counts=True)
        self._canvas.columns(path, at, rr.LineStrips3D.columns(strips=rays).partition(counts))


def _rings(value: FloatArray, peak_rad: FloatArray) -> FloatArray:
    """Pseudo-spectra as closed lines about the origin of the array's frame, shape (n, n_points, 2), metres."""
    radius = np.array(value[:, ::RING_STRIDE])
    azimuth = np.tile(AZIMUTHS_RAD[::RING_STRIDE], (len(value), 1))
    nearest = np.round(peak_rad / (RING_STRIDE * AZIMUTH_STEP_RAD)).astype(np.intp) % azimuth.shape[1]
    rows = np.arange(len(value))
    radius[rows, nearest], azimuth[rows, nearest] = 1.0, peak_rad
    low, high = RING_RADIUS_M
    radius_m = low + (high - low) * radius
    ring = np.stack([radius_m * np.cos(azimuth), radius_m * np.sin(azimuth)], axis=-1)
    return np.concatenate([ring, ring[:, :1]], axis=1)
