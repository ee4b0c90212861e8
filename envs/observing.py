"""The observation and what depends on where the robot truly is, in compiled loops over the robots."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from dirmusic.fitting import pulse_spectra
from dirmusic.spectrum import LEAST_NULL

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
        approached; and whether it is back at the dock after the route. Neither in a new episode. Shape (n_robots,).
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
        all_approached[r] = n_sources > 0 and not is_new[r]
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
                is_docked[r] = route_done and is_near and not is_new[r]
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


class Sight(NamedTuple):
    """What an observation shows beside pulses and progress; a row is a robot.

    Attributes:
        pose: Believed, shape (n_robots, 3).
        velocity: Shape (n_robots, 2).
        lidar_m: True ranges, shape (n_robots, n_beams).
        lidar_noise: Standard normal draws, shape (n_robots, n_beams).
        time_left_s: Shape (n_robots,).
    """

    pose: FloatArray
    velocity: FloatArray
    lidar_m: FloatArray
    lidar_noise: FloatArray
    time_left_s: FloatArray


class Setting(NamedTuple):
    """What stays as it is.

    Attributes:
        stops_m: Waypoints and dock, shape (n_stops, 2).
        lidar_reach_m: Beyond which the lidar sees nothing.
        lidar_std_m: Standard deviation of its ranges.
        noise_v: Standard deviation of one sample of the receiver.
    """

    stops_m: FloatArray
    lidar_reach_m: float
    lidar_std_m: float
    noise_v: float


@compiled
def observe(
    sight: Sight,
    setting: Setting,
    progress: Progress,
    pulses: Pulses,
    good: BoolArray,
    spectrum_gain: FloatArray,
    low: NDArray[np.float32],
    high: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Observations, an entry after the other as `PatrolEnv` lists them, within their bounds.

    The bearing of a robot's strongest pulse becomes the last one of its `progress`.

    Args:
        sight: Of the robots.
        setting: Of all of them.
        progress: Of the robots.
        pulses: Of this step.
        good: Channels in order, shape (n_robots, n_elements).
        spectrum_gain: Of `dirmusic.pulse_spectrum`, shape (n_robots, n_elements, n_azimuths).
        low: Of all entries of one robot.
        high: Likewise.

    Returns:
        Shape (n_entries, n_robots): a row is an entry, so that each part of the observation lies together.
    """
    (n_robots, n_elements), n_beams = good.shape, sight.lidar_m.shape[1]
    strengths, level = np.zeros((n_robots, n_elements)), np.zeros(n_robots)
    for k in range(pulses.robot.size):
        r, energy = pulses.robot[k], 0.0
        for e in range(n_elements):
            energy += good[r, e] * pulses.strengths_v[k, e] * pulses.strengths_v[k, e]
        strength_v = np.sqrt(energy)
        if strength_v <= level[r]:
            continue
        level[r] = strength_v
        for e in range(n_elements):
            strengths[r, e] = good[r, e] * pulses.strengths_v[k, e] / strength_v
        towards = pulses.azimuth_rad[k] + sight.pose[r, 2]
        progress.bearing[r, 0], progress.bearing[r, 1] = np.cos(towards), np.sin(towards)
        progress.bearing_age_s[r] = 0.0
    spectrum = pulse_spectra(strengths, spectrum_gain, LEAST_NULL)
    shown = np.zeros((low.size, n_robots), np.float32)
    for r in range(n_robots):
        shown[0, r], shown[1, r] = sight.pose[r, 0], sight.pose[r, 1]
        shown[2, r], shown[3, r] = np.cos(sight.pose[r, 2]), np.sin(sight.pose[r, 2])
        at = 4
        for beam in range(n_beams):
            range_m = sight.lidar_m[r, beam]
            told_m = range_m + setting.lidar_std_m * sight.lidar_noise[r, beam]
            shown[at + beam, r] = told_m if range_m < setting.lidar_reach_m else setting.lidar_reach_m
        at += n_beams
        shown[at, r], shown[at + 1, r] = sight.velocity[r, 0], sight.velocity[r, 1]
        at += 2
        if level[r] > 0.0:
            shown[at, r] = 1.0
            shown[at + 1 + n_elements, r] = np.log10(level[r] / setting.noise_v)
        for e in range(n_elements):
            shown[at + 1 + e, r] = strengths[r, e]
        at += 2 + n_elements
        highest = max(spectrum[r].max(), 1.0)
        for k in range(spectrum.shape[1]):
            shown[at + k, r] = spectrum[r, k] / highest
        at += spectrum.shape[1]
        shown[at, r], shown[at + 1, r] = progress.bearing[r, 0], progress.bearing[r, 1]
        shown[at + 2, r] = progress.bearing_age_s[r]
        stop = 0
        while stop < len(setting.stops_m) - 1 and progress.visited[r, stop]:
            stop += 1
        shown[at + 3, r], shown[at + 4, r] = setting.stops_m[stop, 0], setting.stops_m[stop, 1]
        shown[at + 5, r] = sight.time_left_s[r]
        for k in range(low.size):
            shown[k, r] = min(max(shown[k, r], low[k]), high[k])
    return shown
