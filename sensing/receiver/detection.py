"""From what radiates to the readings of what triggers, in one compiled loop over the emissions of a robot's scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import Held, compiled
from dirmusic.pulses.batch import PulseBatch
from pdpatrol.sensing.nature.scene import Emissions
from pdpatrol.sensing.radio.arrivals import propagate
from pdpatrol.sensing.radio.diffraction.bends import WEAKEST
from pdpatrol.sensing.radio.propagation import Propagation
from pdpatrol.sensing.receiver.gates import GateParameters, read_gate
from pdpatrol.sensing.receiver.sampling.gate import IS_BURST, IS_PULSE, sample_noise, sample_pulse
from pdpatrol.sensing.receiver.sampling.sampler import Emission, Sampler, Tones
from pdpatrol.sensing.receiver.schedule import NOISE

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
    def room(cls, n_gates: int, n_elements: int, n_samples: int, n_bands: int) -> Self:
        """Room for as many, for a compiled loop to fill in."""
        return cls(np.empty((n_gates, n_elements, n_samples)), PulseBatch.room(n_gates, n_elements, n_bands))


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


class Listening(NamedTuple):
    """All that is one robot's own while it listens.

    Attributes:
        chain: Of its receiver.
        condition: Of its channels.
        upcoming: What may trigger, by time; source `NOISE` where noise alone does.
        rng: Draws.
    """

    chain: ReceiverChain
    condition: Condition
    upcoming: Emissions
    rng: np.random.Generator


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
    start_s: float,
    end_s: float,
    first_row: int,
    world_from_array: FloatArray,
    propagation: Held[Propagation],
    listening: Held[Listening],
    gates: Held[Gates],
) -> tuple[int, int]:
    """Gates of all that triggers one robot's receiver within an interval.

    Args:
        robot: Row of the robot.
        start_s: Of the interval.
        end_s: Of the interval.
        first_row: First of `gates` that is free; there are to be as many as may trigger.
        world_from_array: Poses of the arrays, shape (n_robots, 4, 4).
        propagation: Of all robots.
        listening: What is the robot's own.
        gates: Rows are filled in.

    Returns:
        How many gates there are, and how many emissions triggered and were rejected as bursts; if there is no room for
        all that may trigger, nothing is done, and the first is the number of rows that are wanted, negative.
    """
    chain, condition, upcoming, rng = listening.value
    first, last = int(np.searchsorted(upcoming.time_s, start_s)), int(np.searchsorted(upcoming.time_s, end_s))
    if first == last:
        return 0, 0
    waveforms_v, pulses = gates.value
    if first_row + last - first > len(waveforms_v):
        return first - last, 0
    sampler, converter, gate = chain
    tones, channels = condition
    around = propagation.value
    gate_v = np.empty((sampler.timing.gate, channels.limit_v.size))
    faintest = np.full(around.sources.burst_s.shape[1], np.inf)
    for k in range(first, last):
        s = upcoming.source[k]
        if s != NOISE:
            faintest[s] = min(faintest[s], WEAKEST * sampler.trigger.level_v / abs(upcoming.peak_v[k]))
    ray_paths, arrivals = propagate(robot, faintest, world_from_array, around)
    row, n_rejected = first_row, 0
    for k in range(first, last):
        s = upcoming.source[k]
        if s == NOISE:
            sample_noise(sampler, tones, rng, gate_v)
        else:
            n_paths = int(ray_paths.n_paths[s])
            emission = Emission(upcoming.peak_v[k], around.sources.burst_s[robot, s], int(ray_paths.first[s]), n_paths)
            came_as = sample_pulse(
                emission, arrivals, sampler, tones, channels.limit_v, channels.background_v2, rng, gate_v
            )
            if came_as != IS_PULSE:
                n_rejected += came_as == IS_BURST
                continue
        convert(gate_v, converter, channels, waveforms_v[row])
        read_gate(waveforms_v[row], channels.background_v2, upcoming.time_s[k], gate, row, pulses)
        row += 1
    return row - first_row, n_rejected


class Progress(NamedTuple):
    """How far some robots have come that listen one after the other.

    Attributes:
        turn: Whose turn it is next; their number once all are done, or the first for which there is no room.
        n_gates: Rows of gates that are filled.
        n_rejected: Emissions that triggered and were rejected as bursts.
        n_wanted: Rows that the one for whom there is no room wants.
    """

    turn: int
    n_gates: int
    n_rejected: int
    n_wanted: int


@compiled
def detect_each(
    robots: IntArray,
    before: Progress,
    interval_s: FloatArray,
    world_from_array: FloatArray,
    propagation: Held[Propagation],
    listening: Sequence[Held[Listening]],
    gates: Held[Gates],
    n_found: IntArray,
) -> Progress:
    """As `detect`, of some robots, one after the other, in one call: no thread waits for another meanwhile.

    Args:
        robots: Rows of the robots, shape (n,).
        before: How far they had come.
        interval_s: Start and end for each robot, shape (n_robots, 2).
        world_from_array: As of `detect`.
        propagation: As of `detect`.
        listening: What is the robots' own.
        gates: Rows are filled in, those of one robot after those of the other.
        n_found: Becomes the number of gates of each robot, shape (n_robots,).
    """
    n_gates, n_rejected = before.n_gates, before.n_rejected
    for i in range(before.turn, robots.size):
        robot = int(robots[i])
        start_s, end_s = interval_s[robot]
        n, n_bursts = detect(robot, start_s, end_s, n_gates, world_from_array, propagation, listening[robot], gates)
        if n < 0:
            return Progress(i, n_gates, n_rejected, -n)
        n_found[robot] = n
        n_gates, n_rejected = n_gates + n, n_rejected + n_bursts
    return Progress(robots.size, n_gates, n_rejected, 0)
