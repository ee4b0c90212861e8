"""Detection of pulses in recorded samples: the trigger and the position of the gate, for missions and surveys alike."""

import numpy as np

from dirmusic.arrays import FloatArray, IntArray
from dirmusic.compiled import compiled, compiled_inner


@compiled_inner
def count_crossings(volts: FloatArray, first: int, end: int, limit_v: FloatArray, level_v: float) -> tuple[int, int]:
    """Search the samples from `first` up to `end` for those beyond the level.

    Returns:
        Index of the first such sample, or -1, and number of such samples in all channels.
    """
    crossing, n = -1, 0
    for e in range(limit_v.size):
        if limit_v[e] > level_v:
            channel_v = volts[e, first:end]
            for t in range(channel_v.size):
                if abs(channel_v[t]) > level_v:
                    n += 1
                    if crossing < 0 or first + t < crossing:
                        crossing = first + t
    return crossing, n


@compiled_inner
def gate_start(volts: FloatArray, crossing: int, n_peak: int, n_before: int, limit_v: FloatArray) -> tuple[int, int]:
    """Find the start of the gate: `n_before` samples ahead of where the strongest channel reaches half its peak.

    The trigger itself is not a suitable reference, because stronger pulses cross the level earlier.

    Args:
        volts: Samples, shape (n_elements, n_samples).
        crossing: Sample that triggered.
        n_peak: Number of samples from the trigger until after the peaks in all channels.
        n_before: Number of samples of the gate before the half peak.
        limit_v: Voltage at which each channel saturates, shape (n_elements,).

    Returns:
        The strongest channel, and the first sample of the gate.
    """
    strongest, peak_v = limit_v.size - 1, 0.0
    for t in range(crossing, crossing + n_peak):
        for e in range(limit_v.size):
            clipped_v = min(abs(volts[e, t]), limit_v[e])
            if clipped_v > peak_v:
                strongest, peak_v = e, clipped_v
    limit, half = limit_v[strongest], max(n_before, crossing - n_before)
    while min(abs(volts[strongest, half]), limit) < 0.5 * peak_v:
        half += 1
    return strongest, half - n_before


@compiled
def find_gates(volts: FloatArray, level_v: float, n_before: int, n_peak: int, n_gate: int) -> IntArray:
    """Find the gates of all pulses of a record.

    After a pulse, the next one can trigger once all channels have stayed below the level for the length of a gate, so
    that a decaying pulse is found once. A pulse whose gate the end of the record cuts off is not found.

    Args:
        volts: Samples, shape (n_elements, n_samples); the first `n_before` must not contain a pulse.
        level_v: Level that a sample must exceed.
        n_before: Number of samples of the gate before the half peak of the strongest channel.
        n_peak: Number of samples from the trigger until after the peaks in all channels.
        n_gate: Length of the gate.

    Returns:
        First samples of the gates, shape (n_pulses,).
    """
    n_elements, n_samples = volts.shape
    starts, n_pulses = np.empty(n_samples // n_gate + 1, np.intp), 0
    limit_v, at, is_quiet = np.full(n_elements, np.inf), 0, True
    while at < n_samples:
        end = min(at + n_gate, n_samples)
        crossing, _ = count_crossings(volts, at, end, limit_v, level_v)
        if crossing < 0:
            at, is_quiet = end, True
        elif not is_quiet:
            at = crossing + 1
        else:
            _, start = gate_start(volts, crossing, min(n_peak, n_samples - crossing), n_before, limit_v)
            shift = max(0, start + n_gate - n_samples)
            if shift <= min(n_before, start):
                starts[n_pulses] = start - shift
                n_pulses += 1
            at, is_quiet = max(start + n_gate, crossing + 1), False
    return starts[:n_pulses]
