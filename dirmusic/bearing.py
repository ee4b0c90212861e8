"""Strengths to bearings: the peak of the normalised pseudo-spectrum, refined, with its standard deviation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic.angles import wrap
from dirmusic.bounds import perpendicular_slope
from dirmusic.manifold import GainManifold

FloatArray = NDArray[np.float64]

GRID_AZIMUTHS_RAD = np.radians(np.arange(360.0))
"""Where the peak is looked for before it is refined; one degree, as in the paper."""

REFINEMENTS = 4
"""Gauss-Newton steps from the grid's peak; the third moves it by less than 1e-9 rad."""


@dataclass(frozen=True, kw_only=True)
class Bearings:
    """Directions of arrival in the array frame.

    Attributes:
        azimuth_rad: Shape (...), in (-pi, pi]; NaN where nothing was heard (all strengths zero).
        std_rad: Shape (...), from noise alone: an error of the manifold is common to all pulses and comes on top.
            NaN without a strength variance.
        misfit: Shape (...), share of the strengths' energy that no single direction explains, in [0, 1].
    """

    azimuth_rad: FloatArray
    std_rad: FloatArray
    misfit: FloatArray


def estimate_bearings(
    strengths: ArrayLike, manifold: GainManifold, *, strength_variance: ArrayLike | None = None
) -> Bearings:
    r"""Direction from which the pooled pulses came.

    The principal direction v of the strengths' covariance is compared with the manifold's directions. For one source

    .. math:: \hat\theta = \arg\max_\theta \frac{\lVert g(\theta) \rVert^2}{\lVert E_n^T g(\theta) \rVert^2}
              = \arg\max_\theta \frac{(v^T g(\theta))^2}{\lVert g(\theta) \rVert^2},

    the peak of eq. (15) with the gain normalised, and the maximum-likelihood estimate in equal white noise. The
    normalisation matters where the norm of the gain varies, as with four of six elements.

    Args:
        strengths: Shape (..., n_pulses, n_elements), volts, >= 0. The pulses of one row of the leading axes come from
            one source and are pooled; to keep them apart, give each its own row.
        manifold: The nominal array, n_elements elements.
        strength_variance: Variance of the strengths, V^2; broadcasts to the shape of `strengths`.

    Returns:
        Bearings of the leading shape (...).

    Raises:
        ValueError: If the element axis does not fit the manifold, there is no pulse axis, a strength is negative or not
            finite.

    References:
        Dir-MUSIC, eq. (15).
    """
    a = np.asarray(strengths, dtype=np.float64)
    if a.ndim < 2 or a.shape[-1] != manifold.n_elements:
        raise ValueError(
            f"`strengths` must have shape (..., n_pulses, {manifold.n_elements}) to match `manifold`, got {a.shape}"
        )
    if not (np.isfinite(a).all() and np.all(a >= 0)):
        raise ValueError(
            "`strengths` must be finite and >= 0 V; drop broken channels from strengths and manifold alike"
        )
    direction = _principal_direction(a)
    azimuth = _refine(direction, manifold, _coarse_peak(direction, manifold))
    gain = np.moveaxis(manifold.gain(azimuth), 0, -1)
    slope = np.moveaxis(manifold.derivative(azimuth), 0, -1)
    amplitude = (a * gain[..., np.newaxis, :]).sum(-1) / np.square(gain).sum(-1)[..., np.newaxis]
    heard = a.any(axis=(-1, -2))
    total = np.where(heard, np.square(a).sum(axis=(-1, -2)), 1.0)
    explained = np.square(amplitude).sum(-1) * np.square(gain).sum(-1)
    std = np.full(azimuth.shape, np.nan)
    if strength_variance is not None:
        perpendicular = np.moveaxis(perpendicular_slope(np.moveaxis(gain, -1, 0), np.moveaxis(slope, -1, 0)), 0, -1)
        variance = np.broadcast_to(np.asarray(strength_variance, dtype=np.float64), a.shape)
        noise = np.square(amplitude[..., np.newaxis] * perpendicular[..., np.newaxis, :]) * variance
        weight = np.square(amplitude).sum(-1) * np.square(perpendicular).sum(-1)
        std = np.sqrt(noise.sum(axis=(-1, -2))) / np.where(heard, weight, 1.0)
    return Bearings(
        azimuth_rad=np.where(heard, wrap(azimuth), np.nan),
        std_rad=np.where(heard, std, np.nan),
        misfit=np.where(heard, np.clip(1.0 - explained / total, 0.0, 1.0), np.nan),
    )


def _principal_direction(strengths: FloatArray) -> FloatArray:
    """Unit vector (..., n_elements) nearest to all pulses (..., n_pulses, n_elements)."""
    if strengths.shape[-2] == 1:
        single = strengths[..., 0, :]
        norm = np.linalg.norm(single, axis=-1, keepdims=True)
        return single / np.where(norm > 0, norm, 1.0)
    _, vectors = np.linalg.eigh(np.swapaxes(strengths, -1, -2) @ strengths)
    return vectors[..., -1]


def _coarse_peak(direction: FloatArray, manifold: GainManifold) -> FloatArray:
    """Grid azimuth (...) of the best match to `direction` (..., n_elements)."""
    gain = manifold.gain(GRID_AZIMUTHS_RAD)
    match = np.square(direction @ (gain / np.linalg.norm(gain, axis=0)))
    return GRID_AZIMUTHS_RAD[match.argmax(axis=-1)]


def _refine(direction: FloatArray, manifold: GainManifold, azimuth_rad: FloatArray) -> FloatArray:
    """Gauss-Newton on the azimuth with the amplitude projected out, kept within one grid step of the peak."""
    start, step = azimuth_rad, np.radians(1.0)
    direction = np.moveaxis(direction, -1, 0)
    for _ in range(REFINEMENTS):
        gain, slope = manifold.gain(azimuth_rad), manifold.derivative(azimuth_rad)
        perpendicular = perpendicular_slope(gain, slope)
        amplitude = (direction * gain).sum(axis=0) / np.square(gain).sum(axis=0)
        amplitude = np.where(amplitude == 0, 1.0, amplitude)
        shift = (direction * perpendicular).sum(axis=0) / (amplitude * np.square(perpendicular).sum(axis=0))
        azimuth_rad = np.clip(azimuth_rad + shift, start - step, start + step)
    return azimuth_rad
