"""Gain of one directional element over the angle off its boresight."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


class GainPattern(Protocol):
    """Amplitude gain of one element in the plane of the array, and its slope."""

    def __call__(self, off_boresight_rad: ArrayLike) -> FloatArray:
        """Gain, unitless and positive, at `off_boresight = azimuth - boresight` of any shape."""
        ...

    def derivative(self, off_boresight_rad: ArrayLike) -> FloatArray:
        """Slope of the gain per radian, same shape."""
        ...


class GaussianPattern:
    r"""The helical antenna of the Dir-MUSIC paper: three Gaussians fitted to a measured pattern.

    .. math:: g(\theta) = \sum_{i=1}^{3} a_i \exp(-(\theta - b_i)^2 / c_i^2), \quad
              \theta = (207^\circ + \text{off\_boresight}) \bmod 360^\circ

    Its peak, 1.0058, is at 207 degrees of the printed formula: that is the boresight. -3 dB width 101 degrees,
    front to back 16.3 dB. The pattern is not symmetric, and has a step of 0.006 where the printed angle passes
    0/360 (off boresight by 153 degrees), left as printed.

    References:
        Dir-MUSIC, eq. (1).
    """

    AMPLITUDE = np.array([0.5255, 0.3405, 0.6251])
    CENTRE_DEG = np.array([218.1, 304.8, 156.1])
    WIDTH_DEG = np.array([51.73, 41.0, 109.1])
    BORESIGHT_DEG = 207.0

    def __call__(self, off_boresight_rad: ArrayLike) -> FloatArray:
        """Gain, unitless, in [0.15, 1.01]; same shape as `off_boresight_rad`."""
        return self._terms(off_boresight_rad)[1].sum(axis=-1)

    def derivative(self, off_boresight_rad: ArrayLike) -> FloatArray:
        """Slope of the gain per radian; same shape as `off_boresight_rad`."""
        offset_deg, terms = self._terms(off_boresight_rad)
        slope_per_deg = (-2 * offset_deg / self.WIDTH_DEG**2 * terms).sum(axis=-1)
        return slope_per_deg * np.degrees(1.0)

    def _terms(self, off_boresight_rad: ArrayLike) -> tuple[FloatArray, FloatArray]:
        angle_deg = np.mod(self.BORESIGHT_DEG + np.degrees(np.asarray(off_boresight_rad, dtype=np.float64)), 360.0)
        offset_deg = angle_deg[..., np.newaxis] - self.CENTRE_DEG
        return offset_deg, self.AMPLITUDE * np.exp(-((offset_deg / self.WIDTH_DEG) ** 2))


class TabulatedPattern:
    """A measured pattern: a periodic cubic spline through gains at given angles.

    Args:
        off_boresight_rad: Strictly increasing angles within one turn, shape (n,), n >= 4.
        gain: Amplitude gain at those angles, shape (n,), positive.

    Raises:
        ValueError: If shapes disagree, angles do not increase within one turn, or a gain is not positive and finite.
    """

    def __init__(self, off_boresight_rad: ArrayLike, gain: ArrayLike) -> None:
        from scipy.interpolate import CubicSpline  # here, so that a command line help need not wait for it

        angle = np.asarray(off_boresight_rad, dtype=np.float64)
        value = np.asarray(gain, dtype=np.float64)
        if angle.ndim != 1 or angle.shape != value.shape or angle.size < 4:
            raise ValueError(
                f"`off_boresight_rad` and `gain` must be of one shape (n,), n >= 4, got {angle.shape} and {value.shape}"
            )
        if not (np.isfinite(angle).all() and np.all(np.diff(angle) > 0) and angle[-1] - angle[0] < 2 * np.pi):
            raise ValueError("`off_boresight_rad` must be finite and strictly increasing within one turn (2 pi)")
        if not (np.isfinite(value).all() and np.all(value > 0)):
            raise ValueError("`gain` must be finite and positive: it is an amplitude ratio, not decibels")
        closed_angle = np.append(angle, angle[0] + 2 * np.pi)
        self._start = angle[0]
        self._spline = CubicSpline(closed_angle, np.append(value, value[0]), bc_type="periodic")
        self._slope = self._spline.derivative()

    def __call__(self, off_boresight_rad: ArrayLike) -> FloatArray:
        """Gain, unitless; same shape as `off_boresight_rad`."""
        return np.asarray(self._spline(self._within(off_boresight_rad)))

    def derivative(self, off_boresight_rad: ArrayLike) -> FloatArray:
        """Slope of the gain per radian; same shape as `off_boresight_rad`."""
        return np.asarray(self._slope(self._within(off_boresight_rad)))

    def _within(self, off_boresight_rad: ArrayLike) -> FloatArray:
        angle = np.asarray(off_boresight_rad, dtype=np.float64)
        return self._start + np.mod(angle - self._start, 2 * np.pi)
