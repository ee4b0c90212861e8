"""Simulation of many robots, each in its own copy of one yard, on which both environments are built.

A row is a robot. What happens in one row is the same to the bit whatever happens in the others: each row draws from its
own generators, and all results are computed along the row alone.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.bearing.channel_health import ChannelMonitor, SuspectChannel
from dirmusic.compiled import Held, compiled
from dirmusic.pulses.batch import PulseBatch
from pdpatrol.envs.episode import Episode, Generators, ResetOptions
from pdpatrol.envs.motion import N_DRAWS, MotionState, SensorParameters, sense_motion, start_motion
from pdpatrol.envs.observation import SPECTRUM_AZIMUTHS_RAD, ObservationModel, RobotPulses, observation_space, observe
from pdpatrol.envs.progress import REWARD_TERMS, Task, TaskProgress, advance_progress, start_progress
from pdpatrol.envs.scenario import Scenario
from pdpatrol.envs.scenario.base import STEP_S
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.envs.user_code import make_estimator
from pdpatrol.robot_models.antenna_elements import AntennaElements
from pdpatrol.robot_models.readings import LEAST_UPRIGHT, UPRIGHT
from pdpatrol.robot_models.robots import Robots
from pdpatrol.robot_models.sensors import LIDAR_BEAMS
from pdpatrol.sensing.receiver.bank import Listener, ReceiverBank

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Rows = NDArray[np.intp]


class Outcome(NamedTuple):
    """Result of a step or a start, with a row for each robot. Rows that were not stepped or started have no meaning.

    Attributes:
        observation: Observations as vectors, float32, shape (n_robots, n_entries); see `ObservationModel`.
        reward: Shape (n_robots,).
        terminated: Shape (n_robots,).
        truncated: Shape (n_robots,).
        info: Entries of fixed shape by key; see `PatrolEnv`.
        robot: Robot of each pulse, shape (n_pulses,), not decreasing.
        pulses: Pulses of all robots with their bearings.
        suspects: Channels newly found faulty, for each robot.
    """

    observation: NDArray[np.float32]
    reward: FloatArray
    terminated: BoolArray
    truncated: BoolArray
    info: dict[str, NDArray[Any]]
    robot: Rows
    pulses: PulseBatch
    suspects: list[tuple[SuspectChannel, ...]]

    def replaced(self, rows: Rows, other: Outcome) -> Outcome:
        """Return the outcome with some rows taken from another."""

        def mixed(mine: NDArray[Any], others: NDArray[Any]) -> NDArray[Any]:
            mine = mine.copy()
            mine[rows] = others[rows]
            return mine

        mine, others = ~np.isin(self.robot, rows), np.isin(other.robot, rows)
        robot = np.concatenate([self.robot[mine], other.robot[others]])
        order = np.argsort(robot, kind="stable")
        pulses = PulseBatch.join([self.pulses.take(mine), other.pulses.take(others)]).take(order)
        suspects = [(other if row in rows else self).suspects[row] for row in range(len(self.suspects))]
        return Outcome(
            *(mixed(mine, others) for mine, others in zip(self[:4], other[:4], strict=True)),
            info={key: mixed(values, other.info[key]) for key, values in self.info.items()},
            robot=robot[order],
            pulses=pulses,
            suspects=suspects,
        )


class RobotStates(NamedTuple):
    """State of all robots and parameters of their sensors, which compiled functions take by reference."""

    motion: MotionState
    sensors: SensorParameters
    progress: TaskProgress
    task: Task
    observations: ObservationModel
    sources_m: FloatArray
    motion_normal: FloatArray
    lidar_normal: FloatArray
    is_usable: BoolArray
    spectrum_gain: FloatArray


@compiled
def advance_robots(
    held: Held[RobotStates], step_s: float, readings: FloatArray, is_touching: BoolArray, rows: Rows
) -> tuple[FloatArray, BoolArray]:
    """Update motion sensors and progress of some robots; see `sense_motion` and `advance_progress`."""
    state = held.value
    sense_motion(state.motion, state.sensors, readings, state.motion_normal, rows)
    return advance_progress(state.progress, state.task, step_s, readings, state.sources_m, is_touching, rows)


@compiled
def observe_robots(
    held: Held[RobotStates], readings: FloatArray, robot: Rows, strengths_v: FloatArray, azimuth_rad: FloatArray
) -> NDArray[np.float32]:
    """Compute the observations of all robots; see `observe`."""
    state, pulses = held.value, RobotPulses(robot, strengths_v, azimuth_rad)
    return observe(
        state.observations, state.progress, state.motion, readings, state.lidar_normal, state.is_usable,
        state.spectrum_gain, pulses,
    )  # fmt: skip


class Simulation:
    """Episodes of one scenario.

    Args:
        scenario: Scenario of all episodes.
        n_robots: Number of robots.
        n_threads: Number of threads for physics and receivers, 0 for all cores.
        terminate_on_approach: Whether an episode ends once all sources are approached.
        max_episode_steps: Limit on the steps of an episode besides the scenario's time limit.

    Attributes:
        robot: Description of the robots.
        robots: Physics of the robots.
        array: Array as the robots know it.
        estimator: Bearing estimator.
        observation_space: Space of the observations of one robot.
        observations: Layout of the observations as vectors.
        max_episode_steps: Steps after which an episode is truncated.
    """

    def __init__(
        self,
        scenario: Scenario,
        n_robots: int = 1,
        n_threads: int = 1,
        *,
        terminate_on_approach: bool = True,
        max_episode_steps: int | None = None,
    ) -> None:
        self.scenario, yard, task = scenario, scenario.yard, scenario.task
        self.array, self.robot = scenario.known_array, scenario.robot.description
        self.estimator = make_estimator(scenario.estimator.method, self.array)
        nominal = scenario.array.nominal_elements()
        elements = AntennaElements(nominal.positions_m, nominal.boresights_rad, nominal.boresight_elevations_rad)
        self.robots = Robots(self.robot, yard, elements, n_robots, n_threads)
        self.max_episode_steps = math.ceil(min(task.time_limit_s / STEP_S - 1e-6, max_episode_steps or math.inf))
        n_elements, stops_m = self.array.manifold.n_elements, np.array([*scenario.route.stops_m, scenario.route.dock_m])
        self.observation_space = observation_space(yard.size_m, self.robot.limits, n_elements, task.time_limit_s)
        self.observations = ObservationModel.of(
            self.observation_space, stops_m, scenario.lidar.range_std_m, scenario.receiver.noise_v
        )
        self._n_threads = n_threads or os.cpu_count() or 1
        self._surroundings = surroundings_of(yard, second_order=scenario.radio.second_order)
        self._sensors = SensorParameters.of(scenario.pose_sensor, scenario.odometry, scenario.battery, STEP_S)
        self._task = Task(
            stops_m=stops_m,
            standoff_m=task.standoff_m,
            stop_radius_m=task.waypoint_radius_m,
            ends_on_approach=terminate_on_approach,
            reward_per_metre=task.reward_per_metre,
            reward_per_second=task.reward_per_second,
            reward_per_contact_step=task.reward_per_contact_step,
        )
        self._all_rows = np.arange(n_robots)
        self._episodes: list[Episode | None] = [None] * n_robots
        self._generators = [Generators.spawn(np.random.default_rng(0))] * n_robots
        self._monitors = [ChannelMonitor(self.array, self.estimator) for _ in range(n_robots)]
        self._receivers: ReceiverBank | None = None
        self._motion = MotionState.zeros(n_robots)
        self._progress = TaskProgress.at_start(n_robots, len(scenario.sources), len(stops_m))
        self._sources_m = np.zeros((n_robots, len(scenario.sources), 2))
        self._motion_normal, self._lidar_normal = np.zeros((n_robots, N_DRAWS)), np.zeros((n_robots, LIDAR_BEAMS))
        self._usable = np.ones((n_robots, n_elements), dtype=np.bool_)
        self._spectrum_gain = np.empty((n_robots, n_elements, SPECTRUM_AZIMUTHS_RAD.size))
        self._held = Held(
            RobotStates(
                self._motion, self._sensors, self._progress, self._task, self.observations, self._sources_m,
                self._motion_normal, self._lidar_normal, self._usable, self._spectrum_gain,
            )
        )  # fmt: skip

    @property
    def has_begun(self) -> bool:
        """True once every robot has been started."""
        return None not in self._episodes

    def episode(self, row: int) -> Episode:
        """Return the ground truth of a robot's episode."""
        episode = self._episodes[row]
        assert episode is not None, "start first"
        return episode

    def generators(self, row: int) -> Generators:
        """Return the random generators of a robot's episode."""
        return self._generators[row]

    def start(self, rows: Rows, rngs: Sequence[np.random.Generator], options: ResetOptions) -> Outcome:
        """Start new episodes in some rows, each with its generator, and observe them."""
        spawned = [Generators.spawn(rng) for rng in rngs]
        drawn = [Episode.draw(self.scenario, self._surroundings, each, options) for each in spawned]
        for row, generators, episode in zip(rows.tolist(), spawned, drawn, strict=True):
            self._episodes[row], self._generators[row] = episode, generators
            self._monitors[row] = ChannelMonitor(self.array, self.estimator)
            self._sources_m[row] = np.array([s.position_m[:2] for s in episode.sources]).reshape(-1, 2)
            if self._receivers is not None:
                self._receivers.replace(row, _listener(episode, generators))
        if self._receivers is None:
            episodes = [episode or drawn[0] for episode in self._episodes]
            listeners = [_listener(*pair) for pair in zip(episodes, self._generators, strict=True)]
            self._receivers = ReceiverBank(self.scenario.receiver, listeners, self._n_threads)
        self._usable[rows] = True
        self._spectrum_gain[rows] = self._unit_gain(np.ones(self.array.manifold.n_elements))
        self.robots.reset(rows, [episode.start_pose for episode in drawn])
        self._draw_noise(rows)
        readings = self.robots.readings.values
        start_motion(self._motion, self._sensors, readings, self._motion_normal, rows)
        start_progress(self._progress, self._task, readings, self._sources_m, rows)
        for row in rows.tolist():
            rng = self._generators[row].motion
            self._motion.draw_odometry(row, self.scenario.odometry, self.robot.wheel_radius_m, rng)
        n, receiver = len(self._all_rows), self.scenario.receiver
        no_pulses = PulseBatch.none(self.array.manifold.n_elements, receiver.n_bands)
        return self._outcome(
            np.zeros((len(REWARD_TERMS), n)), np.zeros(n, dtype=np.bool_), self._all_rows[:0], no_pulses, [()] * n
        )

    def step(self, commands: FloatArray, rows: Rows | None = None) -> Outcome:
        """Drive some robots for 0.1 s and listen.

        Args:
            commands: Speeds, m/s, and yaw rates, rad/s, shape (n_robots, 2).
            rows: Robots that drive; None for all. For the others no time passes.
        """
        assert self._receivers is not None, "start first"
        start_s = self._motion.time_s.copy()
        self.robots.drive(commands[:, 0], commands[:, 1], STEP_S, rows)
        driven = self._all_rows if rows is None else rows
        self._draw_noise(driven)
        readings, is_touching = self.robots.readings, self.robots.is_touching
        reward, is_done = advance_robots(self._held, STEP_S, readings.values, is_touching, driven)
        found = self._receivers.listen(readings.world_from_base, start_s, STEP_S, rows)
        pulses, suspects = self._find_directions(found.robot, found.pulses)
        return self._outcome(reward, is_done, found.robot, pulses, suspects)

    def _draw_noise(self, rows: Rows) -> None:
        for row in rows.tolist():
            self._generators[row].motion.standard_normal(out=self._motion_normal[row])
            self._generators[row].lidar.standard_normal(out=self._lidar_normal[row])

    def _find_directions(
        self, robot: Rows, detected: PulseBatch
    ) -> tuple[PulseBatch, list[tuple[SuspectChannel, ...]]]:
        """Estimate bearings of all pulses from usable channels, and find channels newly faulty for each robot."""
        suspects: list[tuple[SuspectChannel, ...]] = [()] * len(self._monitors)
        pulses = self.estimator(detected, self.array).attached_to(detected)
        for row, own in _slices(robot):
            monitor = self._monitors[row]
            if monitor.n_bad:
                renewed, suspects[row] = monitor.watch(pulses.take(own))
            else:
                suspects[row] = monitor.note(pulses, own)
                if not suspects[row]:
                    continue
                renewed = monitor.bearings(pulses.take(own))
            for column, values in zip(pulses, renewed, strict=True):
                column[own] = values
            self._usable[row] = monitor.good
            self._spectrum_gain[row] = self._unit_gain(monitor.good)
        return pulses, suspects

    def _unit_gain(self, good: NDArray[Any]) -> FloatArray:
        """Return the gains of the good channels (n_elements,) towards the observed azimuths, scaled to unit norm."""
        gain = self.array.manifold.gain(SPECTRUM_AZIMUTHS_RAD) * good[:, np.newaxis]
        return gain / np.linalg.norm(gain, axis=0)

    def _outcome(
        self,
        reward: FloatArray,
        is_done: BoolArray,
        robot: Rows,
        pulses: PulseBatch,
        suspects: list[tuple[SuspectChannel, ...]],
    ) -> Outcome:
        motion, progress, readings = self._motion, self._progress, self.robots.readings.values
        observation = observe_robots(self._held, readings, robot, pulses.strengths_v, pulses.azimuth_rad).T
        fell_over = readings[:, UPRIGHT] < LEAST_UPRIGHT
        info = {
            "time_s": motion.time_s.copy(),
            "believed_pose": motion.pose.copy(),
            "odometry": motion.odometry.copy(),
            "battery": motion.battery.copy(),
            **{f"reward_{term}": values for term, values in zip(REWARD_TERMS, reward, strict=True)},
            "touched": self.robots.is_touching.copy(),
            "fell_over": fell_over,
            "success": progress.success.copy(),
            "is_success": progress.success.copy(),
            "approached": progress.approached.copy(),
            "waypoints_visited": progress.visited[:, :-1].copy(),
            "true_pose": self.robots.readings.pose.copy(),
        }
        return Outcome(
            observation=observation,
            reward=reward[0] + reward[1] + reward[2],
            terminated=is_done | fell_over,
            truncated=motion.n_steps >= self.max_episode_steps,
            info=info,
            robot=robot,
            pulses=pulses,
            suspects=suspects,
        )


def _slices(robot: Rows) -> Iterator[tuple[int, slice]]:
    """Yield each robot and the slice of its pulses, from the robots of pulses in order."""
    start = 0
    for row, pulses in groupby(robot.tolist()):
        end = start + len(list(pulses))
        yield row, slice(start, end)
        start = end


def _listener(episode: Episode, generators: Generators) -> Listener:
    return Listener(
        array=episode.array, scene=episode.scene, nature_rng=generators.nature, receiver_rng=generators.receiver
    )
