"""What noise and the manifold say of given directions, in compiled loops: for estimators that search in other ways."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.manifold import ManifoldTable
from dirmusic.bearing.bearings import LEAST_SHARE, UNKNOWN_STD_RAD, Bearings
from dirmusic.bearing.likelihood_kernels import TINY, look_up
from dirmusic.compiled import Held, compiled
from dirmusic.kernels import dot, wrapped
from dirmusic.pulses.batch import NO_DIRECTION

FloatArray = NDArray[np.float64]


@compiled
def spectrum_peaks_on_grid(strengths: FloatArray, gain: FloatArray) -> NDArray[np.intp]:
    r"""Grid direction at which eq. (15), as printed, peaks for each pulse.

    One pulse a leaves all of space but itself to the noise, so
    :math:`P(\theta) = 1 / (\lVert g \rVert^2 - (g^T a)^2 / \lVert a \rVert^2)`.

    Args:
        strengths: Shape (n_pulses, n_elements).
        gain: Towards the directions of the grid, not normalised, shape (n_elements, n_directions).

    Returns:
        Number of the direction, shape (n_pulses,); 0 for a pulse without any strength.

    References:
        Dir-MUSIC, eq. (13)-(15).
    """
    (n_pulses, n), n_directions = strengths.shape, gain.shape[1]
    peak = np.zeros(n_pulses, np.intp)
    for k in range(n_pulses):
        energy, deepest = dot(strengths[k], strengths[k]), np.inf
        if energy == 0.0:
            continue
        for j in range(n_directions):
            norm = match = 0.0
            for e in range(n):
                norm += gain[e, j] * gain[e, j]
                match += gain[e, j] * strengths[k, e]
            null = norm - match * match / energy
            if null < deepest:
                deepest, peak[k] = null, j
    return peak


@compiled
def bearings_towards(
    azimuth_rad: FloatArray, strengths: FloatArray, variance: FloatArray, table: Held[ManifoldTable]
) -> Bearings:
    r"""Given directions with their deviations by noise and their misfits.

    .. math:: \sigma^2 = \frac{\sum_i p_i^2 v_i}{\lVert p \rVert^4 \alpha^2}, \quad p = (I - g g^T / g^T g) g',
              \quad \alpha = g^T a / g^T g

    Args:
        azimuth_rad: Array frame, shape (n_pulses,).
        strengths: Shape (n_pulses, n_elements), volts.
        variance: Variance of the strengths, same shape.
        table: Of the manifold.

    Returns:
        Columns of shape (n_pulses,); `NO_DIRECTION` for a pulse without any strength.
    """
    n_pulses, n = strengths.shape
    found = Bearings(np.empty(n_pulses), np.empty(n_pulses), np.empty(n_pulses))
    gain, slope = np.empty(n), np.empty(n)
    for k in range(n_pulses):
        total = dot(strengths[k], strengths[k])
        if total == 0.0:
            found.azimuth_rad[k], found.std_rad[k], found.misfit[k] = NO_DIRECTION
            continue
        look_up(azimuth_rad[k], table.value, gain, slope)
        energy = dot(gain, gain)
        along, amplitude = dot(gain, slope) / energy, dot(gain, strengths[k]) / energy
        perpendicular = spread = bias = 0.0
        for e in range(n):
            p = slope[e] - along * gain[e]
            perpendicular += p * p
            spread += p * p * variance[k, e]
            bias += variance[k, e] * gain[e] * gain[e] / (energy * energy)
        square = amplitude * amplitude
        signal = max(square - bias, LEAST_SHARE * square) / max(abs(amplitude), TINY)
        found.azimuth_rad[k] = wrapped(azimuth_rad[k])
        found.std_rad[k] = min(np.sqrt(spread) / ((perpendicular + TINY) * max(signal, TINY)), UNKNOWN_STD_RAD)
        found.misfit[k] = min(max(1.0 - square * energy / total, 0.0), 1.0)
    return found
