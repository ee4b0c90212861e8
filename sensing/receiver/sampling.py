"""What a receiver samples, in compiled loops: signals, carriers and noise in all channels, the trigger, the gate.

Time runs along the first axis of every record and channels along the second: the sections of the filter then work on
all channels at once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from sensing.nature.pulse_shape import FREQUENCY_HZ
from sensing.radio.arrivals import Arrivals
from sensing.receiver.front_end import NoiseFilter, PulseTable

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

LIKELY = 0.3
"""Samples expected beyond the trigger level from which on a pulse is sampled at once. Below, a draw decides first
whether there is anything to sample; the law is the same, see `sample_pulse`."""

PIECE = 48
"""Samples that are made at once while a trigger is looked for; it decides about speed alone."""

NOT_TRIGGERED, IS_PULSE, IS_BURST = 0, 1, 2


class Timing(NamedTuple):
    """Lengths in samples.

    Attributes:
        before: From the start of a gate to where its loudest channel comes to half its peak.
        aperture: By which arrivals at two elements may differ.
        rise: From an arrival to where the pulse is past its peak.
        peak: From where a pulse triggers to where all channels are past their peaks.
        gate: Length of a gate.
        apart: Noise so far apart is independent.
    """

    before: int
    aperture: int
    rise: int
    peak: int
    gate: int
    apart: int


class Trigger(NamedTuple):
    """When a sample triggers.

    Attributes:
        level_v: What the magnitude of a sample has to exceed, in any channel.
        noise_v: Standard deviation of a sample of noise behind the band-pass.
        correlation: Of that noise over the lags from 0 on, shape (n_lags,); 0 beyond.
        probability: That a sample with so much signal triggers, for signals in steps of `step_v` from 0 on; shape
            (n_steps,).
        step_v: As said.
    """

    level_v: float
    noise_v: float
    correlation: FloatArray
    probability: FloatArray
    step_v: float


class BurstTest(NamedTuple):
    """What makes a burst: in the loudest channel its power lasts through all of some windows after the gate.

    Attributes:
        first: From the start of the gate to that of the first window, samples.
        step: From one window to the next, samples.
        n_windows: How many there are.
        n_samples: Length of each.
        share: Of the mean power in the gate, that a burst exceeds in each window.
    """

    first: int
    step: int
    n_windows: int
    n_samples: int
    share: float


class Tones(NamedTuple):
    """Steady carriers behind the band-pass, as the channels of an array at one place receive them.

    Attributes:
        amplitude_v: Shape (n_carriers, n_elements).
        phase_rad: Shape (n_carriers, n_elements).
        turn_rad: By which each goes on from sample to sample, shape (n_carriers,).
    """

    amplitude_v: FloatArray
    phase_rad: FloatArray
    turn_rad: FloatArray


class Emission(NamedTuple):
    """One emission and the ray paths it takes.

    Attributes:
        peak_v: 1 m away in a unit-gain channel, before the band-pass, with its sign.
        burst_s: How long it lasts if it is a burst, 0 for a pulse.
        first: First of its paths among the arrivals.
        n_paths: How many it has.
    """

    peak_v: float
    burst_s: float
    first: int
    n_paths: int


class Sampler(NamedTuple):
    """How a receiver samples.

    Attributes:
        pulse: Shape of a pulse behind the filter.
        noise: The filter, and the noise before it.
        timing: Of windows and gates.
        trigger: When a sample triggers.
        burst: What makes a burst.
    """

    pulse: PulseTable
    noise: NoiseFilter
    timing: Timing
    trigger: Trigger
    burst: BurstTest


@compiled
def add_signal(record_v: FloatArray, start_s: float, emission: Emission, arrivals: Arrivals, pulse: PulseTable) -> None:
    """Add an emission by all its paths to a record (n_samples, n_elements) from `start_s` after the emission on."""
    n_phases, n_known = pulse.values_v.shape
    n_samples, n_elements = record_v.shape
    for p in range(emission.first, emission.first + emission.n_paths):
        for e in range(n_elements):
            amplitude_v = emission.peak_v * arrivals.amplitude[p, e]
            at = int(np.floor(n_phases * (start_s - arrivals.delay_s[p, e]) * pulse.rate_hz + 0.5))
            before, phase = at // n_phases, at % n_phases  # samples from the arrival to the first one of the record
            if emission.burst_s > 0.0:
                for t in range(max(0, -before), n_samples):
                    since_s = start_s + t / pulse.rate_hz - arrivals.delay_s[p, e]
                    if 0.0 <= since_s < emission.burst_s:
                        record_v[t, e] += amplitude_v * math.sin(2.0 * np.pi * FREQUENCY_HZ * since_s)
                continue
            values_v = pulse.values_v[phase]
            for t in range(max(0, -before), min(n_samples, n_known - before)):
                record_v[t, e] += amplitude_v * values_v[before + t]


@compiled
def add_tones(record_v: FloatArray, at: int, tones: Tones, start_rad: FloatArray) -> None:
    """Add carriers to a record whose first row is `at` samples after that at which they have the phases `start_rad`."""
    for c in range(start_rad.size):
        for t in range(record_v.shape[0]):
            now_rad = start_rad[c] + (at + t) * tones.turn_rad[c]
            for e in range(record_v.shape[1]):
                record_v[t, e] += tones.amplitude_v[c, e] * math.cos(now_rad + tones.phase_rad[c, e])


@compiled
def settle(noise: NoiseFilter, rng: np.random.Generator, state: FloatArray) -> None:
    """Draw the state that the filter has after a long time in white noise.

    Args:
        noise: The filter.
        rng: Draws.
        state: Becomes that of each channel, shape (n_sections, 2, n_elements).
    """
    n_states, n_elements = noise.settled.shape[0], state.shape[2]
    row = np.empty(n_elements)
    state[:] = 0.0
    for j in range(n_states):
        for e in range(n_elements):
            row[e] = rng.standard_normal()
        for i in range(n_states):
            into, share = state[i // 2, i % 2], noise.settled[i, j]
            for e in range(n_elements):
                into[e] += share * row[e]


@compiled
def add_noise(noise: NoiseFilter, rng: np.random.Generator, state: FloatArray, record_v: FloatArray) -> None:
    """Add noise behind the filter to a record (n_samples, n_elements); the state goes on, for the next piece of it."""
    n_elements, sections = record_v.shape[1], noise.sections
    row = np.empty(n_elements)
    for t in range(record_v.shape[0]):
        for e in range(n_elements):
            row[e] = rng.standard_normal()
        for s in range(sections.shape[0]):
            b0, b1, b2, a1, a2 = sections[s, 0], sections[s, 1], sections[s, 2], sections[s, 4], sections[s, 5]
            z1, z2 = state[s, 0], state[s, 1]
            for e in range(n_elements):
                into = row[e]
                out = b0 * into + z1[e]
                z1[e] = b1 * into - a1 * out + z2[e]
                z2[e] = b2 * into - a2 * out
                row[e] = out
        for e in range(n_elements):
            record_v[t, e] += noise.std_v * row[e]


@compiled
def tail_probability(sigmas: float) -> float:
    """That a standard normal number is larger."""
    return 0.5 * math.erfc(sigmas * math.sqrt(0.5))


@compiled
def draw_tail(sigmas: float, rng: np.random.Generator) -> float:
    """A standard normal number, given that it is larger than `sigmas`.

    By rejection from an exponential (C. P. Robert, Simulation of truncated normal variables, 1995); below 0.5 simply
    from normal numbers.
    """
    if sigmas < 0.5:
        drawn = rng.standard_normal()
        while drawn <= sigmas:
            drawn = rng.standard_normal()
        return drawn
    rate = 0.5 * (sigmas + math.sqrt(sigmas * sigmas + 4.0))
    while True:
        drawn = sigmas - math.log(1.0 - rng.random()) / rate
        if rng.random() <= math.exp(-0.5 * (drawn - rate) ** 2):
            return drawn


@compiled
def step_probability(trigger: Trigger, signal_v: float) -> float:
    """That a sample with so much signal, rounded up to the next step, triggers; 1 beyond the last step."""
    step = int(math.ceil(abs(signal_v) / trigger.step_v))
    return trigger.probability[step] if step < trigger.probability.size else 1.0


class Windows(NamedTuple):
    """Where a trigger is looked for: pieces of a record, one after the other in time, with noise of their own.

    Attributes:
        start_s: Of the first row of each, after the emission, shape (n_windows,).
        first: Its first row in the record, shape (n_windows,).
        search_end: The row after the last in which it may trigger; the first such is `before` after `first`.
        end: The row after the last that a gate may reach.
    """

    start_s: FloatArray
    first: IntArray
    search_end: IntArray
    end: IntArray


@compiled
def plan_windows(emission: Emission, arrivals: Arrivals, timing: Timing, rate_hz: float, offset: float) -> Windows:
    """A window about each arrival; those whose gates or noise would overlap are one.

    Args:
        emission: What is on its way.
        arrivals: Its paths among others.
        timing: Of windows and gates.
        rate_hz: Samples per second.
        offset: Of the sampling clock, in [0, 1) of a sample.
    """
    n_paths, n = emission.n_paths, 0
    windows = Windows(
        np.empty(n_paths), np.empty(n_paths, np.intp), np.empty(n_paths, np.intp), np.empty(n_paths, np.intp)
    )
    at = np.sort(arrivals.loudest_s[emission.first : emission.first + n_paths]) * rate_hz - offset
    reach, after = timing.aperture + timing.rise, timing.peak + timing.gate
    begins = 0.0
    for p in range(n_paths):
        starts = np.floor(at[p]) - timing.aperture - timing.before
        if n > 0 and starts - begins < windows.end[n - 1] - windows.first[n - 1] + timing.apart:
            windows.search_end[n - 1] = windows.first[n - 1] + int(np.floor(at[p]) - begins) + reach
        else:
            begins = starts
            windows.start_s[n] = (starts + offset) / rate_hz
            windows.first[n] = 0 if n == 0 else windows.end[n - 1]
            windows.search_end[n] = windows.first[n] + timing.before + timing.aperture + reach
            n += 1
        windows.end[n - 1] = windows.search_end[n - 1] + after
    return Windows(windows.start_s[:n], windows.first[:n], windows.search_end[:n], windows.end[:n])


@compiled
def crossings(record_v: FloatArray, first: int, end: int, limit_v: FloatArray, level_v: float) -> tuple[int, int]:
    """The first row from `first` to `end` with a channel above the level, or -1, and how many samples there are."""
    found, n = -1, 0
    for t in range(first, end):
        for e in range(limit_v.size):
            if abs(record_v[t, e]) > level_v and limit_v[e] > level_v:
                if found < 0:
                    found = t
                n += 1
    return found, n


class Record(NamedTuple):
    """What a receiver samples, made as far as it is needed.

    Attributes:
        volts: All windows, one below the other, shape (n_samples, n_elements).
        has_signal: Row up to which each window has its signal, shape (n_windows,).
        has_noise: Row up to which it has its noise, shape (n_windows,).
        states: Of the filter there, shape (n_windows, n_sections, 2, n_elements).
    """

    volts: FloatArray
    has_signal: IntArray
    has_noise: IntArray
    states: FloatArray


class Incoming(NamedTuple):
    """One emission as it comes in, and the carriers beside it.

    Attributes:
        emission: What is on its way.
        arrivals: Its paths among others.
        tones: Carriers.
        start_rad: Their phases at the start of the first window, shape (n_carriers,).
    """

    emission: Emission
    arrivals: Arrivals
    tones: Tones
    start_rad: FloatArray


@compiled
def fill_signal(record: Record, windows: Windows, w: int, end: int, incoming: Incoming, pulse: PulseTable) -> None:
    """Put the signal into a window, up to a row."""
    row = record.has_signal[w]
    if end <= row:
        return
    start_s = windows.start_s[w] + (row - windows.first[w]) / pulse.rate_hz
    piece_v = record.volts[row:end]
    add_signal(piece_v, start_s, incoming.emission, incoming.arrivals, pulse)
    if incoming.start_rad.size > 0:
        at = int(np.round((start_s - windows.start_s[0]) * pulse.rate_hz))
        add_tones(piece_v, at, incoming.tones, incoming.start_rad)
    record.has_signal[w] = end


@compiled
def fill(
    record: Record, windows: Windows, w: int, end: int, incoming: Incoming, sampler: Sampler, rng: np.random.Generator
) -> None:
    """Put signal and noise into a window, up to a row."""
    row = record.has_noise[w]
    if end <= row:
        return
    fill_signal(record, windows, w, end, incoming, sampler.pulse)
    if row == windows.first[w]:
        settle(sampler.noise, rng, record.states[w])
    add_noise(sampler.noise, rng, record.states[w], record.volts[row:end])
    record.has_noise[w] = end


class Fixed(NamedTuple):
    """The sample that is known to exceed the level.

    Attributes:
        window: It lies in; -1 for none.
        row: Of it.
        channel: Of it.
        added_v: To the noise that was drawn for it.
    """

    window: int
    row: int
    channel: int
    added_v: float


@compiled
def expect(record: Record, windows: Windows, incoming: Incoming, sampler: Sampler, limit_v: FloatArray) -> float:
    """How many samples are expected to exceed the level; it is not counted on beyond `LIKELY`."""
    expected, trigger = 0.0, sampler.trigger
    for w in range(windows.first.size):
        row = windows.first[w] + sampler.timing.before
        while row < windows.search_end[w]:
            end = min(row + PIECE, windows.search_end[w])
            fill_signal(record, windows, w, end, incoming, sampler.pulse)
            for t in range(row, end):
                for e in range(limit_v.size):
                    if limit_v[e] > trigger.level_v:
                        expected += step_probability(trigger, record.volts[t, e])
            if expected > LIKELY:
                return expected
            row = end
    return expected


@compiled
def follow(volts: FloatArray, first: int, end: int, fixed: Fixed, correlation: FloatArray) -> None:
    """Let the noise from row `first` to `end` follow that of the sample that is fixed."""
    for t in range(max(first, fixed.row - correlation.size + 1), min(end, fixed.row + correlation.size)):
        volts[t, fixed.channel] += fixed.added_v * correlation[abs(t - fixed.row)]


@compiled
def fix_one(
    record: Record,
    windows: Windows,
    left: float,
    incoming: Incoming,
    sampler: Sampler,
    limit_v: FloatArray,
    rng: np.random.Generator,
) -> Fixed:
    """Choose the sample at which the sum of the probabilities passes `left`; let it exceed the level, and fill all.

    The table of probabilities is rounded up: what it has too much is made up for by choosing none now and then.
    """
    trigger, before = sampler.trigger, sampler.timing.before
    window = row = channel = -1
    probability = 0.0
    for w in range(windows.first.size):
        for t in range(windows.first[w] + before, windows.search_end[w]):
            for e in range(limit_v.size):
                if window < 0 and limit_v[e] > trigger.level_v:
                    probability = step_probability(trigger, record.volts[t, e])
                    left -= probability
                    if left < 0.0:
                        window, row, channel = w, t, e
    if window < 0:
        return Fixed(-1, -1, -1, 0.0)
    signal_v = record.volts[row, channel]
    below, above = (
        (trigger.level_v - abs(signal_v)) / trigger.noise_v,
        (trigger.level_v + abs(signal_v)) / trigger.noise_v,
    )
    with_signal = tail_probability(below)
    exact = with_signal + tail_probability(above)
    if rng.random() * probability >= exact:
        return Fixed(-1, -1, -1, 0.0)
    side = 1.0 if signal_v >= 0.0 else -1.0
    if rng.random() * exact < with_signal:
        noise_v = side * trigger.noise_v * draw_tail(below, rng)
    else:
        noise_v = -side * trigger.noise_v * draw_tail(above, rng)
    for w in range(windows.first.size):
        fill(record, windows, w, windows.search_end[w], incoming, sampler, rng)
    fixed = Fixed(window, row, channel, signal_v + noise_v - record.volts[row, channel])
    follow(record.volts, windows.first[window], windows.search_end[window], fixed, trigger.correlation)
    return fixed


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
        volts[:] = 0.0
        add_signal(volts, start_s + at / sampler.pulse.rate_hz, incoming.emission, arrivals, sampler.pulse)
        add_tones(volts, since + at, tones, incoming.start_rad)
        settle(sampler.noise, rng, state)
        add_noise(sampler.noise, rng, state, volts)
        for t in range(burst.n_samples):
            power_v2 += min(abs(volts[t, 0]), limit_v) ** 2
        if power_v2 <= least_v2 * burst.n_samples:
            return False
    return burst.n_windows > 0


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
    r"""Whether an emission triggers, and the gate that it then fills.

    A pulse that hardly ever triggers is not sampled each time. With :math:`p_i` the probability that sample i alone
    exceeds the level, and :math:`S = \sum_i p_i < 1`: with the probability 1 - S there is nothing to be seen. Else one
    sample is drawn, i with the probability :math:`p_i / S`; it exceeds the level, all others follow it as the noise's
    correlation says; and where K samples exceed it, the record counts with the probability 1 / K. Every record that
    triggers comes as often as if all had been sampled, for :math:`\sum_{i \in K} p_i P(\cdot | i) / K = P(\cdot)`.

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
    timing, trigger = sampler.timing, sampler.trigger
    level_v, n_elements = trigger.level_v, limit_v.size
    left, most_v = rng.random(), 0.0
    for p in range(emission.first, emission.first + emission.n_paths):
        most_v += abs(emission.peak_v) * arrivals.loudest[p]
    for c in range(tones.turn_rad.size):
        most_v += tones.amplitude_v[c].max()
    n_samples = emission.n_paths * (2 * timing.aperture + timing.rise) * n_elements
    if left >= n_samples * step_probability(trigger, most_v):
        return NOT_TRIGGERED  # at least the sum of all that is below
    windows = plan_windows(emission, arrivals, timing, sampler.pulse.rate_hz, rng.random())
    start_rad = np.empty(tones.turn_rad.size)
    for c in range(start_rad.size):
        start_rad[c] = 2.0 * np.pi * rng.random()
    incoming = Incoming(emission, arrivals, tones, start_rad)
    n_windows = windows.first.size
    record = Record(
        np.zeros((windows.end[-1], n_elements)),
        windows.first.copy(),
        windows.first.copy(),
        np.empty((n_windows, sampler.noise.sections.shape[0], 2, n_elements)),
    )
    expected = expect(record, windows, incoming, sampler, limit_v)
    window, crossing, fixed = -1, -1, Fixed(-1, -1, -1, 0.0)
    if expected > LIKELY:
        for w in range(n_windows):
            row = windows.first[w] + timing.before
            while window < 0 and row < windows.search_end[w]:
                end = min(row + PIECE, windows.search_end[w])
                fill(record, windows, w, end, incoming, sampler, rng)
                crossing, _ = crossings(record.volts, row, end, limit_v, level_v)
                if crossing >= 0:
                    window = w
                row = end
    elif left < expected:
        fixed = fix_one(record, windows, left, incoming, sampler, limit_v, rng)
        n_above = 0
        for w in range(n_windows if fixed.window >= 0 else 0):
            first = windows.first[w] + timing.before
            found, n = crossings(record.volts, first, windows.search_end[w], limit_v, level_v)
            n_above += n
            if found >= 0 and window < 0:
                window, crossing = w, found
        if rng.random() * n_above >= 1.0:
            window = -1
    if window < 0:
        return NOT_TRIGGERED

    row, end = record.has_noise[window], crossing + timing.peak
    fill(record, windows, window, end, incoming, sampler, rng)
    loudest, peak_v = 0, 0.0
    if window == fixed.window:
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
    if window == fixed.window:
        follow(record.volts, row, end, fixed, trigger.correlation)
    for t in range(timing.gate):
        for e in range(n_elements):
            gate_v[t, e] = min(max(record.volts[start + t, e], -limit_v[e]), limit_v[e])
        power_v2 += gate_v[t, loudest] ** 2
    power_v2 = power_v2 / timing.gate - background_v2[loudest]
    least_v2 = sampler.burst.share * power_v2 + background_v2[loudest]
    start_s = windows.start_s[window] + (start - windows.first[window]) / sampler.pulse.rate_hz
    since = int(np.round((start_s - windows.start_s[0]) * sampler.pulse.rate_hz))
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
