"""The observation and what depends on where the robot truly is, in compiled loops over the robots."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from robot_models.readings import Readings

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]


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
    progress: Progress,
    true_pose: FloatArray,
    sources_m: FloatArray,
    stops_m: FloatArray,
    standoff_m: float,
    stop_radius_m: float,
    is_new: BoolArray,
) -> tuple[FloatArray, BoolArray, BoolArray]:
    """Bring progress up to date.

    Args:
        progress: Of the robots.
        true_pose: Shape (n_robots, 3).
        sources_m: Shape (n_robots, n_sources, 2).
        stops_m: Waypoints and dock, shape (n_stops, 2).
        standoff_m: Within which a source is approached.
        stop_radius_m: Within which a stop is reached.
        is_new: Whose episode has just begun, shape (n_robots,).

    Returns:
        Metres by which each came nearer to the nearest source that was not yet approached; whether all sources are
        approached; and whether it is back at the dock after the route. Shape (n_robots,) each.
    """
    n_robots, n_sources = progress.approached.shape
    n_stops = len(stops_m)
    nearer_m = np.zeros(n_robots)
    all_approached, is_docked = np.zeros(n_robots, np.bool_), np.zeros(n_robots, np.bool_)
    for r in range(n_robots):
        x, y = true_pose[r, 0], true_pose[r, 1]
        now_m = nearest_to_go(sources_m[r], progress.approached[r], x, y)
        if not is_new[r]:
            nearer_m[r] = progress.to_go_m[r] - now_m
        all_approached[r] = n_sources > 0
        for s in range(n_sources):
            if np.hypot(sources_m[r, s, 0] - x, sources_m[r, s, 1] - y) <= standoff_m:
                progress.approached[r, s] = True
            all_approached[r] = all_approached[r] and progress.approached[r, s]
        progress.to_go_m[r] = nearest_to_go(sources_m[r], progress.approached[r], x, y)
        route_done = n_stops > 1
        for k in range(n_stops):
            is_near = np.hypot(stops_m[k, 0] - x, stops_m[k, 1] - y) <= stop_radius_m
            if k < n_stops - 1:
                progress.visited[r, k] = progress.visited[r, k] or is_near
                route_done = route_done and progress.visited[r, k]
            else:
                is_docked[r] = route_done and is_near
    return nearer_m, all_approached, is_docked


class Pulses(NamedTuple):
    """Pulses of one step, robot by robot.

    Attributes:
        robot: Who heard each, shape (n_pulses,).
        strengths_v: Shape (n_pulses, n_elements).
        azimuth_rad: Its direction, array frame, shape (n_pulses,).
    """

    robot: IntArray
    strengths_v: FloatArray
    azimuth_rad: FloatArray


class Heard(NamedTuple):
    """Entries of the observation on the strongest pulse of each robot; zero where nothing was heard.

    Attributes:
        is_heard: 1 or 0, shape (n_robots, 1).
        strengths: Unit norm, shape (n_robots, n_elements).
        level: log10 of the strength over the noise of one sample, shape (n_robots, 1).
    """

    is_heard: FloatArray
    strengths: FloatArray
    level: FloatArray


@compiled
def strongest(pulses: Pulses, good: BoolArray, noise_v: float, pose: FloatArray, progress: Progress) -> Heard:
    """The strongest pulse of each robot; its bearing becomes the last one of the robot's `progress`.

    Args:
        pulses: Of this step.
        good: Channels in order, shape (n_robots, n_elements).
        noise_v: Standard deviation of one sample.
        pose: Believed, shape (n_robots, 3).
        progress: Of the robots.
    """
    n_robots, n_elements = good.shape
    heard = Heard(np.zeros((n_robots, 1)), np.zeros((n_robots, n_elements)), np.zeros((n_robots, 1)))
    most = np.zeros(n_robots)
    for k in range(pulses.robot.size):
        r, energy = pulses.robot[k], 0.0
        for e in range(n_elements):
            energy += good[r, e] * pulses.strengths_v[k, e] * pulses.strengths_v[k, e]
        if energy <= most[r]:
            continue
        most[r], norm = energy, np.sqrt(energy)
        heard.is_heard[r, 0], heard.level[r, 0] = 1.0, np.log10(norm / noise_v)
        for e in range(n_elements):
            heard.strengths[r, e] = good[r, e] * pulses.strengths_v[k, e] / norm
        towards = pulses.azimuth_rad[k] + pose[r, 2]
        progress.bearing[r, 0], progress.bearing[r, 1] = np.cos(towards), np.sin(towards)
        progress.bearing_age_s[r] = 0.0
    return heard


@compiled
def first_left(visited: BoolArray) -> IntArray:
    """Number of the first stop not visited, for each robot; the last if all others are, shape (n_robots,)."""
    stops = np.empty(len(visited), np.intp)
    for r in range(len(visited)):
        stops[r] = visited.shape[1] - 1
        for k in range(visited.shape[1] - 1):
            if not visited[r, k]:
                stops[r] = k
                break
    return stops


@compiled
def lidar_readings(readings: Readings, reach_m: float, std_m: float, normal: FloatArray) -> FloatArray:
    """Ranges with noise on what was hit, and nothing beyond the reach, shape (n_robots, n_beams)."""
    told = np.empty(normal.shape)
    for r in range(normal.shape[0]):
        for beam in range(normal.shape[1]):
            range_m = readings.lidar_m[r, beam]
            noisy_m = min(max(range_m + std_m * normal[r, beam], 0.0), reach_m)
            told[r, beam] = noisy_m if range_m < reach_m else reach_m
    return told
