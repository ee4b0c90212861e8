"""How many echoes there can be: a discharge is detected once, on its straight path or as an echo, not as both."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

WINDOW_S = 5.0
"""Pulses are counted in windows of this length (assumed): long for numbers that tell, short for the robot's way."""

SECTOR_RAD = np.radians(30.0)
"""Echoes of one window are counted by sectors of this width (assumed)."""

RATE_QUANTILE = 0.9
"""A source is taken to discharge as often, always, as in this quantile of the windows in which it was detected
(assumed): in the others distance or an obstacle took some."""

EXCESS_SIGMAS = 3.0
"""Pulses are too many once they are so many Poisson deviations more than there can be echoes (assumed)."""


def too_many_for_echoes(
    time_s: FloatArray, bearing_rad: FloatArray, is_suspect: BoolArray, owner: NDArray[np.intp], n_sources: int
) -> BoolArray:
    r"""Which pulses came from one direction in greater number than there can be echoes of known sources.

    Source k, of which :math:`\lambda_k` pulses are due in a window and :math:`n_k` came on the straight path, leaves
    :math:`b = \sum_k \max(\lambda_k - n_k, 0)` echoes at most; :math:`n > b + 3 \sqrt{b + 1}` pulses of one sector are
    not all echoes, so another source is among them.

    The number of echoes is a Poisson number of mean b at most. The 1 keeps its tail below 0.4 % where b is small: with
    :math:`\sqrt{b}`, one stray pulse would be another source at b = 0, and one window in 100 would have one at b = 0.1.

    Args:
        time_s: Of each pulse, shape (n,).
        bearing_rad: World frame, shape (n,).
        is_suspect: Whether each pulse may be an echo of one of these sources, shape (n,).
        owner: Which source each pulse came from on the straight path, in [0, n_sources), or anything below, shape (n,).
        n_sources: How many there are.

    Returns:
        Shape (n,); pulses that are no suspects are none of these.
    """
    if n_sources == 0 or not is_suspect.any():
        return np.zeros(time_s.size, dtype=np.bool_)
    window = np.unique(time_s // WINDOW_S, return_inverse=True)[1]  # empty windows say nothing, and may be many
    n_windows, n_sectors = int(window.max()) + 1, round(2 * np.pi / SECTOR_RAD)
    rows = np.flatnonzero(is_suspect)
    cell = window[rows] * n_sectors
    cell += (np.mod(bearing_rad[rows], 2 * np.pi) // SECTOR_RAD).astype(np.intp) % n_sectors
    n_alike = np.bincount(cell)[cell]
    too_many = np.zeros(time_s.size, dtype=np.bool_)
    if n_alike.max() <= EXCESS_SIGMAS:  # too few, whatever there can be
        return too_many
    is_owned = owner >= 0
    direct = np.bincount(owner[is_owned] * n_windows + window[is_owned], minlength=n_sources * n_windows)
    direct = direct.reshape(n_sources, n_windows)
    rising, n_empty = np.sort(direct, axis=1), (direct == 0).sum(axis=1)
    at = n_empty + (RATE_QUANTILE * (n_windows - 1 - n_empty)).astype(np.intp)
    due = np.where(n_empty < n_windows, rising[np.arange(n_sources), np.minimum(at, n_windows - 1)], np.inf)
    most = np.maximum(due[:, np.newaxis] - direct, 0.0).sum(axis=0)
    too_many[rows] = n_alike > (most + EXCESS_SIGMAS * np.sqrt(most + 1.0))[window[rows]]
    return too_many
