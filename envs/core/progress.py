"""What an episode has come to, and what it is worth, in a compiled loop over the robots."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import Held, compiled
from pdpatrol.envs.core.motion import Motion, SensorParameters, StepInputs, move
from pdpatrol.robot_models.readings import LEAST_UPRIGHT, POSE, UPRIGHT

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MAX_BEARING_AGE_S = 60.0
"""Older bearings are observed as so old."""

REWARD_TERMS = ("progress", "time", "contact")
"""Terms of the reward; their weights are the task's."""


class Progress(NamedTuple):
    """What an episode has come to; a row is a robot. Compiled loops change it in place.

    Attributes:
        approached: Which sources the robot has been within the stand-off of, shape (n_robots, n_sources).
        success: Whether it has approached every source; never where there is none; shape (n_robots,).
        visited: Which stops it has been at, shape (n_robots, n_stops); the last, the dock, only when all others were.
        to_go_m: Distance to the nearest source not yet approached, 0 if there is none, shape (n_robots,).
        bearing: Cos and sin of the last bearing, world frame; zeros before the first; shape (n_robots, 2).
        bearing_age_s: Time since that bearing, shape (n_robots,).
    """

    approached: BoolArray
    success: BoolArray
    visited: BoolArray
    to_go_m: FloatArray
    bearing: FloatArray
    bearing_age_s: FloatArray

    @classmethod
    def at_start(cls, n_robots: int, n_sources: int, n_stops: int) -> Progress:
        """Of episodes that have just begun."""
        return cls(
            approached=np.zeros((n_robots, n_sources), dtype=np.bool_),
            success=np.zeros(n_robots, dtype=np.bool_),
            visited=np.zeros((n_robots, n_stops), dtype=np.bool_),
            to_go_m=np.zeros(n_robots),
            bearing=np.zeros((n_robots, 2)),
            bearing_age_s=np.full(n_robots, MAX_BEARING_AGE_S),
        )

    def restart(self, rows: NDArray[np.intp]) -> None:
        """Begin anew in some rows."""
        self.approached[rows], self.success[rows], self.visited[rows], self.to_go_m[rows] = False, False, False, 0.0
        self.bearing[rows], self.bearing_age_s[rows] = 0.0, MAX_BEARING_AGE_S


@compiled
def nearest_to_go(sources_m: FloatArray, approached: BoolArray, x: float, y: float) -> float:
    """Horizontal distance from (x, y) to the nearest of the sources (n_sources, 2) not yet approached."""
    nearest_m = np.inf
    for s in range(len(sources_m)):
        if not approached[s]:
            nearest_m = min(nearest_m, np.hypot(sources_m[s, 0] - x, sources_m[s, 1] - y))
    return 0.0 if np.isinf(nearest_m) else nearest_m


class Task(NamedTuple):
    """What an episode is about.

    Attributes:
        stops_m: Waypoints and dock, shape (n_stops, 2).
        standoff_m: Within which a source is approached.
        stop_radius_m: Within which a stop is reached.
        last_step: After which time is up.
        ends_on_approach: Whether an episode is over once all sources are approached.
        reward_per_metre: For coming nearer to the nearest source that was not yet approached.
        reward_per_second: For time.
        reward_per_contact_step: For a step in contact with anything but the floor.
    """

    stops_m: FloatArray
    standoff_m: float
    stop_radius_m: float
    last_step: float
    ends_on_approach: bool
    reward_per_metre: float
    reward_per_second: float
    reward_per_contact_step: float


class StepResult(NamedTuple):
    """What a step came to; none of it in an episode that has just begun. Compiled loops change it in place.

    Attributes:
        reward: Terms in the order of `REWARD_TERMS`, shape (3, n_robots).
        terminated: Whether all sources are approached, if that counts, or the robot is back at the dock after the
            route, or fell over, shape (n_robots,).
        fell_over: Whether the robot did, shape (n_robots,).
        truncated: Whether time is up, shape (n_robots,).
    """

    reward: FloatArray
    terminated: BoolArray
    fell_over: BoolArray
    truncated: BoolArray

    @classmethod
    def of_nothing(cls, n_robots: int) -> StepResult:
        """Of no step at all."""
        terminated, fell_over, truncated = np.zeros((3, n_robots), dtype=np.bool_)
        return cls(np.zeros((3, n_robots)), terminated, fell_over, truncated)


@compiled
def update_progress(
    progress: Progress, task: Task, motion: Motion, step_s: float, inputs: StepInputs, result: StepResult
) -> None:
    """Bring progress up to date after a step of `step_s`, and weigh it: fill in its result."""
    n_robots, n_sources = progress.approached.shape
    n_stops, true_pose = len(task.stops_m), inputs.readings[:, POSE]
    for r in range(n_robots):
        result.reward[:, r], result.terminated[r], result.fell_over[r], result.truncated[r] = 0.0, False, False, False
        if inputs.is_idle[r]:
            continue
        x, y, approached, visited = true_pose[r, 0], true_pose[r, 1], progress.approached[r], progress.visited[r]
        sources_m, is_reset = inputs.sources_m[r], inputs.is_reset[r]
        if not is_reset:
            nearer_m = progress.to_go_m[r] - nearest_to_go(sources_m, approached, x, y)
            result.reward[0, r] = task.reward_per_metre * nearer_m
            result.reward[1, r] = task.reward_per_second * step_s
            result.reward[2, r] = task.reward_per_contact_step * inputs.is_touching[r]
            progress.bearing_age_s[r] = min(progress.bearing_age_s[r] + step_s, MAX_BEARING_AGE_S)
        all_approached, route_done = n_sources > 0, n_stops > 1
        for s in range(n_sources):
            if np.hypot(sources_m[s, 0] - x, sources_m[s, 1] - y) <= task.standoff_m:
                approached[s] = True
            all_approached = all_approached and approached[s]
        progress.success[r] = all_approached
        progress.to_go_m[r] = nearest_to_go(sources_m, approached, x, y)
        for k in range(n_stops - 1):
            away_m = np.hypot(task.stops_m[k, 0] - x, task.stops_m[k, 1] - y)
            visited[k] = visited[k] or away_m <= task.stop_radius_m
            route_done = route_done and visited[k]
        from_dock_m = np.hypot(task.stops_m[n_stops - 1, 0] - x, task.stops_m[n_stops - 1, 1] - y)
        is_docked = route_done and from_dock_m <= task.stop_radius_m
        is_done = is_docked or (task.ends_on_approach and all_approached)
        result.fell_over[r] = inputs.readings[r, UPRIGHT] < LEAST_UPRIGHT
        result.terminated[r] = result.fell_over[r] or (is_done and not is_reset)
        result.truncated[r] = motion.n_steps[r] >= task.last_step


class Stepping(NamedTuple):
    """What the steps of a simulation share, and bring up to date.

    Attributes:
        motion: Of the robots.
        sensors: Their deviations.
        progress: Of the robots.
        task: Theirs.
        result: Becomes that of the last step.
    """

    motion: Motion
    sensors: SensorParameters
    progress: Progress
    task: Task
    result: StepResult


@compiled
def advance(stepping: Held[Stepping], inputs: tuple[Any, ...]) -> None:
    """Bring motion and progress up to date after a step, which brought plain `StepInputs`."""
    motion, sensors, progress, task, result = stepping.value
    brought = StepInputs(*inputs)
    move(motion, sensors, brought)
    update_progress(progress, task, motion, sensors.step_s, brought, result)
