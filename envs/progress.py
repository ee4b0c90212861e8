"""What an episode has come to, and what it is worth, in a compiled loop over the robots."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled

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


@compiled
def move_on(
    progress: tuple[FloatArray, ...],
    true_pose: FloatArray,
    sources_m: FloatArray,
    stops_m: FloatArray,
    standoff_m: float,
    stop_radius_m: float,
    elapsed_s: float,
    is_new: BoolArray,
    touched: BoolArray,
) -> tuple[FloatArray, BoolArray, BoolArray]:
    """Bring progress up to date.

    Args:
        progress: Of the robots, a plain `Progress`.
        true_pose: Shape (n_robots, 3).
        sources_m: Shape (n_robots, n_sources, 2).
        stops_m: Waypoints and dock, shape (n_stops, 2).
        standoff_m: Within which a source is approached.
        stop_radius_m: Within which a stop is reached.
        elapsed_s: Since the last call.
        is_new: Whose episode has just begun, shape (n_robots,): no time has passed for them.
        touched: Who touched something, shape (n_robots,).

    Returns:
        The reward's terms, shape (3, n_robots): for metres by which each came nearer to the nearest source that was
        not yet approached, for time, and for contact. Whether all sources are approached, shape (n_robots,), and
        whether each is back at the dock after the route. All nothing in a new episode.
    """
    approached, visited, to_go_m, _, bearing_age_s = progress
    n_robots, n_sources = approached.shape
    n_stops = len(stops_m)
    reward = np.zeros((3, n_robots))
    all_approached, is_docked = np.zeros(n_robots, np.bool_), np.zeros(n_robots, np.bool_)
    for r in range(n_robots):
        x, y = true_pose[r, 0], true_pose[r, 1]
        if not is_new[r]:
            reward[0, r] = REWARD_PER_METRE * (to_go_m[r] - nearest_to_go(sources_m[r], approached[r], x, y))
            reward[1, r] = REWARD_PER_SECOND * elapsed_s
            reward[2, r] = REWARD_PER_CONTACT_STEP * touched[r]
            bearing_age_s[r] = min(bearing_age_s[r] + elapsed_s, MAX_BEARING_AGE_S)
        all_approached[r] = n_sources > 0 and not is_new[r]
        for s in range(n_sources):
            if np.hypot(sources_m[r, s, 0] - x, sources_m[r, s, 1] - y) <= standoff_m:
                approached[r, s] = True
            all_approached[r] = all_approached[r] and approached[r, s]
        to_go_m[r] = nearest_to_go(sources_m[r], approached[r], x, y)
        route_done = n_stops > 1
        for k in range(n_stops):
            is_near = np.hypot(stops_m[k, 0] - x, stops_m[k, 1] - y) <= stop_radius_m
            if k < n_stops - 1:
                visited[r, k] = visited[r, k] or is_near
                route_done = route_done and visited[r, k]
            else:
                is_docked[r] = route_done and is_near and not is_new[r]
    return reward, all_approached, is_docked
