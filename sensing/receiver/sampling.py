"""Sampling of one emission: from its arrivals to the gate that it fills, in compiled functions.

A receiver samples without end, but only windows around the arrivals of an emission are computed, and each only as far
as it is needed. Arrays of samples have the shape (n_elements, n_samples).

The trigger: the first sample in any channel whose magnitude exceeds the level. Windows are far enough apart that their
noises are independent. Most windows of weak emissions hardly ever trigger, and for them the outcome is drawn before any
noise (importance sampling):

- Let p_i be the probability that sample i alone exceeds the level, given its signal, and S their sum. If S is above
  `LIKELY`, the window is sampled directly.
- Otherwise, with probability 1 - S, the window is taken not to trigger.
- Else one sample is pinned: i with probability p_i / S. Its noise is drawn from the tail beyond the level, and the
  noise around it has the mean that the autocorrelation gives (`add_pinned`). If K samples of the window now exceed the
  level, the window counts with probability 1 / K.

Every record x that triggers then occurs as often as with direct sampling, because the sum over its K samples beyond the
level of p_i P(x | i exceeds) / K = P(x). The table of p_i is rounded up; a pinned sample is rejected in proportion.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from pdpatrol.sensing.nature.pulses import FREQUENCY_HZ
from pdpatrol.sensing.radio.arrivals import Arrivals

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

LIKELY = 0.3
"""Expected number of samples beyond the trigger level from which on a window is sampled directly. It affects speed, not
the distribution of the results."""

PIECE = 48
"""Samples that are computed at once while a trigger is searched. It affects speed only."""

BURST_WINDOWS, BURST_SHARE, BURST_LENGTH = 4, 0.15, 3
"""Test for a burst: between one and three times the longest echo delay after the trigger, the strongest channel has
more than this share of the gate's power in all of four windows. Assumed; echoes do not fill all windows, and paths of a
burst that cancel leave a quarter of its power now and then."""

NOT_TRIGGERED, IS_PULSE, IS_BURST = 0, 1, 2


class PulseTable(NamedTuple):
    """Pulse of 1 V behind the band-pass, divided into bands that add up to it.

    Attributes:
        sine_v: Shape (n_bands, n_phases, n_samples). Row k of a band begins k / n_phases of a sample after the first
            known value; the pulse is 0 before and behind.
        cosine_v: The same for an oscillation that is a quarter of a turn ahead.
        lead: Samples from the first known value to the arrival.
        steady_share: Share of each band in a steady wave at the frequency of the pulses, shape (n_bands,).
        rate_hz: Samples per second.
    """

    sine_v: FloatArray
    cosine_v: FloatArray
    lead: int
    steady_share: FloatArray
    rate_hz: float


class NoiseFilter(NamedTuple):
    """White noise and the band-pass behind it.

    Attributes:
        std_v: Standard deviation of a sample before the filter.
        sections: Second-order sections b0, b1, b2, 1, a1, a2, shape (n_sections, 6); none without a filter.
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
        noise_v: Standard deviation of the noise behind the band-pass.
        correlation: Autocorrelation of that noise over the lags from 0 on, shape (n_lags,); 0 beyond.
        probability: Probability that a sample exceeds the level, for signals in steps of `step_v` from 0 on, shape
            (n_steps,); 1 beyond.
        step_v: Step of that table.
    """

    level_v: float
    noise_v: float
    correlation: FloatArray
    probability: FloatArray
    step_v: float


class Timing(NamedTuple):
    """Lengths in samples.

    Attributes:
        before: From the start of a gate to where its strongest channel reaches half its peak.
        aperture: Largest difference of arrivals at two elements.
        rise: From an arrival to behind the peak of the pulse.
        peak: From the trigger to behind the peaks in all channels.
        gate: Length of a gate.
        burst_first: From the start of a gate to the first window of the burst test.
        burst_step: From one window of the burst test to the next.
        burst_window: Length of a window of the burst test.
    """

    before: int
    aperture: int
    rise: int
    peak: int
    gate: int
    burst_first: int
    burst_step: int
    burst_window: int


class Sampler(NamedTuple):
    """Receiver from the antennas to the gate.

    Attributes:
        pulse: Pulse behind the band-pass.
        noise: Noise and band-pass.
        trigger: Trigger.
        timing: Lengths.
    """

    pulse: PulseTable
    noise: NoiseFilter
    trigger: Trigger
    timing: Timing


class Tones(NamedTuple):
    """Carriers behind the band-pass as the channels of one array receive them.

    Attributes:
        amplitude_v: Amplitudes, shape (n_carriers, n_elements).
        phase_rad: Phases, shape (n_carriers, n_elements).
        turn_rad: Change of phase from sample to sample, shape (n_carriers,).
    """

    amplitude_v: FloatArray
    phase_rad: FloatArray
    turn_rad: FloatArray


class Channels(NamedTuple):
    """State of the channels; each column has shape (n_elements,).

    Attributes:
        limit_v: Voltage at which the amplifier saturates; infinite if it does not.
        background_v2: Power of a sample without emission.
        source: Channel whose samples this one reports: its own unless plugs are swapped.
        stuck_v: Constant output of a stuck ADC; NaN if it is not stuck.
    """

    limit_v: FloatArray
    background_v2: FloatArray
    source: NDArray[np.intp]
    stuck_v: FloatArray


class PinnedSample(NamedTuple):
    """Noise sample that was drawn from the tail beyond the trigger level.

    Attributes:
        at: Number of the sample; -1 if no sample is pinned.
        channel: Its channel.
        added_v: Voltage added to the noise that was drawn for it before.
    """

    at: int
    channel: int
    added_v: float


NOT_PINNED = PinnedSample(-1, 0, 0.0)


class Signal(NamedTuple):
    """Everything that arrives with one emission, apart from noise.

    Attributes:
        peak_v: Peak of the emission 1 m away in a unit-gain channel before the band-pass, with its sign.
        burst_s: Duration of a burst; 0 for a pulse.
        arrivals: Arrivals of the emission.
        tones: Carriers.
        start_rad: Phases of the carriers at the first sample of the first window, shape (n_carriers,).
    """

    peak_v: float
    burst_s: float
    arrivals: Arrivals
    tones: Tones
    start_rad: FloatArray


class Window(NamedTuple):
    """Samples around an arrival, computed as far as they are needed.

    Attributes:
        start_s: Time of the first sample since the emission.
        offset: Samples from the start of the first window to that of this one.
        search_end: End of the samples that may trigger; the first of them is number `Timing.before`.
        volts: Samples, shape (n_elements, n_samples).
        filled: Numbers of samples that have their signal, and that have their noise too, shape (2,).
        state: State of the noise filter behind the last sample with noise, shape (n_sections, 2, n_elements).
    """

    start_s: float
    offset: int
    search_end: int
    volts: FloatArray
    filled: IntArray
    state: FloatArray


@compiled
def add_pulse(channel_v: FloatArray, since_s: float, peak_v: complex, band: int, pulse: PulseTable) -> None:
    """Add one band of a pulse to a channel whose first sample is `since_s` after its arrival."""
    _, n_phases, n_known = pulse.sine_v.shape
    at = int(np.floor(n_phases * (since_s * pulse.rate_hz + pulse.lead) + 0.5))
    skipped, phase = at // n_phases, at % n_phases  # samples from the first of the table to the first of the channel
    first, end = max(0, -skipped), min(channel_v.size, n_known - skipped)
    if first < end:
        sine_v = pulse.sine_v[band, phase, first + skipped : end + skipped]
        cosine_v = pulse.cosine_v[band, phase, first + skipped : end + skipped]
        result_v, sine, cosine = channel_v[first:end], peak_v.real, peak_v.imag
        for t in range(result_v.size):
            result_v[t] += sine * sine_v[t] + cosine * cosine_v[t]


@compiled
def add_burst(channel_v: FloatArray, since_s: float, peak_v: complex, burst_s: float, rate_hz: float) -> None:
    """Add a sine of a duration to a channel whose first sample is `since_s` after its arrival."""
    for t in range(channel_v.size):
        now_s = since_s + t / rate_hz
        if 0.0 <= now_s < burst_s:
            turn_rad = 2.0 * np.pi * FREQUENCY_HZ * now_s
            channel_v[t] += peak_v.real * math.sin(turn_rad) + peak_v.imag * math.cos(turn_rad)


@compiled
def add_tones(channel_v: FloatArray, e: int, offset: int, tones: Tones, start_rad: FloatArray) -> None:
    """Add carriers to channel e, whose first sample is `offset` samples after the phases `start_rad`."""
    for c in range(start_rad.size):
        for t in range(channel_v.size):
            now_rad = start_rad[c] + (offset + t) * tones.turn_rad[c]
            channel_v[t] += tones.amplitude_v[c, e] * math.cos(now_rad + tones.phase_rad[c, e])


@compiled
def set_signal(channel_v: FloatArray, e: int, start_s: float, offset: int, signal: Signal, pulse: PulseTable) -> None:
    """Set samples of channel e to emission and carriers, without noise.

    Args:
        channel_v: Filled in.
        e: Channel.
        start_s: Time of the first sample since the emission.
        offset: Samples from the start of the first window to the first sample.
        signal: Emission and carriers.
        pulse: Pulse behind the band-pass.
    """
    channel_v[:] = 0.0
    delay_s, amplitude = signal.arrivals.delay_s, signal.arrivals.amplitude
    for p in range(len(delay_s)):
        since_s = start_s - delay_s[p, e]
        if signal.burst_s > 0.0:
            steady = 0.0j
            for b in range(amplitude.shape[2]):
                steady += pulse.steady_share[b] * amplitude[p, e, b]
            add_burst(channel_v, since_s, signal.peak_v * steady, signal.burst_s, pulse.rate_hz)
        else:
            for b in range(amplitude.shape[2]):
                add_pulse(channel_v, since_s, signal.peak_v * amplitude[p, e, b], b, pulse)
    add_tones(channel_v, e, offset, signal.tones, signal.start_rad)


@compiled
def settle(noise: NoiseFilter, rng: np.random.Generator, state: FloatArray) -> None:
    """Draw the stationary state of the filter in white noise, shape (n_sections, 2, n_elements)."""
    n_states, n_elements = noise.settled.shape[0], state.shape[2]
    drawn = np.empty(n_elements)
    state[:] = 0.0
    for j in range(n_states):
        for e in range(n_elements):
            drawn[e] = rng.standard_normal()
        for i in range(n_states):
            for e in range(n_elements):
                state[i // 2, i % 2, e] += noise.settled[i, j] * drawn[e]


@compiled
def add_noise(
    noise: NoiseFilter, rng: np.random.Generator, state: FloatArray, volts: FloatArray, first: int, end: int
) -> None:
    """Add filtered noise to samples `first` to `end` of all channels; the state of the filter advances."""
    n_elements, sections = volts.shape[0], noise.sections
    row = np.empty(n_elements)
    for t in range(first, end):
        for e in range(n_elements):
            row[e] = rng.standard_normal()
        for s in range(sections.shape[0]):
            b0, b1, b2, a1, a2 = sections[s, 0], sections[s, 1], sections[s, 2], sections[s, 4], sections[s, 5]
            z1, z2 = state[s, 0], state[s, 1]
            for e in range(n_elements):
                sample = row[e]
                row[e] = b0 * sample + z1[e]
                z1[e] = b1 * sample - a1 * row[e] + z2[e]
                z2[e] = b2 * sample - a2 * row[e]
        for e in range(n_elements):
            volts[e, t] += noise.std_v * row[e]


@compiled
def tail_probability(sigmas: float) -> float:
    """Return the probability that a standard normal number is larger."""
    return 0.5 * math.erfc(sigmas * math.sqrt(0.5))


@compiled
def draw_tail(sigmas: float, rng: np.random.Generator) -> float:
    """Draw a standard normal number larger than `sigmas`.

    By rejection from an exponential distribution (C. P. Robert, Simulation of truncated normal variables, 1995); below
    0.5 by rejection from normal numbers.
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
def add_pinned(volts: FloatArray, first: int, end: int, pinned: PinnedSample, correlation: FloatArray) -> None:
    """Add the change of noise sample `pinned`, and the change of the mean around it, to samples `first` to `end`."""
    at, channel, added_v = pinned
    if at >= 0:
        for t in range(max(first, at - correlation.size + 1), min(end, at + correlation.size)):
            volts[channel, t] += added_v * correlation[abs(t - at)]


