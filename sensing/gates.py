"""What the gates of pulses hold, in compiled loops: which path triggers, the pulse in the gate, and its energy."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from sensing.array import ArrayTable
from sensing.front_end import PulseTable
from sensing.propagation import Surroundings
from sensing.tracing import Arrivals, trace

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
def _add_paths(
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
        _add_paths(made[k], float(start_s[k]), incoming.first[k], incoming.n_paths[k], incoming.arrivals, pulse)
    return made


class GateNoise(NamedTuple):
    """Filtered noise over a gate.

    Attributes:
        std_v: Standard deviation of one sample.
        eigenvalues: Of its correlation over the gate, shape (n_modes,).
        eigenvectors: Of unit norm, shape (n_samples, n_modes); in white noise (n_samples, 0).
    """

    std_v: float
    eigenvalues: FloatArray
    eigenvectors: FloatArray


@compiled
def gate_energies(
    incoming: Incoming,
    path: IntArray,
    gate_lead_s: float,
    pulse: PulseTable,
    noise: GateNoise,
    normal: FloatArray,
    left_v2: FloatArray,
) -> FloatArray:
    r"""Energies of gates that hold a pulse and Gaussian noise, without drawing a sample.

    .. math:: E = \sigma^2 \sum_k \mu_k (z_k + d_k)^2, \quad z_k \sim N(0, 1)

    with the eigenvalues :math:`\mu_k` of the noise's correlation over the gate, and :math:`d_k` the pulse along the
    eigenvectors in units of their noise. Modes left out hold next to no noise: they add its mean, and what the pulse
    has in them. In white noise any direction is an eigenvector: the pulse's own is taken, and what is left is
    :math:`\chi^2` distributed.

    Args:
        incoming: The pulses.
        path: By which path each of them triggers, shape (n_pulses,).
        gate_lead_s: From that path's arrival at its loudest element to the start of the gate; negative is before.
        pulse: Its shape behind the filter.
        noise: Over the gate.
        normal: Standard normal draws, shape (n_pulses, n_elements, max(n_modes, 1)).
        left_v2: Noise energy beside the modes, shape (n_pulses, n_elements), V^2.

    Returns:
        Sums of squares over the gate, shape (n_pulses, n_elements), V^2.
    """
    n_elements, (n_samples, n_modes) = incoming.arrivals.delay_s.shape[1], noise.eigenvectors.shape
    energy, gate = np.empty((path.size, n_elements)), np.empty((n_elements, n_samples))
    along, rest = np.empty((n_elements, max(n_modes, 1))), np.empty(n_elements)
    known = -1
    for k in range(path.size):
        if path[k] != known:  # else the gate of the pulse before holds the same signal
            known = path[k]
            gate[:] = 0.0
            start_s = incoming.arrivals.loudest_s[known] + gate_lead_s
            _add_paths(gate, float(start_s), incoming.first[k], incoming.n_paths[k], incoming.arrivals, pulse)
            along[:] = 0.0
            for e in range(n_elements):
                rest[e] = 0.0
                for t in range(n_samples):
                    rest[e] += gate[e, t] * gate[e, t]
                    for m in range(n_modes):
                        along[e, m] += gate[e, t] * noise.eigenvectors[t, m]
                if n_modes == 0:
                    along[e, 0], rest[e] = np.sqrt(rest[e]), 0.0
                for m in range(n_modes):
                    rest[e] -= along[e, m] * along[e, m]
                rest[e] = max(rest[e], 0.0)
        peak_v = incoming.peak_v[k]
        for e in range(n_elements):
            energy[k, e] = peak_v * peak_v * rest[e] + left_v2[k, e]
            for m in range(along.shape[1]):
                drawn_v = noise.std_v * normal[k, e, m]
                if n_modes > 0:
                    drawn_v *= np.sqrt(noise.eigenvalues[m])
                energy[k, e] += (drawn_v + peak_v * along[e, m]) ** 2
    return energy


class OnAir(NamedTuple):
    """Pulses as they were radiated, and whose they are.

    Attributes:
        robot: Number of the robot that may hear each, shape (n_pulses,).
        source: Number of the source among the robot's own, shape (n_pulses,).
        peak_v: Peak 1 m away in a unit-gain channel, before the band-pass, with its sign, shape (n_pulses,).
    """

    robot: IntArray
    source: IntArray
    peak_v: FloatArray


@compiled
def incoming_pulses(
    on_air: OnAir,
    sources_m: FloatArray,
    world_from_array: FloatArray,
    arrays: ArrayTable,
    surroundings: Surroundings,
) -> Incoming:
    """Pulses with their paths; arguments as of `tracing.trace`."""
    is_on = np.zeros(sources_m.shape[:2], np.bool_)
    for k in range(on_air.robot.size):
        is_on[on_air.robot[k], on_air.source[k]] = True
    legs, arrivals = trace(sources_m, is_on, world_from_array, arrays, surroundings)
    first, n_paths = np.empty(on_air.robot.size, np.intp), np.empty(on_air.robot.size, np.intp)
    for k in range(on_air.robot.size):
        first[k] = legs.first[on_air.robot[k], on_air.source[k]]
        n_paths[k] = legs.n_paths[on_air.robot[k], on_air.source[k]]
    return Incoming(first, n_paths, on_air.peak_v, arrivals)


class Channel(NamedTuple):
    """What a receiver makes of pulses.

    Attributes:
        pulse: Behind the filter.
        pulse_peak: Its largest magnitude.
        threshold_v: Trigger level.
        gate_lead_s: Of `gate_energies`.
        noise: Over a gate.
    """

    pulse: PulseTable
    pulse_peak: float
    threshold_v: float
    gate_lead_s: float
    noise: GateNoise


@compiled
def triggered_energies(
    incoming: Incoming, channel: Channel, normal: FloatArray, beside_v2: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Which pulses trigger, shape (n_heard,), and the energies of their gates, shape (n_heard, n_elements).

    Args:
        incoming: The pulses.
        channel: Of the receiver.
        normal: Standard normal draws, shape (n_pulses, 1 + n_elements * max(n_modes, 1)).
        beside_v2: Noise energy beside the modes, shape (n_pulses, n_elements), V^2.
    """
    path, voltage_v = find_triggers(incoming, channel.pulse_peak, channel.threshold_v)
    heard = np.flatnonzero(voltage_v + channel.noise.std_v * normal[:, 0] > channel.threshold_v)
    n_elements = beside_v2.shape[1]
    drawn = normal[heard, 1:].copy().reshape(heard.size, n_elements, (normal.shape[1] - 1) // n_elements)
    loud = Incoming(incoming.first[heard], incoming.n_paths[heard], incoming.peak_v[heard], incoming.arrivals)
    return heard, gate_energies(
        loud, path[heard], channel.gate_lead_s, channel.pulse, channel.noise, drawn, beside_v2[heard]
    )


@compiled
def hear_energies(
    on_air: OnAir,
    sources_m: FloatArray,
    world_from_array: FloatArray,
    arrays: ArrayTable,
    surroundings: Surroundings,
    channel: Channel,
    normal: FloatArray,
    beside_v2: FloatArray,
) -> tuple[IntArray, FloatArray]:
    """Both in one: from pulses on the air to those that trigger, and the energies of their gates."""
    incoming = incoming_pulses(on_air, sources_m, world_from_array, arrays, surroundings)
    return triggered_energies(incoming, channel, normal, beside_v2)
