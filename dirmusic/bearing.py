"""Strengths to bearings: maximum likelihood over the gain manifold, refined off the grid, with an honest deviation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic.angles import wrap
from dirmusic.element_errors import ManifoldPrior
from dirmusic.manifold import SEARCH_AZIMUTHS_RAD, SEARCH_STEP_RAD, GainManifold
from dirmusic.posterior import bearing_posterior

FloatArray = NDArray[np.float64]

REFINEMENTS = 2
"""How often the manifold is linearised anew on the way from the best search azimuth; without noise, two end within
1e-9 rad."""

TINY = 1e-12
"""Keeps a slope that vanishes from being divided by, unitless per radian squared."""

UNKNOWN_STD_RAD = np.pi / np.sqrt(3)
"""Deviation of a direction of which nothing is known: uniform on the circle. None is told wider."""

LEAST_SHARE = 0.01
"""Share of the pooled energy that is taken as signal at least, where it cannot be told from noise (assumed)."""


@dataclass(frozen=True, kw_only=True)
class Bearings:
    """Directions of arrival in the array frame.

    Attributes:
        azimuth_rad: Shape (...), in (-pi, pi]; NaN where nothing was heard (all strengths zero).
        std_rad: Shape (...). From noise alone, unless a prior on the manifold was given: an error of the manifold is
            common to all pulses from one direction. NaN without a variance of the noise and without a prior.
        misfit: Shape (...), share of the energy that no single direction explains, in [0, 1]. Large where two sources
            overlap, a channel is dead, or there is only noise.
    """

    azimuth_rad: FloatArray
    std_rad: FloatArray
    misfit: FloatArray

    def take(self, rows: slice | NDArray[np.bool_]) -> Bearings:
        """Some of them, by slice or mask."""
        return Bearings(azimuth_rad=self.azimuth_rad[rows], std_rad=self.std_rad[rows], misfit=self.misfit[rows])

    def without_nan(self) -> Bearings:
        """The same for tables that hold no NaN: where nothing was heard, a direction of which nothing is known."""
        return Bearings(
            azimuth_rad=np.nan_to_num(self.azimuth_rad),
            std_rad=np.nan_to_num(self.std_rad, nan=np.pi),
            misfit=np.nan_to_num(self.misfit, nan=1.0),
        )


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
    shape = a.shape[:-2]
    pulses = a.reshape(int(np.prod(shape)), *a.shape[-2:])
    variance = None
    if strength_variance is not None:
        given = np.asarray(strength_variance, dtype=np.float64)
        variance = np.broadcast_to(given, a.shape).reshape(pulses.shape)
    if pulses.shape[1] == 1:
        fit = _fit(*_linear_form(pulses[:, 0], manifold), manifold)
    else:
        fit = _fit(*_quadratic_form(np.swapaxes(pulses, -1, -2) @ pulses, manifold), manifold)
    energy = np.square(pulses).sum(axis=(-1, -2))
    across = bias = None
    if variance is not None:  # products and sums of one order for all batch sizes, so that a row is itself to the bit
        gain = fit.gain.T[:, np.newaxis, :]
        amplitude = (pulses * gain).sum(axis=-1) / fit.gain_energy[:, np.newaxis]
        weighted = (np.square(amplitude)[..., np.newaxis] * variance).sum(axis=1).T
        across = (np.square(fit.perpendicular) * weighted).sum(axis=0)
        bias = (variance * np.square(gain)).sum(axis=(-1, -2)) / np.square(fit.gain_energy)
        noise = weighted if prior is not None else None
    else:
        noise = np.zeros_like(fit.gain)
    return _conclude(fit, energy, across, bias, noise, manifold, prior, shape)


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
    shape = r.shape[:-2]
    total = n_snapshots * r.reshape(-1, n, n)
    fit = _fit(*_quadratic_form(total, manifold), manifold)
    across = bias = None
    noise = np.zeros_like(fit.gain)
    if noise_variance is not None:
        variance = np.broadcast_to(np.asarray(noise_variance, dtype=np.float64), shape).reshape(-1)
        noise = np.broadcast_to(variance * fit.amplitude_energy, fit.gain.shape)
        across = np.square(fit.perpendicular).sum(axis=0) * noise[0]
        bias = n_snapshots * variance / fit.gain_energy
    return _conclude(fit, np.einsum("bii->b", total), across, bias, noise, manifold, prior, shape)


class _Fit(NamedTuple):
    """A direction for each row, and what the manifold and the data are there; element axis first where there is one.

    Attributes:
        azimuth_rad: The direction.
        gain: g.
        gain_energy: g^T g.
        perpendicular: p, the part of the slope across the gain.
        perpendicular_energy: p^T p.
        data: R g / (g^T g): the strengths, weighted by amplitude and summed.
        amplitude_energy: g^T R g / (g^T g)^2: the sum of the squared amplitudes.
    """

    azimuth_rad: FloatArray
    gain: FloatArray
    gain_energy: FloatArray
    perpendicular: FloatArray
    perpendicular_energy: FloatArray
    data: FloatArray
    amplitude_energy: FloatArray


_Times = Callable[[FloatArray], FloatArray]
"""The product R g of the pooled covariance and one vector per row, shape (n_elements, n_rows)."""


def _linear_form(strengths: FloatArray, manifold: GainManifold) -> tuple[FloatArray, _Times]:
    """One pulse a row: what ranks the search azimuths, shape (n_rows, n_azimuths), and the product R g."""
    columns = strengths.T
    match = np.einsum("bi,ij->bj", strengths, manifold.search_unit_gain)  # neither is negative: it ranks as its square
    return match, lambda gain: columns * (columns * gain).sum(axis=0)


def _quadratic_form(covariance: FloatArray, manifold: GainManifold) -> tuple[FloatArray, _Times]:
    """Pooled covariances: the match u^T R u at the search azimuths, and the product R g."""
    unit = manifold.search_unit_gain
    pairs = (unit[:, np.newaxis] * unit[np.newaxis]).reshape(-1, unit.shape[-1])
    match = np.einsum("bm,mj->bj", covariance.reshape(covariance.shape[0], pairs.shape[0]), pairs)
    return match, lambda gain: np.einsum("bij,jb->ib", covariance, gain)


def _fit(match: FloatArray, times: _Times, manifold: GainManifold) -> _Fit:
    """The best search azimuth, refined by Gauss-Newton within one step of the search.

    The amplitude is projected out: only the part of the slope across the gain counts,
    :math:`p = (I - g g^T / g^T g) g'`. Where the pattern has a kink (eq. (1) has one where its angle passes 0/360) the
    steps may end to the other side of it than the very peak; the errors there are as large either way.
    """
    peak = match.argmax(axis=-1)
    start_rad = azimuth_rad = SEARCH_AZIMUTHS_RAD[peak]
    lowest, highest = start_rad - SEARCH_STEP_RAD, start_rad + SEARCH_STEP_RAD
    fit = _linearise(azimuth_rad, manifold.search_gain[:, peak], manifold.search_slope[:, peak], times)
    for _ in range(REFINEMENTS):
        azimuth_rad = np.minimum(np.maximum(_next_azimuth(fit), lowest), highest)
        fit = _linearise(azimuth_rad, *manifold.gain_and_slope(azimuth_rad), times)
    return fit._replace(azimuth_rad=np.minimum(np.maximum(_next_azimuth(fit), lowest), highest))


def _next_azimuth(fit: _Fit) -> FloatArray:
    weight = fit.perpendicular_energy * fit.amplitude_energy
    weight[weight <= 0] = np.inf
    return fit.azimuth_rad + (fit.perpendicular * fit.data).sum(axis=0) / weight


def _linearise(azimuth_rad: FloatArray, gain: FloatArray, slope: FloatArray, times: _Times) -> _Fit:
    gain_energy = (gain * gain).sum(axis=0)
    perpendicular = slope - gain * ((gain * slope).sum(axis=0) / gain_energy)
    data = times(gain) / gain_energy
    return _Fit(
        azimuth_rad,
        gain,
        gain_energy,
        perpendicular,
        (perpendicular * perpendicular).sum(axis=0) + TINY,
        data,
        (data * gain).sum(axis=0) / gain_energy,
    )


def _conclude(
    fit: _Fit,
    energy: FloatArray,
    across: FloatArray | None,
    bias: FloatArray | None,
    noise: FloatArray | None,
    manifold: GainManifold,
    prior: ManifoldPrior | None,
    shape: tuple[int, ...],
) -> Bearings:
    """Bearings from a fit.

    Args:
        fit: Of the rows.
        energy: All that was heard, shape (n_rows,).
        across: Variance of the data along the perpendicular slope; None if the noise is unknown.
        bias: What noise adds to the sum of squared amplitudes.
        noise: Variance of the data, element axis first.
        manifold: The nominal array.
        prior: On its errors.
        shape: Leading shape of the answer.
    """
    heard = fit.amplitude_energy > 0
    amplitude_energy = np.where(heard, fit.amplitude_energy, 1.0)
    signal = amplitude_energy
    if bias is not None:
        signal = np.maximum(amplitude_energy - bias, LEAST_SHARE * amplitude_energy)
    azimuth_rad, std_rad = fit.azimuth_rad, np.full(fit.azimuth_rad.shape, np.nan)
    if across is not None:
        std_rad = np.minimum(np.sqrt(across) / (fit.perpendicular_energy * signal), UNKNOWN_STD_RAD)
    if prior is not None and noise is not None:
        azimuth_rad, std_rad = bearing_posterior(
            (fit.data / amplitude_energy).T, (noise / np.square(signal)).T, azimuth_rad, manifold, prior
        )
    misfit = 1.0 - fit.amplitude_energy * fit.gain_energy / np.where(heard, energy, 1.0)
    answer = (wrap(azimuth_rad), std_rad, np.minimum(np.maximum(misfit, 0.0), 1.0))
    if not heard.all():
        answer = tuple(np.where(heard, x, np.nan) for x in answer)
    return Bearings(
        azimuth_rad=answer[0].reshape(shape), std_rad=answer[1].reshape(shape), misfit=answer[2].reshape(shape)
    )