@compiled
def fill_signal(window: Window, end: int, signal: Signal, pulse: PulseTable) -> None:
    """Compute the signal of a window up to a sample."""
    first = window.filled[0]
    if end > first:
        start_s = window.start_s + first / pulse.rate_hz
        for e in range(len(window.volts)):
            set_signal(window.volts[e, first:end], e, start_s, window.offset + first, signal, pulse)
        window.filled[0] = end


@compiled
def fill(
    window: Window,
    end: int,
    signal: Signal,
    sampler: Sampler,
    pinned: PinnedSample,
    rng: np.random.Generator,
) -> None:
    """Compute signal and noise of a window up to a sample, given a pinned one."""
    first = window.filled[1]
    if end > first:
        fill_signal(window, end, signal, sampler.pulse)
        if first == 0:
            settle(sampler.noise, rng, window.state)
        add_noise(sampler.noise, rng, window.state, window.volts, first, end)
        add_pinned(window.volts, first, end, pinned, sampler.trigger.correlation)
        window.filled[1] = end


@compiled
def trigger_probability(trigger: Trigger, signal_v: float) -> float:
    """Return the probability that a sample with a signal, rounded up to the next step, exceeds the level."""
    step = math.ceil(abs(signal_v) / trigger.step_v)
    return trigger.probability[step] if step < trigger.probability.size else 1.0


