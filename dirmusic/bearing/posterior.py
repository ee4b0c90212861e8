"""Bayes over the errors of the array: a bearing with the deviation that is left when the manifold is not trusted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.element_errors import ManifoldPrior
from dirmusic.array.manifold import GainManifold

FloatArray = NDArray[np.float64]

N_AZIMUTHS, N_SCALES = 61, 25
SPAN_SIGMAS = 5.0
"""The grid on which the posterior is summed: how many azimuths and amplitudes, over how many standard deviations."""

ROWS_AT_ONCE = 128
"""Bounds the memory: about 10 MB."""


def bearing_posterior(
    relative_strengths: FloatArray,
    relative_variance: FloatArray,
    start_rad: FloatArray,
    manifold: GainManifold,
    prior: ManifoldPrior,
) -> tuple[FloatArray, FloatArray]:
    r"""Mean and deviation of the azimuth, given strengths and what is known of the array's errors.

    With strengths :math:`x_i = \alpha (g_i(\theta) + \Delta_i) + n_i`, azimuth and scale :math:`\beta = 1 / \alpha`
    unknown,

    .. math:: p(\theta \mid x) \propto \int \beta^{n - 1} \prod_i p_\Delta(\beta x_i - g_i(\theta)) \, d\beta

    where :math:`p_\Delta` is the density of an element's error and noise. Pulses from one direction share the error:
    pool them first, the error does not average.

    Args:
        relative_strengths: Strengths over their estimated amplitude, so that they are near the gains; shape
            (n_rows, n_elements).
        relative_variance: Variance of the noise in those, same shape.
        start_rad: The maximum-likelihood azimuths, shape (n_rows,).
        manifold: The nominal array.
        prior: What is known of its errors.

    Returns:
        Azimuths, not wrapped, and standard deviations, radians, each of shape (n_rows,).
    """
    mean, std = np.empty_like(start_rad), np.empty_like(start_rad)
    for first in range(0, start_rad.size, ROWS_AT_ONCE):
        rows = slice(first, first + ROWS_AT_ONCE)
        mean[rows], std[rows] = _sum_over_grid(
            relative_strengths[rows].T, relative_variance[rows].T, start_rad[rows], manifold, prior
        )
    return mean, std


def _sum_over_grid(
    strengths: FloatArray, noise: FloatArray, start_rad: FloatArray, manifold: GainManifold, prior: ManifoldPrior
) -> tuple[FloatArray, FloatArray]:
    """The same for a few rows, element axis first."""
    gain, slope = manifold.gain_and_slope(start_rad)
    variance = prior.variance(gain, slope) + noise
    energy = np.square(gain).sum(axis=0)
    perpendicular = slope - gain * ((gain * slope).sum(axis=0) / energy)
    turn = np.sqrt((np.square(perpendicular) * variance).sum(axis=0)) / np.square(perpendicular).sum(axis=0)
    half_rad = np.minimum(SPAN_SIGMAS * turn, np.pi)
    half_scale = np.minimum(SPAN_SIGMAS * np.sqrt((np.square(gain) * variance).sum(axis=0)) / energy, 0.9)

    off_rad = half_rad[:, np.newaxis] * np.linspace(-1, 1, N_AZIMUTHS)
    scale = 1 + half_scale[:, np.newaxis, np.newaxis] * np.linspace(-1, 1, N_SCALES)
    gain, slope = (x[..., np.newaxis] for x in manifold.gain_and_slope(start_rad[:, np.newaxis] + off_rad))
    mismatch = scale * strengths[:, :, np.newaxis, np.newaxis] - gain
    density = prior.log_density(mismatch, gain, slope, np.square(scale) * noise[:, :, np.newaxis, np.newaxis])
    log_weight = density.sum(axis=0) + (manifold.n_elements - 1) * np.log(scale)
    weight = np.exp(log_weight - log_weight.max(axis=(-1, -2), keepdims=True)).sum(axis=-1)
    weight /= weight.sum(axis=-1, keepdims=True)
    mean = (weight * off_rad).sum(axis=-1)
    spread = (weight * np.square(off_rad - mean[:, np.newaxis])).sum(axis=-1)
    return start_rad + mean, np.sqrt(spread)
