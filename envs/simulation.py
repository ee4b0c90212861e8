"""Simulation of many robots, each in its own copy of one yard. Both environments are built on it.

Each array has one row per robot. A row is bit-identical whatever the other rows do: each robot has its own random
generators, and no computation mixes rows.
"""

import os
from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.bearing.channel_health import ChannelMonitor, SuspectChannel
from dirmusic.compiled import Held, compiled
from dirmusic.pulses.batch import PulseBatch
from pdpatrol.envs.episode import Episode, Generators, ResetOptions
from pdpatrol.envs.motion import advance_progress, sense_motion, start_motion, start_progress
from pdpatrol.envs.observation import Float32Array, ObservationLayout, observe_robots
from pdpatrol.envs.robot_states import SPECTRUM_AZIMUTHS_RAD, HeldRobots, Parameters, RobotStates
from pdpatrol.envs.scenario import Scenario
from pdpatrol.envs.scenario.base import STEP_S
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.envs.user_code import make_estimator
from pdpatrol.robot_models.robots import Robots
from pdpatrol.robot_models.sensors import AntennaElements
from pdpatrol.sensing.receiver.bank import ReceiverBank

INFO_KEYS = (
    "time_s", "believed_pose", "odometry", "battery", "reward_progress", "reward_time", "reward_contact", "touched",
    "fell_over", "success", "approached", "waypoints_visited", "true_pose",
)  # fmt: skip
"""Fields of `RobotStates` that the environments return in `info`."""


@compiled
def start_robots(held: HeldRobots, readings: FloatArray, rows: IntArray) -> None:
    """Initialise the states of some robots at the start of an episode; arguments as in `advance_robots`."""
    state, parameters, _ = held.value
    for r in rows:
        start_motion(state, parameters, readings[r], r)
        start_progress(state, parameters, readings[r], r)


@compiled
def advance_robots(held: HeldRobots, readings: FloatArray, is_touching: BoolArray, rows: IntArray) -> None:
    """Update the states of some robots after a step.

    Args:
        held: States, parameters and bounds of the observation.
        readings: Sensor readings as in `pdpatrol.robot_models.readings.Readings`, shape (n_robots, n_values).
        is_touching: True for robots in contact with anything but the floor, shape (n_robots,).
        rows: Indices of the robots to update.
    """
    state, parameters, _ = held.value
    for r in rows:
        state.touched[r] = is_touching[r]
        sense_motion(state, parameters, readings[r], r)
        advance_progress(state, parameters, readings[r], r)


