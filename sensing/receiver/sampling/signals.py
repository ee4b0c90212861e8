"""Signals of pulses, bursts and carriers in the channels, in compiled loops."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from pdpatrol.sensing.nature.pulse_shape import FREQUENCY_HZ
from pdpatrol.sensing.radio.arrivals import Arrivals
from pdpatrol.sensing.receiver.front_end import PulseTable
from pdpatrol.sensing.receiver.sampling.sampler import Emission, Tones

FloatArray = NDArray[np.float64]


@compiled
def set_signal(record_v: FloatArray, start_s: float, emission: Emission, arrivals: Arrivals, pulse: PulseTable) -> None:
    """Set a record (n_samples, n_elements) to an emission by all its paths, from `start_s` after the emission on."""
    n_samples, n_elements = record_v.shape
    channels_v = np.zeros((n_elements, n_samples))
    for p in range(emission.first, emission.first + emission.n_paths):
        for e in range(n_elements):
            since_s, amplitude = start_s - arrivals.delay_s[p, e], arrivals.amplitude[p, e]
            if emission.burst_s > 0.0:
                steady = 0.0j
                for b in range(amplitude.size):
                    steady += pulse.steady_share[b] * amplitude[b]
                add_burst(channels_v, e, since_s, emission.peak_v * steady, emission.burst_s, pulse.rate_hz)
            else:
                for b in range(amplitude.size):
                    add_pulse(channels_v, e, since_s, emission.peak_v * amplitude[b], b, pulse)
    for t in range(n_samples):
        for e in range(n_elements):
            record_v[t, e] = channels_v[e, t]


@compiled
def add_pulse(channels_v: FloatArray, e: int, since_s: float, peak_v: complex, band: int, pulse: PulseTable) -> None:
    """Add what a pulse that arrived `since_s` ago is in a band to a channel."""
    _, n_phases, n_known = pulse.sine_v.shape
    at = int(np.floor(n_phases * (since_s * pulse.rate_hz + pulse.lead) + 0.5))
    before, phase = at // n_phases, at % n_phases  # samples from the table's first to the record's
    first, end = max(0, -before), min(channels_v.shape[1], n_known - before)
    known, n_both = np.uint64(max(0, before)), np.uint64(max(0, end - first))  # loops over unsigned numbers are fast
    for t in range(n_both):
        channels_v[e, np.uint64(first) + t] += (
            peak_v.real * pulse.sine_v[band, phase, known + t] + peak_v.imag * pulse.cosine_v[band, phase, known + t]
        )


@compiled
def add_burst(channels_v: FloatArray, e: int, since_s: float, peak_v: complex, burst_s: float, rate_hz: float) -> None:
    """Add a sine that began `since_s` ago and lasts for `burst_s` to a channel."""
    for t in range(channels_v.shape[1]):
        now_s = since_s + t / rate_hz
        if 0.0 <= now_s < burst_s:
            turn_rad = 2.0 * np.pi * FREQUENCY_HZ * now_s
            channels_v[e, t] += peak_v.real * math.sin(turn_rad) + peak_v.imag * math.cos(turn_rad)


@compiled
def add_tones(record_v: FloatArray, at: int, tones: Tones, start_rad: FloatArray) -> None:
    """Add carriers to a record whose first row is `at` samples after that at which they have the phases `start_rad`."""
    for c in range(start_rad.size):
        for t in range(record_v.shape[0]):
            now_rad = start_rad[c] + (at + t) * tones.turn_rad[c]
            for e in range(record_v.shape[1]):
                record_v[t, e] += tones.amplitude_v[c, e] * math.cos(now_rad + tones.phase_rad[c, e])
