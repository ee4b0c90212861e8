"""Strengths from the law of the gates' energies, without drawing a sample, in compiled loops."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from dirmusic.kernels import dot
from dirmusic.pulses.strength_kernels import strength_of, variance_of_strength
from sensing.array import ArrayTable
from sensing.radio.incoming import EmittedPulses, Incoming, add_paths, find_triggers, incoming_pulses
from sensing.radio.surroundings import Faces, Obstacles, Surroundings
from sensing.receiver.front_end import PulseTable

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


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
    heard: IntArray,
    path: IntArray,
    gate_lead_s: float,
    pulse: PulseTable,
    noise: GateNoise,
    normal: FloatArray,
    beside_v2: FloatArray,
) -> FloatArray:
    r"""Energies of gates that hold a pulse and Gaussian noise, without drawing a sample.

    .. math:: E = \sigma^2 \sum_k \mu_k (z_k + d_k)^2, \quad z_k \sim N(0, 1)

    with the eigenvalues :math:`\mu_k` of the noise's correlation over the gate, and :math:`d_k` the pulse along the
    eigenvectors in units of their noise. Modes left out hold next to no noise: they add its mean, and what the pulse
    has in them. In white noise any direction is an eigenvector: the pulse's own is taken, and what is left is
    :math:`\chi^2` distributed.

    Args:
        incoming: The pulses.
        heard: Which of them have a gate, shape (n_heard,).
        path: By which path each pulse triggers, shape (n_pulses,).
        gate_lead_s: From that path's arrival at its loudest element to the start of the gate; negative is before.
        pulse: Its shape behind the filter.
        noise: Over the gate.
        normal: Standard normal draws, shape (n_pulses, 1 + n_elements * max(n_modes, 1)); the first does not count.
        beside_v2: Noise energy beside the modes, shape (n_pulses, n_elements), or (1, n_elements) for all, V^2.

    Returns:
        Sums of squares over the gate, shape (n_heard, n_elements), V^2.
    """
    n_elements, (n_samples, n_modes) = incoming.arrivals.delay_s.shape[1], noise.eigenvectors.shape
    energy, gate = np.empty((heard.size, n_elements)), np.empty((n_elements, n_samples))
    along, rest = np.empty((n_elements, 1)), np.empty(n_elements)
    known = -1
    for i in range(heard.size):
        k = heard[i]
        if path[k] != known:  # else the gate of the pulse before holds the same signal
            known = path[k]
            gate[:] = 0.0
            start_s = incoming.arrivals.loudest_s[known] + gate_lead_s
            first, n_paths = int(incoming.first[k]), int(incoming.n_paths[k])
            add_paths(gate, float(start_s), first, n_paths, incoming.arrivals, pulse)
            if n_modes > 0:
                along = gate @ noise.eigenvectors  # of one shape for every pulse, so it rounds alike for all of them
            for e in range(n_elements):
                rest[e] = dot(gate[e], gate[e])
                if n_modes == 0:
                    along[e, 0], rest[e] = np.sqrt(rest[e]), 0.0
                else:
                    rest[e] = max(rest[e] - dot(along[e], along[e]), 0.0)
        peak_v, draw = incoming.peak_v[k], 1
        for e in range(n_elements):
            energy[i, e] = peak_v * peak_v * rest[e] + beside_v2[k % len(beside_v2), e]
            for m in range(along.shape[1]):
                drawn_v = noise.std_v * normal[k, draw]
                draw += 1
                if n_modes > 0:
                    drawn_v *= np.sqrt(noise.eigenvalues[m])
                energy[i, e] += (drawn_v + peak_v * along[e, m]) ** 2
    return energy


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
def told(
    energy_v2: FloatArray,
    background_v2: FloatArray,
    time_s: FloatArray,
    telling: tuple[int, float, float, float],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """What a receiver tells of gates.

    Args:
        energy_v2: Shape (n_gates, n_elements).
        background_v2: Power of a sample without a pulse, shape (n_gates, n_elements), or (1, n_elements) for all.
        time_s: Of the triggers, shape (n_gates,).
        telling: Samples of a gate; spread of noise energies and noise on a pulse, both as of
            `dirmusic.strengths.strength_variance`; and frequency of the receiver's own mains supply.

    Returns:
        Strengths and their variance, both of shape (n_gates, n_elements), and the phases of the mains, shape
        (n_gates,), in [0, 2 pi).
    """
    n_samples, energy_spread, noise_on_pulse, mains_hz = telling
    strengths_v, variance_v2 = np.empty(energy_v2.shape), np.empty(energy_v2.shape)
    for k in range(energy_v2.shape[0]):
        for e in range(energy_v2.shape[1]):
            noise_v2 = background_v2[k % len(background_v2), e]
            strengths_v[k, e] = strength_of(energy_v2[k, e], n_samples * noise_v2)
            variance_v2[k, e] = variance_of_strength(strengths_v[k, e], noise_v2, energy_spread, noise_on_pulse)
    return strengths_v, variance_v2, np.mod(2 * np.pi * mains_hz * time_s, 2 * np.pi)


@compiled
def hear_energies(
    emitted: tuple[Any, ...],
    sources_m: FloatArray,
    burst_s: FloatArray,
    world_from_array: FloatArray,
    arrays: tuple[Any, ...],
    surroundings: tuple[Any, ...],
    channel: tuple[Any, ...],
    normal: FloatArray,
    beside_v2: FloatArray,
    background_v2: FloatArray,
    telling: tuple[int, float, float, float],
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, int]:
    """From pulses on the air to what is told of those that trigger.

    Args:
        emitted: A plain `EmittedPulses`.
        sources_m: Of each robot its own, shape (n_robots, n_sources, 3), world frame.
        burst_s: How long emissions last that are no pulses, 0 for pulses, shape (n_robots, n_sources); such a burst
            does not die out after the gate and is rejected.
        world_from_array: Shape (n_robots, 4, 4).
        arrays: Of the robots, a plain `ArrayTable`.
        surroundings: Of all of them, plain `Surroundings`.
        channel: Of all of them, a plain `Channel`.
        normal: Standard normal draws, shape (n_pulses, 1 + n_elements * max(n_modes, 1)).
        beside_v2: Of `gate_energies`.
        background_v2: Of `told`.
        telling: Likewise.

    Returns:
        Of those that are heard and look like a pulse robot and time, shape (n_heard,), energies of the gates, shape
        (n_heard, n_elements), and what is `told` of them; and how many do not look like a pulse.
    """
    pulse, peak, threshold_v, lead_s, noise = channel
    faces, reflection, log_loss, obstacles = surroundings
    around = Surroundings(Faces(*faces), reflection, log_loss, Obstacles(*obstacles))
    air, hiss = EmittedPulses(*emitted), GateNoise(*noise)
    incoming = incoming_pulses(air, sources_m, world_from_array, ArrayTable(*arrays), around)
    path, voltage_v = find_triggers(incoming, peak, threshold_v)
    heard, n_heard, n_rejected = np.empty(path.size, np.intp), 0, 0
    for k in range(path.size):
        if voltage_v[k] + hiss.std_v * normal[k, 0] <= threshold_v:
            continue
        if burst_s[air.robot[k], air.source[k]] > 0.0:
            n_rejected += 1
        else:
            heard[n_heard] = k
            n_heard += 1
    heard = heard[:n_heard]
    energy = gate_energies(incoming, heard, path, lead_s, PulseTable(*pulse), hiss, normal, beside_v2)
    time_s = air.time_s[heard]
    strengths_v, variance_v2, phase_rad = told(energy, background_v2, time_s, telling)
    return air.robot[heard], time_s, energy, strengths_v, variance_v2, phase_rad, n_rejected
