"""From an emission to the gate that it fills, or that noise alone does."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from pdpatrol.sensing.radio.arrivals import Arrivals
from pdpatrol.sensing.receiver.sampling.noise import add_noise, draw_tail, settle
from pdpatrol.sensing.receiver.sampling.rare_triggers import (
    LIKELY,
    Fixed,
    expect,
    fix_one,
    follow,
    step_probability,
)
from pdpatrol.sensing.receiver.sampling.record import PIECE, Record, Windows, crossings, fill, plan_windows
from pdpatrol.sensing.receiver.sampling.sampler import Emission, Incoming, Sampler, Tones
from pdpatrol.sensing.receiver.sampling.signals import add_tones, set_signal

FloatArray = NDArray[np.float64]

NOT_TRIGGERED, IS_PULSE, IS_BURST = 0, 1, 2


@compiled
def lasts(
    start_s: float,
    since: int,
    least_v2: float,
    channel: int,
    limit_v: float,
    incoming: Incoming,
    sampler: Sampler,
    rng: np.random.Generator,
) -> bool:
    """Whether what fills a gate is still there in all windows after it, as a burst is and a pulse is not.

    Args:
        start_s: Start of the gate, after the emission.
        since: Samples from the start of the first window to that of the gate.
        least_v2: Mean power of a window that counts.
        channel: Which is looked at.
        limit_v: Where it saturates.
        incoming: What comes in.
        sampler: How the receiver samples.
        rng: Draws.
    """
    burst, tones, arrivals, only = sampler.burst, incoming.tones, incoming.arrivals, slice(channel, channel + 1)
    arrivals = Arrivals(arrivals.delay_s[:, only], arrivals.amplitude[:, only], arrivals.loudest, arrivals.loudest_s)
    tones = Tones(tones.amplitude_v[:, only], tones.phase_rad[:, only], tones.turn_rad)
    volts, state = np.empty((burst.n_samples, 1)), np.empty((sampler.noise.sections.shape[0], 2, 1))
    for w in range(burst.n_windows):
        at, power_v2 = burst.first + w * burst.step, 0.0
        set_signal(volts, start_s + at / sampler.pulse.rate_hz, incoming.emission, arrivals, sampler.pulse)
        add_tones(volts, since + at, tones, incoming.start_rad)
        settle(sampler.noise, rng, state)
        add_noise(sampler.noise, rng, state, volts)
        for t in range(burst.n_samples):
            power_v2 += min(abs(volts[t, 0]), limit_v) ** 2
        if power_v2 <= least_v2 * burst.n_samples:
            return False
    return burst.n_windows > 0


class Found(NamedTuple):
    """What triggers.

    Attributes:
        window: It lies in; -1 if nothing triggers.
        crossing: Row of the first sample beyond the level.
        fixed: A sample that was known to be.
    """

    window: int
    crossing: int
    fixed: Fixed


@compiled
def find_trigger(
    record: Record,
    windows: Windows,
    most_tones_v: float,
    incoming: Incoming,
    sampler: Sampler,
    limit_v: FloatArray,
    rng: np.random.Generator,
) -> Found:
    r"""Look for the first sample beyond the level, window by window: their noises are independent.

    A window that hardly ever triggers is not sampled each time. With :math:`p_i` the probability that sample i alone
    exceeds the level, and :math:`S = \sum_i p_i < 1`: with the probability 1 - S there is nothing to be seen. Else one
    sample is drawn, i with the probability :math:`p_i / S`; it exceeds the level, all others follow it as the noise's
    correlation says; and where K samples exceed it, the record counts with the probability 1 / K. Every record that
    triggers comes as often as if all had been sampled, for :math:`\sum_{i \in K} p_i P(\cdot | i) / K = P(\cdot)`.

    Args:
        record: Is filled as far as needed.
        windows: Of it.
        most_tones_v: No sample has more of the carriers.
        incoming: What comes in.
        sampler: How the receiver samples.
        limit_v: Voltage at which each channel saturates, shape (n_elements,).
        rng: Draws.
    """
    before, level_v, nothing = sampler.timing.before, sampler.trigger.level_v, Fixed(-1, -1, 0.0)
    for w in range(windows.first.size):
        left, first, end = rng.random(), windows.first[w] + before, windows.search_end[w]
        if left >= (end - first) * limit_v.size * step_probability(sampler.trigger, windows.most_v[w] + most_tones_v):
            continue  # at least what is expected
        expected = expect(record, windows, w, incoming, sampler, limit_v)
        if expected > LIKELY:
            for row in range(first, end, PIECE):
                piece_end = min(row + PIECE, end)
                fill(record, windows, w, piece_end, incoming, sampler, rng)
                crossing, _ = crossings(record.volts, row, piece_end, limit_v, level_v)
                if crossing >= 0:
                    return Found(w, crossing, nothing)
        elif left < expected:
            fixed = fix_one(record, windows, w, left, incoming, sampler, limit_v, rng)
            if fixed.row >= 0:
                crossing, n_above = crossings(record.volts, first, end, limit_v, level_v)
                if rng.random() * n_above < 1.0:
                    return Found(w, crossing, fixed)
    return Found(-1, -1, nothing)


@compiled
def sample_pulse(
    emission: Emission,
    arrivals: Arrivals,
    sampler: Sampler,
    tones: Tones,
    limit_v: FloatArray,
    background_v2: FloatArray,
    rng: np.random.Generator,
    gate_v: FloatArray,
) -> int:
    """Whether an emission triggers, and the gate that it then fills.

    Args:
        emission: What is on its way.
        arrivals: Its paths among others.
        sampler: How the receiver samples.
        tones: Carriers.
        limit_v: Voltage at which each channel saturates, shape (n_elements,); infinite if it does not.
        background_v2: Power of a sample without an emission, shape (n_elements,).
        rng: Draws.
        gate_v: Becomes the gate, shape (n_gate, n_elements), as the converter gets it.

    Returns:
        `NOT_TRIGGERED`, `IS_PULSE`, or `IS_BURST`.
    """
    timing, trigger, n_elements, most_tones_v = sampler.timing, sampler.trigger, limit_v.size, 0.0
    start_rad = np.empty(tones.turn_rad.size)
    for c in range(start_rad.size):
        start_rad[c] = 2.0 * np.pi * rng.random()
        loudest_v = 0.0
        for e in range(n_elements):
            loudest_v = max(loudest_v, tones.amplitude_v[c, e])
        most_tones_v += loudest_v
    incoming = Incoming(emission, arrivals, tones, start_rad)
    windows = plan_windows(emission, arrivals, timing, sampler.pulse.rate_hz, rng.random())
    n_windows = windows.first.size
    if n_windows == 0:
        return NOT_TRIGGERED
    record = Record(
        np.empty((windows.end[-1], n_elements)),
        windows.first.copy(),
        windows.first.copy(),
        np.empty((n_windows, sampler.noise.sections.shape[0], 2, n_elements)),
    )
    window, crossing, fixed = find_trigger(record, windows, most_tones_v, incoming, sampler, limit_v, rng)
    if window < 0:
        return NOT_TRIGGERED

    row, end = record.has_noise[window], crossing + timing.peak
    fill(record, windows, window, end, incoming, sampler, rng)
    loudest, peak_v = 0, 0.0
    follow(record.volts, row, end, fixed, trigger.correlation)
    for t in range(crossing, end):
        for e in range(n_elements):
            clipped_v = min(abs(record.volts[t, e]), limit_v[e])
            if clipped_v > peak_v:
                loudest, peak_v = e, clipped_v
    half = max(windows.first[window] + timing.before, crossing - timing.before)
    while min(abs(record.volts[half, loudest]), limit_v[loudest]) < 0.5 * peak_v:
        half += 1
    start, power_v2 = half - timing.before, 0.0
    row, end = record.has_noise[window], start + timing.gate
    fill(record, windows, window, end, incoming, sampler, rng)
    follow(record.volts, row, end, fixed, trigger.correlation)
    for t in range(timing.gate):
        for e in range(n_elements):
            gate_v[t, e] = min(max(record.volts[start + t, e], -limit_v[e]), limit_v[e])
        power_v2 += gate_v[t, loudest] ** 2
    power_v2 = power_v2 / timing.gate - background_v2[loudest]
    least_v2 = sampler.burst.share * power_v2 + background_v2[loudest]
    start_s = windows.start_s[window] + (start - windows.first[window]) / sampler.pulse.rate_hz
    since = int(np.rint((start_s - windows.start_s[0]) * sampler.pulse.rate_hz))
    return IS_BURST if lasts(start_s, since, least_v2, loudest, limit_v[loudest], incoming, sampler, rng) else IS_PULSE


@compiled
def sample_noise(sampler: Sampler, tones: Tones, rng: np.random.Generator, gate_v: FloatArray) -> None:
    """A gate that noise alone has triggered.

    One sample of one channel lies in the tail beyond the level, and its channel follows it as the noise's correlation
    says; all other channels are as ever.

    Args:
        sampler: How the receiver samples.
        tones: Carriers.
        rng: Draws.
        gate_v: Becomes the gate, shape (n_gate, n_elements).
    """
    trigger, n_gate, n_elements = sampler.trigger, gate_v.shape[0], gate_v.shape[1]
    state = np.zeros((sampler.noise.sections.shape[0], 2, n_elements))
    gate_v[:] = 0.0
    settle(sampler.noise, rng, state)
    add_noise(sampler.noise, rng, state, gate_v)
    at, channel = sampler.timing.before, int(rng.random() * n_elements)
    side = 1.0 if rng.random() < 0.5 else -1.0
    crossing_v = side * trigger.noise_v * draw_tail(trigger.level_v / trigger.noise_v, rng)
    added_v = crossing_v - gate_v[at, channel]
    for t in range(n_gate):
        if abs(t - at) < trigger.correlation.size:
            gate_v[t, channel] += added_v * trigger.correlation[abs(t - at)]
    start_rad = np.empty(tones.turn_rad.size)
    for c in range(start_rad.size):
        start_rad[c] = 2.0 * np.pi * rng.random()
    add_tones(gate_v, 0, tones, start_rad)
