"""Positions of several sources and the errors of the array that detected them, estimated together.

An array that is not what its data sheet says turns every bearing by degrees, in common for all pulses from one
azimuth: averaging does not help, and a covariance that takes the errors as independent is wrong. But the robot turns
and drives, so the same error shows at other azimuths, and positions and element errors can be told apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.element_errors import ElementErrors
from dirmusic.array.model import ArrayModel
from dirmusic.pulses.batch import PulseBatch

FloatArray = NDArray[np.float64]

STRENGTH_FLOOR = 0.01
"""Assumed share of the strength that the model leaves unexplained in a channel: reflections within the gate, its edges,
mutual coupling. It stays the same for as long as the pose error does, so pulses from nearly one place share it."""

POSITION_PRIOR_M = 60.0
"""Assumed standard deviation of a source about the places of its detections: it keeps one line of bearings finite."""

HEIGHT_PRIOR_M = (0.8, 1.0)
"""Assumed mean and standard deviation of a source's height above the array: cable boxes to bushings."""

ROBUST_SCALE = 3.0
"""Residuals beyond this many standard deviations are taken as outliers, softly (soft L1 loss)."""


@dataclass(frozen=True, kw_only=True)
class PoseError:
    """How wrong the robot's pose is: standard deviations, and the time over which the error stays the same."""

    position_m: float
    heading_rad: float
    correlation_s: float


@dataclass(frozen=True, kw_only=True)
class JointFix:
    """Sources and array, estimated together.

    Attributes:
        positions_m: Shape (n_sources, 2), world frame.
        covariances_m2: Shape (n_sources, 2, 2), with the uncertainty of the array's errors in it.
        errors: What the elements turned out to be off by.
    """

    positions_m: FloatArray
    covariances_m2: FloatArray
    errors: ElementErrors


def locate_jointly(
    pulses: PulseBatch,
    pose: FloatArray,
    source: NDArray[np.intp],
    start_m: FloatArray,
    array: ArrayModel,
    pose_error: PoseError,
) -> JointFix:
    r"""Maximum a posteriori positions, and gain errors e, pointing errors d and offsets o of the elements.

    A pulse of unknown amplitude :math:`\alpha` from a source at p gives element i, at distance r_i and seeing p at
    array azimuth :math:`\theta_i`, the strength
    :math:`\alpha ((1 + e_i) g(\theta_i - b_i - d_i) + o_i) / r_i`. The amplitude is projected out of every pulse;
    offsets are a state where the array's spread has them. Pose errors turn all elements alike and stay the same for
    seconds: they widen the one direction in which the strengths move with azimuth, by as much as so many correlated
    pulses deserve. What no model explains stays as long, and widens every direction.

    Args:
        pulses: Detected pulses, n rows; their scale does not matter, and channels that are not usable have no weight.
        pose: Believed x m, y m, yaw rad at each pulse, world frame, shape (n, 3).
        source: Which source each pulse belongs to, shape (n,), in [0, n_sources).
        start_m: Where to start, shape (n_sources, 2). Every source has at least one row.
        array: The array's data sheet and spread.
        pose_error: Spread and correlation of the pose.

    Returns:
        The fix. The height above the array is a state of its own, held by its prior: it shows only close by, where it
        makes ranges and gains of the elements more alike; ignored, it would be mistaken for errors of the array.
    """
    from scipy.optimize import least_squares  # here, so that a command line help need not wait for it

    n_sources, n_elements = start_m.shape[0], array.manifold.n_elements
    data = _Data.of(pulses, pose, source, pose_error)
    of_elements = [array.spread.gain, array.spread.pointing_rad]
    if array.spread.offset > 0:
        of_elements.append(array.spread.offset)
    of_places = np.tile([POSITION_PRIOR_M, POSITION_PRIOR_M, HEIGHT_PRIOR_M[1]], n_sources)
    spread = np.concatenate([of_places, np.repeat(np.maximum(of_elements, 1e-6), n_elements)])
    no_errors = np.zeros(len(of_elements) * n_elements)
    detected_from_m = [pose[source == k, :2].mean(axis=0) for k in range(n_sources)]
    height_m = np.full(n_sources, HEIGHT_PRIOR_M[0])
    mean = np.concatenate([np.column_stack([detected_from_m, height_m]).ravel(), no_errors])
    start = np.concatenate([np.column_stack([start_m, height_m]).ravel(), no_errors])

    def residual(state: FloatArray) -> FloatArray:
        miss, _ = _linearise(state, data, array, pose_error, slopes=False)
        return np.concatenate([miss.ravel(), (state - mean) / spread])

    def jacobian(state: FloatArray) -> FloatArray:
        _, slope = _linearise(state, data, array, pose_error, slopes=True)
        return np.concatenate([slope.reshape(-1, state.size), np.diag(1.0 / spread)])

    n_places = 3 * n_sources
    scale = np.concatenate([np.ones(n_places), spread[n_places:]])
    solution = least_squares(
        residual,
        start,
        jacobian,
        loss="soft_l1",
        f_scale=ROBUST_SCALE,
        x_scale=scale,
        max_nfev=30,
        xtol=1e-5,
        ftol=1e-6,
    )
    slopes = np.asarray(solution.jac, dtype=np.float64)  # scaled by the robust loss
    covariance: FloatArray = np.linalg.inv(slopes.T @ slopes).astype(np.float64)
    block: NDArray[np.intp] = 3 * np.arange(n_sources, dtype=np.intp)[:, np.newaxis] + np.arange(2, dtype=np.intp)
    return JointFix(
        positions_m=solution.x[:n_places].reshape(-1, 3)[:, :2],
        covariances_m2=covariance[block[:, :, np.newaxis], block[:, np.newaxis, :]],
        errors=_errors(solution.x[n_places:], n_elements),
    )


