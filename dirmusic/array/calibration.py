"""Calibration: errors of the elements from one source received at several headings, by turning on the spot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # its submodules are loaded when they are first used
from numpy.typing import ArrayLike, NDArray

from dirmusic.angles import wrap
from dirmusic.array.bounds import rms_bearing_error
from dirmusic.array.element_errors import ElementErrors, ElementSpread
from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD, GainManifold

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """Result of a calibration.

    Attributes:
        manifold: Nominal manifold with the errors applied, for the estimators.
        errors: Estimated errors.
        remaining_rad: Bearing error by the remaining uncertainty of the errors, rms over azimuths.
        azimuth_rad: Azimuth of the source, array frame at the first heading, in (-pi, pi].
        std_rad: Standard deviation of the azimuth.
    """

    manifold: GainManifold
    errors: ElementErrors
    remaining_rad: float
    azimuth_rad: float
    std_rad: float


def calibrate(
    strengths: ArrayLike,
    turns_rad: ArrayLike,
    manifold: GainManifold,
    spread: ElementSpread,
    *,
    strength_variance: ArrayLike,
    turn_std_rad: float = 0.0,
) -> Calibration:
    r"""Estimate the errors of the elements from one source of unknown direction and amplitude (maximum a posteriori).

    At heading :math:`\psi_k` element i gives :math:`\alpha_k ((1 + e_i) g(\theta - \psi_k - b_i - d_i) + o_i)`. The
    amplitude is projected out of each heading, so the source may fluctuate. Four quarter turns are enough. The mean of
    all pointing errors is a rotation of the array, which turning on the spot does not show; its deviation, that of one
    element over the root of their number, remains in `std_rad` and `remaining_rad`.

    The source must be in line of sight and far compared with the ring, and reflections must fall outside the gate:
    whatever else arrives is taken for an error of the array.

    Args:
        strengths: Shape (n_headings, n_pulses, n_elements), volts, >= 0; n_headings >= 2.
        turns_rad: Turn from each heading to the next, counter-clockwise, shape (n_headings - 1,).
        manifold: Nominal array.
        spread: Spread of the errors; errors without spread are not estimated.
        strength_variance: Variance of the strengths, V^2, > 0; broadcasts to the shape of `strengths`.
        turn_std_rad: Standard deviation of the error of each turn, independent from turn to turn.

    Returns:
        The calibration.

    Raises:
        ValueError: If shapes disagree, a value is not finite, or nothing was detected at some heading.
    """
    a, turns = np.asarray(strengths, dtype=np.float64), np.asarray(turns_rad, dtype=np.float64)
    n = manifold.n_elements
    if a.ndim != 3 or a.shape[0] < 2 or a.shape[-1] != n or turns.shape != (a.shape[0] - 1,):
        raise ValueError(
            f"need strengths (n_headings >= 2, n_pulses, {n}) and turns (n_headings - 1,), got {a.shape} and "
            f"{turns.shape}"
        )
    if not (np.isfinite(a).all() and np.all(a >= 0) and np.isfinite(turns).all()):
        raise ValueError("`strengths` must be finite and >= 0 V and `turns_rad` finite; drop broken channels or pulses")
    if not np.all(a.any(axis=(-1, -2))):
        raise ValueError("`strengths` must not all be zero at a heading; leave a heading without a detection out")
    pooled, variance = _pool(a, np.broadcast_to(np.asarray(strength_variance, dtype=np.float64), a.shape))
    weight = 1.0 / np.sqrt(variance)
    heading = np.concatenate([[0.0], np.cumsum(turns)])
    prior = np.maximum(
        np.concatenate(
            [
                [np.inf],
                np.full(turns.size, turn_std_rad),
                np.repeat([spread.gain, spread.pointing_rad, spread.offset], n),
            ]
        ),
        1e-9,  # keeps a parameter without spread at zero
    )
    start = np.zeros(prior.size)
    start[0] = _coarse_azimuth(pooled, heading, manifold)

    def response(state: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        late = np.concatenate([[0.0], np.cumsum(state[1 : turns.size + 1])])
        e, d, o = state[turns.size + 1 :].reshape(3, n)
        off = (state[0] - heading - late)[:, np.newaxis] - manifold.boresights_rad - d
        gain, slope = manifold.element_response(off)
        return weight * ((1 + e) * gain + o), weight * gain, weight * (1 + e) * slope

    def residual(state: FloatArray) -> FloatArray:
        model, _, _ = response(state)
        return np.concatenate([_across(weight * pooled, model).ravel(), state / prior])

    def jacobian(state: FloatArray) -> FloatArray:
        model, by_gain, by_azimuth = response(state)
        energy = np.square(model).sum(axis=-1, keepdims=True)
        amplitude = (weight * pooled * model).sum(axis=-1, keepdims=True) / energy
        change = np.zeros((*model.shape, state.size))
        change[..., 0] = by_azimuth
        for k in range(1, turns.size + 1):  # an error of one turn stays in all headings after it
            change[k:, :, k] = -by_azimuth[k:]
        element = np.arange(n)
        first = turns.size + 1
        change[:, element, first + element] = by_gain
        change[:, element, first + n + element] = -by_azimuth
        change[:, element, first + 2 * n + element] = weight
        change *= -amplitude[..., np.newaxis]
        along = np.einsum("kis,ki->ks", change, model) / energy
        change -= along[:, np.newaxis, :] * model[..., np.newaxis]
        return np.concatenate([change.reshape(-1, state.size), np.diag(1.0 / prior)])

    scale = np.where(np.isfinite(prior), prior, 0.01)
    solution = scipy.optimize.least_squares(residual, start, jacobian, x_scale=scale, xtol=1e-10, ftol=1e-10)
    slopes = jacobian(solution.x)
    covariance = np.linalg.inv(slopes.T @ slopes).astype(np.float64)
    gain, pointing, offset = solution.x[turns.size + 1 :].reshape(3, n)
    errors = ElementErrors(gain=gain, pointing_rad=pointing, offset=offset)
    corrected = errors.correct(manifold)
    return Calibration(
        manifold=corrected,
        errors=errors,
        remaining_rad=rms_bearing_error(corrected, covariance[turns.size + 1 :, turns.size + 1 :]),
        azimuth_rad=float(wrap(solution.x[0])),
        std_rad=float(np.sqrt(covariance[0, 0])),
    )


def _pool(strengths: FloatArray, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Pool the pulses of each heading, weighted by amplitude, to strengths and variance (n_headings, n_elements)."""
    values, vectors = np.linalg.eigh(np.swapaxes(strengths, -1, -2) @ strengths)
    direction = np.abs(vectors[..., -1])
    amplitude = np.einsum("kpi,ki->kp", strengths, direction)
    energy = np.square(amplitude).sum(axis=-1)
    return direction * np.sqrt(values[..., -1:]), np.einsum("kp,kpi->ki", np.square(amplitude), variance) / energy[
        :, None
    ]


def _coarse_azimuth(pooled: FloatArray, heading: FloatArray, manifold: GainManifold) -> float:
    """Find the search azimuth that explains most energy over all headings."""
    gain = manifold.gain(SEARCH_AZIMUTHS_RAD[:, np.newaxis] - heading)
    unit = gain / np.linalg.norm(gain, axis=0)
    return float(SEARCH_AZIMUTHS_RAD[np.square(np.einsum("ki,ijk->jk", pooled, unit)).sum(axis=-1).argmax()])


def _across(data: FloatArray, model: FloatArray) -> FloatArray:
    """Remove from data (..., n_elements) their component along the model."""
    return data - model * ((data * model).sum(axis=-1, keepdims=True) / np.square(model).sum(axis=-1, keepdims=True))
