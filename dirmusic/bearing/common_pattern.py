"""Error of the pattern that all elements share, estimated from pulses.

An element of the wrong pattern deviates by the same gain as every other element at the same angle off its boresight,
whereas a faulty channel deviates alone. Comparing the elements therefore separates the two once waves have come from
several directions.
"""

import numpy as np

from dirmusic.angles import difference
from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD, GainManifold
from dirmusic.arrays import FloatArray, IntArray

N_KNOTS = 12
"""Number of angles off the boresight, 30 degrees apart, between which the error is interpolated linearly."""

N_SECTORS = 12
"""Number of sectors of azimuth, 30 degrees wide; all pulses in one of them share the errors of single elements."""

ITERATIONS = 3
"""Number of alternations between directions and error. For the computed helices, the third changes the gains by 1 to
2 % rms."""

PATTERN_STD, RESIDUAL_STD = 0.2, 0.05
"""Standard deviations, in units of the largest gain, of the common error and of what remains in a sector. A computed
helix deviates from the default pattern by up to 0.36; the spread of gains is 0.05. Only their ratio matters."""

MOST_PATTERN = 0.5
"""Largest common error, in units of the largest gain. Assumed; every antenna of this kind has gain along its
boresight."""

LEAST_GAIN = 0.02
"""Smallest corrected gain, in units of gain."""

SOFT_MISFIT = 0.02
"""Misfit at which a pulse counts half; pulses of several simultaneous waves have more. Assumed."""


def nearest_directions(strengths_v: FloatArray, gain: FloatArray) -> tuple[IntArray, FloatArray]:
    """Find the best search azimuth of each pulse.

    Args:
        strengths_v: Strengths, shape (n_pulses, n_channels).
        gain: Gains towards `SEARCH_AZIMUTHS_RAD`, shape (n_channels, n_azimuths).

    Returns:
        Indices of the azimuths and misfits as in `PulseBatch`, each of shape (n_pulses,).
    """
    match = strengths_v @ (gain / np.linalg.norm(gain, axis=0))
    best, energy = match.argmax(axis=1), np.square(strengths_v).sum(axis=1)
    return best, 1.0 - np.square(match.max(axis=1)) / np.maximum(energy, np.finfo(np.float64).tiny)


def sector(azimuth: IntArray) -> IntArray:
    """Return the sector of each search azimuth, given by index."""
    return azimuth * N_SECTORS // SEARCH_AZIMUTHS_RAD.size


def correct_common_error(manifold: GainManifold, strengths_v: FloatArray, channels: IntArray) -> FloatArray:
    r"""Estimate the common error of the pattern and add it to the gains of all elements.

    With pulse k from azimuth :math:`\theta_k`, of amplitude :math:`\alpha_k`, the error c at angles off the boresights
    :math:`b_i` minimises

    .. math:: \sum_k w_k \lVert P_k (a_k / \alpha_k - g(\theta_k) - c(\theta_k - b)) \rVert^2 +
              \lambda \lVert c \rVert^2

    where P projects on the complement of the gain and its slope, because amplitude and azimuth are unknown. Pulses of
    one sector have a total weight of at most 1.

    Args:
        manifold: Nominal manifold.
        strengths_v: Strengths of all channels, shape (n_pulses, n_elements).
        channels: Indices of the channels to use.

    Returns:
        Gains towards `SEARCH_AZIMUTHS_RAD`, also of the channels that were not used, shape (n_elements, n_azimuths).
    """
    strengths_v = strengths_v[:, channels]
    strengths_v = strengths_v[strengths_v.any(axis=1)]
    nominal, largest = manifold.search_gain, manifold.search_gain.max()
    off_rad = difference(SEARCH_AZIMUTHS_RAD, manifold.boresights_rad[:, np.newaxis])[..., np.newaxis]
    apart = np.abs(difference(off_rad, 2.0 * np.pi / N_KNOTS * np.arange(N_KNOTS))) * N_KNOTS / (2.0 * np.pi)
    basis = largest * np.maximum(1.0 - apart, 0.0)  # shape (n_elements, n_azimuths, N_KNOTS)
    ridge, corrected = (RESIDUAL_STD / PATTERN_STD) ** 2 * np.eye(N_KNOTS), nominal
    for _ in range(ITERATIONS):
        gain = corrected[channels]
        azimuth, misfit = nearest_directions(strengths_v, gain)
        weight = 1.0 / (1.0 + np.square(misfit / SOFT_MISFIT))
        weight /= np.maximum(np.bincount(sector(azimuth), weight, N_SECTORS), 1.0)[sector(azimuth)]
        along = gain[:, azimuth].T
        amplitude = (strengths_v * along).sum(axis=1, keepdims=True) / np.square(along).sum(axis=1, keepdims=True)
        slope = (np.roll(gain, -1, axis=1) - np.roll(gain, 1, axis=1))[:, azimuth].T
        spanned, _ = np.linalg.qr(np.stack([along, slope], axis=-1))
        residual = (strengths_v / amplitude - nominal[channels][:, azimuth].T)[..., np.newaxis]
        columns = np.concatenate([basis[channels][:, azimuth].transpose(1, 0, 2), residual], axis=-1)
        columns -= spanned @ (spanned.transpose(0, 2, 1) @ columns)
        rows = (columns * np.sqrt(weight)[:, np.newaxis, np.newaxis]).reshape(-1, N_KNOTS + 1)
        x, y = rows[:, :N_KNOTS], rows[:, N_KNOTS]
        error = np.clip(np.linalg.solve(x.T @ x + ridge, x.T @ y), -MOST_PATTERN, MOST_PATTERN)
        corrected = np.maximum(nominal + basis @ error, LEAST_GAIN)
    return corrected