@compiled
def count_crossings(volts: FloatArray, first: int, end: int, limit_v: FloatArray, level_v: float) -> tuple[int, int]:
    """Return the first of samples `first` to `end` beyond the level, or -1, and the number of all such samples."""
    crossing, n = -1, 0
    for t in range(first, end):
        for e in range(limit_v.size):
            if abs(volts[e, t]) > level_v and limit_v[e] > level_v:
                if crossing < 0:
                    crossing = t
                n += 1
    return crossing, n


@compiled
def expected_crossings(window: Window, signal: Signal, sampler: Sampler, limit_v: FloatArray) -> float:
    """Return the expected number of samples beyond the level, S; it is not counted further beyond `LIKELY`."""
    expected, row = 0.0, sampler.timing.before
    while row < window.search_end and expected <= LIKELY:
        end = min(row + PIECE, window.search_end)
        fill_signal(window, end, signal, sampler.pulse)
        for t in range(row, end):
            for e in range(limit_v.size):
                if limit_v[e] > sampler.trigger.level_v:
                    expected += trigger_probability(sampler.trigger, window.volts[e, t])
        row = end
    return expected


@compiled
def pin_sample(
    window: Window, remaining: float, signal: Signal, sampler: Sampler, limit_v: FloatArray, rng: np.random.Generator
) -> PinnedSample:
    """Pin the sample at which the sum of the probabilities passes `remaining`, and fill the window around it.

    Returns:
        The sample; `NOT_PINNED` if it is rejected.
    """
    trigger, at, channel, tabulated = sampler.trigger, -1, 0, 0.0
    for t in range(sampler.timing.before, window.search_end):
        for e in range(limit_v.size):
            if at < 0 and limit_v[e] > trigger.level_v:
                tabulated = trigger_probability(trigger, window.volts[e, t])
                remaining -= tabulated
                if remaining < 0.0:
                    at, channel = t, e
    if at < 0:
        return NOT_PINNED
    signal_v = window.volts[channel, at]
    towards = (trigger.level_v - abs(signal_v)) / trigger.noise_v
    against = (trigger.level_v + abs(signal_v)) / trigger.noise_v
    exact = tail_probability(towards) + tail_probability(against)
    if rng.random() * tabulated >= exact:
        return NOT_PINNED
    side = 1.0 if signal_v >= 0.0 else -1.0
    if rng.random() * exact < tail_probability(towards):
        noise_v = side * trigger.noise_v * draw_tail(towards, rng)
    else:
        noise_v = -side * trigger.noise_v * draw_tail(against, rng)
    fill(window, window.search_end, signal, sampler, NOT_PINNED, rng)
    pinned = PinnedSample(at, channel, signal_v + noise_v - window.volts[channel, at])
    add_pinned(window.volts, 0, window.search_end, pinned, trigger.correlation)
    return pinned


