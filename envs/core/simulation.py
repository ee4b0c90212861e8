"""Simulation: episodes side by side, each a robot in its own copy of one yard; both environments are made of them.

What happens in one row is the same to the bit whatever the others do: each row draws from its own generator, and all
that is computed for it is computed along the row alone.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.bearing.channel_health import ChannelMonitor, SuspectChannel
from dirmusic.compiled import Held
from dirmusic.pulses.batch import PulseBatch
from pdpatrol.envs.core.arguments import Fixed
from pdpatrol.envs.core.episode import Episode
from pdpatrol.envs.core.generators import Generators
from pdpatrol.envs.core.motion import N_DRAWS, Motion, SensorParameters
from pdpatrol.envs.core.observation_layout import SPECTRUM_AZIMUTHS_RAD, ObservationLayout, observation_bounds
from pdpatrol.envs.core.observing import ObservationParameters, Observing, Sensed, perceive
from pdpatrol.envs.core.progress import Progress, Stepping, StepResult, Task, advance
from pdpatrol.envs.scenario import Scenario
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.envs.user_code import make_estimator
from pdpatrol.robot_models.antenna_elements import AntennaElements
from pdpatrol.robot_models.robots import Robots
from pdpatrol.robot_models.sensors import LIDAR_BEAMS, LIDAR_RANGE_M
from pdpatrol.sensing.receiver.bank import DetectedPulses, Listener, ReceiverBank

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Rows = NDArray[np.intp]

STEP_S = 0.1
"""Control step: 10 Hz."""

NO_ROWS = np.empty(0, dtype=np.intp)


class Outcome(NamedTuple):
    """What a step led to; rows are robots.

    Attributes:
        observation: All entries of the observation, float32, shape (n_robots, n_entries); see `ObservationLayout`.
        reward: Terms in the order of `REWARD_TERMS`, shape (3, n_robots).
        terminated: Whether the episode is over, shape (n_robots,).
        fell_over: Whether that is because the robot did, shape (n_robots,).
        truncated: Whether its time is, shape (n_robots,).
        robot: Whose each pulse is, shape (n_pulses,).
        pulses: All pulses with their directions, robot by robot.
        suspects: Channels newly found at fault, for each robot.
    """

    observation: NDArray[np.float32]
    reward: FloatArray
    terminated: BoolArray
    fell_over: BoolArray
    truncated: BoolArray
    robot: Rows
    pulses: PulseBatch
    suspects: list[tuple[SuspectChannel, ...]]


class Simulation:
    """Episodes of one scenario.

    Args:
        scenario: What to run.
        n_robots: How many episodes.
        n_threads: On how many threads the physics runs and receivers listen; 0 for all cores.
        terminate_on_approach: Whether an episode ends once all sources are approached.
        max_episode_steps: After how many steps time is up at the latest; None for the scenario's time limit alone.

    Attributes:
        robot: What each robot is.
        robots: All of them.
        array: The array's data sheet and how far real ones spread about it: what the robot knows.
        estimator: Takes the bearings.
        layout: Of the observations: bounds and places of their entries.
        motion: What the robots know of their motion, live: it changes with the next step.
        progress: What the episodes have come to, live as well.
        max_episode_steps: How many steps an episode has at most.
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
        self.scenario = scenario
        yard, self.array = scenario.yard, scenario.known_array
        self.estimator = make_estimator(scenario.estimator.method, self.array)
        self.robot = scenario.robot.description
        nominal = scenario.array.nominal_elements()
        elements = AntennaElements.checked(
            nominal.positions_m, nominal.boresights_rad, nominal.boresight_elevations_rad
        )
        self.robots = Robots(self.robot, yard, elements, n_robots, n_threads)
        self._n_threads = n_threads or os.cpu_count() or 1
        self._surroundings = surroundings_of(yard, second_order=scenario.radio.second_order)
        self._spectrum_gain = np.empty((n_robots, self.array.manifold.n_elements, SPECTRUM_AZIMUTHS_RAD.size))
        n_elements, time_limit_s = self.array.manifold.n_elements, scenario.task.time_limit_s
        self.layout = ObservationLayout(observation_bounds(yard.size_m, self.robot.limits, n_elements, time_limit_s))
        self._stops_m = np.array([*scenario.route.stops_m, scenario.route.dock_m])
        observed = ObservationParameters(
            stops_m=self._stops_m,
            low=self.layout.low,
            high=self.layout.high,
            places=tuple(self.layout.places),
            lidar_range_m=LIDAR_RANGE_M,
            lidar_std_m=scenario.lidar.range_std_m,
            noise_v=scenario.receiver.noise_v,
        )
        self._episodes: list[Episode | None] = [None] * n_robots
        self._generators = [Generators.spawn(np.random.default_rng(0))] * n_robots
        self._monitors = [ChannelMonitor(self.array, self.estimator) for _ in range(n_robots)]
        self._receivers = None
        self._motion_normal, self._lidar_normal = np.zeros((n_robots, N_DRAWS)), np.zeros((n_robots, LIDAR_BEAMS))
        n_sources = len(scenario.sources)
        self._sources_m = np.zeros((n_robots, n_sources, 2))
        self.progress = Progress.at_start(n_robots, n_sources, len(self._stops_m))
        self._usable = np.ones((n_robots, self.array.manifold.n_elements), dtype=np.bool_)
        task = scenario.task
        last_step = min(task.time_limit_s / STEP_S - 1e-6, max_episode_steps or math.inf)
        self.max_episode_steps = math.ceil(last_step)
        self._result = StepResult.of_nothing(n_robots)
        ended = Task(
            self._stops_m,
            task.standoff_m,
            task.waypoint_radius_m,
            last_step,
            terminate_on_approach,
            task.reward_per_metre,
            task.reward_per_second,
            task.reward_per_contact_step,
        )
        self.motion = Motion.at_rest(n_robots)
        sensors = SensorParameters.of(scenario.pose_sensor, scenario.odometry, scenario.battery, STEP_S)
        self._stepping = Held(Stepping(self.motion, sensors, self.progress, ended, self._result))
        sensed = Sensed(self.motion.pose, self._lidar_normal, self.motion.time_s, self._usable, self._spectrum_gain)
        self._observing = Held(Observing(observed, sensed, self.progress))
        self._nobody = np.zeros(n_robots, dtype=np.bool_)

    @property
    def true_pose(self) -> FloatArray:
        """Where the robots are, shape (n_robots, 3)."""
        return self.robots.readings.pose.copy()

    @property
    def usable_channels(self) -> BoolArray:
        """Which channels direction finding uses, shape (n_robots, n_elements)."""
        return self._usable.copy()

    def episode(self, row: int) -> Episode:
        """What was drawn for a robot's episode."""
        episode = self._episodes[row]
        assert episode is not None, "reset first"
        return episode

    def generators(self, row: int) -> Generators:
        """Of a robot's episode."""
        return self._generators[row]

    @property
    def has_begun(self) -> bool:
        """Whether every robot has an episode: all have been reset once."""
        return None not in self._episodes

    def reset(self, rows: Rows, rngs: Sequence[np.random.Generator], fixed: Fixed) -> None:
        """Start new episodes in some rows, each with its generator; the next step is their first look."""
        spawned = [Generators.spawn(rng) for rng in rngs]
        drawn = [Episode.draw(self.scenario, self._surroundings, each, fixed) for each in spawned]
        for row, generators, episode in zip(rows.tolist(), spawned, drawn, strict=True):
            self._episodes[row], self._generators[row] = episode, generators
            self._monitors[row] = ChannelMonitor(self.array, self.estimator)
            self._sources_m[row] = np.array([s.position_m[:2] for s in episode.sources]).reshape(-1, 2)
            if self._receivers is not None:
                self._receivers.replace(row, _listener(episode, generators))
        if self._receivers is None:
            known = [episode or drawn[0] for episode in self._episodes]
            listeners = [_listener(*pair) for pair in zip(known, self._generators, strict=True)]
            self._receivers = ReceiverBank(self.scenario.receiver, listeners, self._n_threads)
        self.robots.reset(rows, [episode.start_pose for episode in drawn])
        self.progress.restart(rows)
        self._usable[rows] = True
        self._spectrum_gain[rows] = self._unit_gain(np.ones(self.array.manifold.n_elements))

    def _unit_gain(self, good: NDArray[Any]) -> FloatArray:
        """Gains of the channels in order (n_elements,) towards the observed azimuths, scaled to unit norm."""
        gain = self.array.manifold.gain(SPECTRUM_AZIMUTHS_RAD) * good[:, np.newaxis]
        return gain / np.linalg.norm(gain, axis=0)

    def step(self, commands: FloatArray | None, started: Rows | None = None) -> Outcome:
        """Drive for 0.1 s and listen; but the rows that have just been `started` only look about.

        Args:
            commands: Speeds, m/s, and yaw rates, rad/s, shape (n_robots, 2); those of rows that started do not count.
                Without any, the other rows are idle: no time passes for them, and their outcome has no meaning.
            started: Rows that were reset since the last step; None for none.
        """
        is_reset, is_idle, moving = self._nobody, self._nobody, None
        if started is not None:
            is_reset = np.zeros(len(self._generators), dtype=np.bool_)
            is_reset[started] = True
            moving = np.flatnonzero(~is_reset)
            if commands is None:
                moving, is_idle = NO_ROWS, ~is_reset
        start_s = self.motion.time_s.copy()
        if commands is not None and (moving is None or moving.size):
            self.robots.drive(commands[:, 0], commands[:, 1], STEP_S, moving)
        for row, generators in enumerate(self._generators):
            if not is_idle[row]:
                generators.motion.standard_normal(out=self._motion_normal[row])
                generators.lidar.standard_normal(out=self._lidar_normal[row])
        now = self.robots.readings
        touching = self.robots.is_touching
        advance(self._stepping, (now.values, self._motion_normal, self._sources_m, touching, is_reset, is_idle))
        for row in [] if started is None else started.tolist():
            rng = self._generators[row].motion
            self.motion.draw_odometry(row, self.scenario.odometry, self.robot.wheel_radius_m, rng)
        assert self._receivers is not None, "reset first"
        detections = self._receivers.listen(now.world_from_base, start_s, STEP_S, moving)
        pulses, suspects = self._find_directions(detections)
        return Outcome(
            observation=self._observe(detections.robot, pulses),
            reward=self._result.reward.copy(),
            terminated=self._result.terminated.copy(),
            fell_over=self._result.fell_over.copy(),
            truncated=self._result.truncated.copy(),
            robot=detections.robot,
            pulses=pulses,
            suspects=suspects,
        )

    def _find_directions(self, detections: DetectedPulses) -> tuple[PulseBatch, list[tuple[SuspectChannel, ...]]]:
        """All pulses with directions from the channels that are in order, and channels newly at fault by robot."""
        suspects: list[tuple[SuspectChannel, ...]] = [()] * len(self._monitors)
        pulses = self.estimator(detections.pulses, self.array).attached_to(detections.pulses)
        for row, own in _runs(detections.robot.tolist()):
            monitor = self._monitors[row]
            if monitor.n_bad:
                again, suspects[row] = monitor.watch(pulses.take(own))
            else:
                suspects[row] = monitor.note(pulses, own)
                if not suspects[row]:
                    continue
                again = monitor.bearings(pulses.take(own))
            for column, renewed in zip(pulses, again, strict=True):
                column[own] = renewed
            self._usable[row] = monitor.good
            self._spectrum_gain[row] = self._unit_gain(monitor.good)
        return pulses, suspects

    def _observe(self, robot: Rows, pulses: PulseBatch) -> NDArray[np.float32]:
        """All entries of the observation, shape (n_robots, n_entries); see `PatrolEnv`."""
        detected = robot, pulses.strengths_v, pulses.azimuth_rad
        return perceive(self._observing, self.robots.readings.values, detected).T


def _runs(rows: list[int]) -> Iterator[tuple[int, slice]]:
    """Each number in a list in which equal ones lie together, and where they lie."""
    first = 0
    while first < len(rows):
        end = first + 1
        while end < len(rows) and rows[end] == rows[first]:
            end += 1
        yield rows[first], slice(first, end)
        first = end


def _listener(episode: Episode, generators: Generators) -> Listener:
    """What a receiver listens with, and to."""
    return Listener(
        array=episode.array, scene=episode.scene, nature_rng=generators.nature, receiver_rng=generators.receiver
    )
