"""What no unbiased estimator can beat, and what no averaging can remove."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic.manifold import GainManifold

FloatArray = NDArray[np.float64]


def perpendicular_slope(gain: FloatArray, slope: FloatArray) -> FloatArray:
    r"""The part of the manifold's slope that a change of amplitude cannot imitate, element axis first.

    .. math:: g'_\perp = (I - g g^T / g^T g) g'
    """
    along = (gain * slope).sum(axis=0) / np.square(gain).sum(axis=0)
    return slope - along * gain


def bearing_bound(manifold: GainManifold, azimuth_rad: ArrayLike, energy_to_noise: ArrayLike) -> FloatArray:
    r"""Cramer-Rao bound of the bearing of one pulse of unknown waveform in white noise.

    .. math:: \sigma_\theta \ge 1 / (\sqrt{\rho}\, \lVert g'_\perp(\theta) \rVert), \quad \rho = \sum_k s_k^2 / \sigma^2

    Args:
        manifold: The array.
        azimuth_rad: Array-frame azimuth, any shape.
        energy_to_noise: rho, the pulse's energy in a unit-gain channel over the variance of one noise sample, > 0;
            broadcasts with `azimuth_rad`. The paper's SNR is rho = 28 070 x 10^(SNR/10) for six elements.

    Returns:
        Standard deviation in radians, of the broadcast shape.

    References:
        Stoica and Nehorai, "MUSIC, maximum likelihood, and Cramer-Rao bound", 1989, for a real gain manifold.
    """
    slope = perpendicular_slope(manifold.gain(azimuth_rad), manifold.derivative(azimuth_rad))
    return 1.0 / np.sqrt(np.asarray(energy_to_noise) * np.square(slope).sum(axis=0))


def manifold_error_std(
    manifold: GainManifold, azimuth_rad: ArrayLike, gain_error: float, pointing_error_rad: float
) -> FloatArray:
    """Bearing error that all pulses from one azimuth share, because the array is not what the data sheet says.

    Args:
        manifold: The nominal array.
        azimuth_rad: Array-frame azimuth, any shape.
        gain_error: Standard deviation of the relative gain errors, >= 0.
        pointing_error_rad: Standard deviation of the pointing errors, >= 0.

    Returns:
        Standard deviation in radians, shape of `azimuth_rad`. Averaging pulses does not lessen it.
    """
    by_gain, by_pointing = _error_sensitivity(manifold, azimuth_rad)
    variance = np.square(by_gain * gain_error) + np.square(by_pointing * pointing_error_rad)
    return np.sqrt(variance.sum(axis=0))


def manifold_error(
    manifold: GainManifold, azimuth_rad: ArrayLike, gain_errors: FloatArray, pointing_errors_rad: FloatArray
) -> FloatArray:
    """First-order bearing error, radians and shape of `azimuth_rad`, made by known errors of the elements.

    Args:
        manifold: The nominal array.
        azimuth_rad: Array-frame azimuth, any shape.
        gain_errors: Relative gain errors, shape (n_elements,).
        pointing_errors_rad: How far each element looks beyond its nominal boresight, shape (n_elements,).
    """
    by_gain, by_pointing = _error_sensitivity(manifold, azimuth_rad)
    return np.tensordot(gain_errors, by_gain, axes=1) + np.tensordot(pointing_errors_rad, by_pointing, axes=1)


def _error_sensitivity(manifold: GainManifold, azimuth_rad: ArrayLike) -> tuple[FloatArray, FloatArray]:
    r"""Bearing error per relative gain error and per pointing error of each element, shape (n_elements, ...).

    :math:`\delta\theta = \sum_i g'_{\perp i} (e_i g_i - d_i g'_i) / \lVert g'_\perp \rVert^2`
    """
    gain, slope = manifold.gain(azimuth_rad), manifold.derivative(azimuth_rad)
    perpendicular = perpendicular_slope(gain, slope)
    weight = perpendicular / np.square(perpendicular).sum(axis=0)
    return weight * gain, -weight * slope