@compiled
def find_trigger(
    window: Window, chance: float, signal: Signal, sampler: Sampler, limit_v: FloatArray, rng: np.random.Generator
) -> tuple[int, PinnedSample]:
    """Search the first sample of a window beyond the level, by the law at the head of this module.

    Args:
        window: Filled as far as needed.
        chance: Random number in [0, 1) that decides about a window that hardly ever triggers.
        signal: Emission and carriers.
        sampler: Receiver up to the gate.
        limit_v: Voltage at which each channel saturates, shape (n_elements,).
        rng: Generator.

    Returns:
        Number of the sample, or -1, and the pinned sample.
    """
    before, end, level_v = sampler.timing.before, window.search_end, sampler.trigger.level_v
    expected = expected_crossings(window, signal, sampler, limit_v)
    if expected > LIKELY:
        for row in range(before, end, PIECE):
            piece_end = min(row + PIECE, end)
            fill(window, piece_end, signal, sampler, NOT_PINNED, rng)
            crossing, _ = count_crossings(window.volts, row, piece_end, limit_v, level_v)
            if crossing >= 0:
                return crossing, NOT_PINNED
    elif chance < expected:
        pinned = pin_sample(window, chance, signal, sampler, limit_v, rng)
        if pinned.at >= 0:
            crossing, n = count_crossings(window.volts, before, end, limit_v, level_v)
            if rng.random() * n < 1.0:
                return crossing, pinned
    return -1, NOT_PINNED