class Simulation:
    """Simulation of the episodes of one scenario.

    Args:
        scenario: Scenario of all episodes.
        n_robots: Number of robots.
        n_threads: Number of threads for physics and receivers, 0 for all cores.
        terminate_on_approach: Whether an episode ends once all sources are approached.
        max_episode_steps: Maximum number of steps of an episode, in addition to the scenario's time limit.

    Attributes:
        robot: Description of the robots.
        robots: Physics of the robots.
        array: Array model that the robots use for direction finding.
        estimator: Bearing estimator.
        layout: Layout and space of the observations.
        max_episode_steps: Number of steps after which an episode is truncated.
        states: States of the robots after the last step or start.
        info: Arrays of `states` that the environments return in `info`, by key.
        truths: Ground truth of each robot's current episode; empty before the first start.
        generators: Random generators of each robot's current episode, by row; empty before the first start.
        pulse_rows: Row of the robot that detected each pulse of the last step, shape (n_pulses,), in ascending order.
        pulses: Pulses that all robots detected in the last step, with their bearings.
        suspects: Channels newly found faulty, for each robot.
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
        self.array, self.robot = scenario.known_array, scenario.robot.description
        self.estimator = make_estimator(scenario.estimator.method, self.array)
        real = scenario.mounted_array
        elements = AntennaElements(real.positions_m, real.boresights_rad, real.boresight_elevations_rad)
        moving = tuple(item.body for item in scenario.nature.moving)
        self.robots = Robots(self.robot, scenario.yard, elements, n_robots, n_threads, moving)
        self.layout, self.states = ObservationLayout(scenario), RobotStates.zeros(n_robots, scenario)
        parameters = Parameters.of(
            scenario, terminate_on_approach=terminate_on_approach, max_episode_steps=max_episode_steps
        )
        self.max_episode_steps = parameters.max_steps
        self.info = {key: getattr(self.states, key) for key in INFO_KEYS} | {"is_success": self.states.success}
        self._held = Held((self.states, parameters, self.layout.bounds))
        self._n_threads = n_threads or os.cpu_count() or 1
        self._surroundings = surroundings_of(scenario.yard, scenario.radio)
        self._all_rows = np.arange(n_robots)
        self.truths: list[dict[str, Any]] = [{}] * n_robots
        self.generators, self._monitors = dict[int, Generators](), dict[int, ChannelMonitor]()
        self._has_pose_events = parameters.jump_probability + parameters.dropout_probability > 0.0
        self._pose_events = dict[int, np.random.Generator]()
        self._receivers: ReceiverBank | None = None
        self.pulse_rows = self._all_rows[:0]
        self.pulses = PulseBatch.none(scenario.array.n_channels, scenario.receiver.n_bands)
        self.suspects: list[tuple[SuspectChannel, ...]] = [()] * n_robots

    @property
    def has_begun(self) -> bool:
        """True once an episode has been started for every robot."""
        return self._receivers is not None

    def start(self, rows: IntArray, rngs: Sequence[np.random.Generator], options: ResetOptions) -> None:
        """Start new episodes in some rows, each with its own generator; the first call must start all rows."""
        spawned = [Generators.spawn(rng) for rng in rngs]
        drawn = [Episode.draw(self.scenario, self._surroundings, own, options) for own in spawned]
        if self._receivers is None:
            listeners = [episode.listener for episode in drawn]
            self._receivers = ReceiverBank(self.scenario.receiver, listeners, self._n_threads)
        states, odometry = self.states, self.scenario.odometry
        for row, own, episode in zip(rows.tolist(), spawned, drawn, strict=True):
            self._receivers.replace(row, episode.listener)
            self.truths[row], self.generators[row] = episode.truth, own
            self._monitors[row], self.suspects[row] = ChannelMonitor(self.array, self.estimator), ()
            states.sources_m[row] = episode.listener.scene.positions_m[: len(self.scenario.sources), :2]
            if self._has_pose_events:
                self._pose_events[row] = own.motion.spawn(1)[0]
            self._draw_noise(row)
            scale, bias = own.motion.standard_normal(2)
            states.metres_per_radian[row] = self.robot.wheel_radius_m * (1.0 + odometry.wheel_radius_error * scale)
            states.gyro_bias_radps[row] = np.radians(odometry.gyro_bias_deg_per_min) / 60.0 * bias
        going_on = ~np.isin(self.pulse_rows, rows)
        self.pulse_rows, self.pulses = self.pulse_rows[going_on], self.pulses.take(going_on)
        states.is_usable[rows] = True
        states.spectrum_gain[rows] = self._unit_gain(np.ones(self.array.manifold.n_elements))
        self.robots.reset(rows, [episode.start_pose for episode in drawn], [episode.tracks for episode in drawn])
        states.touched[rows] = self.robots.is_touching[rows]
        start_robots(self._held, self.robots.readings.values, rows)

    def step(self, commands: FloatArray, rows: IntArray | None = None) -> None:
        """Drive some robots for 0.1 s and record the pulses that they detect.

        Args:
            commands: Commanded speeds, m/s, and yaw rates, rad/s, shape (n_robots, 2).
            rows: Indices of the robots to advance; None for all. No time passes for the others.
        """
        assert self._receivers is not None, "start first"
        start_s = self.states.time_s.copy()
        self.robots.drive(commands[:, 0], commands[:, 1], STEP_S, rows)
        driven = self._all_rows if rows is None else rows
        for row in driven.tolist():
            self._draw_noise(row)
        readings = self.robots.readings
        advance_robots(self._held, readings.values, self.robots.is_touching, driven)
        detected = self._receivers.listen(readings.world_from_base, start_s, STEP_S, rows)
        self.pulse_rows = detected.robot
        self.pulses = self.estimator(detected.pulses, self.array).attached_to(detected.pulses)
        self.suspects = [()] * self._all_rows.size
        start = 0
        for row, same in groupby(detected.robot.tolist()):
            end = start + len(list(same))
            self._watch_channels(row, slice(start, end))
            start = end

    def observe(self) -> Float32Array:
        """Return the observations of all robots as vectors, shape (n_robots, n_numbers); see `ObservationLayout`."""
        pulses = self.pulses
        return observe_robots(
            self._held, self.robots.readings.values, self.pulse_rows, pulses.strengths_v, pulses.azimuth_rad
        ).T

    def _draw_noise(self, row: int) -> None:
        self.generators[row].motion.standard_normal(out=self.states.motion_normal[row])
        if self._has_pose_events:
            rng, events = self._pose_events[row], self.states.pose_events[row]
            events[:2], events[2:] = rng.random(2), rng.standard_normal(3)
        self.generators[row].lidar.standard_normal(out=self.states.lidar_normal[row])

    def _watch_channels(self, row: int, own: slice) -> None:
        """Check the pulses of one robot for newly faulty channels, and estimate its bearings without these."""
        monitor = self._monitors[row]
        if monitor.n_bad:
            renewed, self.suspects[row] = monitor.watch(self.pulses.take(own))
        else:
            self.suspects[row] = monitor.note(self.pulses, own)
            if not self.suspects[row]:
                return
            renewed = monitor.bearings(self.pulses.take(own))
        for column, values in zip(self.pulses, renewed, strict=True):
            column[own] = values
        self.states.is_usable[row] = monitor.good
        self.states.spectrum_gain[row] = self._unit_gain(monitor.good)

    def _unit_gain(self, good: NDArray[Any]) -> FloatArray:
        """Return the gains of the good channels towards the observed azimuths, scaled to unit norm.

        Args:
            good: True for good channels, shape (n_elements,).
        """
        gain = self.array.manifold.gain(SPECTRUM_AZIMUTHS_RAD) * good[:, np.newaxis]
        return gain / np.linalg.norm(gain, axis=0)
