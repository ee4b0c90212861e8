"""Gain of one directional element as a function of the angle off its boresight, in the plane and in space."""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np
import scipy  # its submodules are loaded when they are first used
from numpy.typing import ArrayLike

from dirmusic.arrays import FloatArray
from dirmusic.compiled import compiled, compiled_inner


@compiled_inner
def cubic(share: float, start: float, end: float, start_slope: float, end_slope: float) -> tuple[float, float]:
    """Interpolate between two points with the cubic that has the given values and slopes; `share` is in [0, 1].

    Returns:
        The value, and the slope per unit of `share`.
    """
    rise = end - start
    square, cube = 3.0 * rise - 2.0 * start_slope - end_slope, start_slope + end_slope - 2.0 * rise
    value = start + share * (start_slope + share * (square + share * cube))
    return value, start_slope + share * (2.0 * square + 3.0 * share * cube)


class GainPattern(Protocol):
    """Amplitude gain of one element in the plane of the array. Subclasses implement `gain_and_slope`."""

    @property
    def vertical(self) -> GainPattern | None:
        """Gain in the vertical plane through the boresight, over the elevation; None if the pattern is round."""
        return None

    def __call__(self, off_boresight_rad: ArrayLike) -> FloatArray:
        """Compute the gain, unitless and positive, for `off_boresight = azimuth - boresight` of any shape."""
        return self.gain_and_slope(off_boresight_rad)[0]

    def gain_and_slope(self, off_boresight_rad: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Compute the gain and its slope per radian, both with the shape of `off_boresight_rad`."""
        ...


class GaussianPattern(GainPattern):
    r"""Pattern of the helical antenna of the Dir-MUSIC paper: three Gaussians fitted to a measurement.

    .. math:: g(\theta) = \sum_{i=1}^{3} a_i \exp(-(\theta - b_i)^2 / c_i^2), \quad
              \theta = (207^\circ + \text{off\_boresight}) \bmod 360^\circ

    The peak of 1.0058 is at 207 degrees in the printed formula, which is taken as the boresight. Gains lie in [0.07,
    1.01]. The -3 dB width is 101 degrees and the front-to-back ratio is 16.3 dB. The pattern is not symmetric. As in
    the paper, it has a step of 0.006 where the printed angle passes 0/360 (153 degrees off boresight).

    References:
        Dir-MUSIC, eq. (1).
    """

    def gain_and_slope(self, off_boresight_rad: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Compute the gain and its slope per radian; see `GainPattern`."""
        angle_deg = 207.0 + np.degrees(np.asarray(off_boresight_rad, dtype=np.float64))
        angle_deg = angle_deg - 360.0 * np.floor(angle_deg / 360.0)
        gain, slope = np.zeros((2, *angle_deg.shape))
        for amplitude, centre_deg, width_deg in ((0.5255, 218.1, 51.73), (0.3405, 304.8, 41.0), (0.6251, 156.1, 109.1)):
            off = (angle_deg - centre_deg) / width_deg
            term = amplitude * np.exp(-(off * off))
            gain += term
            slope -= 2.0 * np.degrees(1.0) / width_deg * off * term
        return gain, slope


MAX_GAP_RAD = np.radians(30.0)
MAX_GAP_STEPS = 4.0
"""Widest step of a table, in radians and in median steps. Assumed: the spline is not reliable across a wider gap."""


class TabulatedPattern(GainPattern):
    """Measured pattern: a periodic cubic spline through gains at given angles.

    Args:
        off_boresight_rad: Strictly increasing angles that span less than one turn, shape (n,), n >= 4. No gap,
            including the one between the last and the first angle, may be wider than 30 degrees or four median steps.
        gain: Amplitude gain at those angles, shape (n,), positive.
        vertical: Gain in the vertical plane through the boresight, over the elevation, positive upwards; of any
            reference level. Default: the pattern is the same in all planes through the boresight.

    Raises:
        ValueError: If shapes disagree, if the angles do not increase within one turn or leave a gap, or if a gain is
            not positive and finite.
    """

    def __init__(self, off_boresight_rad: ArrayLike, gain: ArrayLike, vertical: TabulatedPattern | None = None) -> None:
        angle = np.array(off_boresight_rad, dtype=np.float64)
        value = np.array(gain, dtype=np.float64)
        if angle.ndim != 1 or angle.shape != value.shape or angle.size < 4:
            raise ValueError(
                f"`off_boresight_rad` and `gain` must have one shape (n,), n >= 4, got {angle.shape} and {value.shape}"
            )
        if not (np.isfinite(angle).all() and np.all(np.diff(angle) > 0) and angle[-1] - angle[0] < 2 * np.pi):
            raise ValueError("`off_boresight_rad` must be finite and strictly increasing within one turn (2 pi)")
        if not (np.isfinite(value).all() and np.all(value > 0)):
            raise ValueError("`gain` must be finite and positive: it is an amplitude ratio, not decibels")
        closed_angle = np.append(angle, angle[0] + 2 * np.pi)
        steps = np.diff(closed_angle)
        widest = int(steps.argmax())
        if steps[widest] > min(MAX_GAP_RAD, MAX_GAP_STEPS * float(np.median(steps))) * (1 + 1e-9):
            raise ValueError(
                f"`off_boresight_rad` must have steps of at most {np.degrees(MAX_GAP_RAD):.0f} degrees and "
                f"{MAX_GAP_STEPS:.0f} times the median step ({np.degrees(np.median(steps)):.1f} degrees), got a step "
                f"of {np.degrees(steps[widest]):.1f} degrees after {np.degrees(angle[widest]):.1f} degrees"
            )
        self._spline = scipy.interpolate.CubicSpline(closed_angle, np.append(value, value[0]), bc_type="periodic")
        self.off_boresight_rad, self.table_gain, self._vertical = angle, value, vertical

    @property
    def vertical(self) -> TabulatedPattern | None:
        """Gain in the vertical plane through the boresight; see `GainPattern`."""
        return self._vertical

    def gain_and_slope(self, off_boresight_rad: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Compute the gain and its slope per radian; see `GainPattern`."""
        angle = np.asarray(off_boresight_rad, dtype=np.float64)
        return self._spline(angle), self._spline(angle, 1)


NEAR_AXIS = 1e-9
"""Sine of the angle from the boresight below which the roll angle is undefined, because rounding would determine it."""


class SpatialGain(NamedTuple):
    """Gains towards directions in space and their slopes per radian, all of the same shape."""

    gain: FloatArray
    by_azimuth: FloatArray
    by_elevation: FloatArray


def gain_in_space(
    pattern: GainPattern,
    off_boresight_rad: ArrayLike,
    elevation_rad: ArrayLike,
    boresight_elevation_rad: ArrayLike = 0.0,
) -> SpatialGain:
    r"""Compute the gain of an element towards a direction in space.

    With :math:`\psi` the angle from the boresight and :math:`\phi` the roll angle around it, which is zero for a level
    direction to the left,

    .. math:: g(\psi, \phi) = \cos^2(\phi / 2) \, g(+\psi) + \sin^2(\phi / 2) \, g(-\psi)

    At zero elevation the gain of a level element is the pattern itself. The pattern is measured in one plane. Assumed:
    a helix has nearly the same pattern in all planes through its axis; see `element_errors.OFF_PLANE`.

    If the pattern has another vertical cut v, attenuations are added: with azimuth :math:`\alpha` and elevation
    :math:`\epsilon` in the frame of the boresight, :math:`g = g(\alpha) \, v(\epsilon) / v(0)` (3GPP TR 38.901, table
    7.3-1, without its limit of the sum). Both cuts are reproduced; the vertical cut behind the element is not used.

    Args:
        pattern: Pattern in the plane.
        off_boresight_rad: Azimuth of the direction minus that of the boresight.
        elevation_rad: Elevation of the direction, in [-pi/2, pi/2]; broadcasts with `off_boresight_rad`.
        boresight_elevation_rad: Elevation of the boresight, in [-pi/2, pi/2]; broadcasts with the others.

    Returns:
        Gain and slopes of the broadcast shape.
    """
    off, elevation = (np.asarray(a, dtype=np.float64) for a in (off_boresight_rad, elevation_rad))
    tilt = np.asarray(boresight_elevation_rad, dtype=np.float64)
    cos_off, sin_off, cos_up, sin_up = np.cos(off), np.sin(off), np.cos(elevation), np.sin(elevation)
    level, left = cos_up * cos_off, cos_up * sin_off  # components in the frame of the boresight's azimuth
    cos_tilt, sin_tilt = np.cos(tilt), np.sin(tilt)
    if pattern.vertical is not None:
        by_azimuth = -left, cos_up * cos_off, np.zeros_like(left)
        by_elevation = -sin_up * cos_off, -sin_up * sin_off, cos_up
        towards = [
            np.stack(np.broadcast_arrays(cos_tilt * x + sin_tilt * z, y, cos_tilt * z - sin_tilt * x))
            for x, y, z in ((level, left, sin_up), by_azimuth, by_elevation)
        ]
        return _gain_of_cuts(pattern, pattern.vertical, *towards)
    ahead, up = cos_tilt * level + sin_tilt * sin_up, cos_tilt * sin_up - sin_tilt * level  # in that of the boresight
    sin_psi = np.sqrt(np.maximum(1.0 - np.square(ahead), 0.0))
    psi = np.arctan2(np.hypot(left, up), ahead)
    on_axis = sin_psi < NEAR_AXIS
    across = np.where(on_axis, 1.0, sin_psi)
    cos_roll = np.where(on_axis, 1.0, left / across)
    (to_left, to_right), (slope_left, slope_right) = pattern.gain_and_slope(np.stack([psi, -psi]))
    gain = 0.5 * ((1 + cos_roll) * to_left + (1 - cos_roll) * to_right)
    by_psi = 0.5 * ((1 + cos_roll) * slope_left - (1 - cos_roll) * slope_right)
    by_roll = 0.5 * (to_left - to_right)  # per change of cos_roll
    psi_by_azimuth = cos_tilt * cos_roll
    roll_by_azimuth = np.where(on_axis, 0.0, (level - psi_by_azimuth * ahead * cos_roll) / across)
    psi_by_elevation = np.where(on_axis, 0.0, (cos_tilt * sin_up * cos_off - sin_tilt * cos_up) / across)
    roll_by_elevation = np.where(on_axis, 0.0, -(sin_up * sin_off + cos_roll * ahead * psi_by_elevation) / across)
    by_azimuth = by_psi * psi_by_azimuth + by_roll * roll_by_azimuth
    return SpatialGain(gain, by_azimuth, by_psi * psi_by_elevation + by_roll * roll_by_elevation)


def _gain_of_cuts(
    pattern: GainPattern, vertical: GainPattern, towards: FloatArray, by_azimuth: FloatArray, by_elevation: FloatArray
) -> SpatialGain:
    """Compute the gain of a pattern with two cuts along unit vectors, and its slopes; see `gain_in_space`.

    Args:
        pattern: Pattern in the plane.
        vertical: Pattern in the vertical plane.
        towards: Components ahead, to the left and up in the frame of the boresight, shape (3, ...).
        by_azimuth: Their derivatives by the azimuth.
        by_elevation: Their derivatives by the elevation.
    """
    ahead, left, up = towards
    level = np.maximum(np.hypot(ahead, left), NEAR_AXIS)
    in_plane, slope = pattern.gain_and_slope(np.arctan2(left, ahead))
    factor, factor_slope = (x / vertical(0.0) for x in vertical.gain_and_slope(np.arctan2(up, level)))
    slopes = (
        slope * factor * (ahead * by[1] - left * by[0]) / level**2 + in_plane * factor_slope * by[2] / level
        for by in (by_azimuth, by_elevation)
    )
    return SpatialGain(in_plane * factor, *slopes)


TABLE_SIZE = 3600
"""Number of steps of a table, 0.1 degrees each; cubic interpolation is accurate to 1e-10 for a smooth pattern."""

STEP_RAD = 2 * np.pi / TABLE_SIZE


class PatternTable(NamedTuple):
    """Pattern in the plane for compiled kernels, tabulated in equal steps of the angle off boresight, from 0.

    Attributes:
        gain: Gains, shape (TABLE_SIZE,).
        slope: Slopes of the gain per step, shape (TABLE_SIZE,).
        vertical: Factor of the gain over the elevation, relative to that at 0, and its slope per step, shape (2,
            TABLE_SIZE); (2, 0) for a pattern that is the same in all planes through the boresight.
    """

    gain: FloatArray
    slope: FloatArray
    vertical: FloatArray


def tabulate(pattern: GainPattern) -> PatternTable:
    """Tabulate a pattern for compiled kernels."""
    angle_rad, vertical = STEP_RAD * np.arange(TABLE_SIZE), np.empty((2, 0))
    gain, slope = pattern.gain_and_slope(angle_rad)
    if pattern.vertical is not None:
        factor, factor_slope = (x / pattern.vertical(0.0) for x in pattern.vertical.gain_and_slope(angle_rad))
        vertical = np.stack([factor, STEP_RAD * factor_slope])
    return PatternTable(np.ascontiguousarray(gain), STEP_RAD * slope, vertical)


@compiled_inner
def interpolate(gain: FloatArray, slope: FloatArray, angle_rad: float) -> tuple[float, float]:
    """Interpolate a table of gains and their slopes per step; the result has the slope per radian."""
    at = angle_rad / STEP_RAD
    low = np.floor(at)
    i = int(low) % TABLE_SIZE
    j = (i + 1) % TABLE_SIZE
    value, rise = cubic(at - low, gain[i], gain[j], slope[i], slope[j])
    return value, rise / STEP_RAD


@compiled_inner
def pattern_gain_and_slope(pattern: PatternTable, off_boresight_rad: float) -> tuple[float, float]:
    """Interpolate the gain in the plane and its slope per radian."""
    return interpolate(pattern.gain, pattern.slope, off_boresight_rad)


class Boresight(NamedTuple):
    """Direction of one boresight."""

    cos_azimuth: float
    sin_azimuth: float
    cos_elevation: float
    sin_elevation: float


def as_boresights(azimuth_rad: FloatArray, elevation_rad: FloatArray) -> FloatArray:
    """Compute the fields of `Boresight`, shape (n_elements, 4), for azimuths and elevations (n_elements,)."""
    return np.stack([f(angle) for angle in (azimuth_rad, elevation_rad) for f in (np.cos, np.sin)], axis=-1)


@compiled_inner
def frame_of_boresight(boresight: Boresight, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Compute components of a vector: level along the azimuth of a boresight, left of it, along and above it."""
    level = boresight.cos_azimuth * x + boresight.sin_azimuth * y
    left = boresight.cos_azimuth * y - boresight.sin_azimuth * x
    ahead = boresight.cos_elevation * level + boresight.sin_elevation * z
    up = boresight.cos_elevation * z - boresight.sin_elevation * level
    return level, left, ahead, up


@compiled
def gain_towards(pattern: PatternTable, boresight: Boresight, x: float, y: float, z: float) -> float:
    """Compute the gain of an element along the vector (x, y, z), z up, of any length; see `gain_in_space`."""
    _, left, ahead, up = frame_of_boresight(boresight, x, y, z)
    if pattern.vertical.size > 0:
        in_plane, _ = pattern_gain_and_slope(pattern, math.atan2(left, ahead))
        factor, _ = interpolate(pattern.vertical[0], pattern.vertical[1], math.atan2(up, math.hypot(left, ahead)))
        return in_plane * factor
    across = math.sqrt(left * left + up * up)
    psi = math.atan2(across, ahead)
    half_roll = 0.5 * left / max(across, NEAR_AXIS)
    to_left, _ = pattern_gain_and_slope(pattern, psi)
    to_right, _ = pattern_gain_and_slope(pattern, -psi)
    return (0.5 + half_roll) * to_left + (0.5 - half_roll) * to_right


WARP_1, WARP_2 = 1.654, -0.4135
"""Coefficients of the warp of a beam that is wider than tabulated; see `gain_and_slopes_towards`."""


@compiled_inner
def warp_and_slope(angle_rad: float) -> tuple[float, float]:
    """Compute the warp f of an angle, see `gain_and_slopes_towards`, and its slope."""
    sin, cos = math.sin(angle_rad), math.cos(angle_rad)
    return sin * (WARP_1 + 2.0 * WARP_2 * cos), WARP_1 * cos + 2.0 * WARP_2 * (2.0 * cos * cos - 1.0)


@compiled_inner
def gain_and_slopes_of_cuts(
    pattern: PatternTable, boresight: Boresight, x: float, y: float, z: float, widening: float
) -> tuple[float, float, float, float]:
    """Compute the same as `gain_and_slopes_towards` for a pattern with two cuts; azimuth and elevation are warped."""
    _, left, ahead, up = frame_of_boresight(boresight, x, y, z)
    level, sideways = max(math.hypot(left, ahead), NEAR_AXIS), max(math.hypot(x, y), NEAR_AXIS)
    azimuth, elevation = math.atan2(left, ahead), math.atan2(up, level)
    (warp, warp_slope), (warp_up, warp_up_slope) = warp_and_slope(azimuth), warp_and_slope(elevation)
    in_plane, slope = pattern_gain_and_slope(pattern, azimuth - widening * warp)
    factor, factor_slope = interpolate(pattern.vertical[0], pattern.vertical[1], elevation - widening * warp_up)
    slope, factor_slope = slope * factor, factor_slope * in_plane
    by_azimuth = slope * (1.0 - widening * warp_slope) / (level * level)
    by_elevation = factor_slope * (1.0 - widening * warp_up_slope) / level
    _, turn_left, turn_ahead, turn_up = frame_of_boresight(boresight, -y, x, 0.0)
    _, rise_left, rise_ahead, rise_up = frame_of_boresight(boresight, -z * x / sideways, -z * y / sideways, sideways)
    return (
        in_plane * factor,
        by_azimuth * (ahead * turn_left - left * turn_ahead) + by_elevation * turn_up,
        by_azimuth * (ahead * rise_left - left * rise_ahead) + by_elevation * rise_up,
        -slope * warp - factor_slope * warp_up,
    )


@compiled
def gain_and_slopes_towards(
    pattern: PatternTable, boresight: Boresight, x: float, y: float, z: float, widening: float
) -> tuple[float, float, float, float]:
    r"""Compute the gain along the unit vector (x, y, z) and its slopes.

    The pattern may be wider or narrower than tabulated: at the angle :math:`\psi` off boresight, the gain is that of
    the table at :math:`\psi - w f(\psi)` with :math:`f = 1.654 \sin\psi - 0.4135 \sin 2\psi`. Up to 100 degrees, f is
    nearly :math:`\psi`, so that the beam is wider by a factor 1 / (1 - w); the back keeps its gain. These are the first
    two Fourier terms of an angle that grows to 120 degrees and falls to 0 at 180 degrees.

    Args:
        pattern: Pattern in the plane.
        boresight: Boresight of the element.
        x: Component x of the vector.
        y: Component y.
        z: Component z, up.
        widening: Relative widening w of the beam.

    Returns:
        The gain, and its slopes per radian of azimuth, per radian of elevation, and per unit of widening.
    """
    if pattern.vertical.size > 0:
        return gain_and_slopes_of_cuts(pattern, boresight, x, y, z, widening)
    sideways = max(math.hypot(x, y), NEAR_AXIS)
    level, left, ahead, up = frame_of_boresight(boresight, x, y, z)
    sin_psi = math.sqrt(left * left + up * up)
    warp = sin_psi * (WARP_1 + 2.0 * WARP_2 * ahead)
    psi = math.atan2(sin_psi, ahead) - widening * warp
    to_left, slope_left = pattern_gain_and_slope(pattern, psi)
    to_right, slope_right = pattern_gain_and_slope(pattern, -psi)
    if sin_psi < NEAR_AXIS:
        cos_roll, psi_by_elevation, roll_by_azimuth, roll_by_elevation = 1.0, 0.0, 0.0, 0.0
    else:
        cos_roll = left / sin_psi
        psi_by_elevation = (
            boresight.cos_elevation * z * level / sideways - boresight.sin_elevation * sideways
        ) / sin_psi
        roll_by_azimuth = (level - boresight.cos_elevation * ahead * cos_roll * cos_roll) / sin_psi
        roll_by_elevation = -(z * left / sideways + cos_roll * ahead * psi_by_elevation) / sin_psi
    by_table = 0.5 * ((1.0 + cos_roll) * slope_left - (1.0 - cos_roll) * slope_right)
    by_psi = by_table * (1.0 - widening * (WARP_1 * ahead + 2.0 * WARP_2 * (2.0 * ahead * ahead - 1.0)))
    by_roll = 0.5 * (to_left - to_right)  # per change of cos_roll
    return (
        0.5 * ((1.0 + cos_roll) * to_left + (1.0 - cos_roll) * to_right),
        by_psi * boresight.cos_elevation * cos_roll + by_roll * roll_by_azimuth,
        by_psi * psi_by_elevation + by_roll * roll_by_elevation,
        -by_table * warp,
    )
