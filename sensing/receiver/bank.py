"""Bank of receivers: detection of pulses by several robots at the same time."""

from bisect import bisect_left
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dirmusic.array.pattern import tabulate
from dirmusic.arrays import FloatArray, IntArray
from dirmusic.compiled import Held
from pdpatrol.sensing.array.array_table import ArrayTable
from pdpatrol.sensing.array.helical_array import HelicalArray
from pdpatrol.sensing.nature.sources import Emissions, Scene
from pdpatrol.sensing.radio.arrivals import Propagation
from pdpatrol.sensing.receiver.config import ReceiverConfig
from pdpatrol.sensing.receiver.detection import FALSE_ALARM, DetectedPulses, ReceiverState, detect
from pdpatrol.sensing.receiver.faults import ChannelFault, signal_factors
from pdpatrol.sensing.receiver.receiver import Receiver

AHEAD_S = 10.0
"""Time span for which emissions are drawn at once; the cost of a draw hardly depends on the number of emissions."""

LEAST_ROBOTS = 4
"""Minimum number of robots per thread; with fewer, the overhead of a thread is not worth it."""

NO_EMISSIONS = Emissions(np.empty(0, dtype=np.intp), np.empty(0), np.empty(0))


@dataclass(kw_only=True)
class Listener:
    """One robot of a bank, with emissions and false alarms that are drawn in advance.

    Attributes:
        array: Array as built.
        scene: Sources and surroundings.
        nature_rng: Generator of the emissions.
        receiver_rng: Generator of noise and triggers.
        faults: Faults of the channels.
        drift_db_per_min: Drift of the gain of each channel, shape (n_elements,); None without drift.
    """

    array: HelicalArray
    scene: Scene
    nature_rng: np.random.Generator
    receiver_rng: np.random.Generator
    faults: Sequence[ChannelFault] = ()
    drift_db_per_min: FloatArray | None = None
    _drawn: Emissions = field(default=NO_EMISSIONS, init=False)
    _first_s: float = field(default=0.0, init=False)
    _last_s: float = field(default=0.0, init=False)

    def emissions(self, start_s: float, end_s: float, false_alarm_rate_hz: float) -> Emissions:
        """Return the emissions and false alarms of an interval, in order of time.

        Intervals normally follow one another; after a gap or a step back in time, new emissions are drawn.

        Args:
            start_s: Start of the interval.
            end_s: End of the interval.
            false_alarm_rate_hz: Mean rate of the Poisson process of triggers by noise alone.
        """
        if not self._first_s <= start_s <= self._last_s:
            self._drawn, self._first_s, self._last_s = NO_EMISSIONS, start_s, start_s
        if end_s > self._last_s:
            rng, duration_s = self.receiver_rng, max(AHEAD_S, end_s - self._last_s)
            false_s = self._last_s + duration_s * rng.random(rng.poisson(false_alarm_rate_hz * duration_s))
            drawn = self.scene.draw(self._last_s, duration_s, self.nature_rng)
            false = Emissions(np.full(false_s.size, FALSE_ALARM), false_s, np.zeros(false_s.size))
            kept = self._drawn.take(self._drawn.time_s >= start_s)
            columns: list[Any] = [np.concatenate(column) for column in zip(kept, drawn, false, strict=True)]
            joined = Emissions(*columns)
            self._drawn = joined.take(joined.time_s.argsort(kind="stable"))
            self._first_s, self._last_s = start_s, round(self._last_s + duration_s, 9)
        time_s = self._drawn.time_s
        return self._drawn.take(slice(bisect_left(time_s, start_s), bisect_left(time_s, end_s)))


