"""A bank of receivers: robots with the same receiver that listen at one time; from what radiates to detections."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import plain
from dirmusic.pulses.batch import PulseBatch
from sensing.array.array_table import ArrayTable
from sensing.array.helical_array import HelicalArray
from sensing.nature.scene import Scene
from sensing.radio.incoming import EmittedPulses
from sensing.radio.propagation import SourceTable
from sensing.receiver.config import ReceiverConfig
from sensing.receiver.detections import Detections
from sensing.receiver.energy_law import EnergyLaw
from sensing.receiver.false_alarms import FalseAlarms, false_alarm_gates
from sensing.receiver.receiver import Listener, Receiver
from sensing.receiver.waveform_law import WaveformLaw

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


class DetectionLaw(Protocol):
    """How gates come about: by their energies, or sample by sample."""

    def detect(
        self, emitted: EmittedPulses, propagation: tuple[Any, ...], listeners: Sequence[Listener]
    ) -> list[Detections]:
        """Detections of emitted pulses.

        Args:
            emitted: The pulses, robot by robot.
            propagation: A plain `Propagation`, a row for each listener.
            listeners: All robots.
        """
        ...

    def detect_noise(
        self, robot: int, time_s: FloatArray, gates_v: FloatArray, listener: Listener, world_from_array: FloatArray
    ) -> Detections:
        """Detections of gates that noise alone triggered.

        Args:
            robot: Number of the robot.
            time_s: Times of the false alarms, shape (n_gates,).
            gates_v: Noise in the gates, shape (n_gates, n_elements, gate_samples).
            listener: The robot's array, scene and randomness.
            world_from_array: Where the array really is, shape (4, 4).
        """
        ...


class ReceiverBank:
    """Robots with one make of receiver, each with its own array, scene and generators, in the same surroundings.

    What one robot detects does not depend, to the bit, on how many others there are.

    Args:
        config: Settings of every receiver.
        listeners: The robots, with arrays of one size and pattern, and equally many sources in each scene.
    """

    def __init__(self, config: ReceiverConfig, listeners: Sequence[Listener]) -> None:
        self.config = config
        self._listeners = list(listeners)
        n_robots, scene = len(listeners), listeners[0].scene
        self._receiver = Receiver(config, listeners[0].array.n_elements)
        self._law: DetectionLaw = (EnergyLaw if config.fidelity == "energy" else WaveformLaw)(self._receiver)
        self._false_alarms = FalseAlarms(config.false_alarm_rate_hz, n_robots)
        self._arrays = ArrayTable.of([listener.array for listener in listeners])
        n_sources = len(scene.sources)
        self._sources = SourceTable(np.empty((n_robots, n_sources, 3)), np.empty((n_robots, n_sources)))
        self._plain_arrays, self._plain_sources = plain(self._arrays), tuple(self._sources)
        self._surroundings = plain(scene.surroundings)
        for robot, listener in enumerate(listeners):
            self.replace(robot, listener)

    def replace(self, robot: int, listener: Listener) -> None:
        """Another array, scene and generators for one robot, whose time starts anew."""
        self._listeners[robot] = listener
        self._arrays.replace(robot, listener.array)
        self._sources.positions_m[robot], self._sources.burst_s[robot] = (
            listener.scene.positions_m,
            listener.scene.burst_s,
        )
        self._false_alarms.restart(robot)

    def listen(
        self, world_from_array: FloatArray, start_s: FloatArray, duration_s: float, rows: IntArray | None = None
    ) -> Detections:
        """Listen for `duration_s`; the intervals of one robot are to follow one another.

        Sources that move are taken to stand where they are at the start (assumed): in 0.1 s, traffic moves 1 or 2 m.

        Args:
            world_from_array: Where the arrays really are, shape (n_robots, 4, 4).
            start_s: Simulated time of each robot at the start of the interval, shape (n_robots,).
            duration_s: Length of the interval.
            rows: Which robots listen; None for all.
        """
        robots: list[int] = list(range(len(self._listeners))) if rows is None else rows.tolist()
        starts: list[float] = start_s.tolist()
        listeners = self._listeners
        parts: list[Detections] = []
        emissions = [listeners[k].scene.emissions(starts[k], duration_s, listeners[k].nature_rng) for k in robots]
        for k in robots:
            if listeners[k].scene.has_movers:
                self._sources.positions_m[k] = listeners[k].scene.positions_at(starts[k])
            time_s = self._false_alarms.times_s(k, starts[k], duration_s, listeners[k].receiver_rng)
            if time_s:
                gates_v = false_alarm_gates(self._receiver, len(time_s), listeners[k].receiver_rng)
                noise = self._law.detect_noise(k, np.array(time_s), gates_v, listeners[k], world_from_array[k])
                parts.append(noise)
        emitted = EmittedPulses.join(robots, emissions)
        if emitted.time_s.size:
            arrays = plain(self._arrays_at(start_s)) if self.config.faults else self._plain_arrays
            propagation = (self._plain_sources, world_from_array, arrays, self._surroundings)
            parts += self._law.detect(emitted, propagation, listeners)
        if len(parts) == 1:
            return parts[0]
        return Detections.join(parts) if parts else self._nothing

    def _arrays_at(self, time_s: FloatArray) -> ArrayTable:
        """The arrays with what faults have left of their signals."""
        left, arrays = self._receiver.faults.signal_factors(time_s), self._arrays
        return arrays._replace(gain_factors=arrays.gain_factors * left, gain_offsets=arrays.gain_offsets * left)

    @cached_property
    def _nothing(self) -> Detections:
        """What most intervals give."""
        n_samples = self.config.gate_samples if self.config.fidelity == "waveform" else 0
        nobody, n_elements = np.empty(0, dtype=np.intp), self._receiver.n_elements
        return Detections(nobody, PulseBatch.none(n_elements), np.empty((0, n_elements, n_samples)), 0)


def listen_once(
    config: ReceiverConfig,
    array: HelicalArray,
    scene: Scene,
    rng: np.random.Generator,
    *,
    world_from_array: FloatArray,
    duration_s: float,
    start_s: float = 0.0,
) -> Detections:
    """What one receiver detects from one pose.

    Args:
        config: Settings of the receiver.
        array: The array as it was really built.
        scene: All that radiates, and what stands about.
        rng: All randomness.
        world_from_array: Where the array really is, shape (4, 4).
        duration_s: Length of the interval.
        start_s: Simulated time at its start.
    """
    bank = ReceiverBank(config, [Listener(array=array, scene=scene, nature_rng=rng, receiver_rng=rng)])
    return bank.listen(world_from_array[np.newaxis], np.array([start_s]), duration_s)
