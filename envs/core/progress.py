"""What an episode has come to, and what it is worth, in a compiled loop over the robots."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from envs.core.motion import Motion, SensorParameters, move
from robot_models.readings import MOTOR_POWER, POSE, WHEEL_ANGLES

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MAX_BEARING_AGE_S = 60.0
"""Older bearings are told as so old."""

REWARD_TERMS = ("progress", "time", "contact")
REWARD_PER_METRE = 1.0
REWARD_PER_SECOND = -0.05
REWARD_PER_CONTACT_STEP = -1.0
"""Weights of the reward's terms (assumed): a second costs 5 cm of progress, touching something costs a metre."""


class Progress(NamedTuple):
    """What an episode has come to; a row is a robot. Compiled loops change it in place.

    Attributes:
        approached: Which sources the robot has been within the stand-off of, shape (n_robots, n_sources).
        visited: Which stops it has been at, shape (n_robots, n_stops); the last, the dock, only when all others were.
        to_go_m: Distance to the nearest source not yet approached, 0 if there is none, shape (n_robots,).
        bearing: Cos and sin of the last bearing, world frame; zeros before the first; shape (n_robots, 2).
        bearing_age_s: Time since that bearing, shape (n_robots,).
    """

    approached: BoolArray
    visited: BoolArray
    to_go_m: FloatArray
    bearing: FloatArray
    bearing_age_s: FloatArray

    @classmethod
    def at_start(cls, n_robots: int, n_sources: int, n_stops: int) -> Progress:
        """Of episodes that have just begun."""
        return cls(
            approached=np.zeros((n_robots, n_sources), dtype=np.bool_),
            visited=np.zeros((n_robots, n_stops), dtype=np.bool_),
            to_go_m=np.zeros(n_robots),
            bearing=np.zeros((n_robots, 2)),
            bearing_age_s=np.full(n_robots, MAX_BEARING_AGE_S),
        )

    def restart(self, rows: NDArray[np.intp]) -> None:
        """Begin anew in some rows."""
        self.approached[rows], self.visited[rows], self.to_go_m[rows] = False, False, 0.0
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
    """

    stops_m: FloatArray
    standoff_m: float
    stop_radius_m: float
    last_step: float
    ends_on_approach: bool


@compiled
def move_on(
    progress: Progress,
    task: Task,
    motion: Motion,
    step_s: float,
    true_pose: FloatArray,
    sources_m: FloatArray,
    touched: BoolArray,
    is_new: BoolArray,
    waits: BoolArray,
) -> tuple[FloatArray, BoolArray, BoolArray]:
    """Bring progress up to date; arguments as of `advance`."""
    n_robots, n_sources = progress.approached.shape
    n_stops = len(task.stops_m)
    reward = np.zeros((3, n_robots))
    is_over, is_late = np.zeros(n_robots, np.bool_), np.zeros(n_robots, np.bool_)
    for r in range(n_robots):
        if waits[r]:
            continue
        x, y, approached, visited = true_pose[r, 0], true_pose[r, 1], progress.approached[r], progress.visited[r]
        if not is_new[r]:
            nearer_m = progress.to_go_m[r] - nearest_to_go(sources_m[r], approached, x, y)
            reward[0, r] = REWARD_PER_METRE * nearer_m
            reward[1, r] = REWARD_PER_SECOND * step_s
            reward[2, r] = REWARD_PER_CONTACT_STEP * touched[r]
            progress.bearing_age_s[r] = min(progress.bearing_age_s[r] + step_s, MAX_BEARING_AGE_S)
        all_approached, route_done = n_sources > 0, n_stops > 1
        for s in range(n_sources):
            if np.hypot(sources_m[r, s, 0] - x, sources_m[r, s, 1] - y) <= task.standoff_m:
                approached[s] = True
            all_approached = all_approached and approached[s]
        progress.to_go_m[r] = nearest_to_go(sources_m[r], approached, x, y)
        for k in range(n_stops - 1):
            away_m = np.hypot(task.stops_m[k, 0] - x, task.stops_m[k, 1] - y)
            visited[k] = visited[k] or away_m <= task.stop_radius_m
            route_done = route_done and visited[k]
        from_dock_m = np.hypot(task.stops_m[n_stops - 1, 0] - x, task.stops_m[n_stops - 1, 1] - y)
        is_docked = route_done and from_dock_m <= task.stop_radius_m
        is_over[r] = not is_new[r] and (is_docked or (task.ends_on_approach and all_approached))
        is_late[r] = motion.n_steps[r] >= task.last_step
    return reward, is_over, is_late


@compiled
def advance(
    motion: tuple[Any, ...],
    senses: tuple[Any, ...],
    progress: tuple[Any, ...],
    task: tuple[Any, ...],
    readings: FloatArray,
    normal: FloatArray,
    sources_m: FloatArray,
    touched: BoolArray,
    is_new: BoolArray,
    waits: BoolArray,
) -> tuple[FloatArray, BoolArray, BoolArray]:
    """Bring motion and progress up to date after a step.

    Args:
        motion: Of the robots, a plain `Motion`.
        senses: Of all of them, plain `SensorParameters`.
        progress: Of the robots, a plain `Progress`.
        task: Of all of them, a plain `Task`.
        readings: The values of `robot_models.readings.Readings`.
        normal: Of `motion.move`.
        sources_m: Shape (n_robots, n_sources, 2).
        touched: Who touched something, shape (n_robots,).
        is_new: Whose episode has just begun, shape (n_robots,): no time has passed for them.
        waits: Who takes no step, shape (n_robots,): nothing changes.

    Returns:
        The reward's terms, shape (3, n_robots): for metres by which each came nearer to the nearest source that was
        not yet approached, for time, and for contact. Whether all sources are approached, if that counts, or the robot
        is back at the dock after the route; and whether time is up; shape (n_robots,). None of it in a new episode.
    """
    moving, sensing, true_pose = Motion(*motion), SensorParameters(*senses), readings[:, POSE]
    move(moving, sensing, true_pose, readings[:, WHEEL_ANGLES], readings[:, MOTOR_POWER], normal, is_new, waits)
    return move_on(
        Progress(*progress), Task(*task), moving, sensing.step_s, true_pose, sources_m, touched, is_new, waits
    )