class ReceiverBank:
    """Robots with identically configured receivers, each with its own array, scene and generators.

    The pulses of one robot are bit-identical whatever the other robots do.

    Args:
        config: Configuration of all receivers.
        listeners: The robots; their arrays must have the same number of elements and the same pattern.
        n_threads: Number of threads.
    """

    def __init__(self, config: ReceiverConfig, listeners: Sequence[Listener], n_threads: int = 1) -> None:
        array = listeners[0].array
        self._receiver, self._n_threads = Receiver(config, array.n_elements), n_threads
        self._reading, self._grid = self._receiver.reading(), self._receiver.grid(array)
        self._pattern = tabulate(array.cut())
        self._listeners, self._states = list(listeners), [self._state(listener) for listener in listeners]
        self._rngs = [Held(listener.receiver_rng) for listener in listeners]
        self._found = [self._room(64) for _ in range(n_threads)]
        self._pool: ThreadPoolExecutor | None = None

    def replace(self, robot: int, listener: Listener) -> None:
        """Replace array, scene and generators of one robot, and restart its time."""
        self._listeners[robot], self._states[robot] = listener, self._state(listener)
        self._rngs[robot] = Held(listener.receiver_rng)

    def listen(
        self, world_from_array: FloatArray, start_s: FloatArray, duration_s: float, rows: IntArray | None = None
    ) -> DetectedPulses:
        """Return the pulses detected in one interval; the intervals of each robot must follow one another.

        Assumed: moving sources and changing channels keep their state at the start of the interval; in 0.1 s, traffic
        moves 1 or 2 m.

        Args:
            world_from_array: True poses of the arrays, shape (n_robots, 4, 4).
            start_s: Simulated time of each robot at the start of the interval, shape (n_robots,).
            duration_s: Duration of the interval.
            rows: Indices of the robots to simulate, ascending; None for all.
        """
        robots = np.arange(len(self._listeners)) if rows is None else rows
        n_jobs = min(self._n_threads, robots.size // LEAST_ROBOTS)
        if n_jobs < 2:
            return self._listen(0, robots, world_from_array, start_s, duration_s)
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self._n_threads - 1)  # besides this thread, which works instead of waiting
        jobs = [
            (k, share, world_from_array, start_s, duration_s) for k, share in enumerate(np.array_split(robots, n_jobs))
        ]
        others = [self._pool.submit(self._listen, *job) for job in jobs[1:]]
        return DetectedPulses.join([self._listen(*jobs[0]), *(other.result() for other in others)])

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without the threads; a copy starts its own."""
        return vars(self) | {"_pool": None}

    def _listen(
        self, thread: int, robots: IntArray, world_from_array: FloatArray, start_s: FloatArray, duration_s: float
    ) -> DetectedPulses:
        """Return the pulses that some robots detect, computed on one thread."""
        updated = [
            (robot, self._update(robot, world_from_array[robot], float(start_s[robot]), duration_s))
            for robot in robots.tolist()
        ]
        n_emissions = sum(due.time_s.size for _, due in updated)
        if n_emissions > self._found[thread].value.robot.size:
            self._found[thread] = self._room(2 * n_emissions)
        held, row, n_rejected = self._found[thread], 0, 0
        for robot, due in updated:
            if due.time_s.size:
                first, state, rng = row, self._states[robot], self._rngs[robot]
                row, n = detect(state, rng, due, world_from_array[robot], held, first)
                held.value.robot[first:row] = robot
                n_rejected += n
        return held.value.first(row)._replace(n_rejected=n_rejected)

    def _room(self, n_pulses: int) -> Held[DetectedPulses]:
        config = self._receiver.config
        return Held(DetectedPulses.room(n_pulses, self._receiver.n_elements, config.gate_samples, config.n_bands))

    def _state(self, listener: Listener) -> Held[ReceiverState]:
        """Return the state of a robot's receiver at time 0, without carriers."""
        receiver, scene, array = self._receiver, listener.scene, listener.array
        table, positions_m = ArrayTable.of(array, self._pattern, *self._grid), scene.positions_m.copy()
        return Held(
            ReceiverState(
                sampler=receiver.sampler(array),
                reading=self._reading,
                channels=receiver.channels(0.0, (), (), array, np.eye(4)),
                propagation=Propagation(positions_m, scene.axes, scene.burst_s, table, scene.surroundings),
            )
        )

    def _update(self, robot: int, world_from_array: FloatArray, start_s: float, duration_s: float) -> Emissions:
        """Update what depends on the time and pose of a robot, and return its emissions in an interval."""
        receiver, listener, state = self._receiver, self._listeners[robot], self._states[robot].value
        scene, array, faults, config = listener.scene, listener.array, listener.faults, receiver.config
        start_s, end_s = round(start_s, 9), round(start_s + duration_s, 9)
        if scene.has_movers:
            state.propagation.positions_m[:] = scene.positions_at(start_s)
        if faults or listener.drift_db_per_min is not None:
            factors = signal_factors(faults, listener.drift_db_per_min, array.n_elements, start_s)
            table = state.propagation.array
            table.gain_factors[:] = array.gain_factors * factors
            table.gain_offsets[:] = array.gain_offsets * factors
        if scene.carriers or faults:
            channels = receiver.channels(start_s, scene.carriers, faults, array, world_from_array)
            sampler = state.sampler
            if scene.carriers:  # the trigger level must be above them
                level_v = receiver.threshold_v + float(channels.tone_v.sum(axis=0).max())
                sampler = sampler._replace(trigger=receiver.front_end.trigger(config.noise_v, level_v))
            self._states[robot] = Held(state._replace(channels=channels, sampler=sampler))
        return listener.emissions(start_s, end_s, config.false_alarm_rate_hz)


def listen_once(
    config: ReceiverConfig,
    array: HelicalArray,
    scene: Scene,
    rng: np.random.Generator,
    *,
    world_from_array: FloatArray,
    duration_s: float,
    start_s: float = 0.0,
    faults: Sequence[ChannelFault] = (),
) -> DetectedPulses:
    """Return the pulses that one receiver detects at one pose.

    Args:
        config: Configuration of the receiver.
        array: Array as built.
        scene: Sources and surroundings.
        rng: Generator of all random numbers.
        world_from_array: True pose of the array, shape (4, 4).
        duration_s: Duration of the interval.
        start_s: Simulated time at the start of the interval.
        faults: Faults of the channels.
    """
    listener = Listener(array=array, scene=scene, nature_rng=rng, receiver_rng=rng, faults=faults)
    bank = ReceiverBank(config, [listener])
    return bank.listen(world_from_array[np.newaxis], np.array([start_s]), duration_s)
