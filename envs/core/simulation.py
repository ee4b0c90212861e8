"""Simulation: episodes side by side, each a robot in its own copy of one yard; both environments are made of them.

What happens in one row is the same to the bit whatever the others do: each row draws from its own generator, and all
that is computed for it is computed along the row alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic import Bearings
from dirmusic.bearing.channel_health import ChannelMonitor, SuspectChannel
from dirmusic.bearing.likelihood_kernels import UNKNOWN, bearings_of_pulses
from envs.core.episode import Episode
from envs.core.motion import N_DRAWS, Motion, SensorParameters
from envs.core.observation_layout import SPECTRUM_AZIMUTHS_RAD, ObservationLayout, observation_bounds
from envs.core.observing import ObservationParameters, observe
from envs.core.progress import Progress, Task, advance
from envs.scenario import Scenario
from robot_models.robots import LIDAR_BEAMS, LIDAR_RANGE_M, WHEEL_RADIUS_M, Robots
from sensing import Detections, Faces, HelicalArray, Obstacles, Surroundings

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Rows = NDArray[np.intp]

STEP_S = 0.1
"""Control step: 10 Hz."""

NO_ROWS = np.empty(0, dtype=np.intp)


class Outcome(NamedTuple):
    """What a step led to; rows are robots.

    Attributes:
        shown: All entries of the observation, float32, shape (n_robots, n_entries); see `ObservationLayout`.
        reward: Terms in the order of `REWARD_TERMS`, shape (3, n_robots).
        terminated: Whether the episode is over, shape (n_robots,).
        truncated: Whether its time is, shape (n_robots,).
        heard: All pulses, robot by robot.
        bearings: Of the pulses.
        suspects: Channels newly found at fault, for each robot.
    """

    shown: NDArray[np.float32]
    reward: FloatArray
    terminated: BoolArray
    truncated: BoolArray
    heard: Detections
    bearings: Bearings
    suspects: list[tuple[SuspectChannel, ...]]


class Simulation:
    """Episodes of one scenario.

    Args:
        scenario: What to run.
        n_robots: How many episodes.
        n_threads: On how many threads the physics runs.
        terminate_on_approach: Whether an episode ends once all sources are approached.

    Attributes:
        inspectors: The robots.
        manifold: Of the array's data sheet.
        bounds: Lowest and highest value of each entry of the observation, float32, by key.
        entries: Takes observations apart.
        motion: What the robots know of their motion, live: it changes with the next step.
    """

    def __init__(
        self, scenario: Scenario, n_robots: int = 1, n_threads: int = 1, *, terminate_on_approach: bool = True
    ) -> None:
        self.scenario = scenario
        nominal, yard = HelicalArray.nominal(scenario.array), scenario.yard
        self.manifold = nominal.manifold()
        self.inspectors = Robots(yard, nominal.positions_m, nominal.boresights_rad, n_robots, n_threads)
        self._surroundings = Surroundings.of_kinds(
            [item.kind for item in yard.equipment],
            Faces(**yard.faces()._asdict()),
            Obstacles(**yard.obstacles()._asdict()),
        )
        self._spectrum_gain = np.empty((n_robots, self.manifold.n_elements, SPECTRUM_AZIMUTHS_RAD.size))
        self.bounds = observation_bounds(yard.size_m, self.manifold.n_elements, scenario.task.time_limit_s)
        self.entries = ObservationLayout(self.bounds)
        self._stops_m = np.array([*scenario.route.waypoints_m, scenario.route.dock_m])
        self._setting = ObservationParameters(
            stops_m=self._stops_m,
            low=self.entries.low,
            high=self.entries.high,
            lidar_reach_m=LIDAR_RANGE_M,
            lidar_std_m=scenario.lidar.range_std_m,
            noise_v=scenario.receiver.noise_v,
            time_limit_s=scenario.task.time_limit_s,
        )
        self._episodes: list[Episode | None] = [None] * n_robots
        self._rngs: list[np.random.Generator] = [np.random.default_rng(0)] * n_robots
        self._monitors = [ChannelMonitor(self.manifold) for _ in range(n_robots)]
        self._receivers = None
        self._draws = np.zeros((n_robots, N_DRAWS + LIDAR_BEAMS))
        n_sources = len(scenario.sources)
        self._sources_m = np.zeros((n_robots, n_sources, 2))
        self._progress = Progress.at_start(n_robots, n_sources, len(self._stops_m))
        self._good = np.ones((n_robots, self.manifold.n_elements), dtype=np.bool_)
        task = scenario.task
        self._task = Task(
            self._stops_m,
            task.standoff_m,
            task.waypoint_radius_m,
            task.time_limit_s / STEP_S - 1e-6,
            terminate_on_approach,
        )
        self.motion = Motion.at_rest(n_robots)
        self._senses = SensorParameters.of(scenario.pose_sensor, scenario.odometry, scenario.battery, STEP_S)
        self._nobody = np.zeros(n_robots, dtype=np.bool_)

    @property
    def true_pose(self) -> FloatArray:
        """Where the robots are, shape (n_robots, 3)."""
        return self.inspectors.readings.pose.copy()

    @property
    def good_channels(self) -> BoolArray:
        """Which channels direction finding uses, shape (n_robots, n_elements)."""
        return self._good.copy()

    def episode(self, row: int) -> Episode:
        """What was drawn for a robot's episode."""
        episode = self._episodes[row]
        assert episode is not None, "reset first"
        return episode

    def waypoints_visited(self, row: int) -> tuple[int, ...]:
        """Numbers of the waypoints that a robot has visited."""
        return tuple(self._progress.visited[row, :-1].nonzero()[0].tolist())

    def reset(self, rows: Rows, rngs: Sequence[np.random.Generator], options: Mapping[str, Any]) -> None:
        """Start new episodes in some rows, each with its generator; the next step is their first look."""
        from sensing.receiver.bank import Receivers  # here, so that a command line help need not wait for the compiler

        drawn = [Episode.draw(self.scenario, self._surroundings, rng, options) for rng in rngs]
        for row, rng, episode in zip(rows.tolist(), rngs, drawn, strict=True):
            self._episodes[row], self._rngs[row] = episode, rng
            self._monitors[row] = ChannelMonitor(self.manifold)
            self._sources_m[row] = np.array([s.position_m[:2] for s in episode.sources]).reshape(-1, 2)
            if self._receivers is not None:
                self._receivers.replace(row, episode.array, episode.scene, rng)
        if self._receivers is None:
            known = [episode or drawn[0] for episode in self._episodes]
            self._receivers = Receivers(
                self.scenario.receiver, [e.array for e in known], [e.scene for e in known], self._rngs
            )
        self.inspectors.reset(rows, [episode.start_pose for episode in drawn])
        self._progress.restart(rows)
        self._good[rows] = True
        self._spectrum_gain[rows] = self._unit_gain(np.ones(self.manifold.n_elements))

    def _unit_gain(self, good: NDArray[Any]) -> FloatArray:
        """Gains of the channels in order (n_elements,) towards the observed azimuths, scaled to unit norm."""
        gain = self.manifold.gain(SPECTRUM_AZIMUTHS_RAD) * good[:, np.newaxis]
        return gain / np.linalg.norm(gain, axis=0)

    def step(self, commands: FloatArray | None, started: Rows | None = None) -> Outcome:
        """Drive for 0.1 s and listen; but the rows that have just been `started` only look about.

        Args:
            commands: Speeds, m/s, and yaw rates, rad/s, shape (n_robots, 2); those of rows that started do not count.
                Without any, the other rows wait: no time passes for them, and what is told of them has no meaning.
            started: Rows that were reset since the last step; None for none.
        """
        is_new, waits, moving = self._nobody, self._nobody, None
        if started is not None:
            is_new = np.zeros(len(self._rngs), dtype=np.bool_)
            is_new[started] = True
            moving = np.flatnonzero(~is_new)
            if commands is None:
                moving, waits = NO_ROWS, ~is_new
        start_s = self.motion.time_s.copy()
        if commands is not None and (moving is None or moving.size):
            self.inspectors.drive(commands[:, 0], commands[:, 1], STEP_S, moving)
        for row, rng in enumerate(self._rngs):
            if not waits[row]:
                rng.standard_normal(out=self._draws[row])
        now = self.inspectors.readings
        reward, is_over, is_late = advance(
            tuple(self.motion),
            tuple(self._senses),
            tuple(self._progress),
            tuple(self._task),
            now.values,
            self._draws,
            self._sources_m,
            self.inspectors.is_touching,
            is_new,
            waits,
        )
        for row in [] if started is None else started.tolist():
            self.motion.draw_odometry(row, self.scenario.odometry, WHEEL_RADIUS_M, self._rngs[row])
        assert self._receivers is not None, "reset first"
        heard = self._receivers.listen(now.world_from_base, start_s, STEP_S, moving)
        bearings, suspects = self._find_directions(heard)
        return Outcome(
            shown=self._observe(heard, bearings),
            reward=reward,
            terminated=is_over,
            truncated=is_late,
            heard=heard,
            bearings=bearings,
            suspects=suspects,
        )

    def _find_directions(self, heard: Detections) -> tuple[Bearings, list[tuple[SuspectChannel, ...]]]:
        """Bearings of all pulses, from the channels that are in order, and channels newly at fault by robot."""
        suspects: list[tuple[SuspectChannel, ...]] = [()] * len(self._monitors)
        azimuth_rad, std_rad, misfit = bearings_of_pulses(
            heard.strengths_v[:, np.newaxis], heard.variance_v2[:, np.newaxis], tuple(self.manifold.table), UNKNOWN
        )
        bearings = Bearings(azimuth_rad=azimuth_rad, std_rad=std_rad, misfit=misfit)
        first, robots = 0, heard.robot.tolist()
        while first < len(robots):
            row, end = robots[first], first
            while end < len(robots) and robots[end] == row:
                end += 1
            own, monitor = slice(first, end), self._monitors[row]
            first = end
            strengths, variance = heard.strengths_v[own], heard.variance_v2[own]
            if not monitor.n_bad:
                suspects[row] = monitor.note(strengths, std_rad[own], misfit[own])
                if not suspects[row]:
                    continue
                again = monitor.bearings(strengths, variance).without_nan()
            else:
                again, suspects[row] = monitor.watch(strengths, variance)
                again = again.without_nan()
            bearings.azimuth_rad[own], bearings.std_rad[own], bearings.misfit[own] = (
                again.azimuth_rad,
                again.std_rad,
                again.misfit,
            )
            self._good[row] = monitor.good
            self._spectrum_gain[row] = self._unit_gain(monitor.good)
        return bearings, suspects

    def _observe(self, heard: Detections, bearings: Bearings) -> NDArray[np.float32]:
        """All entries of the observation, shape (n_robots, n_entries); see `PatrolEnv`."""
        now = self.inspectors.readings
        sight = self.motion.pose, now.values, self._draws, self.motion.time_s
        pulses = heard.robot, heard.strengths_v, bearings.azimuth_rad
        setting, progress = tuple(self._setting), tuple(self._progress)
        return observe(sight, setting, progress, *pulses, self._good, self._spectrum_gain).T
