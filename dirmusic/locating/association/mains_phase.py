"""Mains phase: findings that a pulse cannot have come from, for they do not discharge at its phase."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

N_BINS = 24
"""Of a period (assumed): 15 degrees, half the width of most clusters of `dirmusic.pulses.phase_resolved`."""

STRAY_PULSES = 1.0
"""Each bin is taken to hold so many pulses more than were counted (assumed): kinds have strays, and few pulses tell
nothing."""

LEAST_RATIO = 0.1
"""A finding does not discharge where it does so less often by this than on average over the period (assumed). Of a
finding that discharges at any phase no bin is so empty: of more than 200 pulses, the fewest that can rule anything out,
each holds 9 on average."""


def may_share_phase(phase_rad: FloatArray, owner: NDArray[np.intp], n_findings: int) -> BoolArray:
    r"""Whether each pulse may have come from each finding, by the phases of the pulses that surely did.

    With :math:`c_b` of n pulses in bin b, smoothed over the bins beside it, a pulse of that phase is ruled out if
    :math:`c_b + 1 < 0.1 (n / 24 + 1)`.

    Args:
        phase_rad: Of the mains at each pulse, in [0, 2 pi), shape (n,); NaN where it was not recorded, which rules
            nothing out.
        owner: Which finding each pulse surely came from, in [0, n_findings), or anything below, shape (n,).
        n_findings: How many there are.

    Returns:
        Shape (n_findings, n).
    """
    is_known = np.isfinite(phase_rad)
    slot = (np.where(is_known, phase_rad, 0.0) * (N_BINS / (2 * np.pi))).astype(np.intp) % N_BINS
    sure = is_known & (owner >= 0)
    counts = np.bincount(owner[sure] * N_BINS + slot[sure], minlength=n_findings * N_BINS)
    counts = counts.reshape(n_findings, N_BINS).astype(np.float64)
    smooth = 0.5 * counts + 0.25 * (np.roll(counts, 1, axis=1) + np.roll(counts, -1, axis=1))
    ratio = (smooth + STRAY_PULSES) / (counts.mean(axis=1, keepdims=True) + STRAY_PULSES)
    return (ratio >= LEAST_RATIO)[:, slot] | ~is_known
