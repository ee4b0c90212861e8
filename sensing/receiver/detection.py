"""Detection of pulses in compiled functions: ADC, readings of gates, and the loop over the emissions of one robot."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import Held, compiled
from dirmusic.pulses.batch import NO_DIRECTION, PulseBatch
from dirmusic.pulses.strengths import dot, strength_of, variance_of_strength
from pdpatrol.sensing.nature.sources import Emissions
from pdpatrol.sensing.radio.arrivals import Arrivals, Propagation, propagate
from pdpatrol.sensing.radio.ray_paths import WEAKEST
from pdpatrol.sensing.receiver.sampling import (
    IS_BURST,
    IS_PULSE,
    Channels,
    Sampler,
    Tones,
    sample_emission,
    sample_false_alarm,
)

FloatArray = NDArray[np.float64]

FALSE_ALARM = -1
"""Source of what noise alone triggers."""


class GateReading(NamedTuple):
    """Parameters of the ADC and of the readings of a gate; those of sub-bands as of `dirmusic.bearing.sub_bands`.

    Attributes:
        step_v: Voltage of one count.
        highest: Largest count, of either sign.
        mains_hz: Frequency of the receiver's mains supply.
        energy_spread: Spread of the noise energy as of `dirmusic.strength_variance`.
        noise_on_pulse: Noise on a pulse as of `dirmusic.strength_variance`.
        band_lines: Lines of the sub-bands, shape (n_bands, n_lines, n_samples); no bands if none are read.
        band_noise_samples: Noise of the sub-bands, shape (n_bands,).
        band_energy_spread: Spread of the noise energy of the sub-bands, shape (n_bands,).
        band_noise_on_pulse: Noise on a pulse in the sub-bands, shape (n_bands,).
    """

    step_v: float
    highest: float
    mains_hz: float
    energy_spread: float
    noise_on_pulse: float
    band_lines: FloatArray
    band_noise_samples: FloatArray
    band_energy_spread: FloatArray
    band_noise_on_pulse: FloatArray


class ReceiverState(NamedTuple):
    """Everything that the detection of one robot depends on.

    Attributes:
        sampler: Receiver up to the gate.
        reading: ADC and readings.
        channels: State of the channels.
        tones: Carriers.
        propagation: Sources, array and surroundings.
        emissions: Emissions and false alarms by time; the source of the latter is `FALSE_ALARM`.
        rng: Generator of noise and triggers.
    """

    sampler: Sampler
    reading: GateReading
    channels: Channels
    tones: Tones
    propagation: Propagation
    emissions: Emissions
    rng: np.random.Generator


class Gates(NamedTuple):
    """Gates and their readings; a row is a gate.

    Attributes:
        waveforms_v: Output of the ADC, shape (n_gates, n_elements, n_samples).
        pulses: Readings.
    """

    waveforms_v: FloatArray
    pulses: PulseBatch

    @classmethod
    def room(cls, n_gates: int, n_elements: int, n_samples: int, n_bands: int) -> Self:
        """Make space for gates."""
        return cls(np.empty((n_gates, n_elements, n_samples)), PulseBatch.room(n_gates, n_elements, n_bands))


@compiled
def convert(gate_v: FloatArray, reading: GateReading, channels: Channels, waveform_v: FloatArray) -> None:
    """Convert a gate, shape (n_elements, n_samples), as the ADC does."""
    for e in range(waveform_v.shape[0]):
        for t in range(waveform_v.shape[1]):
            counts = np.rint(gate_v[channels.source[e], t] / reading.step_v)
            waveform_v[e, t] = min(max(counts, -reading.highest), reading.highest) * reading.step_v
            if not np.isnan(channels.stuck_v[e]):
                waveform_v[e, t] = channels.stuck_v[e]


@compiled
def read_gate(
    waveforms_v: FloatArray, background_v2: FloatArray, time_s: float, reading: GateReading, k: int, pulses: PulseBatch
) -> None:
    """Read strengths, variances, clipping and mains phase of a gate.

    Args:
        waveforms_v: Output of the ADC, shape (n_elements, n_samples).
        background_v2: Power of a sample without emission, shape (n_elements,).
        time_s: Time of the trigger.
        reading: Parameters of the reading.
        k: Row to be filled in.
        pulses: Batch to be filled in.
    """
    n_elements, n_samples = waveforms_v.shape
    pulses.time_s[k] = time_s
    pulses.azimuth_rad[k], pulses.std_rad[k], pulses.misfit[k] = NO_DIRECTION
    pulses.mains_phase_rad[k] = np.mod(2 * np.pi * reading.mains_hz * time_s, 2 * np.pi)
    for e in range(n_elements):
        waveform_v, noise_v2 = waveforms_v[e], background_v2[e]
        strength_v = strength_of(dot(waveform_v, waveform_v), n_samples * noise_v2)
        pulses.strengths_v[k, e] = strength_v
        pulses.variance_v2[k, e] = variance_of_strength(
            strength_v, noise_v2, reading.energy_spread, reading.noise_on_pulse
        )
        pulses.is_usable[k, e] = True
        pulses.is_clipped[k, e] = np.abs(waveform_v).max() >= (reading.highest - 0.5) * reading.step_v
        for b in range(reading.band_noise_samples.size):
            energy_v2 = 0.0
            for line in range(reading.band_lines.shape[1]):
                energy_v2 += dot(waveform_v, reading.band_lines[b, line]) ** 2
            strength_v = strength_of(energy_v2, reading.band_noise_samples[b] * noise_v2)
            pulses.band_strengths_v[k, b, e] = strength_v
            pulses.band_variance_v2[k, b, e] = variance_of_strength(
                strength_v, noise_v2, reading.band_energy_spread[b], reading.band_noise_on_pulse[b]
            )


@compiled
def detect(
    held_state: Held[ReceiverState],
    first: int,
    end: int,
    world_from_array: FloatArray,
    held_gates: Held[Gates],
    row: int,
) -> tuple[int, int]:
    """Fill the gates of all emissions `first` to `end` that trigger.

    Args:
        held_state: State of the receiver.
        first: First emission.
        end: End of the emissions.
        world_from_array: Pose of the array, shape (4, 4).
        held_gates: Filled in; there must be a row for each emission.
        row: First row that is free.

    Returns:
        The row behind the last that was filled, and the number of emissions rejected as bursts.
    """
    sampler, reading, channels, tones, propagation, emissions, rng = held_state.value
    waveforms_v, pulses = held_gates.value
    gate_v, n_rejected = np.empty(waveforms_v.shape[1:]), 0
    least = np.full(propagation.burst_s.size, np.inf)
    for k in range(first, end):
        s = emissions.source[k]
        if s != FALSE_ALARM:
            least[s] = min(least[s], WEAKEST * sampler.trigger.level_v / abs(emissions.peak_v[k]))
    ray_paths, arrivals = propagate(least, world_from_array, propagation)
    for k in range(first, end):
        s = emissions.source[k]
        if s == FALSE_ALARM:
            sample_false_alarm(sampler, tones, rng, gate_v)
        else:
            of_source = slice(ray_paths.first[s], ray_paths.first[s] + ray_paths.n_paths[s])
            delay_s, amplitude, peak, peak_s = arrivals
            outcome = sample_emission(
                emissions.peak_v[k],
                float(propagation.burst_s[s]),
                Arrivals(delay_s[of_source], amplitude[of_source], peak[of_source], peak_s[of_source]),
                sampler,
                tones,
                channels,
                rng,
                gate_v,
            )
            n_rejected += outcome == IS_BURST
            if outcome != IS_PULSE:
                continue
        convert(gate_v, reading, channels, waveforms_v[row])
        read_gate(waveforms_v[row], channels.background_v2, emissions.time_s[k], reading, row, pulses)
        row += 1
    return row, n_rejected
