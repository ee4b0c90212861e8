"""The law of the energies of gates, in compiled loops: from emitted pulses to strengths, without drawing a sample."""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from dirmusic.kernels import dot
from dirmusic.pulses.batch import PulseBatch
from sensing.radio.incoming import EmittedPulses, Incoming, incoming_pulses
from sensing.radio.propagation import SourceTable
from sensing.receiver.front_end import PulseTable
from sensing.receiver.gates import add_paths, read_gates
from sensing.receiver.trigger import find_triggers

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


class GateNoise(NamedTuple):
    """Filtered noise over a gate.

    Attributes:
        std_v: Standard deviation of one sample.
        eigenvalues: Of the noise's correlation over the gate, shape (n_modes,).
        eigenvectors: Modes of unit norm, shape (n_samples, n_modes); in white noise (n_samples, 0).
    """

    std_v: float
    eigenvalues: FloatArray
    eigenvectors: FloatArray


class EnergyParameters(NamedTuple):
    """What a receiver makes of pulses, where the energies of its gates are drawn.

    Attributes:
        pulse: Shape of a pulse behind the filter.
        pulse_peak: Largest magnitude of that.
        threshold_v: Trigger level.
        gate_lead_s: From the arrival, at its loudest element, of the path that triggers to the start of the gate;
            negative is before.
        noise: Over the gate.
        background_v2: Power of a sample without a pulse, shape (1, n_elements).
        gate: Plain `GateParameters`.
    """

    pulse: PulseTable
    pulse_peak: float
    threshold_v: float
    gate_lead_s: float
    noise: GateNoise
    background_v2: FloatArray
    gate: tuple[int, float, float, float]


class NoiseDraws(NamedTuple):
    """Noise of pulses.

    Attributes:
        normal: Standard normal draws, shape (n_pulses, 1 + n_elements * max(n_modes, 1)); the first is the noise that
            the trigger meets, the others go along the modes.
        residual_v2: Noise energy that no mode holds, shape (n_pulses, n_elements), or (1, n_elements) for all, V^2.
    """

    normal: FloatArray
    residual_v2: FloatArray


class EnergyDetections(NamedTuple):
    """What triggered and looked like a pulse; a row is a pulse.

    Attributes:
        robot: Number of the robot that detected it, shape (n_detected,).
        energy_v2: Sums of squares over the gates, shape (n_detected, n_elements).
        pulses: What the receiver reads from those, if no channel is at fault.
    """

    robot: IntArray
    energy_v2: FloatArray
    pulses: PulseBatch

    @classmethod
    def room(cls, n_pulses: int, n_elements: int) -> Self:
        """Room for as many as there are pulses, to be filled in: more than one call of compiled code can hand out."""
        room = PulseBatch.room(n_pulses, n_elements)
        return cls(np.empty(n_pulses, dtype=np.intp), np.empty((n_pulses, n_elements)), room)

    def first(self, n_detected: int) -> Self:
        """The first rows."""
        rows = slice(0, n_detected)
        return type(self)(self.robot[rows], self.energy_v2[rows], self.pulses.take(rows))


@compiled
def named_parameters(parameters: tuple[Any, ...]) -> EnergyParameters:
    """`EnergyParameters` from plain ones, in which all inner records are plain too."""
    pulse, pulse_peak, threshold_v, gate_lead_s, noise, background_v2, gate = parameters
    return EnergyParameters(
        PulseTable(*pulse), pulse_peak, threshold_v, gate_lead_s, GateNoise(*noise), background_v2, gate
    )


