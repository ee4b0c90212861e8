"""Compiled functions that sample one emission, from its arrivals to the gate.

A receiver samples continuously, but only windows around the arrivals of an emission are computed, and each window only
as far as needed. Arrays of samples have the shape (n_elements, n_samples).

The first sample, in any channel, whose magnitude exceeds the level triggers the receiver. Windows are so far apart that
their noises are independent. Most windows of weak emissions have a very small probability of triggering, and for these
the outcome is drawn before any noise (importance sampling):

- Let p_i be the marginal probability that sample i exceeds the level, given its signal, and S the sum of all p_i. If S
  is above `LIKELY`, the window is sampled directly.
- Otherwise, the window does not trigger with probability 1 - S.
- With probability S, one sample i is pinned, chosen with probability p_i / S. Its noise is drawn from the tail beyond
  the level, and the mean of the noise around it is shifted according to the autocorrelation (`pin_noise`). If K samples
  of the window now exceed the level, the trigger is accepted with probability 1 / K.

Every record x that triggers then occurs with the same probability as in direct sampling, because the sum of
p_i P(x | i exceeds) / K over the K samples of x beyond the level is P(x). The tabulated p_i are rounded up, and a
pinned sample is rejected with the corresponding probability.

Two details serve speed. Fields of records are read outside of loops, because Numba updates the reference counts of all
arrays of a record when it unpacks it. Arguments are variables where possible, because Numba compiles a function again
for each literal.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.arrays import FloatArray, IntArray
from dirmusic.compiled import compiled, compiled_inner
from dirmusic.pulses.strengths import count_crossings, gate_start
from pdpatrol.sensing.nature.pulses import FREQUENCY_HZ

LIKELY = 0.3
"""Expected number of samples beyond the trigger level above which a window is sampled directly. It affects speed, not
the distribution of the results."""

PIECE = 48
"""Number of samples computed at a time during the search for a trigger. It affects only speed."""

BURST_WINDOWS, BURST_SHARE, BURST_LENGTH = 4, 0.15, 3
"""Parameters of the burst test: number of windows, minimum power relative to that of the gate, and end of the last
window in units of the longest echo delay. In a burst, the strongest channel exceeds the minimum power in all windows
between one and three times the longest echo delay after the trigger. Assumed; multipath of a pulse does not fill all
windows, and destructive interference between the paths of a burst sometimes leaves only a quarter of its power."""

NOT_TRIGGERED, IS_PULSE, IS_BURST = 0, 1, 2


class PulseTable(NamedTuple):
    """Pulse of 1 V after the band-pass, divided into bands that add up to the pulse.

    Attributes:
        sine_v: Samples of the pulse, shape (n_bands, n_phases, n_samples). Row k of a band begins k / n_phases of a
            sample after the first tabulated value; the pulse is 0 before and after the table.
        cosine_v: The same for a pulse whose oscillation leads by a quarter of a period.
        lead: Number of samples from the first tabulated value to the arrival.
        steady_share: Weight of each band in a continuous wave at the frequency of the pulses, shape (n_bands,).
        rate_hz: Samples per second.
    """

    sine_v: FloatArray
    cosine_v: FloatArray
    lead: int
    steady_share: FloatArray
    rate_hz: float


class NoiseFilter(NamedTuple):
    """White noise followed by the band-pass.

    Attributes:
        std_v: Standard deviation of a sample before the filter.
        sections: Second-order sections b0, b1, b2, 1, a1, a2, shape (n_sections, 6); n_sections is 0 without a filter.
        settled: Square root of the covariance of the filter's state in white noise of unit variance, shape
            (2 n_sections, 2 n_sections).
    """

    std_v: float
    sections: FloatArray
    settled: FloatArray


class Trigger(NamedTuple):
    """Trigger of all channels.

    Attributes:
        level_v: Magnitude that a sample must exceed.
        noise_v: Standard deviation of the noise after the band-pass.
        correlation: Autocorrelation of that noise at lags 0, 1, ..., shape (n_lags,); 0 at larger lags.
        probability: Probability that a sample exceeds the level, for signals 0, `step_v`, ..., shape (n_steps,); 1 for
            larger signals.
        step_v: Step of the table `probability`.
    """

    level_v: float
    noise_v: float
    correlation: FloatArray
    probability: FloatArray
    step_v: float


class Sampler(NamedTuple):
    """Parameters of a receiver from the antennas to the gate. Lengths are numbers of samples.

    Attributes:
        pulse: Pulse after the band-pass.
        noise: Noise and band-pass.
        trigger: Trigger.
        before: Length from the start of a gate to where its strongest channel reaches half its peak.
        aperture: Largest difference between the arrivals at two elements.
        rise: Length from an arrival until after the peak of the pulse.
        peak: Length from the trigger until after the peaks in all channels.
        gate: Length of a gate.
        burst_first: Length from the start of a gate to the first window of the burst test.
        burst_step: Length from one window of the burst test to the next.
        burst_window: Length of a window of the burst test.
    """

    pulse: PulseTable
    noise: NoiseFilter
    trigger: Trigger
    before: int
    aperture: int
    rise: int
    peak: int
    gate: int
    burst_first: int
    burst_step: int
    burst_window: int


class Channels(NamedTuple):
    """State of the channels, and the carriers that they receive, after the band-pass.

    Attributes:
        limit_v: Voltage at which the amplifier saturates, shape (n_elements,); infinite if it does not.
        background_v2: Mean power of a sample without an emission, shape (n_elements,).
        source: Channel whose samples each channel reports, shape (n_elements,): its own unless plugs are swapped.
        stuck_v: Constant output of a stuck ADC, shape (n_elements,); NaN if it is not stuck.
        tone_v: Amplitudes of the carriers, shape (n_carriers, n_elements).
        tone_rad: Phases of the carriers, shape (n_carriers, n_elements).
        turn_rad: Phase increment of the carriers per sample, shape (n_carriers,).
    """

    limit_v: FloatArray
    background_v2: FloatArray
    source: IntArray
    stuck_v: FloatArray
    tone_v: FloatArray
    tone_rad: FloatArray
    turn_rad: FloatArray


class Signal(NamedTuple):
    """All arrivals of one emission, without noise.

    Attributes:
        peak_v: Signed peak of the emission in a unit-gain channel 1 m from the source, before the band-pass.
        burst_s: Duration of a burst; 0 for a pulse.
        delay_s: Travel times, shape (n_paths, n_elements).
        amplitude: Complex amplitudes as in `Arrivals`, shape (n_paths, n_elements, n_bands).
    """

    peak_v: float
    burst_s: float
    delay_s: FloatArray
    amplitude: NDArray[np.complex128]


class Window(NamedTuple):
    """Samples around an arrival, computed as far as they are needed.

    Attributes:
        start_s: Time of the first sample, relative to the emission.
        start_rad: Phases of the carriers at that sample, shape (n_carriers,).
        search_end: Index after the last sample that may trigger; the first that may trigger is `Sampler.before`.
        volts: Samples, shape (n_elements, n_samples). Samples not computed yet hold 0, or the shift of the noise that a
            pinned sample causes.
        filled: Number of samples with signal, and number of samples with signal and noise, shape (2,).
        state: State of the noise filter after the last sample with noise, shape (2 n_sections, n_elements).
    """

    start_s: float
    start_rad: FloatArray
    search_end: int
    volts: FloatArray
    filled: IntArray
    state: FloatArray


@compiled
def add_emission(channel_v: FloatArray, e: int, start_s: float, signal: Signal, pulse: PulseTable) -> None:
    """Add all arrivals of an emission to channel e.

    Args:
        channel_v: Samples of the channel.
        e: Index of the channel.
        start_s: Time of the first sample, relative to the emission.
        signal: The emission.
        pulse: Pulse after the band-pass.
    """
    peak_v, burst_s, delay_s, amplitude = signal
    sine_v, cosine_v, lead, steady_share, rate_hz = pulse
    _, n_phases, n_known = sine_v.shape
    for p in range(len(delay_s)):
        since_s = start_s - delay_s[p, e]
        if burst_s > 0.0:
            steady = 0.0j
            for b in range(amplitude.shape[2]):
                steady += steady_share[b] * amplitude[p, e, b]
            wave_v = peak_v * steady
            for t in range(channel_v.size):
                now_s = since_s + t / rate_hz
                if 0.0 <= now_s < burst_s:
                    turn_rad = 2.0 * np.pi * FREQUENCY_HZ * now_s
                    channel_v[t] += wave_v.real * math.sin(turn_rad) + wave_v.imag * math.cos(turn_rad)
        else:
            at = int(np.floor(n_phases * (since_s * rate_hz + lead) + 0.5))
            skipped, phase = at // n_phases, at % n_phases  # samples from the table's first to the first here
            first = max(0, -skipped)
            n = np.uint64(max(0, min(channel_v.size, n_known - skipped) - first))
            here, known = np.uint64(first), np.uint64(first + skipped)  # unsigned: no checks for negative indices
            for b in range(amplitude.shape[2]):
                wave_v = peak_v * amplitude[p, e, b]
                for t in range(n):
                    channel_v[here + t] += (
                        wave_v.real * sine_v[b, phase, known + t] + wave_v.imag * cosine_v[b, phase, known + t]
                    )


@compiled_inner
def add_tones(channel_v: FloatArray, e: int, offset: int, channels: Channels, start_rad: FloatArray) -> None:
    """Add the carriers to channel e; `start_rad` are their phases `offset` samples before its first sample."""
    for c in range(start_rad.size):
        for t in range(channel_v.size):
            now_rad = start_rad[c] + (offset + t) * channels.turn_rad[c]
            channel_v[t] += channels.tone_v[c, e] * math.cos(now_rad + channels.tone_rad[c, e])


@compiled
def settle(noise: NoiseFilter, rng: np.random.Generator, state: FloatArray) -> None:
    """Draw a stationary state of the filter in white noise, shape (2 n_sections, n_elements).

    It is drawn into `state`, because the assignment of one array to another takes 5 s to compile.
    """
    settled = noise.settled
    state[:] = 0.0
    for j in range(len(settled)):
        for e in range(state.shape[1]):
            drawn = rng.standard_normal()
            for i in range(len(settled)):
                state[i, e] += settled[i, j] * drawn


@compiled
def add_noise(
    noise: NoiseFilter, rng: np.random.Generator, state: FloatArray, volts: FloatArray, first: int, end: int
) -> None:
    """Add filtered noise to the samples from `first` up to `end` of all channels, and advance the filter state."""
    n_elements, sections, std_v = volts.shape[0], noise.sections, noise.std_v
    row = np.empty(n_elements)
    for t in range(first, end):
        for e in range(n_elements):
            row[e] = rng.standard_normal()
        for s in range(sections.shape[0]):
            b0, b1, b2, a1, a2 = sections[s, 0], sections[s, 1], sections[s, 2], sections[s, 4], sections[s, 5]
            for e in range(n_elements):  # all values are read before any is written, which is faster
                sample, z1, z2 = row[e], state[2 * s, e], state[2 * s + 1, e]
                filtered = b0 * sample + z1
                row[e], state[2 * s, e] = filtered, b1 * sample - a1 * filtered + z2
                state[2 * s + 1, e] = b2 * sample - a2 * filtered
        for e in range(n_elements):
            volts[e, t] += std_v * row[e]


@compiled_inner
def tail_probability(sigmas: float) -> float:
    """Return the probability that a standard normal variable exceeds `sigmas`."""
    return 0.5 * math.erfc(sigmas * math.sqrt(0.5))


@compiled_inner
def draw_tail(sigmas: float, rng: np.random.Generator) -> float:
    """Draw a standard normal variable conditioned on being larger than `sigmas`, which is above 0.5.

    The method is rejection from an exponential distribution (C. P. Robert, Simulation of truncated normal variables,
    1995). A sample is pinned only if its probability is at most `LIKELY`, so that it needs that much noise.
    """
    rate = 0.5 * (sigmas + math.sqrt(sigmas * sigmas + 4.0))
    while True:
        drawn = sigmas - math.log(1.0 - rng.random()) / rate
        if rng.random() <= math.exp(-0.5 * (drawn - rate) ** 2):
            return drawn


@compiled_inner
def pin_noise(channel_v: FloatArray, at: int, sample_v: float, correlation: FloatArray) -> None:
    """Set one sample of a channel, and add the resulting change of the conditional mean to its neighbours."""
    added_v = sample_v - channel_v[at]
    for t in range(max(0, at - correlation.size + 1), min(channel_v.size, at + correlation.size)):
        channel_v[t] += added_v * correlation[abs(t - at)]


@compiled_inner
def fill_signal(window: Window, end: int, signal: Signal, pulse: PulseTable, channels: Channels) -> None:
    """Compute the signal of a window up to a given sample."""
    first, volts = window.filled[0], window.volts
    if end > first:
        start_s = window.start_s + first / pulse.rate_hz
        for e in range(len(volts)):
            add_emission(volts[e, first:end], e, start_s, signal, pulse)
            add_tones(volts[e, first:end], e, first, channels, window.start_rad)
        window.filled[0] = end


@compiled_inner
def fill(
    window: Window, end: int, signal: Signal, sampler: Sampler, channels: Channels, rng: np.random.Generator
) -> None:
    """Compute signal and noise of a window up to a given sample."""
    first = window.filled[1]
    if end > first:
        fill_signal(window, end, signal, sampler.pulse, channels)
        if first == 0:
            settle(sampler.noise, rng, window.state)
        add_noise(sampler.noise, rng, window.state, window.volts, first, end)
        window.filled[1] = end


@compiled_inner
def trigger_probability(trigger: Trigger, signal_v: float) -> float:
    """Return the probability that a sample exceeds the level, for a signal rounded up to the next table step."""
    step = math.ceil(abs(signal_v) / trigger.step_v)
    return trigger.probability[step] if step < trigger.probability.size else 1.0


@compiled_inner
def expected_crossings(window: Window, signal: Signal, sampler: Sampler, channels: Channels) -> float:
    """Return S, the expected number of samples beyond the level; the summation stops when it exceeds `LIKELY`."""
    expected, trigger, limit_v, volts = 0.0, sampler.trigger, channels.limit_v, window.volts
    for first in range(sampler.before, window.search_end, PIECE):
        end = min(first + PIECE, window.search_end)
        fill_signal(window, end, signal, sampler.pulse, channels)
        for e in range(limit_v.size):
            if limit_v[e] > trigger.level_v:
                channel_v = volts[e, first:end]
                for t in range(channel_v.size):
                    expected += trigger_probability(trigger, channel_v[t])
        if expected > LIKELY:
            break
    return expected


@compiled_inner
def pin_sample(
    window: Window, remaining: float, signal: Signal, sampler: Sampler, channels: Channels, rng: np.random.Generator
) -> bool:
    """Pin the sample at which the cumulative probability reaches `remaining`, and fill the window around it.

    Returns:
        False if the sample is rejected.
    """
    trigger, limit_v, volts, end = sampler.trigger, channels.limit_v, window.volts, window.search_end
    at, channel, tabulated = end, 0, 0.0
    for t in range(sampler.before, end):
        for e in range(limit_v.size):
            if at == end and limit_v[e] > trigger.level_v:
                tabulated = trigger_probability(trigger, volts[e, t])
                remaining -= tabulated
                if remaining < 0.0:
                    at, channel = t, e
    if at == end:
        return False
    signal_v = volts[channel, at]
    towards = (trigger.level_v - abs(signal_v)) / trigger.noise_v
    against = (trigger.level_v + abs(signal_v)) / trigger.noise_v
    exact = tail_probability(towards) + tail_probability(against)
    if rng.random() * tabulated >= exact:
        return False
    side = 1.0 if signal_v >= 0.0 else -1.0
    if rng.random() * exact < tail_probability(towards):
        noise_v = side * trigger.noise_v * draw_tail(towards, rng)
    else:
        noise_v = -side * trigger.noise_v * draw_tail(against, rng)
    fill(window, end, signal, sampler, channels, rng)
    pin_noise(volts[channel], at, signal_v + noise_v, trigger.correlation)
    return True


@compiled_inner
def find_trigger(
    window: Window, chance: float, signal: Signal, sampler: Sampler, channels: Channels, rng: np.random.Generator
) -> int:
    """Find the sample of a window that triggers, by the method described at the top of this module.

    Args:
        window: The window; filled as far as needed.
        chance: Uniform random number in [0, 1) that decides whether an unlikely trigger occurs.
        signal: Emission.
        sampler: Receiver up to the gate.
        channels: State of the channels, and carriers.
        rng: Generator.

    Returns:
        Index of the sample, or -1.
    """
    trigger, before, end, limit_v = sampler.trigger, sampler.before, window.search_end, channels.limit_v
    expected = expected_crossings(window, signal, sampler, channels)
    if expected > LIKELY:
        for first in range(before, end, PIECE):
            piece_end = min(first + PIECE, end)
            fill(window, piece_end, signal, sampler, channels, rng)
            crossing, _ = count_crossings(window.volts, first, piece_end, limit_v, trigger.level_v)
            if crossing >= 0:
                return crossing
    elif chance < expected and pin_sample(window, chance, signal, sampler, channels, rng):
        crossing, n = count_crossings(window.volts, before, end, limit_v, trigger.level_v)
        if rng.random() * n < 1.0:
            return crossing
    return -1


@compiled_inner
def read_out(
    window: Window,
    crossing: int,
    signal: Signal,
    sampler: Sampler,
    channels: Channels,
    rng: np.random.Generator,
    gate_v: FloatArray,
) -> int:
    """Fill the gate after a trigger, and test for a burst; arguments and result as in `sample_emission`.

    In a burst, the mean power of the strongest channel exceeds a limit in all windows of the test.
    """
    before, n_gate, n_window, noise = sampler.before, sampler.gate, sampler.burst_window, sampler.noise
    volts, limit_v = window.volts, channels.limit_v
    fill(window, crossing + sampler.peak, signal, sampler, channels, rng)
    strongest, start = gate_start(volts, crossing, sampler.peak, before, limit_v)
    limit, background_v2, gate_v2 = limit_v[strongest], channels.background_v2[strongest], 0.0
    fill(window, start + n_gate, signal, sampler, channels, rng)
    for e in range(limit_v.size):
        for t in range(n_gate):
            gate_v[e, t] = min(max(volts[e, start + t], -limit_v[e]), limit_v[e])
    for t in range(n_gate):
        gate_v2 += gate_v[strongest, t] ** 2
    least_v2 = BURST_SHARE * (gate_v2 / n_gate - background_v2) + background_v2
    for w in range(BURST_WINDOWS):
        at, power_v2 = start + sampler.burst_first + w * sampler.burst_step, 0.0
        test_v, state = np.zeros((1, n_window)), np.empty((len(noise.settled), 1))
        add_emission(test_v[0], strongest, window.start_s + at / sampler.pulse.rate_hz, signal, sampler.pulse)
        add_tones(test_v[0], strongest, at, channels, window.start_rad)
        settle(noise, rng, state)
        add_noise(noise, rng, state, test_v, 0, n_window)
        for t in range(n_window):
            power_v2 += min(abs(test_v[0, t]), limit) ** 2
        if power_v2 <= least_v2 * n_window:
            return IS_PULSE
    return IS_BURST


@compiled_inner
def sample_emission(
    signal: Signal,
    peak: FloatArray,
    peak_s: FloatArray,
    sampler: Sampler,
    channels: Channels,
    rng: np.random.Generator,
    gate_v: FloatArray,
) -> int:
    """Sample an emission, and fill the gate if it triggers.

    Each arrival has a window; windows whose gates or noise would overlap are merged.

    Args:
        signal: Arrivals of the emission.
        peak: Upper bound of each arrival, as in `Arrivals`.
        peak_s: Travel times to the elements with these bounds.
        sampler: Receiver up to the gate.
        channels: State of the channels, and carriers.
        rng: Generator.
        gate_v: Output: samples at the input of the ADC, shape (n_elements, n_gate).

    Returns:
        `NOT_TRIGGERED`, `IS_PULSE` or `IS_BURST`.
    """
    trigger, rate_hz, n_elements, n_tones = sampler.trigger, sampler.pulse.rate_hz, len(gate_v), channels.turn_rad.size
    before, aperture = sampler.before, sampler.aperture
    first_rad = 2.0 * np.pi * rng.random(n_tones)
    clock = rng.random()  # delay of the sampling clock, in samples
    is_new, begin, first_begin, bound_v, tones_v = True, 0, 0, 0.0, 0.0
    for c in range(n_tones):
        tones_v += channels.tone_v[c].max()
    peak_s = peak_s.copy()
    for k in range(peak_s.size):  # in order of time
        p = peak_s.argmin()
        at = math.floor(peak_s[p] * rate_hz - clock)
        peak_s[p] = np.inf
        start = at - aperture - before
        if k == 0:
            first_begin = start
        if is_new:
            begin, bound_v, is_new = start, 0.0, False
        bound_v += abs(signal.peak_v) * peak[p]
        search_end = at - begin + aperture + sampler.rise
        end = search_end + sampler.peak + sampler.gate
        next_start = peak_s.min() * rate_hz - clock - aperture - before
        if next_start < begin + end + trigger.correlation.size:
            continue
        is_new, chance, n_searched = True, rng.random(), (search_end - before) * n_elements
        if chance < n_searched * trigger_probability(trigger, bound_v + tones_v):  # an upper bound of S
            start_rad = first_rad + (begin - first_begin) * channels.turn_rad
            volts, filled = np.zeros((n_elements, end)), np.zeros(2, np.intp)
            state = np.empty((len(sampler.noise.settled), n_elements))
            window = Window((begin + clock) / rate_hz, start_rad, search_end, volts, filled, state)
            crossing = find_trigger(window, chance, signal, sampler, channels, rng)
            if crossing >= 0:
                return read_out(window, crossing, signal, sampler, channels, rng, gate_v)
    return NOT_TRIGGERED


@compiled_inner
def sample_false_alarm(sampler: Sampler, channels: Channels, rng: np.random.Generator, gate_v: FloatArray) -> None:
    """Fill a gate, shape (n_elements, n_gate), that noise alone has triggered, by pinning one noise sample."""
    trigger, noise = sampler.trigger, sampler.noise
    n_elements, n_gate = gate_v.shape
    gate_v[:], state = 0.0, np.empty((len(noise.settled), n_elements))
    settle(noise, rng, state)
    add_noise(noise, rng, state, gate_v, 0, n_gate)
    channel = int(rng.random() * n_elements)
    side = 1.0 if rng.random() < 0.5 else -1.0
    crossing_v = side * trigger.noise_v * draw_tail(trigger.level_v / trigger.noise_v, rng)
    pin_noise(gate_v[channel], sampler.before, crossing_v, trigger.correlation)
    start_rad = 2.0 * np.pi * rng.random(channels.turn_rad.size)
    for e in range(n_elements):
        add_tones(gate_v[e], e, 0, channels, start_rad)
