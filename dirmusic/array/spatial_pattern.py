"""Gain of one directional element over azimuth, elevation and frequency, as measured or computed."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import scipy  # its submodules are loaded when they are first used
from numpy.typing import ArrayLike, NDArray

from dirmusic.array.pattern import MAX_GAP_RAD, TabulatedPattern

FloatArray = NDArray[np.float64]

LEAST_GAIN = 1e-6
"""What a spline that swings below zero between the angles of a table is raised to: 120 dB below the reference."""

CUT_STEP_RAD = np.radians(1.0)
"""Of a cut's own table: so fine that it does not matter what is interpolated first."""

AROUND = 4
"""Azimuths that are repeated on either side, so that the spline goes on once round."""


class SpatialPattern:
    """A pattern as a table: cubic between its angles, linear between its frequencies.

    Angles are those of the element: azimuth off the boresight, counter-clockwise seen from above, and elevation from
    the plane of boresight and left side. Above the highest frequency of the table the gain is that of the highest, and
    so on below the lowest and beyond the outermost elevations.

    Args:
        frequency_hz: Rising, shape (n_frequencies,).
        azimuth_rad: Rising, less than one turn from first to last, and all round: no gap wider than 30 degrees; shape
            (n_azimuths,), n >= 12.
        elevation_rad: Rising, in [-pi/2, pi/2], on both sides of 0; shape (n_elevations,), n >= 4.
        gain: Amplitude gain, positive, shape (n_frequencies, n_azimuths, n_elevations). Straight up and down, where all
            azimuths are one direction, their mean counts.

    Raises:
        ValueError: If shapes disagree, an axis is not as said, or a gain is not positive and finite.
    """

    def __init__(
        self, frequency_hz: ArrayLike, azimuth_rad: ArrayLike, elevation_rad: ArrayLike, gain: ArrayLike
    ) -> None:
        frequency, azimuth, elevation, table = (
            np.array(x, dtype=np.float64) for x in (frequency_hz, azimuth_rad, elevation_rad, gain)
        )
        shape = frequency.size, azimuth.size, elevation.size
        for name, axis in (("frequency_hz", frequency), ("azimuth_rad", azimuth), ("elevation_rad", elevation)):
            if axis.ndim != 1 or not np.isfinite(axis).all() or not np.all(np.diff(axis) > 0):
                raise ValueError(f"`{name}` must be finite and strictly increasing, of one axis")
        if table.shape != shape or not (np.isfinite(table).all() and np.all(table > 0)):
            raise ValueError(f"`gain` must be finite, positive and of shape {shape}, got {table.shape}")
        if frequency.size == 0 or frequency[0] <= 0:
            raise ValueError("`frequency_hz` must have one frequency at least, all above 0")
        widest = np.diff(azimuth, append=azimuth[:1] + 2 * np.pi).max(initial=2 * np.pi if azimuth.size < 2 else 0.0)
        if widest > MAX_GAP_RAD * (1 + 1e-9) or azimuth[-1] - azimuth[0] >= 2 * np.pi:
            raise ValueError(
                f"`azimuth_rad` leaves a gap of {np.degrees(widest):.1f} degrees, or goes past one turn; allowed is "
                f"once round in steps of {np.degrees(MAX_GAP_RAD):.0f} degrees at most"
            )
        is_wide = (
            elevation.size >= 4 and np.abs(elevation).max() <= np.pi / 2 + 1e-9 and elevation[0] < 0 < elevation[-1]
        )
        if not is_wide or np.diff(elevation).max() > MAX_GAP_RAD * (1 + 1e-9):
            raise ValueError(
                "`elevation_rad` must have four elevations at least, on both sides of 0, from -90 to 90 degrees, in "
                f"steps of {np.degrees(MAX_GAP_RAD):.0f} degrees at most"
            )
        for end in (0, -1):
            if np.isclose(abs(elevation[end]), np.pi / 2):
                table[:, :, end] = table[:, :, end].mean(axis=1, keepdims=True)
        for array in (frequency, azimuth, elevation, table):
            array.setflags(write=False)
        self.frequency_hz, self.azimuth_rad, self.elevation_rad, self.table_gain = frequency, azimuth, elevation, table
        around = np.concatenate([azimuth[-AROUND:] - 2 * np.pi, azimuth, azimuth[:AROUND] + 2 * np.pi])
        wrapped = np.concatenate([table[:, -AROUND:], table, table[:, :AROUND]], axis=1)
        self._splines = [
            scipy.interpolate.RectBivariateSpline(around, elevation, each, kx=3, ky=3, s=0) for each in wrapped
        ]

    def gain(self, azimuth_rad: ArrayLike, elevation_rad: ArrayLike, frequency_hz: ArrayLike) -> FloatArray:
        """Gain towards directions, at each of some frequencies.

        Args:
            azimuth_rad: Off the boresight, any shape.
            elevation_rad: Broadcasts with `azimuth_rad`.
            frequency_hz: Shape (n_frequencies,).

        Returns:
            Amplitude gain, shape (n_frequencies, *directions).
        """
        at, up = np.broadcast_arrays(np.asarray(azimuth_rad, np.float64), np.asarray(elevation_rad, np.float64))
        at = self.azimuth_rad[0] + np.mod(at - self.azimuth_rad[0], 2 * np.pi)
        up = np.clip(up, self.elevation_rad[0], self.elevation_rad[-1])
        tabulated = np.array([np.maximum(spline.ev(at, up), LEAST_GAIN) for spline in self._splines])
        weight = frequency_weights(np.atleast_1d(np.asarray(frequency_hz, np.float64)), self.frequency_hz)
        return np.tensordot(weight, tabulated, axes=1)

    def cut(self, band_hz: tuple[float, float] | None = None) -> TabulatedPattern:
        """The pattern in the plane: root mean square of the gain over a band, as a flat spectrum makes of it.

        Args:
            band_hz: Lowest and highest frequency; None for those of the table.
        """
        low_hz, high_hz = band_hz or (self.frequency_hz[0], self.frequency_hz[-1])
        frequency_hz = np.linspace(low_hz, high_hz, 33)
        azimuth_rad = CUT_STEP_RAD * np.arange(round(2 * np.pi / CUT_STEP_RAD))
        gain = self.gain(azimuth_rad, np.zeros(azimuth_rad.size), frequency_hz)
        return TabulatedPattern(azimuth_rad, np.sqrt(np.square(gain).mean(axis=0)))


def frequency_weights(frequency_hz: FloatArray, known_hz: FloatArray) -> FloatArray:
    """Shares of what is known at some frequencies in what is linear between them and goes on level outside.

    Args:
        frequency_hz: Shape (n,).
        known_hz: Rising, shape (n_known,).

    Returns:
        Shape (n, n_known); rows sum to 1.
    """
    return np.array([np.interp(frequency_hz, known_hz, row) for row in np.eye(known_hz.size)]).T


def halves(edges_hz: Sequence[float]) -> list[tuple[float, float]]:
    """Lower and upper half of each sub-band, lowest first; edges as of `SubBands`."""
    middles = [(low + high) / 2 for low, high in pairwise(edges_hz)]
    ends = sorted([*edges_hz, *middles])
    return list(pairwise(ends))
