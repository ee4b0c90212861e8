"""Strengths to bearings: maximum likelihood over the gain manifold, refined off the grid, with an honest deviation."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic.angles import wrap
from dirmusic.array.element_errors import ManifoldPrior
from dirmusic.array.manifold import GainManifold
from dirmusic.array.model import ArrayModel
from dirmusic.bearing.bearings import LEAST_SHARE, Bearings
from dirmusic.bearing.posterior import bearing_posterior
from dirmusic.pulses.batch import NO_DIRECTION, PulseBatch

if TYPE_CHECKING:
    from dirmusic.bearing.likelihood_kernels import Fit, NoiseOfFit

FloatArray = NDArray[np.float64]


class MaximumLikelihood:
    """The default estimator: each pulse on its own, off the grid, with its deviation; see `estimate_bearings`."""

    def __init__(self) -> None:
        from dirmusic.bearing.likelihood_kernels import bearings_of_pulses  # loads the compiler

        self._bearings_of_pulses = bearings_of_pulses

    def __call__(self, pulses: PulseBatch, array: ArrayModel) -> Bearings:
        """Directions of the pulses, shape (n_pulses,); as of `estimator.BearingEstimator`."""
        # in one order of memory, for which alone it is compiled
        strengths, variance = (
            np.ascontiguousarray(values[:, np.newaxis]) for values in (pulses.strengths_v, pulses.variance_v2)
        )
        return self._bearings_of_pulses(strengths, variance, array.manifold.held_table, NO_DIRECTION)


def estimate_bearings(
    strengths: ArrayLike,
    manifold: GainManifold,
    *,
    strength_variance: ArrayLike | None = None,
    prior: ManifoldPrior | None = None,
) -> Bearings:
    r"""Direction from which the pooled pulses came: maximum likelihood in white noise, amplitudes unknown.

    .. math:: \hat\theta = \arg\max_\theta \frac{g(\theta)^T R \, g(\theta)}{\lVert g(\theta) \rVert^2},
              \quad R = \sum_k a_k a_k^T

    For one pulse this is the peak of eq. (15) with the gain normalised. The normalisation matters where the norm of
    the gain varies, as with four of six elements.

    Args:
        strengths: Shape (..., n_pulses, n_elements), volts, >= 0. The pulses of one row of the leading axes come from
            one source and are pooled; to keep them apart, give each its own row.
        manifold: The nominal array, n_elements elements.
        strength_variance: Variance of the strengths, V^2, >= 0; broadcasts to the shape of `strengths`.
        prior: What is known of the errors of the array. With it, azimuth and deviation are the mean and the deviation
            of the posterior over those errors, several hundred times the work.

    Returns:
        Bearings of the leading shape (...).

    Raises:
        ValueError: If the element axis does not fit the manifold, there is no pulse axis, or a strength is negative or
            not finite.

    References:
        Dir-MUSIC, eq. (15).
    """
    a = np.asarray(strengths, dtype=np.float64)
    if a.ndim < 2 or a.shape[-1] != manifold.n_elements:
        raise ValueError(
            f"`strengths` must have shape (..., n_pulses, {manifold.n_elements}) to match `manifold`, got {a.shape}"
        )
    if a.size and not (a.min() >= 0.0 and a.max() < np.inf):
        broken = np.flatnonzero(~np.all(np.isfinite(a) & (a >= 0), axis=tuple(range(a.ndim - 1)))) + 1
        raise ValueError(
            f"`strengths` must be finite and >= 0 V, got others in channels {', '.join(map(str, broken))}; drop broken "
            "channels from the strengths, and from the manifold with `manifold.take`"
        )
    from dirmusic.bearing.likelihood_kernels import (  # loads the compiler
        NO_ANSWER,
        bearings_of_pulses,
        fit_covariances,
        noise_of_pulses,
        pool,
    )

    shape = a.shape[:-2]
    pulses = _in_rows(a)
    variance = np.empty((0, 0, 0))
    if strength_variance is not None:
        given = np.asarray(strength_variance, dtype=np.float64)
        variance = _in_rows(given if given.shape == a.shape else np.broadcast_to(given, a.shape))
    if prior is None:
        found = bearings_of_pulses(pulses, variance, manifold.held_table, NO_ANSWER)
        return Bearings(*(column.reshape(shape) for column in found))
    pooled = pool(pulses)
    fit = fit_covariances(pooled, manifold.table)
    noise = noise_of_pulses(fit, pulses, variance) if variance.size else None
    return _bearings_of_fit(fit, pooled, noise, manifold, prior, shape)


def _in_rows(values: FloatArray) -> FloatArray:
    """A copy of shape (n_rows, n_pulses, n_elements), of the one layout that compiled loops know."""
    return np.array(values).reshape(math.prod(values.shape[:-2]), *values.shape[-2:])


def bearings_from_covariance(
    covariance: ArrayLike,
    manifold: GainManifold,
    *,
    n_snapshots: int = 1,
    noise_variance: ArrayLike | None = None,
    prior: ManifoldPrior | None = None,
) -> Bearings:
    r"""The same from a covariance of samples, for elements that sit so close that all hear the pulse at one time.

    With more than about a centimetre between the elements, samples no longer line up, and gated strengths are the data
    to use. Take samples from a gate around the pulse: those without it only add noise, by which the variance grows from
    the Cramer-Rao bound to :math:`(1 + n \sigma^2 / (E \lVert g \rVert^2))` times that, E the pulse's energy.

    Args:
        covariance: From `sample_covariance`, shape (..., n_elements, n_elements), V^2.
        manifold: The nominal array, n_elements elements.
        n_snapshots: Samples that the covariance is the mean of, >= 1.
        noise_variance: Variance of one noise sample, the same in all channels, V^2; broadcasts to (...).
        prior: What is known of the errors of the array; see `estimate_bearings`.

    Returns:
        Bearings of the leading shape (...). The misfit holds the noise of all samples.

    Raises:
        ValueError: If the shape does not fit the manifold, or a value is not finite.
    """
    r = np.asarray(covariance, dtype=np.float64)
    n = manifold.n_elements
    if r.ndim < 2 or r.shape[-2:] != (n, n):
        raise ValueError(f"`covariance` must have shape (..., {n}, {n}) to match `manifold`, got {r.shape}")
    if not np.isfinite(r).all():
        raise ValueError("`covariance` must be finite; drop the broken record or channel first")
    if n_snapshots < 1:
        raise ValueError(f"`n_snapshots` must be 1 or more, got {n_snapshots}")
    from dirmusic.bearing.likelihood_kernels import (  # here, for the compiler takes time to load
        NoiseOfFit,
        fit_covariances,
    )

    shape = r.shape[:-2]
    total = np.array(n_snapshots * r.reshape(-1, n, n), order="C")
    fit = fit_covariances(total, manifold.table)
    noise = None
    if noise_variance is not None:
        variance = np.array(np.broadcast_to(np.asarray(noise_variance, dtype=np.float64), shape)).reshape(-1)
        energy = np.square(fit.gain).sum(axis=-1)
        each = np.repeat((variance * fit.amplitude_energy)[:, np.newaxis], n, axis=-1)
        noise = NoiseOfFit(each, n_snapshots * variance / energy)
    return _bearings_of_fit(fit, total, noise, manifold, prior, shape)


def _bearings_of_fit(
    fit: Fit,
    pooled: FloatArray,
    noise: NoiseOfFit | None,
    manifold: GainManifold,
    prior: ManifoldPrior | None,
    shape: tuple[int, ...],
) -> Bearings:
    """Bearings from a fit to pooled covariances; no deviation where neither noise nor prior is known."""
    from dirmusic.bearing.likelihood_kernels import deviations, misfits

    azimuth_rad, misfit = fit.azimuth_rad, misfits(fit, pooled)
    std_rad = np.full(azimuth_rad.shape, np.nan) if noise is None else deviations(fit, noise)
    if prior is not None:
        amplitude_energy = np.where(fit.amplitude_energy > 0, fit.amplitude_energy, 1.0)[:, np.newaxis]
        relative_variance = np.zeros_like(fit.data)
        if noise is not None:
            signal = np.maximum(amplitude_energy - noise.bias[:, np.newaxis], LEAST_SHARE * amplitude_energy)
            relative_variance = noise.data / np.square(signal)
        azimuth_rad, std_rad = bearing_posterior(
            fit.data / amplitude_energy, relative_variance, azimuth_rad, manifold, prior
        )
    silent = np.isnan(misfit)
    return Bearings(
        azimuth_rad=np.where(silent, np.nan, wrap(azimuth_rad)).reshape(shape),
        std_rad=np.where(silent, np.nan, std_rad).reshape(shape),
        misfit=misfit.reshape(shape),
    )
