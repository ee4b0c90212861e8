"""Patrols: episodes side by side, each a robot in its own copy of one yard; both environments are made of them.

What happens in one row is the same to the bit whatever the others do: each row draws from its own generator, and all
that is computed for it is computed along the row alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dirmusic import Bearings, estimate_bearings, pulse_spectrum
from dirmusic.angles import difference
from dirmusic.channel_health import ChannelMonitor, SuspectChannel
from envs.episode import Episode
from envs.lidar import measured
from envs.odometry import Odometry
from envs.pose_sensor import PoseSensor
from envs.scenario import Scenario
from robot_models.battery import Battery
from robot_models.inspector import (
    LIDAR_BEAMS,
    LIDAR_RANGE_M,
    MAX_SPEED_MPS,
    MAX_YAW_RATE_RADPS,
    WHEEL_RADIUS_M,
    Inspectors,
)
from sensing import Faces, Heard, HelicalArray, Obstacles, Surroundings

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Rows = NDArray[np.intp]

STEP_S = 0.1
"""Control step: 10 Hz."""

SPECTRUM_AZIMUTHS_RAD = np.radians(np.arange(0.0, 360.0, 5.0))
"""Array-frame azimuths of the observed pseudo-spectrum."""

MAX_BEARING_AGE_S = 60.0
LEVEL_DECADES = 5.0
POSE_MARGIN_M = 5.0

REWARD_PER_METRE = 1.0
REWARD_PER_SECOND = -0.05
REWARD_PER_CONTACT_STEP = -1.0
"""Weights of the reward's terms (assumed): a second costs 5 cm of progress, touching something costs a metre."""

N_DRAWS = PoseSensor.N_DRAWS + 1 + LIDAR_BEAMS
"""Standard normal draws of a robot in a step, beside those of its receiver."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a step led to; rows are robots.

    Attributes:
        observation: Key by key, float32, shape (n_robots, ...).
        reward: Terms by name, shape (n_robots,).
        terminated: Whether the episode is over, shape (n_robots,).
        truncated: Whether its time is, shape (n_robots,).
        heard: All pulses, robot by robot.
        bearings: Of the pulses.
        suspects: Channels newly found at fault, for each robot.
    """

    observation: dict[str, NDArray[np.float32]]
    reward: dict[str, FloatArray]
    terminated: BoolArray
    truncated: BoolArray
    heard: Heard
    bearings: Bearings
    suspects: list[tuple[SuspectChannel, ...]]


