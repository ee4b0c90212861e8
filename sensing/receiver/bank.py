"""A bank of receivers: robots with the same receiver that listen at one time; from what radiates to detections."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import Held
from dirmusic.pulses.batch import PulseBatch
from sensing.array.array_table import ArrayTable
from sensing.array.helical_array import HelicalArray
from sensing.nature.scene import Scene
from sensing.radio.propagation import Propagation, SourceTable
from sensing.receiver.config import ReceiverConfig
from sensing.receiver.detection import Channels, Condition, Gates, detect
from sensing.receiver.detections import Detections
from sensing.receiver.false_alarms import FalseAlarms
from sensing.receiver.receiver import Listener, Receiver
from sensing.receiver.sampling.sampler import Tones

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

NO_TIMES = np.empty(0)

LEAST_ROBOTS = 4
"""On one thread: fewer do not pay for it."""


class ReceiverBank:
    """Robots with one make of receiver, each with its own array, scene and generators, in the same surroundings.

    What one robot detects does not depend, to the bit, on how many others there are.

    Args:
        config: Settings of every receiver.
        listeners: The robots, with arrays of one size and pattern, and equally many sources in each scene.
        n_threads: On how many threads they listen.
    """

    def __init__(self, config: ReceiverConfig, listeners: Sequence[Listener], n_threads: int = 1) -> None:
        self.config = config
        self._listeners, self._n_threads = list(listeners), n_threads
        n_robots, scene, n = len(listeners), listeners[0].scene, listeners[0].array.n_elements
        self._receiver = Receiver(config, n)
        self._false_alarms = FalseAlarms(config.false_alarm_rate_hz, n_robots)
        n_sources = len(scene.sources)
        self._propagation = Propagation(
            SourceTable(
                np.empty((n_robots, n_sources, 3)), np.empty((n_robots, n_sources, 3)), np.empty((n_robots, n_sources))
            ),
            ArrayTable.of([listener.array for listener in listeners]),
            scene.surroundings,
        )
        self._held_propagation = Held(self._propagation)
        self._no_tones = Tones(np.empty((0, n)), np.empty((0, n)), np.empty(0))
        self._quiet = Held(self._condition(0.0, self._no_tones))
        self._nothing = Detections(
            np.empty(0, dtype=np.intp), PulseBatch.none(n), np.empty((0, n, config.gate_samples)), 0
        )
        self._chains = [Held(self._receiver.chain(listener.array)) for listener in listeners]
        self._generators = [Held(listener.receiver_rng) for listener in listeners]
        for robot, listener in enumerate(listeners):
            self.replace(robot, listener)

    def replace(self, robot: int, listener: Listener) -> None:
        """Another array, scene and generators for one robot, whose time starts anew."""
        scene, sources = listener.scene, self._propagation.sources
        self._listeners[robot] = listener
        self._propagation.arrays.replace(robot, listener.array)
        self._chains[robot] = Held(self._receiver.chain(listener.array))
        sources.positions_m[robot], sources.axes[robot], sources.burst_s[robot] = (
            scene.positions_m,
            scene.axes,
            scene.burst_s,
        )
        self._generators[robot] = Held(listener.receiver_rng)
        self._false_alarms.restart(robot)

    def listen(
        self, world_from_array: FloatArray, start_s: FloatArray, duration_s: float, rows: IntArray | None = None
    ) -> Detections:
        """Listen for `duration_s`; the intervals of one robot are to follow one another.

        Sources that move, and channels that change, are taken to be as they are at the start (assumed): in 0.1 s,
        traffic moves 1 or 2 m.

        Args:
            world_from_array: Where the arrays really are, shape (n_robots, 4, 4).
            start_s: Simulated time of each robot at the start of the interval, shape (n_robots,).
            duration_s: Length of the interval.
            rows: Which robots listen; None for all.
        """
        robots: list[int] = list(range(len(self._listeners))) if rows is None else rows.tolist()
        starts: list[float] = start_s.tolist()
        propagation = self._held_propagation
        if self.config.faults:
            propagation = Held(self._propagation._replace(arrays=self._arrays_at(start_s)))

        def listen(some: list[int]) -> list[Detections]:
            all_found = (
                self._listen(robot, world_from_array, propagation, starts[robot], duration_s) for robot in some
            )
            return [found for found in all_found if found is not None]

        n_threads = min(self._n_threads, len(robots) // LEAST_ROBOTS)
        if n_threads > 1:
            shares = [part.tolist() for part in np.array_split(robots, n_threads)]
            with ThreadPoolExecutor(n_threads) as pool:
                parts = [found for share in pool.map(listen, shares) for found in share]
        else:
            parts = listen(robots)
        if len(parts) == 1:
            return parts[0]
        return Detections.join(parts) if parts else self._nothing

    def _listen(
        self,
        robot: int,
        world_from_array: FloatArray,
        propagation: Held[Propagation],
        start_s: float,
        duration_s: float,
    ) -> Detections | None:
        """What one robot detects; None if there is nothing."""
        listener = self._listeners[robot]
        scene, rng = listener.scene, listener.receiver_rng
        emissions = scene.emissions(start_s, duration_s, listener.nature_rng)
        false_alarms = self._false_alarms.times_s(robot, start_s, duration_s, rng)
        n = emissions.time_s.size + len(false_alarms)
        if n == 0:
            return None
        if scene.has_movers:
            self._propagation.sources.positions_m[robot] = scene.positions_at(start_s)
        tones, condition, chain = self._no_tones, self._quiet, self._chains[robot]
        if scene.carriers:
            tones = self._receiver.tones(scene.carriers, listener.array, world_from_array[robot])
            chain = Held(self._receiver.chain(listener.array, above_v=float(tones.amplitude_v.sum(axis=0).max())))
        if scene.carriers or self.config.faults:
            condition = Held(self._condition(start_s, tones))
        found = Gates.room(n, self._receiver.n_elements, self.config.gate_samples)
        n_found, n_rejected = detect(
            robot,
            (tuple(emissions), np.array(false_alarms) if false_alarms else NO_TIMES),
            world_from_array,
            propagation,
            chain,
            condition,
            self._generators[robot],
            (found.waveforms_v, tuple(found.pulses)),
        )
        if n_found == 0 and n_rejected == 0:
            return None
        if n_found < n:
            found = found.first(n_found)
        detections = Detections(np.full(n_found, robot), found.pulses, found.waveforms_v, n_rejected)
        return Detections.join([detections]) if false_alarms else detections

    def _condition(self, time_s: float, tones: Tones) -> Condition:
        """That of one receiver at a time."""
        receiver = self._receiver
        limit_v, source, stuck_v = receiver.faults.channels(time_s, self.config.full_scale_v)
        channels = Channels(
            limit_v=limit_v,
            background_v2=receiver.noise_variance_v2 + 0.5 * np.square(tones.amplitude_v).sum(axis=0),
            source=source,
            stuck_v=stuck_v,
        )
        return Condition(tones, channels)

    def _arrays_at(self, time_s: FloatArray) -> ArrayTable:
        """The arrays with what faults have left of their signals."""
        left, arrays = self._receiver.faults.signal_factors(time_s), self._propagation.arrays
        return arrays._replace(gain_factors=arrays.gain_factors * left, gain_offsets=arrays.gain_offsets * left)


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
