"""Compiled detection of pulses: ADC, evaluation of gates, and the loop over the emissions that reach one robot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np

from dirmusic.arrays import FloatArray, IntArray
from dirmusic.compiled import Held, compiled, compiled_inner
from dirmusic.pulses.batch import NO_DIRECTION, PulseBatch
from dirmusic.pulses.strengths import dot, strength_of, variance_of_strength
from pdpatrol.sensing.nature.sources import Emissions
from pdpatrol.sensing.radio.arrivals import Propagation, propagate
from pdpatrol.sensing.radio.ray_paths import WEAKEST
from pdpatrol.sensing.receiver.sampling import (
    IS_BURST,
    IS_PULSE,
    Channels,
    Sampler,
    Signal,
    sample_emission,
    sample_false_alarm,
)

FALSE_ALARM = -1
"""Source number of a trigger by noise alone."""


class GateReading(NamedTuple):
    """Parameters of the ADC and of the evaluation of a gate; for sub-bands, see `dirmusic.bearing.sub_bands`.

    Attributes:
        step_v: Voltage of one count.
        highest: Largest count, of either sign.
        mains_hz: Frequency of the receiver's mains supply.
        energy_spread: Spread of the noise energy, as in `dirmusic.strength_variance`.
        noise_on_pulse: Noise on a pulse, as in `dirmusic.strength_variance`.
        band_lines: Spectral lines of the sub-bands, shape (n_bands, n_lines, n_samples); n_bands is 0 if no sub-bands
            are read.
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
    """Everything but random numbers that the detection of pulses by one robot depends on.

    A `Held` of it is made at each step if channels change. It takes 40 us, but 2 ms if it contained a generator.

    Attributes:
        sampler: Receiver up to the gate.
        reading: Parameters of the ADC and of the evaluation of gates.
        channels: State of the channels, and carriers.
        propagation: Sources, array and surroundings.
    """

    sampler: Sampler
    reading: GateReading
    channels: Channels
    propagation: Propagation


class DetectedPulses(NamedTuple):
    """Pulses that were detected in one interval, ordered by robot and then by time.

    Attributes:
        robot: Robot that detected each pulse, shape (n_pulses,).
        pulses: The pulses, without directions.
        waveforms_v: Gates after the ADC, shape (n_pulses, n_elements, gate_samples), volts.
        n_rejected: Number of emissions that triggered and were rejected as bursts.
    """

    robot: IntArray
    pulses: PulseBatch
    waveforms_v: FloatArray
    n_rejected: int

    @classmethod
    def room(cls, n_pulses: int, n_elements: int, n_samples: int, n_bands: int) -> Self:
        """Allocate memory for pulses, which `detect` fills in."""
        waveforms_v = np.empty((n_pulses, n_elements, n_samples))
        return cls(np.empty(n_pulses, np.intp), PulseBatch.room(n_pulses, n_elements, n_bands), waveforms_v, 0)

    def first(self, n_pulses: int) -> Self:
        """Copy the first pulses, because the memory is used again."""
        columns: list[Any] = [column[:n_pulses].copy() for column in self.pulses]
        robot, waveforms_v = self.robot[:n_pulses].copy(), self.waveforms_v[:n_pulses].copy()
        return type(self)(robot, PulseBatch(*columns), waveforms_v, self.n_rejected)

    @classmethod
    def join(cls, parts: Sequence[DetectedPulses]) -> Self:
        """Join the pulses of several parts, which must be ordered by robot."""
        return cls(
            robot=np.concatenate([part.robot for part in parts]),
            pulses=PulseBatch.join([part.pulses for part in parts]),
            waveforms_v=np.concatenate([part.waveforms_v for part in parts]),
            n_rejected=sum(part.n_rejected for part in parts),
        )


@compiled_inner
def read_gate(
    gate_v: FloatArray, time_s: float, reading: GateReading, channels: Channels, detected: DetectedPulses, k: int
) -> None:
    """Quantise a gate with the ADC, and compute strengths, variances, clipping and mains phase.

    Args:
        gate_v: Gate before the ADC, shape (n_elements, n_samples).
        time_s: Time of the trigger.
        reading: Parameters of the ADC and of the evaluation.
        channels: State of the channels.
        detected: Filled in.
        k: Row of `detected` to fill in.
    """
    pulses, step_v, highest = detected.pulses, reading.step_v, reading.highest
    pulses.time_s[k] = time_s
    pulses.azimuth_rad[k], pulses.std_rad[k], pulses.misfit[k] = NO_DIRECTION
    pulses.mains_phase_rad[k] = np.mod(2 * np.pi * reading.mains_hz * time_s, 2 * np.pi)
    for e in range(len(gate_v)):
        waveform_v, source_v = detected.waveforms_v[k, e], gate_v[channels.source[e]]
        noise_v2, stuck_v, peak_v = channels.background_v2[e], channels.stuck_v[e], 0.0
        for t in range(waveform_v.size):
            waveform_v[t] = min(max(np.rint(source_v[t] / step_v), -highest), highest) * step_v
            if not np.isnan(stuck_v):
                waveform_v[t] = stuck_v
            peak_v = max(peak_v, abs(waveform_v[t]))
        strength_v = strength_of(dot(waveform_v, waveform_v), waveform_v.size * noise_v2)
        pulses.strengths_v[k, e] = strength_v
        pulses.variance_v2[k, e] = variance_of_strength(
            strength_v, noise_v2, reading.energy_spread, reading.noise_on_pulse
        )
        pulses.is_usable[k, e] = True
        pulses.is_clipped[k, e] = peak_v >= (highest - 0.5) * step_v
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
    held_rng: Held[np.random.Generator],
    emissions: Emissions,
    world_from_array: FloatArray,
    held_detected: Held[DetectedPulses],
    row: int,
) -> tuple[int, int]:
    """Evaluate the gates of those emissions that cause a trigger.

    Args:
        held_state: State of the receiver.
        held_rng: Random generator of noise and triggers.
        emissions: Emissions and false alarms in order of time; the source of a false alarm is `FALSE_ALARM`.
        world_from_array: Pose of the array, shape (4, 4).
        held_detected: Filled in, except for `robot`; must have a free row for each emission.
        row: First free row.

    Returns:
        The next free row, and the number of emissions rejected as bursts.
    """
    sampler, reading, channels, propagation = held_state.value
    rng, detected, (source, time_s, peak_v) = held_rng.value, held_detected.value, emissions
    burst_s, least, n_rejected = propagation.burst_s, np.full(propagation.burst_s.size, np.inf), 0
    gate_v = np.empty(detected.waveforms_v.shape[1:])
    for k in range(source.size):
        s = source[k]
        if s != FALSE_ALARM:
            least[s] = min(least[s], WEAKEST * sampler.trigger.level_v / abs(peak_v[k]))
    ray_paths, (delay_s, amplitude, peak, peak_s) = propagate(least, world_from_array, propagation)
    for k in range(source.size):
        s = source[k]
        if s == FALSE_ALARM:
            sample_false_alarm(sampler, channels, rng, gate_v)
        else:
            of_source = slice(ray_paths.first[s], ray_paths.first[s + 1])
            signal = Signal(peak_v[k], float(burst_s[s]), delay_s[of_source], amplitude[of_source])
            outcome = sample_emission(signal, peak[of_source], peak_s[of_source], sampler, channels, rng, gate_v)
            n_rejected += outcome == IS_BURST
            if outcome != IS_PULSE:
                continue
        read_gate(gate_v, time_s[k], reading, channels, detected, row)
        row += 1
    return row, n_rejected