class Patrols:
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
        pose: Believed, shape (n_robots, 3).
        time_s: Of each episode, shape (n_robots,).
    """

    def __init__(
        self, scenario: Scenario, n_robots: int = 1, n_threads: int = 1, *, terminate_on_approach: bool = True
    ) -> None:
        self.scenario = scenario
        self.terminate_on_approach = terminate_on_approach
        nominal, yard = HelicalArray.nominal(scenario.array), scenario.yard
        self.manifold = nominal.manifold()
        self.inspectors = Inspectors(yard, nominal.positions_m, nominal.boresights_rad, n_robots, n_threads)
        self._surroundings = Surroundings.of_kinds(
            [item.kind for item in yard.equipment], Faces(*yard.faces()), Obstacles(*yard.obstacles())
        )
        gain = self.manifold.gain(SPECTRUM_AZIMUTHS_RAD)
        self._spectrum_gain = np.repeat((gain / np.linalg.norm(gain, axis=0))[np.newaxis], n_robots, axis=0)
        self.bounds = self._bounds()
        self._layout(n_robots)
        self._stops_m = np.array([*scenario.route.waypoints_m, scenario.route.dock_m])
        self._episodes: list[Episode | None] = [None] * n_robots
        self._rngs: list[np.random.Generator] = [np.random.default_rng(0)] * n_robots
        self._monitors = [ChannelMonitor(self.manifold) for _ in range(n_robots)]
        self._receivers = None
        self._pose_sensor = PoseSensor(scenario.pose_sensor, n_robots)
        self._odometry = Odometry(scenario.odometry, n_robots)
        self._battery = Battery(scenario.battery, n_robots)
        self._draws = np.zeros((n_robots, N_DRAWS))
        n_sources = len(scenario.sources)
        self._sources_m = np.zeros((n_robots, n_sources, 2))
        self._approached = np.zeros((n_robots, n_sources), dtype=np.bool_)
        self._visited = np.zeros((n_robots, len(self._stops_m) - 1), dtype=np.bool_)
        self._n_steps = np.zeros(n_robots)
        self._bearing = np.zeros((n_robots, 2))
        self._bearing_age_s = np.full(n_robots, MAX_BEARING_AGE_S)
        self._to_go_m = np.zeros(n_robots)
        self.pose = np.zeros((n_robots, 3))
        self._true_pose, self._wheels = self.inspectors.pose(), self.inspectors.wheel_angles()

    def _bounds(self) -> dict[str, tuple[NDArray[np.float32], NDArray[np.float32]]]:
        size = np.asarray(self.scenario.yard.size_m)
        low, high = np.full(2, -POSE_MARGIN_M), size + POSE_MARGIN_M
        fastest = 2.0 * np.array([MAX_SPEED_MPS, MAX_YAW_RATE_RADPS])

        def box(lowest: Any, highest: Any, n: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:  # noqa: ANN401
            return tuple(np.array(np.broadcast_to(end, n), dtype=np.float32) for end in (lowest, highest))  # pyright: ignore[reportReturnType]

        return {
            "pose": box(np.append(low, [-1, -1]), np.append(high, [1, 1]), 4),
            "lidar": box(0, LIDAR_RANGE_M, LIDAR_BEAMS),
            "velocity": box(-fastest, fastest, 2),
            "heard": box(0, 1, 1),
            "strengths": box(0, 1, self.manifold.n_elements),
            "level": box(0, LEVEL_DECADES, 1),
            "spectrum": box(0, 1, SPECTRUM_AZIMUTHS_RAD.size),
            "bearing": box(-1, 1, 2),
            "bearing_age": box(0, MAX_BEARING_AGE_S, 1),
            "waypoint": box(0, size, 2),
            "time_left": box(0, self.scenario.task.time_limit_s, 1),
        }

    def _layout(self, n_robots: int) -> None:
        """Where each entry of the observation lies in one array of all of them, and between which bounds."""
        ends = np.cumsum([low.size for low, _ in self.bounds.values()]) * n_robots
        self._part = dict(zip(self.bounds, zip([0, *ends[:-1].tolist()], ends.tolist(), strict=True), strict=True))
        low, high = zip(*self.bounds.values(), strict=True)
        self._low, self._high = (np.concatenate([np.tile(end, n_robots) for end in ends]) for ends in (low, high))

    @property
    def time_s(self) -> FloatArray:
        """Simulated time of each episode."""
        return self._n_steps * STEP_S

    @property
    def odometry(self) -> FloatArray:
        """Pose by wheels and gyro alone, shape (n_robots, 3)."""
        return self._odometry.pose.copy()

    @property
    def battery(self) -> FloatArray:
        """Share that is left, shape (n_robots,)."""
        return self._battery.left

    @property
    def true_pose(self) -> FloatArray:
        """Where the robots are, shape (n_robots, 3)."""
        return self._true_pose.copy()

    @property
    def good_channels(self) -> BoolArray:
        """Which channels direction finding uses, shape (n_robots, n_elements)."""
        return np.array([monitor.good for monitor in self._monitors])

    def episode(self, row: int) -> Episode:
        """What was drawn for a robot's episode."""
        episode = self._episodes[row]
        assert episode is not None, "reset first"
        return episode

    def waypoints_visited(self, row: int) -> tuple[int, ...]:
        """Numbers of the waypoints that a robot has visited."""
        return tuple(np.flatnonzero(self._visited[row]).tolist())

    def reset(self, rows: Rows, rngs: Sequence[np.random.Generator], options: Mapping[str, Any]) -> None:
        """Start new episodes in some rows, each with its generator; the next step is their first look."""
        from sensing.receivers import Receivers  # here, so that a command line help need not wait for the compiler

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
        self._pose_sensor.start(rows)
        self._battery.charge(rows)
        self._approached[rows], self._visited[rows], self._n_steps[rows] = False, False, 0
        self._bearing[rows], self._bearing_age_s[rows] = 0.0, MAX_BEARING_AGE_S
        gain = self.manifold.gain(SPECTRUM_AZIMUTHS_RAD)
        self._spectrum_gain[rows] = gain / np.linalg.norm(gain, axis=0)

    def step(self, actions: FloatArray, started: Rows | None = None) -> Outcome:
        """Drive for 0.1 s and listen; but the rows that have just been `started` only look about.

        Args:
            actions: Shape (n_robots, 2), in [-1, 1]; those of rows that started do not count.
            started: Rows that were reset since the last step; None for none.
        """
        n = len(self._rngs)
        is_new = np.zeros(n, dtype=np.bool_)
        moving: Rows | None = None
        if started is not None:
            is_new[started] = True
            moving = np.flatnonzero(~is_new)
        start_s = self._n_steps * STEP_S
        if moving is None or moving.size:
            share = np.minimum(np.maximum(actions, -1.0), 1.0)
            self.inspectors.drive(share[:, 0] * MAX_SPEED_MPS, share[:, 1] * MAX_YAW_RATE_RADPS, STEP_S, moving)
        for rng, draws in zip(self._rngs, self._draws, strict=True):
            rng.standard_normal(out=draws)
        self._sense_motion(is_new, started)
        assert self._receivers is not None, "reset first"
        heard = self._receivers.listen(self.inspectors.world_from_base(), start_s, STEP_S, moving)
        bearings, suspects = self._find_directions(heard)
        touched = np.array([bool(names) for names in self.inspectors.touched()])
        before, self._to_go_m = self._to_go_m, self._distance_to_go()
        before = np.where(is_new, self._to_go_m, before) if started is not None else before
        reward = {
            "progress": REWARD_PER_METRE * (before - self._to_go_m),
            "time": np.where(is_new, 0.0, REWARD_PER_SECOND * STEP_S),
            "contact": np.where(touched & ~is_new, REWARD_PER_CONTACT_STEP, 0.0),
        }
        terminated = self._note_arrivals() & ~is_new
        truncated = (self._n_steps * STEP_S >= self.scenario.task.time_limit_s - 1e-9) & ~is_new
        return Outcome(
            observation=self._observe(heard, bearings),
            reward=reward,
            terminated=terminated,
            truncated=truncated,
            heard=heard,
            bearings=bearings,
            suspects=suspects,
        )

    def _sense_motion(self, is_new: BoolArray, started: Rows | None) -> None:
        """Pose sensor, odometry, battery and clocks."""
        true_pose, wheels = self.inspectors.pose(), self.inspectors.wheel_angles()
        self.pose = self._pose_sensor.read(true_pose, STEP_S, self._draws[:, : PoseSensor.N_DRAWS])
        rolled_m = (0.5 * WHEEL_RADIUS_M) * (wheels - self._wheels).sum(axis=-1)
        turned_rad = difference(true_pose[:, 2], self._true_pose[:, 2])
        self._odometry.move(rolled_m, turned_rad, STEP_S, self._draws[:, PoseSensor.N_DRAWS])
        self._battery.drain(self.inspectors.motor_power_w(), STEP_S)
        self._true_pose, self._wheels = true_pose, wheels
        self._n_steps += 1
        self._bearing_age_s = np.minimum(self._bearing_age_s + STEP_S, MAX_BEARING_AGE_S)
        if started is not None:
            for row in started.tolist():
                self._odometry.start(row, self.pose[row], self._rngs[row])
            self._battery.charge(started)
            self._n_steps[started] = 0
            self._to_go_m = np.where(is_new, self._distance_to_go(), self._to_go_m)

    def _distance_to_go(self) -> FloatArray:
        """Horizontal distance to the nearest source not yet approached, shape (n_robots,); 0 if there is none."""
        if self._approached.shape[1] == 0:
            return np.zeros(len(self.pose))
        distance_m = np.where(self._approached, np.inf, self._source_distance())
        nearest = distance_m.min(axis=-1)
        return np.where(np.isinf(nearest), 0.0, nearest)

    def _source_distance(self) -> FloatArray:
        off_m = self._sources_m - self._true_pose[:, np.newaxis, :2]
        return np.sqrt((off_m * off_m).sum(axis=-1))

    def _note_arrivals(self) -> BoolArray:
        """Tick off sources approached and stops visited; whether that ends the episode, shape (n_robots,)."""
        task = self.scenario.task
        over = np.zeros(len(self.pose), dtype=np.bool_)
        if self._approached.shape[1]:
            self._approached |= self._source_distance() <= task.standoff_m
            if self.terminate_on_approach:
                over |= self._approached.all(axis=-1)
        off_m = self._stops_m - self._true_pose[:, np.newaxis, :2]
        is_near = (off_m * off_m).sum(axis=-1) <= task.waypoint_radius_m**2
        self._visited |= is_near[:, :-1]
        if self._visited.shape[1]:
            over |= self._visited.all(axis=-1) & is_near[:, -1]
        return over

    def _find_directions(self, heard: Heard) -> tuple[Bearings, list[tuple[SuspectChannel, ...]]]:
        """Bearings of all pulses, from the channels that are in order, and channels newly at fault by robot."""
        suspects: list[tuple[SuspectChannel, ...]] = [()] * len(self._monitors)
        bearings = estimate_bearings(
            heard.strengths_v[:, np.newaxis], self.manifold, strength_variance=heard.variance_v2[:, np.newaxis]
        )
        first = 0
        for row, n_pulses in enumerate(np.bincount(heard.robot, minlength=len(self._monitors)).tolist()):
            if n_pulses == 0:
                continue
            own, monitor = slice(first, first + n_pulses), self._monitors[row]
            first += n_pulses
            strengths, variance = heard.strengths_v[own], heard.variance_v2[own]
            if monitor.good.all():
                suspects[row] = monitor.note(strengths, bearings.take(own))
                if not suspects[row]:
                    continue
                again = monitor.bearings(strengths, variance)
            else:
                again, suspects[row] = monitor.watch(strengths, variance)
            bearings.azimuth_rad[own], bearings.std_rad[own], bearings.misfit[own] = (
                again.azimuth_rad,
                again.std_rad,
                again.misfit,
            )
            gain = self.manifold.gain(SPECTRUM_AZIMUTHS_RAD) * monitor.good[:, np.newaxis]
            self._spectrum_gain[row] = gain / np.linalg.norm(gain, axis=0)
        return bearings, suspects

    def _observe(self, heard: Heard, bearings: Bearings) -> dict[str, NDArray[np.float32]]:
        """All entries of the observation, within their bounds; see `PatrolEnv`."""
        n = len(self.pose)
        flat = np.zeros(self._low.size, dtype=np.float32)
        entry = {key: flat[first:end].reshape(n, -1) for key, (first, end) in self._part.items()}
        yaw = self.pose[:, 2]
        entry["pose"][:, :2], entry["pose"][:, 2], entry["pose"][:, 3] = self.pose[:, :2], np.cos(yaw), np.sin(yaw)
        noise = self._draws[:, PoseSensor.N_DRAWS + 1 :]
        entry["lidar"][:] = measured(self.inspectors.lidar(), LIDAR_RANGE_M, self.scenario.lidar, noise)
        entry["velocity"][:] = self.inspectors.velocity()
        if heard.robot.size:
            self._observe_pulses(heard, bearings, entry)
        entry["bearing"][:], entry["bearing_age"][:, 0] = self._bearing, self._bearing_age_s
        left = np.zeros((n, len(self._stops_m)), dtype=np.bool_)
        left[:, :-1] = self._visited
        entry["waypoint"][:] = self._stops_m[left.argmin(axis=-1)]
        entry["time_left"][:, 0] = self.scenario.task.time_limit_s - self._n_steps * STEP_S
        np.minimum(np.maximum(flat, self._low, out=flat), self._high, out=flat)
        return entry

    def _observe_pulses(self, heard: Heard, bearings: Bearings, entry: dict[str, NDArray[np.float32]]) -> None:
        """The strongest pulse of each robot that heard one."""
        energy = np.square(heard.strengths_v).sum(axis=-1)
        order = np.lexsort((-energy, heard.robot))
        best = order[np.flatnonzero(np.diff(heard.robot[order], prepend=-1))]
        strengths = heard.strengths_v[best] * self.good_channels[heard.robot[best]]
        norm = np.sqrt(np.square(strengths).sum(axis=-1))
        if not norm.all():  # nothing in the channels that are in order
            best, strengths, norm = best[norm > 0], strengths[norm > 0], norm[norm > 0]
        rows = heard.robot[best]
        entry["heard"][rows] = 1.0
        strengths = strengths / norm[:, np.newaxis]
        entry["strengths"][rows] = strengths
        entry["level"][rows, 0] = 0.5 * np.log10(energy[best]) - np.log10(self.scenario.receiver.noise_v)
        spectrum = pulse_spectrum(strengths, self._spectrum_gain[rows])
        entry["spectrum"][rows] = spectrum / spectrum.max(axis=-1, keepdims=True)
        towards = bearings.azimuth_rad[best] + self.pose[rows, 2]
        self._bearing[rows, 0], self._bearing[rows, 1] = np.cos(towards), np.sin(towards)
        self._bearing_age_s[rows] = 0.0