@compiled
def gate_energies(
    incoming: Incoming,
    detected: IntArray,
    path: IntArray,
    receiver: EnergyParameters,
    draws: NoiseDraws,
    energy_v2: FloatArray,
) -> None:
    r"""Energies of gates that hold a pulse and Gaussian noise, without drawing a sample.

    .. math:: E = \sigma^2 \sum_k \mu_k (z_k + d_k)^2, \quad z_k \sim N(0, 1)

    with the eigenvalues :math:`\mu_k` of the noise's correlation over the gate, and :math:`d_k` the pulse along the
    eigenvectors in units of their noise. Modes left out hold next to no noise: they add its mean, and what the pulse
    has in them. In white noise any direction is an eigenvector: the pulse's own is taken, and what is left is
    :math:`\chi^2` distributed.

    Args:
        incoming: The pulses.
        detected: Numbers of the pulses that have a gate, shape (n_detected,).
        path: Ray path by which each pulse triggers, shape (n_pulses,).
        receiver: What it makes of pulses.
        draws: Noise of the pulses.
        energy_v2: Becomes the sums of squares over the gates, shape (n_detected, n_elements), V^2.
    """
    noise, normal, residual_v2 = receiver.noise, draws.normal, draws.residual_v2
    n_elements, (n_samples, n_modes) = incoming.arrivals.delay_s.shape[1], noise.eigenvectors.shape
    gate = np.empty((n_elements, n_samples))
    along, rest = np.empty((n_elements, 1)), np.empty(n_elements)
    known = -1
    for i in range(detected.size):
        k = detected[i]
        if path[k] != known:  # else the gate of the pulse before holds the same signal
            known = path[k]
            gate[:] = 0.0
            start_s = incoming.arrivals.loudest_s[known] + receiver.gate_lead_s
            first, n_paths = int(incoming.first[k]), int(incoming.n_paths[k])
            add_paths(gate, float(start_s), first, n_paths, incoming.arrivals, receiver.pulse)
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
            energy_v2[i, e] = peak_v * peak_v * rest[e] + residual_v2[k % len(residual_v2), e]
            for m in range(along.shape[1]):
                drawn_v = noise.std_v * normal[k, draw]
                draw += 1
                if n_modes > 0:
                    drawn_v *= np.sqrt(noise.eigenvalues[m])
                energy_v2[i, e] += (drawn_v + peak_v * along[e, m]) ** 2


@compiled
def detect_energies(
    emitted: tuple[Any, ...],
    propagation: tuple[Any, ...],
    parameters: tuple[Any, ...],
    draws: tuple[Any, ...],
    found: tuple[Any, ...],
) -> tuple[int, int]:
    """From emitted pulses to the readings of those that are detected.

    A burst does not die out after the gate: it is rejected.

    Args:
        emitted: Plain `EmittedPulses`.
        propagation: A plain `Propagation`.
        parameters: Plain `EnergyParameters`.
        draws: Plain `NoiseDraws`.
        found: Plain `EnergyDetections` with room for all pulses.

    Returns:
        How many are detected and fill the first rows of `found`, and how many triggered and do not look like a pulse.
    """
    pulses, sources = EmittedPulses(*emitted), SourceTable(*propagation[0])
    receiver, drawn = named_parameters(parameters), NoiseDraws(*draws)
    incoming = incoming_pulses(emitted, propagation)
    triggers = find_triggers(incoming, receiver.pulse_peak, receiver.threshold_v)
    detected, n_detected, n_rejected = np.empty(triggers.path.size, np.intp), 0, 0
    for k in range(triggers.path.size):
        if triggers.voltage_v[k] + receiver.noise.std_v * drawn.normal[k, 0] <= receiver.threshold_v:
            continue
        if sources.burst_s[pulses.robot[k], pulses.source[k]] > 0.0:
            n_rejected += 1
        else:
            detected[n_detected] = k
            n_detected += 1
    detected = detected[:n_detected]
    robot, energy_v2, batch = found
    robot[:n_detected] = pulses.robot[detected]
    energy_v2 = energy_v2[:n_detected]
    gate_energies(incoming, detected, triggers.path, receiver, drawn, energy_v2)
    read_gates(energy_v2, receiver.background_v2, pulses.time_s[detected], receiver.gate, batch)
    return n_detected, n_rejected
