"""A bank of receivers: robots with the same receiver that listen at one time; from what radiates to detections."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import Held, held_list, replace_in
from dirmusic.pulses.batch import PulseBatch
from pdpatrol.sensing.array.array_table import ArrayTable
from pdpatrol.sensing.array.helical_array import HelicalArray
from pdpatrol.sensing.nature.scene import Scene
from pdpatrol.sensing.nature.sources import in_nanoseconds
from pdpatrol.sensing.radio.propagation import Propagation, SourceTable
from pdpatrol.sensing.receiver.config import ReceiverConfig
from pdpatrol.sensing.receiver.detection import (
    Channels,
    Condition,
    Gates,
    Listening,
    Progress,
    ReceiverChain,
    detect_each,
)
from pdpatrol.sensing.receiver.detections import Detections
from pdpatrol.sensing.receiver.receiver import Listener, Receiver
from pdpatrol.sensing.receiver.sampling.sampler import Tones
from pdpatrol.sensing.receiver.schedule import Schedule

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

LEAST_ROBOTS = 4
"""On one thread: fewer do not pay for it."""

LEAST_ROOM = 64
"""Gates that there is room for at first."""


NOT_BEGUN = Progress(0, 0, 0, 0)


class Interval(NamedTuple):
    """What all robots share while they listen.

    Attributes:
        world_from_array: Poses of the arrays, shape (n_robots, 4, 4).
        start_s: Simulated time of each robot.
        duration_s: Of the interval.
        propagation: Sources and arrays, and what surrounds them.
    """

    world_from_array: FloatArray
    start_s: list[float]
    duration_s: float
    propagation: Held[Propagation]


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
        self._listeners, self._all = list(listeners), np.arange(len(listeners))
        n_robots, scene, n = len(listeners), listeners[0].scene, listeners[0].array.n_elements
        self._receiver = Receiver(config, n)
        shape = n_robots, len(scene.sources)
        self._propagation = Propagation(
            SourceTable(np.empty((*shape, 3)), np.empty((*shape, 3)), np.empty(shape)),
            ArrayTable.of([listener.array for listener in listeners], self._receiver.grid(listeners[0].array)),
            scene.surroundings,
        )
        self._held_propagation = Held(self._propagation)
        self._nothing = Detections(
            np.empty(0, dtype=np.intp), PulseBatch.none(n, config.n_bands), np.empty((0, n, config.gate_samples)), 0
        )
        self._no_tones = Tones(np.empty((0, n)), np.empty((0, n)), np.empty(0))
        self._quiet = self._condition(0.0, self._no_tones)
        self._schedules: dict[int, Schedule] = {}
        self._changes: dict[int, bool] = {}
        self._chains: dict[int, ReceiverChain] = {}
        self._gates = [Held(Gates.room(LEAST_ROOM, n, config.gate_samples, config.n_bands)) for _ in range(n_threads)]
        self._pool: ThreadPoolExecutor | None = None
        self._interval_s, self._n_found = np.empty((n_robots, 2)), np.empty(n_robots, dtype=np.intp)
        for robot, listener in enumerate(listeners):
            self._replace(robot, listener)
        self._own_of = [self._own(robot, self._quiet) for robot in range(n_robots)]
        self._listening = held_list(self._own_of)

    def replace(self, robot: int, listener: Listener) -> None:
        """Another array, scene and generators for one robot, whose time starts anew."""
        self._replace(robot, listener)
        self._take_in(robot, self._quiet)

    def _replace(self, robot: int, listener: Listener) -> None:
        scene, sources = listener.scene, self._propagation.sources
        self._listeners[robot] = listener
        self._schedules[robot] = Schedule(
            scene, self.config.false_alarm_rate_hz, listener.nature_rng, listener.receiver_rng
        )
        self._changes[robot] = scene.has_movers or bool(scene.carriers) or bool(self.config.faults)
        self._propagation.arrays.replace(robot, listener.array)
        self._chains[robot] = self._receiver.chain(listener.array)
        sources.positions_m[robot], sources.axes[robot] = scene.positions_m, scene.axes
        sources.burst_s[robot] = scene.burst_s

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
        robots = self._all if rows is None else rows
        interval = Interval(world_from_array, start_s.tolist(), duration_s, self._held_propagation)
        if self.config.faults:
            interval = interval._replace(propagation=Held(self._propagation._replace(arrays=self._arrays_at(start_s))))
        n_threads = min(len(self._gates), robots.size // LEAST_ROBOTS)
        if n_threads <= 1:
            return self._listen(0, robots, interval)
        first, *others = np.array_split(robots, n_threads)
        if self._pool is None:
            self._pool = ThreadPoolExecutor(len(self._gates) - 1)
        waiting = [self._pool.submit(self._listen, k + 1, share, interval) for k, share in enumerate(others)]
        return Detections.join([self._listen(0, first, interval), *(each.result() for each in waiting)])

    def __getstate__(self) -> dict[str, Any]:
        """A copy starts threads of its own."""
        return vars(self) | {"_pool": None, "_listening": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """As it was."""
        vars(self).update(state | {"_listening": held_list(state["_own_of"])})

    def _listen(self, thread: int, robots: IntArray, interval: Interval) -> Detections:
        """What some robots detect, one after the other."""
        numbers: list[int] = robots.tolist()
        for robot in numbers:
            start_s = in_nanoseconds(interval.start_s[robot])
            end_s = in_nanoseconds(interval.start_s[robot] + interval.duration_s)
            self._interval_s[robot] = start_s, end_s
            if self._changes[robot] or not self._schedules[robot].reaches(start_s, end_s):
                self._prepare(robot, start_s, end_s, interval)
        shared = self._interval_s, interval.world_from_array, interval.propagation, self._listening
        done = NOT_BEGUN
        while done.turn < robots.size:
            done = detect_each(robots, done, *shared, self._gates[thread], self._n_found)
            if done.n_wanted:
                n_gates = 2 * (done.n_gates + done.n_wanted)
                self._gates[thread] = self._more_room(self._gates[thread].value, done.n_gates, n_gates)
        if done.n_gates == 0:
            return self._nothing._replace(n_rejected=done.n_rejected)
        found = self._gates[thread].value
        n, n_rejected = done.n_gates, done.n_rejected
        whose = np.full(n, numbers[0]) if len(numbers) == 1 else np.repeat(robots, self._n_found[robots])
        return Detections(whose, found.pulses.first(n), found.waveforms_v[:n].copy(), n_rejected)

    def _prepare(self, robot: int, start_s: float, end_s: float, interval: Interval) -> None:
        """Draw what may trigger a receiver, and let what changes with time be as it is now."""
        schedule, listener = self._schedules[robot], self._listeners[robot]
        scene, tones = listener.scene, self._no_tones
        if not schedule.reaches(start_s, end_s):
            schedule.draw(start_s, end_s)
        if scene.has_movers:
            self._propagation.sources.positions_m[robot] = scene.positions_at(start_s)
        if scene.carriers:
            tones = self._receiver.tones(scene.carriers, listener.array, interval.world_from_array[robot])
        changes = scene.carriers or self.config.faults
        self._take_in(robot, self._condition(start_s, tones) if changes else self._quiet)

    def _take_in(self, robot: int, condition: Condition) -> None:
        """Let a robot listen with what is its own now."""
        self._own_of[robot] = self._own(robot, condition)
        replace_in(self._listening, robot, self._own_of[robot])

    def _own(self, robot: int, condition: Condition) -> Held[Listening]:
        """All that is one robot's own."""
        listener, chain, tones_v = self._listeners[robot], self._chains[robot], condition.tones.amplitude_v
        if len(tones_v):
            chain = self._receiver.chain(listener.array, above_v=float(tones_v.sum(axis=0).max()))
        return Held(Listening(chain, condition, self._schedules[robot].ahead, listener.receiver_rng))

    def _more_room(self, gates: Gates, n_filled: int, n_gates: int) -> Held[Gates]:
        """Room for so many gates, the first of which are as they are."""
        more = Gates.room(n_gates, self._receiver.n_elements, self.config.gate_samples, self.config.n_bands)
        more.waveforms_v[:n_filled] = gates.waveforms_v[:n_filled]
        for column, filled in zip(more.pulses, gates.pulses, strict=True):
            column[:n_filled] = filled[:n_filled]
        return Held(more)

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