def _errors(state: FloatArray, n_elements: int) -> ElementErrors:
    """The errors in the state, offsets zero where they are none."""
    kinds = np.zeros((3, n_elements))
    kinds[: state.size // n_elements] = state.reshape(-1, n_elements)
    return ElementErrors(gain=kinds[0], pointing_rad=kinds[1], offset=kinds[2])


def _tolerated(change: FloatArray, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The direction of a change of the strengths, and the share of a miss along it that its variance explains away.

    Args:
        change: By unit error, whitened by the noise, shape (n, n_elements).
        variance: Of that error, shape (n, 1).

    Returns:
        Unit vectors of the shape of `change`, and shares in [0, 1) of the shape of `variance`.
    """
    energy = np.maximum(np.square(change).sum(axis=-1, keepdims=True), 1e-12)
    return change / np.sqrt(energy), 1.0 - 1.0 / np.sqrt(1.0 + variance * energy)


def _correlated_pulses(time_s: FloatArray, source: NDArray[np.intp], correlation_s: float) -> FloatArray:
    """For each pulse, how many of the same source share its pose error, shape (n,), >= 1."""
    lag = np.abs(time_s[:, np.newaxis] - time_s) / max(correlation_s, 1e-9)
    return (np.exp(-lag) * (source[:, np.newaxis] == source)).sum(axis=-1)


class _Data(NamedTuple):
    """What the fit is to explain, one pulse a row.

    Attributes:
        pose: Shape (n, 3).
        source: Shape (n,).
        weight: One over the deviation of each strength; 0 for channels that are not usable, shape (n, n_elements).
        strengths: Scaled to unit norm, times the weight, shape (n, n_elements).
        repeats: How many pulses share its pose error, shape (n, 1).
    """

    pose: FloatArray
    source: NDArray[np.intp]
    weight: FloatArray
    strengths: FloatArray
    repeats: FloatArray

    @classmethod
    def of(cls, pulses: PulseBatch, pose: FloatArray, source: NDArray[np.intp], pose_error: PoseError) -> _Data:
        """Weights and weighted strengths of pulses; the floor stays for as long as the pose error does."""
        usable_v = pulses.strengths_v * pulses.is_usable
        norm_v = np.linalg.norm(usable_v, axis=-1, keepdims=True)
        strengths, variance = usable_v / norm_v, pulses.variance_v2 / norm_v**2
        repeats = _correlated_pulses(pulses.time_s, source, pose_error.correlation_s)
        floor = STRENGTH_FLOOR**2 * np.square(strengths) * repeats[:, np.newaxis]
        weight = pulses.is_usable / np.sqrt(variance + floor + 1e-8)
        return cls(pose, source, weight, weight * strengths, repeats[:, np.newaxis])


def _linearise(
    state: FloatArray, data: _Data, array: ArrayModel, pose_error: PoseError, *, slopes: bool
) -> tuple[FloatArray, FloatArray]:
    """Whitened misses (n, n_elements) and, on request, their derivative (n, n_elements, n_states)."""
    pose, source, weight = data.pose, data.source, data.weight
    n, n_elements = data.strengths.shape
    n_places = 3 * (int(source.max()) + 1)
    position = state[:n_places].reshape(-1, 3)[source]
    errors = _errors(state[n_places:], n_elements)

    yaw = pose[:, 2, np.newaxis]
    forward, left = array.positions_m[:, 0], array.positions_m[:, 1]
    dx = position[:, :1] - pose[:, :1] - (np.cos(yaw) * forward - np.sin(yaw) * left)
    dy = position[:, 1:2] - pose[:, 1:2] - (np.sin(yaw) * forward + np.cos(yaw) * left)
    horizontal = np.maximum(dx**2 + dy**2, 1e-4)
    square = horizontal + position[:, 2:] ** 2
    range_m = np.linalg.norm(position[:, :2] - pose[:, :2], axis=-1, keepdims=True)
    off = np.arctan2(dy, dx) - yaw - array.manifold.boresights_rad - errors.pointing_rad
    sideways = np.sqrt(horizontal)
    gain, slope, slope_up = array.manifold.response_in_space(off, np.arctan2(position[:, 2:], sideways))

    spreading = weight * np.maximum(range_m, 1e-2) / np.sqrt(square)
    model = ((1 + errors.gain) * gain + errors.offset) * spreading
    by_azimuth = (1 + errors.gain) * slope * spreading
    by_elevation = (1 + errors.gain) * slope_up * spreading
    energy = np.square(model).sum(axis=-1, keepdims=True)
    amplitude = (data.strengths * model).sum(axis=-1, keepdims=True) / energy

    def project(vector: FloatArray) -> FloatArray:
        return vector - model * ((vector * model).sum(axis=-1, keepdims=True) / energy)

    # how the strengths move when the pose is wrong: sideways or in heading, and towards the source
    height, near_m = position[:, 2:], np.maximum(range_m, 0.3)
    turn_variance = pose_error.heading_rad**2 + (pose_error.position_m / near_m) ** 2
    rise_variance = (pose_error.position_m * height / (np.square(near_m) + np.square(height))) ** 2
    turn, turn_share = _tolerated(amplitude * project(by_azimuth), turn_variance * data.repeats)
    rise = amplitude * project(by_elevation)
    rise -= turn * (rise * turn).sum(axis=-1, keepdims=True)
    rise, rise_share = _tolerated(rise, rise_variance * data.repeats)

    def whiten(vector: FloatArray) -> FloatArray:
        sideways_part = turn * (turn_share * (vector * turn).sum(axis=-1, keepdims=True))
        return vector - sideways_part - rise * (rise_share * (vector * rise).sum(axis=-1, keepdims=True))

    miss = whiten(data.strengths - amplitude * model)
    if not slopes:
        return miss, np.empty((0, 0, 0))
    jacobian = np.zeros((n, n_elements, state.size))
    rows = np.arange(n, dtype=np.intp)
    by_place = (
        by_azimuth * -dy / horizontal - (model + by_elevation * position[:, 2:] / sideways) * dx / square,
        by_azimuth * dx / horizontal - (model + by_elevation * position[:, 2:] / sideways) * dy / square,
        (by_elevation * sideways - model * position[:, 2:]) / square,
    )
    for axis, by_axis in enumerate(by_place):
        jacobian[rows, :, 3 * source + axis] = -whiten(amplitude * project(by_axis))
    by_error = (gain * spreading, -by_azimuth, spreading)[: (state.size - n_places) // n_elements]
    for i in range(n_elements):
        one = np.zeros(n_elements)
        one[i] = 1.0
        for kind, change in enumerate(by_error):
            jacobian[:, :, n_places + kind * n_elements + i] = -whiten(amplitude * project(one * change))
    return miss, jacobian
