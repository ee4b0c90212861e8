"""Signals of pulses, bursts and carriers in the channels, in compiled loops."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from sensing.nature.pulse_shape import FREQUENCY_HZ
from sensing.radio.arrivals import Arrivals
from sensing.receiver.front_end import PulseTable
from sensing.receiver.sampling.sampler import Emission, Tones

FloatArray = NDArray[np.float64]


@compiled
def set_signal(record_v: FloatArray, start_s: float, emission: Emission, arrivals: Arrivals, pulse: PulseTable) -> None:
    """Set a record (n_samples, n_elements) to an emission by all its paths, from `start_s` after the emission on."""
    n_phases, n_known = pulse.sine_v.shape
    n_samples, n_elements = record_v.shape
    channels_v = np.zeros((n_elements, n_samples))
    for p in range(emission.first, emission.first + emission.n_paths):
        for e in range(n_elements):
            into_v, in_phase_v = channels_v[e], emission.peak_v * arrivals.amplitude[p, e].real
            ahead_v = emission.peak_v * arrivals.amplitude[p, e].imag
            if emission.burst_s > 0.0:
                add_burst(
                    into_v, start_s - arrivals.delay_s[p, e], pulse.rate_hz, emission.burst_s, in_phase_v, ahead_v
                )
                continue
            at = int(np.floor(n_phases * (start_s - arrivals.delay_s[p, e]) * pulse.rate_hz + 0.5))
            before, phase = at // n_phases, at % n_phases  # samples from the arrival to the first one of the record
            first, end = max(0, -before), min(n_samples, n_known - before)
            if end > first:
                sine_v, cosine_v = pulse.sine_v[phase, first + before :], pulse.cosine_v[phase, first + before :]
                into_v = into_v[first:end]
                for t in range(into_v.size):
                    into_v[t] += in_phase_v * sine_v[t] + ahead_v * cosine_v[t]
    for t in range(n_samples):
        for e in range(n_elements):
            record_v[t, e] = channels_v[e, t]


@compiled
def add_burst(
    channel_v: FloatArray, since_s: float, rate_hz: float, burst_s: float, in_phase_v: float, ahead_v: float
) -> None:
    """Add a sine that lasts from time 0 to `burst_s` to a record that begins at `since_s`."""
    for t in range(channel_v.size):
        now_s = since_s + t / rate_hz
        if 0.0 <= now_s < burst_s:
            turn_rad = 2.0 * np.pi * FREQUENCY_HZ * now_s
            channel_v[t] += in_phase_v * math.sin(turn_rad) + ahead_v * math.cos(turn_rad)


@compiled
def add_tones(record_v: FloatArray, at: int, tones: Tones, start_rad: FloatArray) -> None:
    """Add carriers to a record whose first row is `at` samples after that at which they have the phases `start_rad`."""
    for c in range(start_rad.size):
        for t in range(record_v.shape[0]):
            now_rad = start_rad[c] + (at + t) * tones.turn_rad[c]
            for e in range(record_v.shape[1]):
                record_v[t, e] += tones.amplitude_v[c, e] * math.cos(now_rad + tones.phase_rad[c, e])