@compiled
def lasts_like_a_burst(
    start_s: float,
    offset: int,
    least_v2: float,
    e: int,
    limit_v: float,
    signal: Signal,
    sampler: Sampler,
    rng: np.random.Generator,
) -> bool:
    """Return True where channel e has at least a mean power in all windows of the burst test.

    Args:
        start_s: Start of the gate since the emission.
        offset: Samples from the start of the first window to that of the gate.
        least_v2: The mean power.
        e: Channel.
        limit_v: Voltage at which it saturates.
        signal: Emission and carriers.
        sampler: Receiver up to the gate.
        rng: Generator.
    """
    timing, noise = sampler.timing, sampler.noise
    volts, state = np.empty((1, timing.burst_window)), np.empty((len(noise.sections), 2, 1))
    for w in range(BURST_WINDOWS):
        at, power_v2 = timing.burst_first + w * timing.burst_step, 0.0
        set_signal(volts[0], e, start_s + at / sampler.pulse.rate_hz, offset + at, signal, sampler.pulse)
        settle(noise, rng, state)
        add_noise(noise, rng, state, volts, 0, timing.burst_window)
        for t in range(timing.burst_window):
            power_v2 += min(abs(volts[0, t]), limit_v) ** 2
        if power_v2 <= least_v2 * timing.burst_window:
            return False
    return True


@compiled
def read_out(
    window: Window,
    crossing: int,
    pinned: PinnedSample,
    signal: Signal,
    sampler: Sampler,
    channels: Channels,
    rng: np.random.Generator,
    gate_v: FloatArray,
) -> int:
    """Fill the gate after a trigger and test for a burst; arguments and results as those of `sample_emission`.

    The gate starts `before` samples ahead of where the strongest channel reaches half its peak, because a crossing is
    the earlier the stronger the pulse.
    """
    timing, volts, limit_v, background_v2 = sampler.timing, window.volts, channels.limit_v, channels.background_v2
    strongest, peak_v, n_elements = 0, 0.0, limit_v.size
    fill(window, crossing + timing.peak, signal, sampler, pinned, rng)
    for t in range(crossing, crossing + timing.peak):
        for e in range(n_elements):
            clipped_v = min(abs(volts[e, t]), limit_v[e])
            if clipped_v > peak_v:
                strongest, peak_v = e, clipped_v
    half = max(timing.before, crossing - timing.before)
    while min(abs(volts[strongest, half]), limit_v[strongest]) < 0.5 * peak_v:
        half += 1
    start, power_v2 = half - timing.before, 0.0
    fill(window, start + timing.gate, signal, sampler, pinned, rng)
    for e in range(n_elements):
        for t in range(timing.gate):
            gate_v[e, t] = min(max(volts[e, start + t], -limit_v[e]), limit_v[e])
    for t in range(timing.gate):
        power_v2 += gate_v[strongest, t] ** 2
    power_v2 = power_v2 / timing.gate - background_v2[strongest]
    least_v2 = BURST_SHARE * power_v2 + background_v2[strongest]
    start_s, offset, limit = window.start_s + start / sampler.pulse.rate_hz, window.offset + start, limit_v[strongest]
    is_burst = lasts_like_a_burst(start_s, offset, least_v2, strongest, limit, signal, sampler, rng)
    return IS_BURST if is_burst else IS_PULSE


