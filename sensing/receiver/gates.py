"""Gates, in compiled loops: the signals in them, and what a receiver reads from their energies."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from dirmusic.pulses.batch import NO_DIRECTION, PulseBatch
from dirmusic.pulses.strength_kernels import strength_of, variance_of_strength
from sensing.radio.arrivals import Arrivals
from sensing.radio.incoming import Incoming
from sensing.receiver.front_end import PulseTable

FloatArray = NDArray[np.float64]


@compiled
def add_paths(
    record: FloatArray, start_s: float, first: int, n_paths: int, arrivals: Arrivals, pulse: PulseTable
) -> None:
    """Add one pulse of 1 V by all its paths to a record (n_elements, n_samples) from `start_s` after its emission."""
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
        start_s: When each record starts, after the emission of its pulse, shape (n_pulses,).
        n_samples: Length of the records.
        pulse: Shape of a pulse behind the filter.

    Returns:
        Shape (n_pulses, n_elements, n_samples).
    """
    made = np.zeros((start_s.size, incoming.arrivals.delay_s.shape[1], n_samples))
    for k in range(start_s.size):
        add_paths(made[k], float(start_s[k]), incoming.first[k], incoming.n_paths[k], incoming.arrivals, pulse)
    return made


class GateParameters(NamedTuple):
    """What a receiver knows of its gates.

    Attributes:
        n_samples: Length of a gate.
        energy_spread: Spread of the noise energies, as of `dirmusic.strength_variance`.
        noise_on_pulse: Noise on a pulse, as of `dirmusic.strength_variance`.
        mains_hz: Frequency of the receiver's own mains supply.
    """

    n_samples: int
    energy_spread: float
    noise_on_pulse: float
    mains_hz: float


@compiled
def read_gates(
    energy_v2: FloatArray,
    background_v2: FloatArray,
    time_s: FloatArray,
    gate: tuple[int, float, float, float],
    pulses: tuple[Any, ...],
) -> None:
    """Pulses from energies of gates: strengths, their variance, and phases of the mains; no channel is clipped.

    Args:
        energy_v2: Sums of squares over the gates, shape (n_gates, n_elements).
        background_v2: Power of a sample without a pulse, shape (n_gates, n_elements), or (1, n_elements) for all.
        time_s: Times of the triggers, shape (n_gates,).
        gate: Plain `GateParameters`.
        pulses: A plain `PulseBatch` with room for them; its first n_gates rows are filled in.
    """
    n_samples, energy_spread, noise_on_pulse, mains_hz = GateParameters(*gate)
    n_gates, n_elements = energy_v2.shape
    read = PulseBatch(*pulses)
    for k in range(n_gates):
        read.time_s[k] = time_s[k]
        read.azimuth_rad[k], read.std_rad[k], read.misfit[k] = NO_DIRECTION
        read.mains_phase_rad[k] = np.mod(2 * np.pi * mains_hz * time_s[k], 2 * np.pi)
        for e in range(n_elements):
            noise_v2 = background_v2[k % len(background_v2), e]
            read.strengths_v[k, e] = strength_of(energy_v2[k, e], n_samples * noise_v2)
            read.variance_v2[k, e] = variance_of_strength(
                read.strengths_v[k, e], noise_v2, energy_spread, noise_on_pulse
            )
            read.is_usable[k, e], read.is_clipped[k, e] = True, False
