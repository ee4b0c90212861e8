"""The record in which a trigger is looked for: about each arrival, and made as far as it is needed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from pdpatrol.sensing.radio.arrivals import Arrivals
from pdpatrol.sensing.receiver.front_end import PulseTable
from pdpatrol.sensing.receiver.sampling.noise import add_noise, settle
from pdpatrol.sensing.receiver.sampling.sampler import Emission, Incoming, Sampler, Timing
from pdpatrol.sensing.receiver.sampling.signals import add_tones, set_signal

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

PIECE = 48
"""Samples that are made at once while a trigger is looked for; it decides about speed alone."""


class Windows(NamedTuple):
    """Where a trigger is looked for: pieces of a record, one after the other in time, with noise of their own.

    Attributes:
        start_s: Of the first row of each, after the emission, shape (n_windows,).
        first: Its first row in the record, shape (n_windows,).
        search_end: The row after the last in which it may trigger; the first such is `before` after `first`.
        end: The row after the last that a gate may reach.
        most_v: No sample has more of the emission, shape (n_windows,).
    """

    start_s: FloatArray
    first: IntArray
    search_end: IntArray
    end: IntArray
    most_v: FloatArray


@compiled
def _in_order(values: FloatArray) -> IntArray:
    """Indices of a few values, ascending."""
    order = np.empty(values.size, np.intp)
    for k in range(values.size):
        i = k
        while i > 0 and values[order[i - 1]] > values[k]:
            order[i] = order[i - 1]
            i -= 1
        order[i] = k
    return order


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
    start_s, most_v = np.empty(n_paths), np.zeros(n_paths)
    first, search_end, end = np.empty(n_paths, np.intp), np.empty(n_paths, np.intp), np.empty(n_paths, np.intp)
    own = slice(emission.first, emission.first + n_paths)
    order, loudest = _in_order(arrivals.loudest_s[own]), arrivals.loudest[own]
    reach, after = timing.aperture + timing.rise, timing.peak + timing.gate
    begins = 0.0
    for p in order:
        at = arrivals.loudest_s[emission.first + p] * rate_hz - offset
        starts = np.floor(at) - timing.aperture - timing.before
        if n > 0 and starts - begins < end[n - 1] - first[n - 1] + timing.apart:
            search_end[n - 1] = first[n - 1] + int(np.floor(at) - begins) + reach
        else:
            begins = starts
            start_s[n] = (starts + offset) / rate_hz
            first[n] = 0 if n == 0 else end[n - 1]
            search_end[n] = first[n] + timing.before + timing.aperture + reach
            n += 1
        end[n - 1] = search_end[n - 1] + after
        most_v[n - 1] += abs(emission.peak_v) * loudest[p]
    return Windows(start_s[:n], first[:n], search_end[:n], end[:n], most_v[:n])


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


@compiled
def fill_signal(record: Record, windows: Windows, w: int, end: int, incoming: Incoming, pulse: PulseTable) -> None:
    """Put the signal into a window, up to a row."""
    row = record.has_signal[w]
    if end <= row:
        return
    start_s = windows.start_s[w] + (row - windows.first[w]) / pulse.rate_hz
    piece_v = record.volts[row:end]
    set_signal(piece_v, start_s, incoming.emission, incoming.arrivals, pulse)
    if incoming.start_rad.size > 0:
        at = int(np.rint((start_s - windows.start_s[0]) * pulse.rate_hz))
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
