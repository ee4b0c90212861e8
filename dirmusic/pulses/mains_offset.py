"""Offset between the frequency of the mains and the receiver's reference, estimated from the phases of the pulses.

The phases that a receiver measures with a clock not locked to the mains drift by one period every 1 / offset seconds,
which blurs the phase-resolved patterns.
"""

from collections.abc import Sequence

import numpy as np
from scipy.stats import gamma

from dirmusic.arrays import FloatArray

MAX_OFFSET_HZ = 0.2
"""Largest offset searched; the mains in Continental Europe stays within it (Regulation (EU) 2017/1485, annex III)."""

HARMONICS = (1, 2)
"""Harmonics of the mains. Discharges that are alike in both half cycles show in the second only."""

FALSE_ALARM = 1e-3
"""Probability that an offset is significant although the pulses are independent of the mains."""

BIN_S, FINENESS = 0.2, 32
"""Bins of time, and points of the periodogram per inverse duration: phases are at most 7 degrees off at `MAX_OFFSET_HZ`
and at most 6 degrees at the ends of the mission."""


def mains_offset_hz(time_s: Sequence[FloatArray], phase_rad: Sequence[FloatArray]) -> float:
    r"""Estimate the mains frequency minus the receiver's reference from all sources, by a joint periodogram.

    .. math:: P(f) = \sum_s \frac{1}{n_s} \sum_h \Big| \sum_k e^{i h (\varphi_k + 2 \pi f t_k)} \Big|^2

    For pulses independent of the mains, each term is exponentially distributed with mean 1 (Rayleigh's test). The
    maximum is significant if it exceeds P(0) by more than the (1 - `FALSE_ALARM`) quantile of the largest of all P.
    The offset is assumed to be constant; a frequency that wanders by less than 1 / (4 T) in T seconds does little harm.

    Args:
        time_s: Ascending times of the pulses of each source, shape (n_pulses,) each.
        phase_rad: Phases of the receiver's reference at the pulses, shape (n_pulses,) each.

    Returns:
        The offset in Hz, or 0 if it is not significant. `phase_rad + 2 pi offset time_s` is free of drift.
    """
    sources = [(time, phase) for time, phase in zip(time_s, phase_rad, strict=True) if time.size]
    if not sources:
        return 0.0
    start_s = min(time[0] for time, _ in sources)
    n_bins = 1 + int((max(time[-1] for time, _ in sources) - start_s) / BIN_S)
    size = FINENESS * n_bins
    steps = np.arange(-int(MAX_OFFSET_HZ * BIN_S * size), int(MAX_OFFSET_HZ * BIN_S * size) + 1)
    power = np.zeros(steps.size)
    for time, phase in sources:
        bins = ((time - start_s) / BIN_S).astype(np.intp)
        for harmonic in HARMONICS:
            parts = (np.bincount(bins, wave(harmonic * phase), n_bins) for wave in (np.cos, np.sin))
            spectrum = np.fft.fft(np.array([1, 1j]) @ list(parts), size)
            power += np.square(np.abs(spectrum[-harmonic * steps % size])) / time.size
    n_independent = HARMONICS[-1] * steps.size / FINENESS
    least = gamma.isf(FALSE_ALARM / n_independent, len(HARMONICS) * len(sources))
    best = int(power.argmax())
    return float(steps[best] / (size * BIN_S)) if power[best] - power[steps.size // 2] > least else 0.0
