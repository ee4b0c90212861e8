"""Gain of one directional element over the angle off its boresight."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


class GainPattern(Protocol):
    """Amplitude gain of one element in the plane of the array, and its slope: a subclass writes `gain_and_slope`."""

    def __call__(self, off_boresight_rad: ArrayLike) -> FloatArray:
        """Gain, unitless and positive, at `off_boresight = azimuth - boresight` of any shape."""
        return self.gain_and_slope(off_boresight_rad)[0]

    def derivative(self, off_boresight_rad: ArrayLike) -> FloatArray:
        """Slope of the gain per radian, same shape."""
        return self.gain_and_slope(off_boresight_rad)[1]

    def gain_and_slope(self, off_boresight_rad: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Both at once, for they share their work."""
        ...


class GaussianPattern(GainPattern):
    r"""The helical antenna of the Dir-MUSIC paper: three Gaussians fitted to a measured pattern.

    .. math:: g(\theta) = \sum_{i=1}^{3} a_i \exp(-(\theta - b_i)^2 / c_i^2), \quad
              \theta = (207^\circ + \text{off\_boresight}) \bmod 360^\circ

    Its peak, 1.0058, is at 207 degrees of the printed formula: that is the boresight. Gains lie in [0.07, 1.01]; -3 dB
    width 101 degrees, front to back 16.3 dB. The pattern is not symmetric, and has a step of 0.006 where the printed
    angle passes 0/360 (off boresight by 153 degrees), left as printed.

    References:
        Dir-MUSIC, eq. (1).
    """

    AMPLITUDE = np.array([0.5255, 0.3405, 0.6251])
    CENTRE_DEG = np.array([218.1, 304.8, 156.1])
    WIDTH_DEG = np.array([51.73, 41.0, 109.1])
    BORESIGHT_DEG = 207.0
    _SLOPE_FACTOR = -2.0 * np.degrees(1.0) / WIDTH_DEG

    def __call__(self, off_boresight_rad: ArrayLike) -> FloatArray:
        """Gain alone, of the shape of `off_boresight_rad`."""
        return self._terms(off_boresight_rad)[0].sum(axis=0)

    def gain_and_slope(self, off_boresight_rad: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Gain, unitless, and its slope per radian; each of the shape of `off_boresight_rad`."""
        terms, widths_off = self._terms(off_boresight_rad)
        widths_off *= self._SLOPE_FACTOR.reshape(3, *(1,) * (widths_off.ndim - 1))
        return terms.sum(axis=0), (widths_off * terms).sum(axis=0)

    def _terms(self, off_boresight_rad: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """The three Gaussians, and by how many of their widths the angle is off their centres."""
        angle_deg = self.BORESIGHT_DEG + np.degrees(np.asarray(off_boresight_rad, dtype=np.float64))
        angle_deg = angle_deg - 360.0 * np.floor(angle_deg / 360.0)
        per_term = (3, *(1,) * angle_deg.ndim)
        widths_off = (angle_deg - self.CENTRE_DEG.reshape(per_term)) / self.WIDTH_DEG.reshape(per_term)
        return self.AMPLITUDE.reshape(per_term) * np.exp(-(widths_off * widths_off)), widths_off


MAX_GAP_RAD = np.radians(30.0)
MAX_GAP_STEPS = 4.0
"""A table with a wider hole than this, in radians or in its own median steps, has a gap: a spline would invent gain."""


class TabulatedPattern(GainPattern):
    """A measured pattern: a periodic cubic spline through gains at given angles.

    Args:
        off_boresight_rad: Strictly increasing angles, less than one turn from first to last, shape (n,), n >= 4. They
            go all round: no gap wider than 30 degrees or than four of the median steps.
        gain: Amplitude gain at those angles, shape (n,), positive.

    Raises:
        ValueError: If shapes disagree, angles do not increase within one turn or leave a gap, or a gain is not
            positive and finite.
    """

    def __init__(self, off_boresight_rad: ArrayLike, gain: ArrayLike) -> None:
        from scipy.interpolate import CubicSpline  # here, so that a command line help need not wait for it

        angle = np.array(off_boresight_rad, dtype=np.float64)
        value = np.array(gain, dtype=np.float64)
        if angle.ndim != 1 or angle.shape != value.shape or angle.size < 4:
            raise ValueError(
                f"`off_boresight_rad` and `gain` must be of one shape (n,), n >= 4, got {angle.shape} and {value.shape}"
            )
        if not (np.isfinite(angle).all() and np.all(np.diff(angle) > 0) and angle[-1] - angle[0] < 2 * np.pi):
            raise ValueError("`off_boresight_rad` must be finite and strictly increasing within one turn (2 pi)")
        if not (np.isfinite(value).all() and np.all(value > 0)):
            raise ValueError("`gain` must be finite and positive: it is an amplitude ratio, not decibels")
        steps = np.diff(np.append(angle, angle[0] + 2 * np.pi))
        widest = int(steps.argmax())
        if steps[widest] > min(MAX_GAP_RAD, MAX_GAP_STEPS * float(np.median(steps))) * (1 + 1e-9):
            raise ValueError(
                f"`off_boresight_rad` leaves a gap of {np.degrees(steps[widest]):.1f} degrees after "
                f"{np.degrees(angle[widest]):.1f} degrees; allowed are {np.degrees(MAX_GAP_RAD):.0f} degrees and "
                f"{MAX_GAP_STEPS:.0f} times the median step ({np.degrees(np.median(steps)):.1f} degrees), all round"
            )
        self._start = angle[0]
        closed_angle = np.append(angle, angle[0] + 2 * np.pi)
        self._spline = CubicSpline(closed_angle, np.append(value, value[0]), bc_type="periodic")
        self._slope = self._spline.derivative()
        for array in (angle, value):
            array.setflags(write=False)
        self.off_boresight_rad, self.table_gain = angle, value

    def gain_and_slope(self, off_boresight_rad: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Gain, unitless, and its slope per radian; each of the shape of `off_boresight_rad`."""
        angle = np.asarray(off_boresight_rad, dtype=np.float64)
        within = self._start + np.mod(angle - self._start, 2 * np.pi)
        return np.asarray(self._spline(within)), np.asarray(self._slope(within))
