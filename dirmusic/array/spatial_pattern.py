"""Gain of one directional element over azimuth, elevation and frequency, as measured or computed."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import scipy  # its submodules are loaded when they are first used
from numpy.typing import ArrayLike

from dirmusic.array.pattern import MAX_GAP_RAD, TabulatedPattern
from dirmusic.arrays import FloatArray

LEAST_GAIN = 1e-6
"""Lower limit of the gain, 120 dB below the reference: a spline may overshoot below 0 between the tabulated angles."""


class SpatialPattern:
    """Tabulated pattern, with cubic interpolation over the angles and linear interpolation over frequency.

    Angles refer to the element: azimuth off boresight, counter-clockwise seen from above, and elevation above the plane
    through the boresight and the element's left side. Outside the tabulated frequencies and elevations, the gain is
    that of the nearest one.

    Args:
        frequency_hz: Frequencies, increasing, shape (n_frequencies,).
        azimuth_rad: Azimuths, increasing, spanning less than one turn; no gap, including that between the last and the
            first, may exceed 30 degrees; shape (n_azimuths,), n_azimuths >= 12.
        elevation_rad: Elevations, increasing, in [-pi/2, pi/2], on both sides of 0; shape (n_elevations,),
            n_elevations >= 4.
        gain: Amplitude gain, positive, shape (n_frequencies, n_azimuths, n_elevations). At the zenith and the nadir,
            the mean over the azimuths is used.

    Raises:
        ValueError: If shapes disagree, an axis is invalid, or a gain is not positive and finite.
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
                raise ValueError(f"`{name}` must be finite, strictly increasing and one-dimensional")
        if table.shape != shape or not (np.isfinite(table).all() and np.all(table > 0)):
            raise ValueError(f"`gain` must be finite, positive and of shape {shape}, got {table.shape}")
        if frequency.size == 0 or frequency[0] <= 0:
            raise ValueError("`frequency_hz` must have at least one frequency, all above 0")
        widest = np.diff(azimuth, append=azimuth[:1] + 2 * np.pi).max(initial=2 * np.pi if azimuth.size < 2 else 0.0)
        if widest > MAX_GAP_RAD * (1 + 1e-9) or azimuth[-1] - azimuth[0] >= 2 * np.pi:
            raise ValueError(
                f"`azimuth_rad` must cover one turn in steps of at most {np.degrees(MAX_GAP_RAD):.0f} degrees, has a "
                f"gap of {np.degrees(widest):.1f} degrees or goes beyond"
            )
        is_wide = (
            elevation.size >= 4 and np.abs(elevation).max() <= np.pi / 2 + 1e-9 and elevation[0] < 0 < elevation[-1]
        )
        if not is_wide or np.diff(elevation).max() > MAX_GAP_RAD * (1 + 1e-9):
            raise ValueError(
                "`elevation_rad` must have at least four elevations from -90 to 90 degrees, on both sides of 0, in "
                f"steps of at most {np.degrees(MAX_GAP_RAD):.0f} degrees"
            )
        for end in (0, -1):
            if np.isclose(abs(elevation[end]), np.pi / 2):
                table[:, :, end] = table[:, :, end].mean(axis=1, keepdims=True)
        self.frequency_hz, self.azimuth_rad, self.elevation_rad, self.table_gain = frequency, azimuth, elevation, table
        around = np.concatenate([azimuth[-4:] - 2 * np.pi, azimuth, azimuth[:4] + 2 * np.pi])  # for a periodic spline
        wrapped = np.concatenate([table[:, -4:], table, table[:, :4]], axis=1)
        self._splines = [
            scipy.interpolate.RectBivariateSpline(around, elevation, each, kx=3, ky=3, s=0) for each in wrapped
        ]

    def gain(self, azimuth_rad: ArrayLike, elevation_rad: ArrayLike, frequency_hz: ArrayLike) -> FloatArray:
        """Compute the gain towards one or more directions at several frequencies.

        Args:
            azimuth_rad: Azimuths off boresight, any shape.
            elevation_rad: Elevations; broadcast with `azimuth_rad`.
            frequency_hz: Frequencies, shape (n_frequencies,).

        Returns:
            Amplitude gain, shape (n_frequencies, *directions).
        """
        at, up = np.broadcast_arrays(azimuth_rad, elevation_rad)
        at = self.azimuth_rad[0] + np.mod(at - self.azimuth_rad[0], 2 * np.pi)
        up = np.clip(up, self.elevation_rad[0], self.elevation_rad[-1])
        tabulated = np.array([np.maximum(spline.ev(at, up), LEAST_GAIN) for spline in self._splines])
        weight = frequency_weights(np.atleast_1d(np.asarray(frequency_hz, np.float64)), self.frequency_hz)
        return np.tensordot(weight, tabulated, axes=1)

    def cut(self, band_hz: tuple[float, float] | None = None) -> TabulatedPattern:
        """Compute the pattern in the plane for a flat spectrum, that is, the rms of the gain over a band.

        Args:
            band_hz: Lowest and highest frequency; by default those of the table.
        """
        low_hz, high_hz = band_hz or (self.frequency_hz[0], self.frequency_hz[-1])
        frequency_hz = np.linspace(low_hz, high_hz, 33)
        azimuth_rad = np.radians(1.0) * np.arange(360)
        gain = self.gain(azimuth_rad, np.zeros(azimuth_rad.size), frequency_hz)
        return TabulatedPattern(azimuth_rad, np.sqrt(np.square(gain).mean(axis=0)))


def frequency_weights(frequency_hz: FloatArray, known_hz: FloatArray) -> FloatArray:
    """Compute the weights of linear interpolation between known frequencies, with constant extrapolation.

    Args:
        frequency_hz: Frequencies at which to interpolate, shape (n,).
        known_hz: Known frequencies, increasing, shape (n_known,).

    Returns:
        Weights, shape (n, n_known); each row sums to 1.
    """
    return np.array([np.interp(frequency_hz, known_hz, row) for row in np.eye(known_hz.size)]).T


def halves(edges_hz: Sequence[float]) -> list[tuple[float, float]]:
    """Return the lower and the upper half of each sub-band, lowest first; `edges_hz` as in `SubBands`."""
    middles = [(low + high) / 2 for low, high in pairwise(edges_hz)]
    ends = sorted([*edges_hz, *middles])
    return list(pairwise(ends))
