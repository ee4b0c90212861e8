"""Pulses on their way into gates, in compiled loops: their paths, which of these triggers, and the record."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from sensing.array import ArrayTable
from sensing.radio.ray_paths import Arrivals, trace
from sensing.radio.surroundings import Surroundings
from sensing.receiver.front_end import PulseTable

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]


class Incoming(NamedTuple):
    """Pulses and the paths they take.

    Attributes:
        first: First path of each pulse, shape (n_pulses,).
        n_paths: How many each has, shape (n_pulses,).
        peak_v: Of each pulse 1 m away in a unit-gain channel, before the band-pass, shape (n_pulses,).
        arrivals: All paths.
    """

    first: IntArray
    n_paths: IntArray
    peak_v: FloatArray
    arrivals: Arrivals

    def take(self, chosen: IntArray | BoolArray | slice) -> Incoming:
        """Some of the pulses."""
        return Incoming(self.first[chosen], self.n_paths[chosen], self.peak_v[chosen], self.arrivals)


@compiled
def find_triggers(incoming: Incoming, pulse_peak: float, threshold_v: float) -> tuple[IntArray, FloatArray]:
    """By which of its paths each pulse triggers.

    Args:
        incoming: The pulses.
        pulse_peak: Largest magnitude of a filtered pulse.
        threshold_v: Trigger level.

    Returns:
        The first path that is loud enough in its loudest channel, or where none is the loudest, shape (n_pulses,); and
        the greatest voltage of each pulse, without noise, shape (n_pulses,).
    """
    n_pulses, loudest, loudest_s = incoming.first.size, incoming.arrivals.loudest, incoming.arrivals.loudest_s
    path, voltage_v = np.empty(n_pulses, np.intp), np.empty(n_pulses)
    for k in range(n_pulses):
        first = incoming.first[k]
        paths = range(first, first + incoming.n_paths[k])
        scale_v = abs(incoming.peak_v[k]) * pulse_peak
        highest_v = 0.0
        for p in paths:
            highest_v = max(highest_v, scale_v * loudest[p])
        earliest_s, path[k] = np.inf, first
        for p in paths:
            if scale_v * loudest[p] >= min(threshold_v, highest_v) and loudest_s[p] < earliest_s:
                earliest_s, path[k] = loudest_s[p], p
        voltage_v[k] = highest_v
    return path, voltage_v


@compiled
def add_paths(
    record: FloatArray, start_s: float, first: int, n_paths: int, arrivals: Arrivals, pulse: PulseTable
) -> None:
    """Add one pulse of 1 V by all its paths to a record (n_elements, n_samples) from `start_s` after its radiation."""
    n_phases, n_known = pulse.values_v.shape
    for p in range(first, first + n_paths):
        for e in range(record.shape[0]):
            at = int(np.floor(n_phases * (start_s - arrivals.delay_s[p, e]) * pulse.rate_hz + 0.5))
            before, phase = at // n_phases, at % n_phases  # samples from the arrival to the first one of the record
            values_v, amplitude = pulse.values_v[phase], arrivals.amplitude[p, e]
            for t in range(max(0, -before), min(record.shape[1], n_known - before)):
                record[e, t] += amplitude * values_v[before + t]


@compiled
def signals(incoming: Incoming, start_s: FloatArray, n_samples: int, pulse: PulseTable) -> FloatArray:
    """Noise-free records of pulses as if their peak were 1 V; overlapping paths are one waveform.

    Args:
        incoming: The pulses.
        start_s: When each record starts, after its pulse was radiated, shape (n_pulses,).
        n_samples: Length of the records.
        pulse: Its shape behind the filter.

    Returns:
        Shape (n_pulses, n_elements, n_samples).
    """
    made = np.zeros((start_s.size, incoming.arrivals.delay_s.shape[1], n_samples))
    for k in range(start_s.size):
        add_paths(made[k], float(start_s[k]), incoming.first[k], incoming.n_paths[k], incoming.arrivals, pulse)
    return made


class EmittedPulses(NamedTuple):
    """Pulses as they were radiated, and whose they are.

    Attributes:
        robot: Number of the robot that may hear each, shape (n_pulses,).
        source: Number of the source among the robot's own, shape (n_pulses,).
        peak_v: Peak 1 m away in a unit-gain channel, before the band-pass, with its sign, shape (n_pulses,).
        time_s: When, shape (n_pulses,).
    """

    robot: IntArray
    source: IntArray
    peak_v: FloatArray
    time_s: FloatArray


@compiled
def incoming_pulses(
    emitted: EmittedPulses,
    sources_m: FloatArray,
    world_from_array: FloatArray,
    arrays: ArrayTable,
    surroundings: Surroundings,
) -> Incoming:
    """Pulses with their paths; arguments as of `tracing.trace`."""
    is_on = np.zeros(sources_m.shape[:2], np.bool_)
    for k in range(emitted.robot.size):
        is_on[emitted.robot[k], emitted.source[k]] = True
    legs, arrivals = trace(sources_m, is_on, world_from_array, arrays, surroundings)
    first, n_paths = np.empty(emitted.robot.size, np.intp), np.empty(emitted.robot.size, np.intp)
    for k in range(emitted.robot.size):
        first[k] = legs.first[emitted.robot[k], emitted.source[k]]
        n_paths[k] = legs.n_paths[emitted.robot[k], emitted.source[k]]
    return Incoming(first, n_paths, emitted.peak_v, arrivals)
