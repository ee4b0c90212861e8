"""From what radiates to the readings of what triggers, in one compiled loop over the emissions of a robot's scene."""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import Held, compiled
from dirmusic.pulses.batch import PulseBatch
from sensing.nature.scene import Emissions
from sensing.radio.arrivals import propagate
from sensing.radio.propagation import Propagation
from sensing.receiver.gates import GateParameters, read_gate
from sensing.receiver.sampling.gate import IS_BURST, IS_PULSE, sample_noise, sample_pulse
from sensing.receiver.sampling.sampler import Emission, Sampler, Tones

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


class Converter(NamedTuple):
    """From volts to whole counts.

    Attributes:
        step_v: What a count stands for.
        highest: Largest count, of either sign.
    """

    step_v: float
    highest: float


class Channels(NamedTuple):
    """State of the channels; a row is a reading, each of shape (n_elements,).

    Attributes:
        limit_v: Where the amplifier of a channel saturates; infinite if it does not.
        background_v2: Power of a sample without an emission.
        source: Number of the channel whose samples come as this reading: its own, unless plugs are swapped.
        stuck_v: What the converter says for ever; NaN if it is not stuck.
    """

    limit_v: FloatArray
    background_v2: FloatArray
    source: IntArray
    stuck_v: FloatArray


class Gates(NamedTuple):
    """Gates behind the converter, and what is read from them; a row is a gate.

    Attributes:
        waveforms_v: Shape (n_gates, n_elements, n_samples).
        pulses: Readings.
    """

    waveforms_v: FloatArray
    pulses: PulseBatch

    @classmethod
    def room(cls, n_gates: int, n_elements: int, n_samples: int) -> Self:
        """Room for as many, for a compiled loop to fill in."""
        return cls(np.empty((n_gates, n_elements, n_samples)), PulseBatch.room(n_gates, n_elements))

    def first(self, n_gates: int) -> Self:
        """The first rows."""
        return type(self)(self.waveforms_v[:n_gates], self.pulses.take(slice(0, n_gates)))


class ReceiverChain(NamedTuple):
    """From the feeds of the antennas to readings.

    Attributes:
        sampler: Up to the gate.
        converter: Behind it.
        gate: How it is read.
    """

    sampler: Sampler
    converter: Converter
    gate: GateParameters


class Condition(NamedTuple):
    """What changes with time.

    Attributes:
        tones: Carriers.
        channels: State of the channels.
    """

    tones: Tones
    channels: Channels


@compiled
def convert(gate_v: FloatArray, converter: Converter, channels: Channels, waveform_v: FloatArray) -> None:
    """Whole counts of a gate (n_samples, n_elements), as readings (n_elements, n_samples)."""
    for e in range(waveform_v.shape[0]):
        for t in range(waveform_v.shape[1]):
            counts = np.rint(gate_v[t, channels.source[e]] / converter.step_v)
            waveform_v[e, t] = min(max(counts, -converter.highest), converter.highest) * converter.step_v
            if not np.isnan(channels.stuck_v[e]):
                waveform_v[e, t] = channels.stuck_v[e]


@compiled
def detect(
    robot: int,
    triggering: tuple[Any, ...],
    world_from_array: FloatArray,
    propagation: Held[Propagation],
    receiver: Held[ReceiverChain],
    condition: Held[Condition],
    generator: Held[np.random.Generator],
    found: tuple[Any, ...],
) -> tuple[int, int]:
    """Gates of all that triggers in one robot's receiver.

    Args:
        robot: Row of the robot.
        triggering: Plain `Emissions` of its scene, and times at which noise alone triggers, shape (n_false_alarms,).
        world_from_array: Poses of the arrays, shape (n_robots, 4, 4).
        propagation: Of all robots.
        receiver: Behind its antennas.
        condition: As it is now.
        generator: Draws.
        found: Plain `Gates` with room for all emissions and false alarms; its first rows are filled in.

    Returns:
        How many gates there are, and how many emissions triggered and were rejected as bursts.
    """
    radiated, around, rng = Emissions(*triggering[0]), propagation.value, generator.value
    sampler, converter, gate = receiver.value
    carriers, state = condition.value
    waveforms_v, pulses = found[0], PulseBatch(*found[1])
    gate_v = np.empty((sampler.timing.gate, state.limit_v.size))
    n_found = n_rejected = 0
    if radiated.time_s.size > 0:
        is_emitting = np.zeros(around.sources.burst_s.shape[1], np.bool_)
        for k in range(radiated.time_s.size):
            is_emitting[radiated.source[k]] = True
        ray_paths, arrivals = propagate(robot, is_emitting, world_from_array, around)
        for k in range(radiated.time_s.size):
            s = radiated.source[k]
            first, n_paths = int(ray_paths.first[s]), int(ray_paths.n_paths[s])
            emission = Emission(radiated.peak_v[k], around.sources.burst_s[robot, s], first, n_paths)
            came_as = sample_pulse(
                emission, arrivals, sampler, carriers, state.limit_v, state.background_v2, rng, gate_v
            )
            if came_as == IS_PULSE:
                convert(gate_v, converter, state, waveforms_v[n_found])
                read_gate(waveforms_v[n_found], state.background_v2, radiated.time_s[k], gate, n_found, pulses)
                n_found += 1
            elif came_as == IS_BURST:
                n_rejected += 1
    for time_s in triggering[1]:
        sample_noise(sampler, carriers, rng, gate_v)
        convert(gate_v, converter, state, waveforms_v[n_found])
        read_gate(waveforms_v[n_found], state.background_v2, time_s, gate, n_found, pulses)
        n_found += 1
    return n_found, n_rejected
