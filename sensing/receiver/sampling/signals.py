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
def add_signal(record_v: FloatArray, start_s: float, emission: Emission, arrivals: Arrivals, pulse: PulseTable) -> None:
    """Add an emission by all its paths to a record (n_samples, n_elements) from `start_s` after the emission on."""
    n_phases, n_known = pulse.sine_v.shape
    n_samples, n_elements = record_v.shape
    for p in range(emission.first, emission.first + emission.n_paths):
        for e in range(n_elements):
            in_phase_v = emission.peak_v * arrivals.amplitude[p, e].real
            ahead_v = emission.peak_v * arrivals.amplitude[p, e].imag
            at = int(np.floor(n_phases * (start_s - arrivals.delay_s[p, e]) * pulse.rate_hz + 0.5))
            before, phase = at // n_phases, at % n_phases  # samples from the arrival to the first one of the record
            if emission.burst_s > 0.0:
                for t in range(max(0, -before), n_samples):
                    since_s = start_s + t / pulse.rate_hz - arrivals.delay_s[p, e]
                    if 0.0 <= since_s < emission.burst_s:
                        turn_rad = 2.0 * np.pi * FREQUENCY_HZ * since_s
                        record_v[t, e] += in_phase_v * math.sin(turn_rad) + ahead_v * math.cos(turn_rad)
                continue
            sine_v, cosine_v = pulse.sine_v[phase], pulse.cosine_v[phase]
            for t in range(max(0, -before), min(n_samples, n_known - before)):
                record_v[t, e] += in_phase_v * sine_v[before + t] + ahead_v * cosine_v[before + t]


@compiled
def add_tones(record_v: FloatArray, at: int, tones: Tones, start_rad: FloatArray) -> None:
    """Add carriers to a record whose first row is `at` samples after that at which they have the phases `start_rad`."""
    for c in range(start_rad.size):
        for t in range(record_v.shape[0]):
            now_rad = start_rad[c] + (at + t) * tones.turn_rad[c]
            for e in range(record_v.shape[1]):
                record_v[t, e] += tones.amplitude_v[c, e] * math.cos(now_rad + tones.phase_rad[c, e])
