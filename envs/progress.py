"""Task of an episode: approached sources, visited waypoints, reward, and end."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from pdpatrol.robot_models.readings import POSE

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

MAX_BEARING_AGE_S = 60.0
"""Upper bound of the observed age of the last bearing. Assumed; older bearings say little about a moving robot."""

REWARD_TERMS = ("progress", "time", "contact")


class Task(NamedTuple):
    """Conditions of success, and weights of the reward.

    Attributes:
        stops_m: Waypoints and dock, shape (n_stops, 2).
        standoff_m: Distance within which a source is approached.
        stop_radius_m: Distance within which a stop is reached.
        ends_on_approach: Whether an episode ends once all sources are approached.
        reward_per_metre: Weight of progress towards the nearest source not yet approached.
        reward_per_second: Weight of time.
        reward_per_contact_step: Reward of a step in contact with anything but the floor.
    """

    stops_m: FloatArray
    standoff_m: float
    stop_radius_m: float
    ends_on_approach: bool
    reward_per_metre: float
    reward_per_second: float
    reward_per_contact_step: float


class TaskProgress(NamedTuple):
    """Progress of the episodes, with a row for each robot. The kernels change it in place.

    Attributes:
        approached: True for sources that the robot has approached, shape (n_robots, n_sources).
        success: True if it has approached every source, False without sources, shape (n_robots,).
        visited: True for stops that it has visited, shape (n_robots, n_stops). The dock counts after all waypoints.
        distance_m: Distance to the nearest source not yet approached, 0 if all are approached, shape (n_robots,).
        bearing: Cos and sin of the last bearing, world frame, zeros before the first, shape (n_robots, 2).
        bearing_age_s: Time since that bearing, shape (n_robots,).
    """

    approached: BoolArray
    success: BoolArray
    visited: BoolArray
    distance_m: FloatArray
    bearing: FloatArray
    bearing_age_s: FloatArray

    @classmethod
    def at_start(cls, n_robots: int, n_sources: int, n_stops: int) -> Self:
        """Make the progress of episodes that have just begun."""
        return cls(
            approached=np.zeros((n_robots, n_sources), dtype=np.bool_),
            success=np.zeros(n_robots, dtype=np.bool_),
            visited=np.zeros((n_robots, n_stops), dtype=np.bool_),
            distance_m=np.zeros(n_robots),
            bearing=np.zeros((n_robots, 2)),
            bearing_age_s=np.full(n_robots, MAX_BEARING_AGE_S),
        )


@compiled
def nearest_distance(sources_m: FloatArray, approached: BoolArray, x: float, y: float) -> float:
    """Return the horizontal distance from (x, y) to the nearest of the sources (n_sources, 2) not yet approached."""
    nearest_m = np.inf
    for s in range(len(sources_m)):
        if not approached[s]:
            nearest_m = min(nearest_m, np.hypot(sources_m[s, 0] - x, sources_m[s, 1] - y))
    return 0.0 if np.isinf(nearest_m) else nearest_m


@compiled
def visit(progress: TaskProgress, task: Task, sources_m: FloatArray, r: int, x: float, y: float) -> bool:
    """Mark the sources and stops that robot `r` reaches at (x, y), and return whether its task is done."""
    n_stops, approached, visited = len(task.stops_m), progress.approached[r], progress.visited[r]
    all_approached, route_done = len(sources_m) > 0, n_stops > 1
    for s in range(len(sources_m)):
        if np.hypot(sources_m[s, 0] - x, sources_m[s, 1] - y) <= task.standoff_m:
            approached[s] = True
        all_approached = all_approached and approached[s]
    progress.success[r] = all_approached
    progress.distance_m[r] = nearest_distance(sources_m, approached, x, y)
    for k in range(n_stops - 1):
        away_m = np.hypot(task.stops_m[k, 0] - x, task.stops_m[k, 1] - y)
        visited[k] = visited[k] or away_m <= task.stop_radius_m
        route_done = route_done and visited[k]
    from_dock_m = np.hypot(task.stops_m[n_stops - 1, 0] - x, task.stops_m[n_stops - 1, 1] - y)
    is_docked = route_done and from_dock_m <= task.stop_radius_m
    return is_docked or (task.ends_on_approach and all_approached)


@compiled
def start_progress(
    progress: TaskProgress, task: Task, readings: FloatArray, sources_m: FloatArray, rows: IntArray
) -> None:
    """Start the progress of some robots at the beginning of an episode; arguments as in `advance_progress`."""
    for r in rows:
        progress.approached[r], progress.visited[r] = False, False
        progress.bearing[r], progress.bearing_age_s[r] = 0.0, MAX_BEARING_AGE_S
        x, y = readings[r, POSE][0], readings[r, POSE][1]
        visit(progress, task, sources_m[r], r, x, y)


@compiled
def advance_progress(
    progress: TaskProgress,
    task: Task,
    step_s: float,
    readings: FloatArray,
    sources_m: FloatArray,
    is_touching: BoolArray,
    rows: IntArray,
) -> tuple[FloatArray, BoolArray]:
    """Update the progress of some robots after a step.

    Args:
        progress: Progress; updated.
        task: The task.
        step_s: Length of the step.
        readings: Values of `pdpatrol.robot_models.readings.Readings`, shape (n_robots, n_values).
        sources_m: Positions of the sources, world frame, shape (n_robots, n_sources, 2).
        is_touching: True for robots in contact with anything but the floor, shape (n_robots,).
        rows: The robots.

    Returns:
        Terms of the reward in the order of `REWARD_TERMS`, shape (3, n_robots), and True for robots whose task is done,
        shape (n_robots,).
    """
    n_robots = len(readings)
    reward, is_done = np.zeros((3, n_robots)), np.zeros(n_robots, np.bool_)
    for r in rows:
        x, y = readings[r, POSE][0], readings[r, POSE][1]
        nearer_m = progress.distance_m[r] - nearest_distance(sources_m[r], progress.approached[r], x, y)
        reward[0, r] = task.reward_per_metre * nearer_m
        reward[1, r] = task.reward_per_second * step_s
        reward[2, r] = task.reward_per_contact_step * is_touching[r]
        progress.bearing_age_s[r] = min(progress.bearing_age_s[r] + step_s, MAX_BEARING_AGE_S)
        is_done[r] = visit(progress, task, sources_m[r], r, x, y)
    return reward, is_done