@compiled
def draw_phases(tones: Tones, rng: np.random.Generator) -> FloatArray:
    """Draw the phases of carriers."""
    start_rad = np.empty(tones.turn_rad.size)
    for c in range(start_rad.size):
        start_rad[c] = 2.0 * np.pi * rng.random()
    return start_rad


@compiled
def sample_emission(
    peak_v: float,
    burst_s: float,
    arrivals: Arrivals,
    sampler: Sampler,
    tones: Tones,
    channels: Channels,
    rng: np.random.Generator,
    gate_v: FloatArray,
) -> int:
    """Sample an emission, and fill the gate if it triggers.

    Each arrival has a window; windows whose gates or noise would overlap are one.

    Args:
        peak_v: Peak of the emission, as of `Signal`.
        burst_s: Duration of a burst, 0 for a pulse.
        arrivals: Arrivals of the emission.
        sampler: Receiver up to the gate.
        tones: Carriers.
        channels: State of the channels.
        rng: Generator.
        gate_v: Filled in, shape (n_elements, n_gate), as the ADC gets it.

    Returns:
        `NOT_TRIGGERED`, `IS_PULSE` or `IS_BURST`.
    """
    timing, rate_hz, n_elements = sampler.timing, sampler.pulse.rate_hz, channels.limit_v.size
    signal = Signal(peak_v, burst_s, arrivals, tones, draw_phases(tones, rng))
    clock = rng.random()  # fraction of a sample by which the sampling clock is late
    order, is_new = np.argsort(arrivals.peak_s, kind="mergesort"), True
    begin, first_begin, bound_v, tones_v = 0, 0, 0.0, 0.0
    for c in range(len(tones.amplitude_v)):
        tones_v += tones.amplitude_v[c].max()
    for k in range(order.size):
        at = math.floor(arrivals.peak_s[order[k]] * rate_hz - clock)
        start = at - timing.aperture - timing.before
        if k == 0:
            first_begin = start
        if is_new:
            begin, bound_v, is_new = start, 0.0, False
        bound_v += abs(peak_v) * float(arrivals.peak[order[k]])
        search_end = at - begin + timing.aperture + timing.rise
        end = search_end + timing.peak + timing.gate
        if k + 1 < order.size:
            following = math.floor(arrivals.peak_s[order[k + 1]] * rate_hz - clock) - timing.aperture - timing.before
            if following - begin < end + sampler.trigger.correlation.size:
                continue
        is_new, chance, n_searched = True, rng.random(), (search_end - timing.before) * n_elements
        if chance < n_searched * trigger_probability(sampler.trigger, bound_v + tones_v):  # S is not larger
            window = Window(
                (begin + clock) / rate_hz,
                begin - first_begin,
                search_end,
                np.empty((n_elements, end)),
                np.zeros(2, np.intp),
                np.empty((len(sampler.noise.sections), 2, n_elements)),
            )
            crossing, pinned = find_trigger(window, chance, signal, sampler, channels.limit_v, rng)
            if crossing >= 0:
                return read_out(window, crossing, pinned, signal, sampler, channels, rng, gate_v)
    return NOT_TRIGGERED


@compiled
def sample_false_alarm(sampler: Sampler, tones: Tones, rng: np.random.Generator, gate_v: FloatArray) -> None:
    """Fill a gate, shape (n_elements, n_gate), that noise alone has triggered: one noise sample is pinned."""
    trigger, noise = sampler.trigger, sampler.noise
    n_elements, n_gate = gate_v.shape
    state = np.empty((len(noise.sections), 2, n_elements))
    gate_v[:] = 0.0
    settle(noise, rng, state)
    add_noise(noise, rng, state, gate_v, 0, n_gate)
    at, channel = sampler.timing.before, int(rng.random() * n_elements)
    side = 1.0 if rng.random() < 0.5 else -1.0
    crossing_v = side * trigger.noise_v * draw_tail(trigger.level_v / trigger.noise_v, rng)
    pinned = PinnedSample(at, channel, crossing_v - gate_v[channel, at])
    add_pinned(gate_v, 0, n_gate, pinned, trigger.correlation)
    start_rad = draw_phases(tones, rng)
    for e in range(n_elements):
        add_tones(gate_v[e], e, 0, tones, start_rad)
