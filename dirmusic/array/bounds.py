"""Bounds on the bearing error: the Cramer-Rao bound for noise, and array errors, which averaging does not reduce."""

import numpy as np
from numpy.typing import ArrayLike

from dirmusic.array.element_errors import ElementErrors, ManifoldPrior
from dirmusic.array.manifold import GainManifold
from dirmusic.arrays import FloatArray


def perpendicular_slope(gain: FloatArray, slope: FloatArray) -> FloatArray:
    r"""Compute the component of the slope that is orthogonal to the gain, with the elements on the first axis.

    .. math:: g'_\perp = (I - g g^T / g^T g) g'
    """
    along = (gain * slope).sum(axis=0) / np.square(gain).sum(axis=0)
    return slope - along * gain


def bearing_bound(manifold: GainManifold, azimuth_rad: ArrayLike, energy_to_noise: ArrayLike) -> FloatArray:
    r"""Compute the Cramer-Rao bound on the bearing of one pulse of unknown waveform in white noise.

    .. math:: \sigma_\theta \ge 1 / (\sqrt{\rho}\, \lVert g'_\perp(\theta) \rVert), \quad \rho = \sum_k s_k^2 / \sigma^2

    Args:
        manifold: Manifold of the array.
        azimuth_rad: Array-frame azimuth, any shape.
        energy_to_noise: rho, the energy of the pulse in a unit-gain channel over the variance of one noise sample, > 0;
            broadcasts with `azimuth_rad`. An SNR as defined in the paper corresponds to
            rho = 28 070 x 10^(SNR/10) for six elements.

    Returns:
        Standard deviation in radians, of the broadcast shape.

    References:
        Stoica and Nehorai, "MUSIC, maximum likelihood, and Cramer-Rao bound", 1989, specialised to a real gain
        manifold.
    """
    slope = perpendicular_slope(*manifold.gain_and_slope(azimuth_rad))
    return 1.0 / np.sqrt(np.asarray(energy_to_noise) * np.square(slope).sum(axis=0))


def manifold_error_std(manifold: GainManifold, azimuth_rad: ArrayLike, prior: ManifoldPrior) -> FloatArray:
    """Compute the bearing error due to errors of the array, which all pulses from one azimuth share.

    Args:
        manifold: Nominal manifold.
        azimuth_rad: Array-frame azimuth, any shape.
        prior: Prior of the errors of the elements.

    Returns:
        Standard deviation in radians, shape of `azimuth_rad`, to first order.
    """
    gain, slope = manifold.gain_and_slope(azimuth_rad)
    variance = np.square(_turn_by_gain(gain, slope)) * prior.variance(gain, slope)
    return np.sqrt(variance.sum(axis=0))


def manifold_error(manifold: GainManifold, azimuth_rad: ArrayLike, errors: ElementErrors) -> FloatArray:
    """Compute the first-order bearing error due to known element errors, radians, shape of `azimuth_rad`."""
    gain, slope = manifold.gain_and_slope(azimuth_rad)
    per_element = (-1, *(1,) * (gain.ndim - 1))
    e, d, o = (x.reshape(per_element) for x in (errors.gain, errors.pointing_rad, errors.offset))
    return (_turn_by_gain(gain, slope) * (e * gain - d * slope + o)).sum(axis=0)


def rms_bearing_error(manifold: GainManifold, covariance: FloatArray) -> float:
    """Compute the rms bearing error over all azimuths due to element errors, radians, to first order.

    Args:
        manifold: Assumed manifold.
        covariance: Covariance of the element errors, shape (3 n_elements, 3 n_elements), as in `EstimatedErrors`.
    """
    gain, slope = manifold.search_gain, manifold.search_slope
    turn = _turn_by_gain(gain, slope)
    by_error = np.concatenate([turn * gain, -turn * slope, turn])
    return float(np.sqrt(np.einsum("ij,ik,kj->j", by_error, covariance, by_error).mean()))


def _turn_by_gain(gain: FloatArray, slope: FloatArray) -> FloatArray:
    r"""Compute the bearing error per unit error of each gain, :math:`g'_{\perp i} / \lVert g'_\perp \rVert^2`."""
    perpendicular = perpendicular_slope(gain, slope)
    return perpendicular / np.square(perpendicular).sum(axis=0)
